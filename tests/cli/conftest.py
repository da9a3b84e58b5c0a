"""A stand-in for the steps, so that the command line is tested by itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from femtune.cli import main, output, running
from femtune.files.study_file import read_study_file
from femtune.steps.info.record.model import UsedCard
from femtune.steps.judge.record.judgement import JudgementResults
from femtune.steps.run_folder import check_writable

STUDY = '[study]\ntitle = "Frame"\ndeck = "frame.bdf"\nunits = "m-kg-s"\n'


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small study in the current folder."""
    (tmp_path / "frame.bdf").write_text("ENDDATA\n")
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "study.toml"


@pytest.fixture
def steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Steps that read the study, make the run folder, and tell what they were asked."""
    module: Any = ModuleType("steps")
    module.calls, module.outcome = [], None
    module.judgement = JudgementResults(verdict="accepted", line="Accepted: no check failed.")
    for name in ("info", "modes", "respond", "plan", "identify", "correlate", "select", "quantify"):
        setattr(module, name, _single(module, name))
    for name in ("update", "run"):
        setattr(module, name, _whole(module, name))
    judge = _whole(module, "validate")
    module.validate = lambda path, output, fresh, progress: judge(path, output, None, fresh, progress)
    module.report = lambda path, progress: Path(path) / "report.html"
    monkeypatch.setattr(running, "load", lambda name: getattr(module, name.partition(":")[2]))
    monkeypatch.setattr(output, "load", _tables)
    monkeypatch.setattr("femtune.reporting.terminal.print_terminal", lambda document, _: click.echo(document.name))
    monkeypatch.setattr(output, "document_of", lambda run, progress: run.results)
    return module


def _tables(name: str) -> Callable[..., Any]:
    """In place of the subject, and of the document of a step."""
    return lambda *arguments: arguments[-1]


def _single(module: Any, name: str) -> Callable[..., SimpleNamespace]:
    def step(path: Path, progress: Any, **_: Any) -> SimpleNamespace:
        module.calls.append((name, Path(path), {}))
        read_study_file(path)
        progress.step(f"{name} of [red]configuration[/red]", 1, 2)
        found = UsedCard(name="CBAR", count=7)
        return SimpleNamespace(
            record=found, records=found, arrays=found, remarks=(), report=None, judgement=module.judgement
        )

    return step


def _whole(module: Any, name: str) -> Callable[..., SimpleNamespace]:
    def step(
        path: Path, output: Path | None, wide: bool | None, fresh: bool, progress: Any, choices: Path | None = None
    ) -> SimpleNamespace:
        module.calls.append((name, Path(path), {"output": output, "wide": wide} | ({"fresh": True} if fresh else {})))
        folder = output or read_study_file(path).output_folder
        check_writable(folder)
        (folder / "results.json").write_text("{}")
        results = Outcome(name="CBAR", count=7, update=module.outcome, judgement=module.judgement)
        return SimpleNamespace(folder=folder, results=results, report=folder / "report.html", remarks=())

    return step


class Outcome(UsedCard):
    """Results as far as the command line looks at them."""

    update: Any = None
    judgement: Any = None


@pytest.fixture
def invoke() -> Callable[..., Result]:
    """Run ``femtune`` with arguments, without colours."""

    def call(*arguments: object, **options: Any) -> Result:
        return CliRunner().invoke(main, [str(a) for a in arguments], **options)

    return call


@pytest.fixture
def command_names() -> list[str]:
    """Names of the commands in their order."""
    return main.list_commands(click.Context(main))
