"""One run of an external solver: what is taken, what is refused, and what is tried again."""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown
from tests.runs.fake import exact_hz, fail, fake_solver, started

from femtune.errors import FemtuneError
from femtune.executor import Threads
from femtune.files.modes.solved import SolvedModes
from femtune.runs import FunctionSolver, ResultFile, check_repeatable, evaluate
from femtune.runs.external import Checks
from femtune.runs.folders import FACTS_FILE
from femtune.runs.outcome import FailureKind
from femtune.runs.process import begun, run_process

POINT = {"k1": 4.0, "k2": 9.0, "point": 1}


def test_modes_by_the_closed_form(tmp_path: Path) -> None:
    found = fake_solver(tmp_path).run(POINT)
    assert found.modes is not None
    np.testing.assert_allclose(found.modes.freq_hz, exact_hz(4.0, 9.0), rtol=1e-11)
    np.testing.assert_array_equal(found.modes.nodes, [1, 2])
    np.testing.assert_allclose(found.modes.shapes[:, 2], np.eye(2))
    assert np.isnan(found.modes.shapes[:, [0, 1, 3, 4, 5]]).all()
    assert (found.attempts, found.state) == (1, "done")
    assert list((tmp_path / "runs").iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "state"),
    [
        ("crash", FailureKind.EXIT_CODE),
        ("error", FailureKind.ERROR_TEXT),
        ("nothing", FailureKind.NO_OUTPUT),
        ("truncated", FailureKind.BAD_OUTPUT),
        ("one", FailureKind.NOT_SANE),
        ("descending", FailureKind.NOT_SANE),
        ("nan", FailureKind.NOT_SANE),
    ],
)
def test_failures_are_named_and_tried_again(tmp_path: Path, kind: str, state: FailureKind) -> None:
    solver = fake_solver(tmp_path)
    fail(tmp_path, 1, kind, 1)
    found = solver.run(POINT)
    assert found.modes is not None
    assert [f.kind for f in found.failures] == [state]
    assert Path(found.failures[0].folder, "in.txt").read_text() == "4\n9\n1\n"
    fail(tmp_path, 1, kind, 2)
    found = solver.run(POINT)
    assert (found.modes, found.attempts, found.state) == (None, 2, state.value)


@pytest.mark.slow
def test_a_run_that_hangs_is_ended_with_what_it_started(tmp_path: Path) -> None:
    solver = replace(fake_solver(tmp_path), timeout_s=0.5, retries=0)
    fail(tmp_path, 1, "hang", 1)
    assert [f.kind for f in solver.run(POINT).failures] == [FailureKind.TIME_OUT]
    inner = "import time; open('grandchild', 'w').write('begun'); time.sleep(2); open('grandchild', 'w').write('alive')"
    script = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {inner!r}])"
    command = (*solver.command[:1], "-c", script)
    assert run_process(command, tmp_path, 1.0, {}, begun()) is None
    assert (tmp_path / "grandchild").read_text() == "begun"
    time.sleep(1.5)
    assert (tmp_path / "grandchild").read_text() == "begun"


def _folders(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / "runs").iterdir())


def test_a_folder_tells_its_run_and_how_it_failed(tmp_path: Path) -> None:
    solver = fake_solver(tmp_path, retries=0)
    fail(tmp_path, 1, "crash", 1)
    assert solver.run(POINT).modes is None
    facts = json.loads((_folders(tmp_path)[0] / FACTS_FILE).read_text())
    assert facts["values"] == {name: float(v) for name, v in POINT.items()}
    assert facts["failure"].endswith("exit code 139")


@pytest.mark.slow
def test_of_failed_runs_the_newest_folders_are_kept(tmp_path: Path) -> None:
    solver = fake_solver(tmp_path, retries=0, keep_most=3)
    points = [{**POINT, "point": i} for i in range(8)]
    for i in range(6):
        fail(tmp_path, i, "crash", 1)
    found = evaluate(solver, points, Threads(1))
    assert len(found.failed) == 6
    kept = {json.loads((folder / FACTS_FILE).read_text())["values"]["point"] for folder in _folders(tmp_path)}
    assert kept == {3.0, 4.0, 5.0}


def test_folders_of_interrupted_runs_are_removed_and_nothing_else(tmp_path: Path) -> None:
    """A folder whose process has ended, one that another machine left long ago, and one whose run is under way."""
    solver = fake_solver(tmp_path)
    fail(tmp_path, 1, "crash", 1)
    solver.run(POINT)
    (failed,) = _folders(tmp_path)
    facts = json.loads((failed / FACTS_FILE).read_text())
    del facts["failure"], facts["ended"]
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    others = {
        "dead": {**facts, "pid": ended.pid}, "alive": facts, "far": {**facts, "host": "elsewhere"},
        "old": {**facts, "host": "elsewhere", "started": time.time() - 2.0 * solver.timeout_s - 4000.0},
    }  # fmt: skip
    for name, some in others.items():
        folder = failed.with_name(f"{failed.name[:17]}{name}")
        folder.mkdir()
        (folder / FACTS_FILE).write_text(json.dumps(some))
    for name in ("notes", f"{failed.name[:17]}mine", "0123456789abcdef-other"):
        failed.with_name(name).mkdir()
    failed.with_name("0123456789abcdef-other").joinpath(FACTS_FILE).write_text("no facts")
    evaluate(solver, [], Threads(1))
    names = {folder.name.removeprefix(failed.name[:17]) for folder in _folders(tmp_path)}
    assert names == {failed.name[17:], "alive", "far", "notes", "mine", "0123456789abcdef-other"}


