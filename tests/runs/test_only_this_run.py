"""The result of a run is what its solver has written into its folder: no older file, no link, no pipe."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from tests.messages.shown import check_shown
from tests.runs.fake import SCRIPT, exact_hz, fake_solver

from femtune.errors import FemtuneError
from femtune.executor import Threads
from femtune.runs import ExternalSolver, ResultFile, Template, Templates, evaluate
from femtune.runs.outcome import FailureKind

POINT = {"k1": 4.0, "k2": 9.0, "point": 1}
# a listing that every check accepts, as an earlier run may have left it
OLD = "0.1 0.2\n1Z 1.0 0.0\n2Z 0.0 1.0\nend\n"
DEEDS = {
    "copied with its time": "import shutil; shutil.copy2(old, 'modes.txt')",
    "link": "import os; os.symlink(old, 'modes.txt')",
    "hard link": "import os; os.link(old, 'modes.txt')",
    "pipe": "import os; os.mkfifo('modes.txt')",
    "folder": "import os; os.mkdir('modes.txt')",
    "device": "import os; os.symlink('/dev/zero', 'modes.txt')",
    "pipe in place of the log": "import os; os.remove('femtune_solver.log'); os.mkfifo('femtune_solver.log')",
    "pipe in place of the facts": "import os; os.remove('femtune_run.json'); os.mkfifo('femtune_run.json')",
    "folder removed": "import os, shutil; shutil.rmtree(os.getcwd())",
    "folder made anew": "import os, shutil; d = os.getcwd(); shutil.rmtree(d); os.mkdir(d)\n"
    "shutil.copy(old, d + '/modes.txt')",
    "all folders removed": "import os, shutil; shutil.rmtree(os.path.dirname(os.getcwd()))",
}


def _solver(folder: Path, deed: str, **more: object) -> ExternalSolver:
    old = folder / "old.txt"
    old.write_text(OLD)
    os.utime(old, (1.6e9, 1.6e9))
    script = Template.of_text("do.py", f"old = {str(old)!r}\n{deed}\n")
    solver = fake_solver(folder, retries=0, **more)
    files = Templates((*solver.inputs.templates, script))  # type: ignore[attr-defined]
    return replace(solver, command=(sys.executable, "-I", "-S", "do.py"), inputs=files)


@pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")
@pytest.mark.quick(4)
@pytest.mark.parametrize("deed", DEEDS)
@pytest.mark.parametrize("keep", ["failed", "none"])
def test_what_the_solver_did_not_write_is_no_result(tmp_path: Path, deed: str, keep: str) -> None:
    outcome = _solver(tmp_path, DEEDS[deed], keep=keep).run(POINT)
    assert [f.kind for f in outcome.failures] == [FailureKind.NO_OUTPUT]
    assert (tmp_path / "old.txt").read_text() == OLD


def test_a_result_in_a_folder_of_the_run(tmp_path: Path) -> None:
    script = SCRIPT.replace('open("modes.txt", "w")', 'open(os.makedirs("out") or "out/modes.txt", "w")')
    solver = fake_solver(tmp_path)
    inputs = Templates((solver.inputs.templates[0], Template.of_text("solve.py", script)))  # type: ignore[attr-defined]
    found = replace(solver, inputs=inputs, result=ResultFile("out/modes.txt", "table")).run(POINT)
    assert found.modes is not None
    assert found.modes.freq_hz.tolist() == pytest.approx(exact_hz(4.0, 9.0).tolist())


@pytest.mark.parametrize("name", ["../modes.txt", "/tmp/modes.txt", "out/../../modes.txt", "C:\\modes.txt", "."])
def test_results_outside_are_refused(name: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        ResultFile(name, "table")
    if name.startswith("/tmp"):
        check_shown("external.result", caught.value)
    assert caught.value.code == "external.result"


@pytest.mark.parametrize("name", ["modes.txt", "femtune_solver.log", "femtune_run.json"])
def test_a_result_that_is_there_before_the_run_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "modes.txt").write_text(OLD)
    solver = fake_solver(tmp_path)
    inputs = replace(solver.inputs, copied=(tmp_path / "modes.txt",))  # type: ignore[type-var]
    with pytest.raises(FemtuneError) as caught:
        replace(solver, inputs=inputs, result=ResultFile(name, "table")).run(POINT)
    if name == "modes.txt":
        check_shown("external.result, input", caught.value)
    assert caught.value.code == "external.result"
    assert list((tmp_path / "runs").iterdir()) == []


def test_two_input_files_of_one_name_are_refused(tmp_path: Path) -> None:
    files = [tmp_path / part / "mass.inc" for part in ("left", "right")]
    with pytest.raises(FemtuneError) as caught:
        Templates((), tuple(files))
    check_shown("external.same-name", str(caught.value).replace(str(tmp_path), "FOLDER"))
    with pytest.raises(FemtuneError, match=r"mass\.inc"):
        Templates((Template.of_text("mass.inc", "{{k1}}"),), (files[0],))
    solver = fake_solver(tmp_path)
    taken = Templates((Template.of_text("femtune_run.json", "{{k1}}"),))
    assert evaluate(solver, [], Threads(1)).outcomes == ()
    replaced = replace(solver, inputs=taken)
    with pytest.raises(FemtuneError) as caught:
        replaced.run(POINT)
    check_shown("external.same-name, taken", caught.value)
