"""The key of a run changes with every file that the run is known to read."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from tests.messages.shown import check_shown
from tests.runs.fake import fake_solver

from femtune.errors import FemtuneError
from femtune.executor import Threads
from femtune.runs import ExternalSolver, ResultFile, RunOutcome, Template, Templates, evaluate

POINT = {"k1": 4.0, "k2": 9.0, "point": 1}
_UP = "../../"
"""From the folder of a run to that of the study."""


def _solver(folder: Path, *command: str, text: str = "", **environment: str) -> ExternalSolver:
    """Not started: the solver of a new command, whose keys are asked for."""
    solver = fake_solver(folder)
    inputs = Templates((*solver.inputs.templates, Template.of_text("model.inp", text)))  # type: ignore[attr-defined]
    return replace(
        solver, command=(sys.executable, *command), inputs=inputs, environment=tuple(sorted(environment.items()))
    )


def _written(folder: Path, **contents: str) -> None:
    for name, content in contents.items():
        path = folder / name.replace("__", "/").replace("_dot_", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)


# the solver, and what is edited; the contents are written as `a__b_dot_c` for a/b.c
READ = {
    "script by a relative path": ((f"{_UP}solve.py",), "", {}, "solve.py"),
    "script behind an equals sign": ((f"--run={_UP}solve.py",), "", {}, "solve.py"),
    "script in the line of a shell": (("-c", f"python3 {_UP}solve.py < model.inp"), "", {}, "solve.py"),
    "module beside the script": ((f"{_UP}solve.py",), "", {}, "physics.py"),
    "module of a package": ((f"{_UP}solve.py",), "", {}, "laws/steel.py"),
    "module in PYTHONPATH": (("-m", "physics"), "", {"PYTHONPATH": _UP}, "physics.py"),
    "data that the script reads": ((f"{_UP}solve.py",), "", {}, "data.csv"),
    "INCLUDE of Nastran": (("x",), f"INCLUDE '{_UP}mesh/part.bdf'", {}, "mesh/part.bdf"),
    "INCLUDE of an included file": (("x",), f"INCLUDE '{_UP}mesh/part.bdf'", {}, "mesh/skin.bdf"),
    "*INCLUDE of Abaqus": (("x",), f"*INCLUDE, INPUT={_UP}mesh/part.bdf", {}, "mesh/part.bdf"),
    "/INPUT of Ansys": (("x",), f"/INPUT,{_UP}mesh/part.bdf", {}, "mesh/part.bdf"),
    "variable of the environment": (("x",), "", {"MATERIAL": f"{_UP}data.csv"}, "data.csv"),
}


@pytest.mark.parametrize("what", READ)
def test_a_file_that_a_run_reads_is_in_its_key(tmp_path: Path, what: str) -> None:
    command, text, environment, edited = READ[what]
    _written(
        tmp_path,
        solve_dot_py="import math, physics\nfrom laws.steel import E\nopen('../../data.csv')\nopen('../../log', 'w')\n",
        physics_dot_py="m = 1.0", laws__steel_dot_py="E = 2.1e11", data_dot_csv="1,2", log="", mesh__skin_dot_bdf="$",
        mesh__part_dot_bdf="GRID,1\ninclude skin.bdf\n",
    )  # fmt: skip

    def key() -> str:
        return _solver(tmp_path, *command, text=text, **environment).key(POINT)

    before = key()
    (tmp_path / "log").write_text("what the script writes is no input")
    os.utime(tmp_path / edited)
    assert key() == before
    (tmp_path / edited).write_text((tmp_path / edited).read_text() + "\n$ edited\n")
    assert key() != before


def test_keys_of_a_solver_stay_while_a_file_changes_and_the_change_is_known(tmp_path: Path) -> None:
    _written(tmp_path, numbers="1")
    solver = _solver(tmp_path, f"{_UP}numbers")
    before = solver.key(POINT)
    assert solver.watched.changed == ()
    (tmp_path / "numbers").write_text("22")
    assert solver.key(POINT) == before
    assert solver.watched.changed == (str(tmp_path / "numbers"),)


def test_a_run_whose_script_is_edited_meanwhile_is_not_for_later_starts(tmp_path: Path) -> None:
    """Its numbers are those of another script than its key has: kept, they would return when the edit is undone."""
    script = tmp_path / "solve.py"
    script.write_text("open('modes.txt', 'w').write('1.0 2.0\\nend\\n')")
    solver = replace(
        fake_solver(tmp_path), command=(sys.executable, str(script)), result=ResultFile("modes.txt", "table")
    )
    outcome = solver.run(POINT)
    assert outcome.modes is not None
    assert outcome.lasting
    script.write_text(f"import os; os.utime({str(script)!r}, ns=(1, 1)); {script.read_text()}")
    outcome = solver.run(POINT)
    assert outcome.modes is not None
    assert not outcome.lasting


def test_folders_of_the_command_are_named_as_not_watched(tmp_path: Path) -> None:
    (tmp_path / "library").mkdir()
    assert _solver(tmp_path, f"{_UP}library").watched.unread == (str(tmp_path / "library"),)


def test_an_input_file_that_is_changed_while_the_runs_are_made(tmp_path: Path) -> None:
    """It changes after the first of two runs: that one is kept, and the second one is not taken for what was asked."""
    (tmp_path / "mesh.inc").write_text("1")
    solver = fake_solver(tmp_path)
    solver = replace(solver, inputs=replace(solver.inputs, copied=(tmp_path / "mesh.inc",)))  # type: ignore[type-var]
    kept: list[RunOutcome] = []

    class Keeper:
        def recall(self, key: str) -> None:
            return None

        def keep(self, outcome: RunOutcome) -> None:
            kept.append(outcome)
            (tmp_path / "mesh.inc").write_text("2")

    with pytest.raises(FemtuneError) as caught:
        evaluate(solver, [POINT, {**POINT, "k1": 5.0}, {**POINT, "k1": 6.0}], Threads(1), Keeper())
    check_shown("external.changed", caught.value)
    assert kept[0].key != solver.key(POINT)