@pytest.mark.slow
def test_a_refused_licence_waits_and_costs_no_retry(tmp_path: Path) -> None:
    solver = replace(fake_solver(tmp_path), retries=0, licence_tries=4)
    fail(tmp_path, 1, "licence", 3)
    found = solver.run(POINT)
    assert found.modes is not None
    assert [f.kind for f in found.failures] == [FailureKind.LICENCE] * 3
    fail(tmp_path, 1, "licence", 9)
    assert solver.run(POINT).state == "licence refused"


def test_nothing_of_a_command_is_a_shell_s(tmp_path: Path) -> None:
    solver = fake_solver(tmp_path)
    solver = replace(solver, command=(*solver.command, "; touch x", "$(touch y)", "> z"))
    assert solver.run(POINT).modes is not None
    assert not any((tmp_path / "runs").rglob("[xyz]"))


def test_an_absent_program(tmp_path: Path) -> None:
    solver = replace(fake_solver(tmp_path), command=("no_such_solver", "-i", "beam"))
    with pytest.raises(FemtuneError) as caught:
        evaluate(solver, [POINT], Threads(1))
    check_shown("external.no-program", caught.value)
    (tmp_path / "no_program").write_text("no program of this machine")
    (tmp_path / "no_program").chmod(0o755)
    solver = replace(solver, command=(str(tmp_path / "no_program"),))
    with pytest.raises(FemtuneError) as caught:
        evaluate(solver, [POINT], Threads(1))
    text = str(caught.value).replace(str(tmp_path), "FOLDER")
    check_shown("external.not-started", re.sub(r"runs/\S+", "runs/RUN", text))


def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solver = fake_solver(tmp_path)

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(FemtuneError) as caught:
            evaluate(solver, [POINT], Threads(1))
        check_shown("external.folder", str(caught.value).replace(str(tmp_path), "FOLDER"))
    fail(tmp_path, 1, "truncated", 1)
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Usage", (), {"free": 1000})())
    with pytest.raises(FemtuneError) as caught:
        solver.run(POINT)
    text = str(caught.value).replace(str(tmp_path), "FOLDER")
    check_shown("external.folder, full", re.sub(r"runs/\S+", "runs/RUN", text))


@pytest.mark.slow
def test_two_runs_that_differ_are_noticed(tmp_path: Path) -> None:
    solver = fake_solver(tmp_path)
    known = solver.run(POINT)
    assert check_repeatable(solver, POINT, known) == 0.0
    with pytest.raises(FemtuneError) as caught:
        check_repeatable(solver, POINT, replace(solver, checks=Checks(3)).run(POINT))
    check_shown("external.failed", caught.value)
    random = iter([1.0, 1.001, 1.0 + 1e-9])
    noisy = FunctionSolver(lambda v: [2.0, next(random) * v["k"]], ("k",), "1")
    first = noisy.run({"k": 5.0})
    with pytest.raises(FemtuneError) as caught:
        check_repeatable(noisy, {"k": 5.0}, first)
    check_shown("external.not-repeatable", caught.value)
    assert check_repeatable(noisy, {"k": 5.0}, first) == pytest.approx(1e-9, rel=1e-3)


@pytest.mark.parametrize(
    ("found", "fault"), [([1.0, 2.0], ""), ([1.0], "1 modes where 2"), ([2.0, 1.0], "do not ascend")]
)
def test_checks_of_frequencies(found: list[float], fault: str) -> None:
    said = Checks(2).fault(SolvedModes.of_frequencies(np.array(found)))
    assert said.startswith(fault) if fault[:1].isdigit() else fault in said


def test_checks_of_the_mass() -> None:
    modes = SolvedModes.of_frequencies(np.array([1.0]), 12.0)
    assert Checks(1, 12.05).fault(modes) == ""
    assert Checks(1, 13.0).fault(modes) == "the mass is 12 where 13 is expected"
    assert "not in the output" in Checks(1, 12.0).fault(SolvedModes.of_frequencies(np.array([1.0])))


def test_a_function_that_fails_is_named() -> None:
    found = FunctionSolver(lambda v: [1.0 / v["k"]], ("k",), "1").run({"k": 0.0})
    assert str(found.failures[0]) == "exit code: ZeroDivisionError: float division by zero"


def test_the_key_holds_all_that_matters(tmp_path: Path) -> None:
    solver = fake_solver(tmp_path)
    same = replace(solver, timeout_s=1.0, retries=7, folder=tmp_path / "elsewhere")
    assert same.key(POINT) == solver.key(POINT)
    others = (
        solver.key({**POINT, "k1": 4.0001}),
        replace(solver, version="2").key(POINT),
        replace(solver, command=(*solver.command, "x")).key(POINT),
        replace(solver, result=ResultFile("other.txt", "table")).key(POINT),
    )
    assert len({solver.key(POINT), *others}) == 5


def test_each_point_is_run_once(tmp_path: Path) -> None:
    found = evaluate(fake_solver(tmp_path), [POINT, {**POINT, "k1": 1.0}, POINT], Threads(2))
    assert (found.started, started(tmp_path)) == (2, 2)
    assert found.outcomes[0] is found.outcomes[2]
