"""A run that was killed goes on where it stopped, and ends as if nothing had happened."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.residuals import direct
from femtune.steps.run.result import RunResult
from femtune.steps.run_folder import read_results

from .cantilever import Bench

# the run of a study that ends itself without any farewell: before or after a solution, or amid the writing of one
_KILLED = """
import os, signal, sys
import femtune as ft
from femtune.residuals import direct
from femtune.journal import entry as journal_entry
study, when, last = sys.argv[1], sys.argv[2], int(sys.argv[3])
calls = 0
def dying(function, amid=False):
    def run(*given):
        global calls
        calls += 1
        if calls == last and amid:
            given[0].write(b"half of it")
            given[0].flush()
        if calls == last and when != "after":
            os.kill(os.getpid(), signal.SIGKILL)
        found = function(*given)
        if calls == last:
            os.kill(os.getpid(), signal.SIGKILL)
        return found
    return run
if when == "writing":
    journal_entry._pack = dying(journal_entry._pack, True)
else:
    type(direct).modes = staticmethod(dying(direct.modes))
    type(direct).derivative = staticmethod(dying(direct.derivative))
ft.update(study)
"""


@pytest.fixture
def whole(finished: tuple[Bench, RunResult]) -> RunResult:
    """The run that nobody interrupted."""
    return finished[1]


def check_same(run: RunResult, whole: RunResult) -> None:
    """The same to the last bit, and every solution of the journal solved once."""
    # alerts name files of the folder that the run was made in
    apart = {"provenance", "journal", "alerts"}
    assert [a.code for a in run.results.alerts] == [a.code for a in whole.results.alerts]
    assert run.results.model_dump(exclude=apart) == whole.results.model_dump(exclude=apart)
    for key, array in whole.arrays.items():
        np.testing.assert_array_equal(run.arrays[key], array)
    for name in ("updated.bdf", "history.jsonl"):
        assert (run.folder / name).read_bytes() == (whole.folder / name).read_bytes()
    assert {p.name for p in (run.folder / "journal").iterdir()} == {
        p.name for p in (whole.folder / "journal").iterdir()
    }
    assert read_results(run.folder)[0] == run.results


def identities(folder: Path) -> dict[str, tuple[int, int]]:
    """A file that is written again is another one."""
    return {p.name: (p.stat().st_ino, p.stat().st_mtime_ns) for p in (folder / "journal").glob("[!.]*.npz")}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(
    ("when", "last"), [("before", 9), pytest.param("after", 17, marks=pytest.mark.long), ("writing", 13)]
)
def test_killed(beam: Bench, whole: RunResult, when: str, last: int) -> None:
    study = beam.study()
    ended = subprocess.run([sys.executable, "-c", _KILLED, str(study), when, str(last)], check=False)
    assert ended.returncode == -signal.SIGKILL
    folder = beam.folder / "run"
    kept = identities(folder)
    assert len(kept) == last - 1
    run = ft.update(study)
    found, total = run.results.journal, whole.results.journal
    assert found is not None
    assert total is not None
    assert found.recalled == len(kept)
    assert found.solved == total.solved - len(kept)
    assert identities(folder) | kept == identities(folder)
    check_same(run, whole)


@pytest.mark.slow
@pytest.mark.parametrize("each", [pytest.param(1, marks=pytest.mark.long), 3])
def test_stopped_at_every_solution_in_turn(
    beam: Bench, whole: RunResult, monkeypatch: pytest.MonkeyPatch, each: int
) -> None:
    """Each run solves one thing, or three, and is interrupted at the next; together they solve nothing twice."""
    study, solved, budget = beam.study(), 0, 0

    def spend() -> None:
        nonlocal solved, budget
        if not budget:
            raise KeyboardInterrupt
        solved += 1
        budget -= 1

    for name in ("modes", "derivative"):
        monkeypatch.setattr(type(direct), name, staticmethod(paid(getattr(direct, name), spend)))

    for _ in range(200):
        budget = each
        try:
            run = ft.update(study)
            break
        except KeyboardInterrupt:
            assert not (beam.folder / "run/running.lock").exists()
    assert whole.results.journal is not None
    assert solved == whole.results.journal.solved
    check_same(run, whole)


def paid(function: Any, spend: Any) -> Any:
    def run(*given: Any) -> Any:
        spend()
        return function(*given)

    return run


@pytest.mark.slow
def test_the_history_of_a_resumed_run_is_whole(beam: Bench, whole: RunResult) -> None:
    class Stop:
        def step(self, text: str, done: int, total: int | None) -> None:
            if text.startswith("update") and done == 2:
                raise KeyboardInterrupt

    study = beam.study()
    with pytest.raises(KeyboardInterrupt):
        ft.update(study, progress=Stop())
    lines = (beam.folder / "run/history.jsonl").read_text().splitlines()
    assert [json.loads(line)["iteration"] for line in lines] == [0, 1, 2]
    run = ft.update(study)
    after = (run.folder / "history.jsonl").read_text().splitlines()
    assert after[:3] == lines
    assert len(after) > 3


@pytest.mark.slow
def test_a_journal_may_be_moved_to_another_folder(beam: Bench, whole: RunResult) -> None:
    shutil.copytree(whole.folder / "journal", beam.folder / "moved/journal")
    run = ft.update(beam.study(), output=beam.folder / "moved")
    assert run.results.journal is not None
    assert run.results.journal.solved == 0
    check_same(run, whole)
