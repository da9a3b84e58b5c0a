"""The commands in README and the pages of the documentation run as they are written, on a small beam."""

from __future__ import annotations

import ast
import importlib
import re
import shlex
import textwrap
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import femtune as ft
from femtune.cli import main
from femtune.steps.exit_codes import NOT_ACCEPTED
from femtune.testing import example_deck, example_test

_ROOT = Path(__file__).resolve().parents[1]
_PAGES = [_ROOT / "README.md", *sorted((_ROOT / "docs").glob("*.md")), *sorted((_ROOT / "docs" / "guide").glob("*.md"))]
# these make their own files, and have tests of their own that compare what is printed or written
_TESTED = {"tutorial.md", "simulate-a-test.md"}
_LEFT_OUT = {
    "femtune modes study.toml --eigensolver slepc": "needs SLEPc and MPI: tests/model/test_slepc.py",
    "femtune view aeroplane.bdf": "opens a window",
    "femtune identify hall.csv --band 1 30 --choices choices.toml": "poles are picked: tests/study/test_choices.py",
    "femtune identify psd.unv --band 1 20": "spectra: tests/identification/test_spectra.py",
}


def _commands() -> dict[str, str]:
    """Every command that stands in a block, with its page; a remark behind # and a folder in brackets left out."""
    found: dict[str, str] = {}
    for page in _PAGES:
        for block in re.findall(r"^```\S*[^\n]*\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S):
            for line in block.replace("\\\n", " ").splitlines():
                if line.startswith("femtune ") and page.name not in _TESTED:
                    words = shlex.split(line.split("[folder]")[0], comments=True)
                    found.setdefault(shlex.join(words), page.name)
    return found


_COMMANDS = _commands()
_DECKS = ("deck", "plate", "aeroplane", "frame", "solid", "shells")
_TABLES = """
[plan]
band_hz = [5.0, 400.0]
uniaxial = 5

[response]
inputs = ["5Z+"]
outputs = ["3Z+", "5Z+"]
from_hz = 1.0
to_hz = 100.0
lines = 40
ratio = 0.01

[[load]]
name = "tip"
forces = { "5Z+" = 1.0 }

[candidates]
subsets = "all"

[search]
generations = 10
seeds = 1
infill = 1
fresh_runs = 1
surrogate = "radial-basis"
"""


def _beam(scale: float) -> str:
    """A free steel beam of 2 m, 20 by 40 mm, with 40 grid points and two sections."""
    points = "".join(f"GRID,{i},,{2.0 * (i - 1) / 39:.6f},0.,0.\n" for i in range(1, 41))
    bars = "".join(f"CBAR,{i},{1 if i < 15 else 2},{i},{i + 1},0.,0.,1.\n" for i in range(1, 40))
    sections = "".join(f"PBAR,{k},1,8.-4,{scale * 2.6667e-8:.4e},1.0667-7,7.3-8\n" for k in (1, 2))
    head = "SOL 103\nCEND\nMETHOD=1\nBEGIN BULK\nEIGRL,1,,,30\nMAT1,1,2.1+11,,.3,7850.\n"
    return f"{head}{sections}{points}{bars}ENDDATA\n"


def _write_hall(path: Path) -> None:
    """A record of three sensors on a floor: two modes under random forces, and a machine at 11 Hz."""
    rng, rate, samples = np.random.default_rng(1), 64.0, 15_360
    time = np.arange(samples) / rate
    values = 0.5 * np.sin(2.0 * np.pi * 11.0 * time)[:, None] + 0.02 * rng.standard_normal((samples, 3))
    for freq, shape in ((3.1, [0.3, 0.6, 0.9]), (7.7, [0.9, 0.4, -0.6])):
        pole = np.exp(2.0 * np.pi * freq * (-0.01 + 1j * np.sqrt(1.0 - 1e-4)) / rate)
        force = rng.standard_normal(samples)
        mode = lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], force)
        values += np.outer(mode / mode.std(), shape)
    np.savetxt(path, np.column_stack([time, values]), delimiter=",", header="Time [s],1Z+,2Z+,3Z+", comments="")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Decks, tests and studies with the names that the pages use."""
    folder = tmp_path_factory.mktemp("pages")
    for name in _DECKS:
        (folder / f"{name}.bdf").write_text(_beam(1.0))
    (folder / "true.bdf").write_text(_beam(1.1))
    truth = folder / "true.bdf"
    sensors = ["1 THRU 40:23"]
    ft.write_test(ft.simulate(truth, sensors, units="m-kg-s", max_hz=400.0), folder / "test.uff")
    lines = {"from_hz": 2.0, "to_hz": 80.0, "step_hz": 0.25, "ratio": 0.01}
    points = [f"{i}Z+" for i in (1, 8, 20)]
    ft.respond(truth, inputs=["1Z+"], outputs=points, uff=folder / "frf.unv", units="m-kg-s", **lines)
    (folder / "test.toml").write_text('[identify]\nfrfs = "frf.unv"\nband_hz = [4.0, 65.0]\nlargest_order = 12\n')
    _write_hall(folder / "hall.csv")
    # what is done with a study is done on the smallest model
    made = ft.init(example_deck(folder), example_test(folder), folder)
    made.path.write_text(made.path.read_text() + _TABLES)
    return folder


def test_what_is_left_out_stands_in_a_page() -> None:
    assert set(_LEFT_OUT) <= set(_COMMANDS)
    assert len(_COMMANDS) > 25


@pytest.mark.slow
@pytest.mark.parametrize("command", [c for c in _COMMANDS if c not in _LEFT_OUT])
def test_the_command_runs(command: str, files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "cma-es" in command:
        pytest.importorskip("cma")
    for library in ("meshio",) if "--vtu" in command else ("pyvista",) if " view " in command else ():
        pytest.importorskip(library)
    for file in files.iterdir():
        if file.is_file() and not (" init " in command and file.name == "study.toml"):
            (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(shlex.split(command)[1:])
    # the elements of the example are coarse: it is not accepted as a model of its test
    judged = command.split()[1] == "run"
    assert end.value.code == (NOT_ACCEPTED if judged else 0)


def _python() -> dict[str, str]:
    """Every block of Python, by page and number."""
    texts = {p.name: p.read_text(encoding="utf-8") for p in (*_PAGES, *(_ROOT / "docs" / "theory").glob("*.md"))}
    found = {name: re.findall(r"^```python\n(.*?)^```", text, re.M | re.S) for name, text in texts.items()}
    return {f"{name} {k}": textwrap.dedent(b) for name in sorted(found) for k, b in enumerate(found[name], 1)}


_BLOCKS = _python()


@pytest.mark.parametrize("place", _BLOCKS)
def test_python_of_a_page_names_what_there_is(place: str) -> None:
    """Some of them are executed by tests of their pages; here all are read, and names of femtune are looked up."""
    tree = ast.parse(_BLOCKS[place])
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "femtune":
            module = importlib.import_module(node.module)
            missing = [name.name for name in node.names if not hasattr(module, name.name)]
            assert missing == [], node.module
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "ft":
            assert hasattr(ft, node.attr), node.attr
