"""The front door: what `import femtune` offers, lazily, with examples that run."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import warnings
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import femtune as ft
from femtune.steps import all_steps, front_door
from femtune.steps.step import load

_MODULES = ("plot", "testing")
_CLASSES = [name for name in ft.__all__ if name[0].isupper()]
_FUNCTIONS = [name for name in ft.__all__ if name[0].islower() and name not in _MODULES]
# runs in its own process: it must see femtune as it is just after the import
_IMPORT = "import sys, femtune; print(sorted(m for m in sys.modules if m.startswith('femtune.') or m in {heavy}))"


def test_the_import_loads_nothing_else() -> None:
    code = _IMPORT.format(heavy=("numpy", "scipy", "pydantic", "matplotlib"))
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        == "['femtune._lazy']\n"
    )


@pytest.mark.parametrize("name", ft.__all__)
def test_every_name_is_there(name: str) -> None:
    value = getattr(ft, name)
    assert name in dir(ft)
    assert (name in _MODULES) == isinstance(value, ModuleType)
    assert (name in _CLASSES) == inspect.isclass(value)


def test_a_name_that_is_not_there_is_no_module_by_chance() -> None:
    with pytest.raises(AttributeError, match="no attribute 'correlation_of'"):
        _ = ft.correlation_of


def test_the_function_of_every_step_and_its_result_are_listed() -> None:
    steps = [step for step in all_steps() if step.command is not None]
    functions = {step.name: load(step.function) for step in steps}
    assert front_door() == {name: function.__module__ for name, function in functions.items()}
    assert all(getattr(ft, name) is function for name, function in functions.items())
    returned = " ".join(inspect.signature(function).return_annotation for function in functions.values())
    results = re.findall(r"\w+Result\b", returned)
    assert len(set(results)) > 10
    assert {*functions, *results} <= set(ft.__all__)


@pytest.mark.slow
def test_no_module_takes_the_place_of_a_function() -> None:
    """Python binds an imported submodule to its package: a package of the name of a verb would replace it."""
    code = (
        "import importlib, inspect, pkgutil, femtune\n"
        "before = {n: getattr(femtune, n) for n in femtune.__all__}\n"
        "for found in pkgutil.walk_packages(femtune.__path__, 'femtune.'):\n"
        "    if not found.name.endswith('__main__'):\n"
        "        importlib.import_module(found.name)\n"
        "for name, value in before.items():\n"
        "    assert getattr(femtune, name) is value, name\n"
        "    assert inspect.ismodule(value) or callable(value), name\n"
        "print(len(before))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert int(done.stdout) == len(ft.__all__)


def test_no_verb_has_the_name_of_a_module() -> None:
    modules = {found.name for found in pkgutil.iter_modules(ft.__path__)}
    assert not modules & {*_FUNCTIONS, *_CLASSES}


@pytest.mark.parametrize("name", ft.__all__)
def test_every_name_is_in_the_reference(name: str) -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "api" / "index.md").read_text(encoding="utf-8")
    listed = re.findall(r"^```\{objects\}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert name in {word for block in listed for word in block.split()} or re.search(rf"femtune\.{name}\b", text)


def _public(module: ModuleType) -> list[tuple[str, Any]]:
    return [(f"{module.__name__}.{name}", getattr(module, name)) for name in module.__all__]


_WITH_EXAMPLES = [
    *((name, getattr(ft, name)) for name in ft.__all__ if name not in _MODULES),
    *_public(ft.plot),
    *_public(ft.testing),
    ("Rows", importlib.import_module("femtune.study.rows").Rows),
    ("Row", importlib.import_module("femtune.study.rows").Row),
]


@pytest.mark.quick(8)
@pytest.mark.parametrize(("name", "value"), _WITH_EXAMPLES, ids=[name for name, _ in _WITH_EXAMPLES])
def test_examples_run(name: str, value: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name in ("to_xarray", "to_inference_data"):
        with warnings.catch_warnings():
            # ArviZ announces its next version
            warnings.simplefilter("ignore")
            pytest.importorskip("xarray" if name == "to_xarray" else "arviz")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    module = importlib.import_module(value.__module__)
    finder, runner = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for test in finder.find(value, name, module=module, globs=dict(vars(module))):
        said: list[str] = []
        runner.run(test, out=said.append)
        assert not said, "".join(said)
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
