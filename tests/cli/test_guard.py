"""Errors, Ctrl-C and faults: messages and exit codes."""

from __future__ import annotations

import os
import signal
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import Result

from femtune.cli import running
from femtune.cli.guard import CRASH_FILE, coloured
from femtune.errors import FemtuneError, FemtuneErrors

Invoke = Callable[..., Result]


def _raise(error: BaseException) -> Callable[..., Any]:
    def step(*arguments: Any, **options: Any) -> Any:
        raise error

    return step


def test_code_is_red_on_a_terminal(invoke: Invoke, steps: Any, study: Path) -> None:
    steps.run = _raise(FemtuneError("a.b", "what [not.this]", hint="fix"))
    result = invoke("run", study, color=True)
    assert result.stderr == click.style("[a.b]", fg="red", bold=True) + " what [not.this]\n\nhint: fix\n"
    assert invoke("run", study).stderr == "[a.b] what [not.this]\n\nhint: fix\n"


def test_every_code_of_several_errors_is_coloured() -> None:
    both = FemtuneErrors([FemtuneError("a.b", "x"), FemtuneError("c-d.e", "y", hint="[f.g] is no code")])
    assert click.unstyle(coloured(both)) == str(both) == "2 problems:\n\n[a.b] x\n\n[c-d.e] y\n\nhint: [f.g] is no code"
    assert coloured(both).count("\x1b[31m") == 2


def test_fault_leaves_one_line_and_a_file_here(invoke: Invoke, steps: Any, study: Path) -> None:
    steps.run = _raise(ZeroDivisionError("division\nby zero"))
    result = invoke("run", study)
    assert result.exit_code == 70
    assert len(result.stderr.splitlines()) == 1
    assert "please report it" in result.stderr
    assert str(study.parent / CRASH_FILE) in result.stderr
    text = (study.parent / CRASH_FILE).read_text()
    assert "Traceback" in text
    assert "ZeroDivisionError" in text


def test_fault_leaves_its_file_in_the_run_folder(invoke: Invoke, steps: Any, study: Path) -> None:
    (study.parent / "run").mkdir()
    steps.run = _raise(KeyError("x"))
    invoke("run", study)
    assert (study.parent / "run" / CRASH_FILE).exists()


def test_fault_where_nothing_can_be_written(
    invoke: Invoke, steps: Any, study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for place in (study.parent / "run", study.parent):
        (place / CRASH_FILE).mkdir(parents=True)
    monkeypatch.setattr("tempfile.tempdir", str(study.parent))
    steps.run = _raise(KeyError("x"))
    result = invoke("run", study)
    assert result.exit_code == 70
    assert "KeyError" in result.stderr


def test_ctrl_c_says_what_has_been_kept(invoke: Invoke, steps: Any, study: Path) -> None:
    def step(path: Path, **options: Any) -> None:
        (study.parent / "run").mkdir()
        (study.parent / "run" / "results.json").touch()
        raise KeyboardInterrupt

    steps.run = step
    result = invoke("run", study)
    assert result.exit_code == 130
    assert result.stderr == f"stopped by Ctrl-C; kept: {study.parent / 'run' / 'results.json'}\n"


@pytest.mark.parametrize(("count", "solutions"), [(1, "1 solution"), (12, "12 solutions")])
def test_ctrl_c_says_how_the_run_goes_on(invoke: Invoke, steps: Any, study: Path, count: int, solutions: str) -> None:
    journal = study.parent / "run" / "journal"

    def step(path: Path, **options: Any) -> None:
        journal.mkdir(parents=True)
        for i in range(count):
            (journal / f"modes-{i}.npz").touch()
        (journal / ".modes-x.npz.half").touch()
        if count > 1:
            (study.parent / "run" / "history.jsonl").touch()
        raise KeyboardInterrupt

    steps.run = step
    result = invoke("run", study)
    assert result.exit_code == 130
    files = f" {journal.parent / 'history.jsonl'}, and" if count > 1 else ""
    assert result.stderr == (
        f"stopped by Ctrl-C; kept:{files} {solutions} in {journal}; the same command continues from there\n"
    )


@pytest.mark.parametrize(("count", "what"), [(1, "1 external run"), (3, "3 external runs")])
def test_ctrl_c_tells_of_external_runs(invoke: Invoke, steps: Any, study: Path, count: int, what: str) -> None:
    runs = study.parent / "run" / "journal" / "runs.sqlite"

    def step(path: Path, **options: Any) -> None:
        runs.parent.mkdir(parents=True)
        with closing(sqlite3.connect(runs)) as database, database:
            database.execute("CREATE TABLE runs (key TEXT)")
            database.executemany("INSERT INTO runs VALUES (?)", [(str(i),) for i in range(count)])
        raise KeyboardInterrupt

    steps.modes = step
    expected = f"stopped by Ctrl-C; kept: {what} in {runs}; the same command continues from there\n"
    assert invoke("modes", study).stderr == expected


def test_ctrl_c_with_a_journal_of_runs_that_cannot_be_read(invoke: Invoke, steps: Any, study: Path) -> None:
    runs = study.parent / "run" / "journal" / "runs.sqlite"
    runs.parent.mkdir(parents=True)
    runs.write_text("no database at all, but long enough to be looked at")
    steps.modes = _raise(KeyboardInterrupt())
    assert invoke("modes", study).stderr == "stopped by Ctrl-C; nothing was written\n"


@pytest.mark.skipif(os.name != "posix", reason="SIGTERM ends a process of Windows without asking it")
def test_sigterm_ends_a_command_as_ctrl_c_does(invoke: Invoke, steps: Any, study: Path) -> None:
    before = signal.getsignal(signal.SIGTERM)

    def step(path: Path, **options: Any) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(10.0)

    steps.modes = step
    result = invoke("modes", study)
    assert result.exit_code == 143
    assert result.stderr == "stopped by SIGTERM; nothing was written\n"
    assert signal.getsignal(signal.SIGTERM) is before


def test_ctrl_c_of_a_step_that_writes_nothing_does_not_speak_of_the_journal(
    invoke: Invoke, steps: Any, study: Path
) -> None:
    journal = study.parent / "run" / "journal"
    journal.mkdir(parents=True)
    (journal / "modes-0.npz").touch()
    os.utime(journal, (0, 0))
    steps.modes = _raise(KeyboardInterrupt())
    assert invoke("modes", study).stderr == "stopped by Ctrl-C; nothing was written\n"


def test_ctrl_c_before_anything_was_written(invoke: Invoke, steps: Any, study: Path) -> None:
    steps.modes = _raise(KeyboardInterrupt())
    result = invoke("modes", study)
    assert result.exit_code == 130
    assert result.stderr == "stopped by Ctrl-C; nothing was written\n"


def test_ctrl_c_before_the_file_was_read(
    invoke: Invoke, steps: Any, study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing more is imported or read to find the run folder, which an earlier run may have left."""
    (study.parent / "run").mkdir()
    (study.parent / "run" / "results.json").touch()
    monkeypatch.setattr(running, "load", _raise(KeyboardInterrupt()))
    monkeypatch.setattr("femtune.files.study_file.reading.read_study_file", _raise(KeyboardInterrupt()))
    assert invoke("run", study).stderr == "stopped by Ctrl-C; nothing was written\n"
