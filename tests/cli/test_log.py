"""What is told and where: the log, lines of steps, warnings of a quiet command, the number of runs at a time."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import Result
from tests.cli.conftest import Outcome

from femtune.errors import FemtuneError, Notice
from femtune.study.progress import silent

Invoke = Callable[..., Result]
_TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ "
ALERTS = (
    SimpleNamespace(level="info", code="uff.not-measured", sentence="4 of 12 components are zero"),
    SimpleNamespace(level="warning", code="model.mesh-coarse", sentence="mode 3 changes \x1b by 5 %"),
)


def _lines(path: Path) -> list[str]:
    return [re.sub(_TIME, "", line) for line in path.read_text().splitlines()]


def _warns(steps: Any, name: str) -> None:
    given = getattr(steps, name)

    def step(path: Path, **options: Any) -> Any:
        found = given(path, **options)
        record = SimpleNamespace(alerts=ALERTS)
        remarks = (
            Notice("deck.ignored", "PARAM ignored"),
            Notice("", "12 solutions from the journal", level="info"),
        )
        return SimpleNamespace(**{**vars(found), "record": record, "records": (record,), "remarks": remarks})

    setattr(steps, name, step)


def test_a_log_has_steps_warnings_and_the_end(invoke: Invoke, steps: Any, study: Path) -> None:
    _warns(steps, "modes")
    log = study.with_name("femtune.log")
    assert invoke("modes", study, "--log", log, "--quiet").exit_code == 0
    lines = _lines(log)
    assert lines[0].startswith("INFO    femtune ")
    assert lines[1:] == [
        "INFO    modes of [red]configuration[/red] 1/2",
        "WARNING [deck.ignored] PARAM ignored",
        "WARNING 12 solutions from the journal",
        "INFO    [uff.not-measured] 4 of 12 components are zero",
        "WARNING [model.mesh-coarse] mode 3 changes \\x1b by 5 %",
        "INFO    ended with exit code 0",
    ]
    assert all(re.match(_TIME, line) for line in log.read_text().splitlines())


def test_a_second_command_adds_to_the_log(invoke: Invoke, steps: Any, study: Path) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise FemtuneError("study.no-test", purpose="an update", values={"file": "none"})

    log = study.with_name("femtune.log")
    invoke("modes", study, "--log", log)
    first = log.read_text()
    steps.modes = refuse
    result = invoke("modes", study, "--log", log)
    assert result.exit_code == 2
    assert result.stderr.count("[study.no-test]") == 1
    assert log.read_text().startswith(first)
    added = log.read_text()[len(first) :].splitlines()
    assert "ERROR   [study.no-test]" in added[1]
    # the values and the hint of the error belong to its line
    assert added[2] == "      file = none"
    assert added[-1].endswith("INFO    ended with exit code 2")


@pytest.mark.parametrize("kind", ["input", "link"])
def test_a_log_is_never_added_to_another_file(invoke: Invoke, steps: Any, study: Path, kind: str) -> None:
    target, before = study, study.read_bytes()
    if kind == "link":
        target = study.with_name("a.log")
        target.symlink_to(study.with_name("absent.log"))
    result = invoke("modes", study, "--log", target)
    assert result.exit_code == 2
    assert result.stderr.startswith("[run.unwritable] the file exists and is not a log of femtune")
    assert study.read_bytes() == before
    assert not study.with_name("absent.log").exists()


def test_a_log_in_a_missing_folder(invoke: Invoke, steps: Any, study: Path) -> None:
    result = invoke("modes", study, "--log", study.parent / "none" / "a.log")
    assert result.exit_code == 2
    assert result.stderr.startswith("[run.unwritable] the log cannot be written: No such file or directory")


def test_verbose_shows_every_step(invoke: Invoke, steps: Any, study: Path) -> None:
    result = invoke("modes", study, "-v")
    assert re.fullmatch(_TIME + r"INFO    modes of \[red\]configuration\[/red\] 1/2\n", result.stderr)
    # the next command is not verbose
    assert invoke("modes", study).stderr == ""


@pytest.mark.parametrize("name", ["modes", "correlate", "select"])
def test_quiet_still_warns(invoke: Invoke, steps: Any, study: Path, name: str) -> None:
    _warns(steps, name)
    result = invoke(name, study, "--quiet")
    assert result.stdout == ""
    assert result.stderr.splitlines() == [
        "[model.mesh-coarse] mode 3 changes \\x1b by 5 %",
        "[deck.ignored] PARAM ignored",
        *([steps.judgement.line] if name == "correlate" else []),
    ]


@pytest.mark.parametrize("name", ["run", "update"])
def test_a_run_as_json(invoke: Invoke, steps: Any, study: Path, name: str) -> None:
    given = getattr(steps, name)

    def step(path: Path, **options: Any) -> Any:
        return SimpleNamespace(**{**vars(given(path, **options)), "results": Outcome(name="CBAR", count=7)})

    setattr(steps, name, step)
    result = invoke(name, study, "--json")
    assert json.loads(result.stdout)["name"] == "CBAR"
    assert result.stderr.splitlines()[-1].startswith(("report: ", "results: "))


def test_the_report_and_an_explanation_as_json(invoke: Invoke, steps: Any, tmp_path: Path) -> None:
    assert json.loads(invoke("report", tmp_path, "--json").stdout) == {"report": str(tmp_path / "report.html")}
    said = json.loads(invoke("explain", "units.unknown", "--json").stdout)
    assert said["code"] == "units.unknown"
    assert said["meaning"].startswith("A deck has no units")
    assert said["fix"]


@pytest.mark.parametrize("name", ["quantify", "update", "validate", "run", "identify"])
def test_jobs_reach_the_step(invoke: Invoke, steps: Any, study: Path, name: str) -> None:
    seen: list[Any] = []

    def step(path: Path, **options: Any) -> None:
        seen.append(options.get("jobs"))
        raise FemtuneError("study.no-test", purpose="an update")

    setattr(steps, name, step)
    if name == "identify":
        study.write_text('[identify]\nrecord = "r.csv"\nunits = "m-kg-s"\n')
    invoke(name, study, "--jobs", "3")
    invoke(name, study)
    assert seen == [3, None]
    assert invoke(name, study, "--jobs", "0").exit_code == 2


def test_steps_are_logged_in_python_too(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="femtune.progress"):
        silent.step("modes of the model", 2, 9)
    assert caplog.messages == ["modes of the model 2/9"]
