"""Errors, Ctrl-C and faults: messages and exit codes."""

from __future__ import annotations

import json
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
from femtune.errors import FemtuneError, FemtuneErrors, Notice, Where
from femtune.steps import all_steps
from femtune.steps.problem import CommandFailure
from femtune.steps.step import JSON

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


def _error_of(result: Result) -> dict[str, Any]:
    ((key, error),) = json.loads(result.stdout).items()
    assert key == "error"
    assert error["exit_code"] == result.exit_code
    return error


def test_an_error_is_one_json_object_beside_its_sentence(invoke: Invoke, steps: Any, study: Path) -> None:
    error = FemtuneError("a.b", "what", where=Where("deck.bdf", 7, "CBAR 3"), values={"length": 0.0}, hint="fix")
    error.notices = (Notice("c.d", "seen before"),)
    error.add_note("[e.f] a card was ignored")
    steps.run = _raise(error)
    result, plain = invoke("run", study, "--json"), invoke("run", study)
    assert (result.stderr, result.exit_code) == (plain.stderr, plain.exit_code)
    assert plain.stdout == ""
    assert _error_of(result) == {
        "exit_code": 2,
        "code": "a.b",
        "message": "what",
        "file": "deck.bdf",
        "line": 7,
        "record": "CBAR 3",
        "values": {"length": "0.0"},
        "hint": "fix",
        "notes": ["[c.d] seen before", "[e.f] a card was ignored"],
        "problems": [],
    }


def test_several_errors_are_listed_in_one_object(invoke: Invoke, steps: Any, study: Path) -> None:
    both = [FemtuneError("a.b", "x", where=Where("s.toml", 2)), FemtuneError("c.d", "y", hint="fix")]
    steps.run = _raise(FemtuneErrors(both))
    error = _error_of(invoke("run", study, "--json"))
    assert (error["code"], error["message"], error["line"]) == ("a.b", "2 problems found", 2)
    listed = [(p["level"], p["code"], p["file"], p["line"], p["hint"]) for p in error["problems"]]
    assert listed == [("error", "a.b", "s.toml", 2, ""), ("error", "c.d", "", None, "fix")]


def test_bytes_that_are_no_text_do_not_spoil_the_object(invoke: Invoke, steps: Any, study: Path) -> None:
    steps.run = _raise(FemtuneError("a.b", "\x1b[31m", where=Where("a\udcff.bdf"), values={"name": "\udcff"}))
    error = _error_of(invoke("run", study, "--json"))
    assert (error["message"], error["file"], error["values"]) == ("\\x1b[31m", "a\\udcff.bdf", {"name": "\\udcff"})


@pytest.mark.parametrize(
    ("fault", "code", "message"),
    [
        (ZeroDivisionError("by zero"), 70, "internal error of femtune"),
        (KeyboardInterrupt(), 130, "stopped by Ctrl-C; nothing was written"),
        (MemoryError(), 2, "memory"),
    ],
)
def test_what_is_no_error_of_the_input_is_an_object_too(
    invoke: Invoke, steps: Any, study: Path, fault: BaseException, code: int, message: str
) -> None:
    steps.run = _raise(fault)
    error = _error_of(invoke("run", study, "--json"))
    assert error["exit_code"] == code
    assert message in error["message"]


@pytest.mark.parametrize("words", [("info", "--nothing"), ("nothing",), ("info",), ("modes", "x.toml", "--count", "a")])
def test_wrong_options_are_an_object_too(invoke: Invoke, words: tuple[str, ...]) -> None:
    result = invoke(*words, "--json")
    error = _error_of(result)
    assert (error["exit_code"], error["code"]) == (2, "")
    assert error["message"] in result.stderr
    assert invoke(*words).stdout == ""


def test_every_command_that_prints_json_prints_its_errors_so(invoke: Invoke, tmp_path: Path) -> None:
    # what `check` prints is a list of errors in any case
    with_json = (step for step in all_steps() if step.command is not None and JSON in step.command.params)
    commands = [step for step in with_json if step.name != "check"]
    assert len(commands) > 15
    for step in commands:
        assert step.command is not None
        files = [p for p in step.command.params if isinstance(p, click.Argument)]
        result = invoke(step.name, *[tmp_path / "absent.toml"] * len(files), "--json")
        assert _error_of(result)["message"], step.name
        assert result.exit_code == 2, step.name


def test_the_guide_shows_all_fields_of_a_failure() -> None:
    guide = (Path(__file__).resolve().parents[2] / "docs/guide/index.md").read_text(encoding="utf-8")
    shown = json.loads(guide.partition("```json\n")[2].partition("```")[0])
    assert CommandFailure.model_validate(shown["error"]).model_dump() == {**shown["error"], "notes": (), "problems": ()}
    assert list(shown["error"]) == list(CommandFailure.model_fields)
