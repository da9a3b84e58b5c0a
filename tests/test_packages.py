"""Packages: what they offer is there, and stays what it is when their modules are imported."""

from __future__ import annotations

import ast
import importlib
import pkgutil
from graphlib import TopologicalSorter
from pathlib import Path
from types import ModuleType

import pytest

import femtune

_MODULES = [module for module in pkgutil.walk_packages(femtune.__path__, "femtune.") if "__main__" not in module.name]
_PACKAGES = ["femtune", *(module.name for module in _MODULES if module.ispkg)]

_OFFERED_MODULES = {"femtune": {"plot", "testing"}}
"""Modules that a package offers as such."""


@pytest.fixture(scope="module", autouse=True)
def _every_module_imported() -> None:
    """An imported module becomes an attribute of its package and hides a name that is spelled alike."""
    for module in _MODULES:
        importlib.import_module(module.name)


@pytest.mark.parametrize("name", _PACKAGES)
def test_no_name_of_a_package_is_that_of_one_of_its_modules(name: str) -> None:
    package = importlib.import_module(name)
    modules = {module.name for module in pkgutil.iter_modules(package.__path__)} - _OFFERED_MODULES.get(name, set())
    assert modules.isdisjoint(getattr(package, "__all__", ()))


@pytest.mark.parametrize("name", _PACKAGES)
def test_a_package_offers_what_it_lists(name: str) -> None:
    package = importlib.import_module(name)
    offered = {each: getattr(package, each) for each in getattr(package, "__all__", ())}
    modules = {each for each, value in offered.items() if isinstance(value, ModuleType)}
    assert modules == _OFFERED_MODULES.get(name, set())
    assert offered.keys() <= set(dir(package))


def test_a_name_that_a_package_lacks_is_an_attribute_error() -> None:
    package = importlib.import_module("femtune.modal")
    with pytest.raises(AttributeError, match=r"module 'femtune\.modal' has no attribute 'nothing'"):
        package.nothing  # noqa: B018


@pytest.mark.slow
def test_no_modules_import_each_other() -> None:
    """Not in circles either, whether for annotations alone or inside of functions."""
    root = Path(femtune.__file__).parent
    files = {".".join(("femtune", *p.relative_to(root).with_suffix("").parts)): p for p in root.rglob("*.py")}
    packages = {name.removesuffix(".__init__"): path for name, path in files.items() if path.name == "__init__.py"}
    modules = {name: path for name, path in files.items() if path.name != "__init__.py"}
    offered = {
        (package, name): module
        for package, path in packages.items()
        for module, names in _imports(path)
        for name in names
    }
    needs = {
        name: {
            found
            for source, names in _imports(path)
            for one in names
            if (found := _module(source, one, modules, offered)) is not None and found != name
        }
        for name, path in modules.items()
    }
    assert len(needs) > 500
    assert needs["femtune.steps.run.run"] >= {"femtune.study.study", "femtune.steps.validate.facts"}
    tuple(TopologicalSorter(needs).static_order())


def _imports(path: Path) -> list[tuple[str, list[str]]]:
    nodes = (node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.ImportFrom))
    return [(node.module or "", [alias.name for alias in node.names]) for node in nodes]


def _module(source: str, name: str, modules: dict[str, Path], offered: dict[tuple[str, str], str]) -> str | None:
    """The module that an import reaches; packages offer names of their modules."""
    if f"{source}.{name}" in modules:
        return f"{source}.{name}"
    reached = offered.get((source, name), source)
    while (reached, name) in offered:
        reached = offered[reached, name]
    return reached if reached in modules else None
