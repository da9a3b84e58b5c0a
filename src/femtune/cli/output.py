"""Results on the terminal and as JSON; what is printed of a run."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femtune.cli.guard import coloured
from femtune.cli.log import alerts_of, log_results
from femtune.cli.running import load
from femtune.errors import printable

if TYPE_CHECKING:
    from pydantic import BaseModel
    from rich.console import Console

    from femtune.document.document import Document
    from femtune.steps.run.result import RunResult
    from femtune.study.progress import Progress

PIPE_WIDTH = 160
"""Columns where the output is no terminal."""


def say(result: Any, quiet: bool) -> None:
    """Remarks beside the result, on standard error; with `quiet` warnings and problems only, each of them."""
    warn(result, quiet)
    for remark in getattr(result, "remarks", ()):
        if not quiet or remark.level != "info":
            click.echo(coloured(remark), err=True)


def warn(result: Any, quiet: bool) -> None:
    """Alerts of a result to the log; with `quiet`, where no table has them, warnings and problems to standard error."""
    log_results(result)
    for alert in alerts_of(result) if quiet else ():
        if alert.level != "info":
            click.echo(coloured(alert), err=True)


def show(document: str, path: Path, record: Any, *more: Any, as_json: bool, quiet: bool, data: Any = None) -> None:
    """A result as JSON or as tables.

    Parameters
    ----------
    document : ``module:function`` below `femtune.steps` that makes the tables
    path : the study or deck
    record, more : arguments of the function after the subject
    data : record, or records, for JSON; that of the tables where None
    """
    if as_json:
        click.echo(as_text(record if data is None else data))
    elif not quiet:
        subject = load("femtune.steps.info.terminal:subject_of")(path)
        show_document(load(f"femtune.steps.{document}")(subject, record, *more))


def name_page(page: Path | None, as_json: bool) -> None:
    """The page that was written, where there is one; standard output is the JSON's alone."""
    if page is not None:
        click.echo(f"report: {printable(str(page.resolve()))}", err=as_json)


def as_text(result: BaseModel | Sequence[BaseModel]) -> str:
    """A result as JSON: an object, or an array where a step gives several records."""
    if isinstance(result, Sequence):
        data: Any = [record.model_dump(mode="json") for record in result]
    else:
        data = result.model_dump(mode="json")
    return json.dumps(data, indent=1, ensure_ascii=True, allow_nan=False)


def show_document(document: Document) -> None:
    """Print the short form of a report."""
    load("femtune.reporting.terminal:print_terminal")(document, _console())


def _console() -> Console:
    """Standard output; a file or pipe is not limited to the 80 columns that rich assumes."""
    from rich.console import Console  # noqa: PLC0415

    console = Console(highlight=False)
    return console if console.is_terminal or "COLUMNS" in os.environ else Console(highlight=False, width=PIPE_WIDTH)


# ----------------------------------------------------------------------------------------------------
# The end of a run.


def show_run(run: RunResult, quiet: bool) -> None:
    """The short form of its report, with the names of the files that were written."""
    if quiet:
        return
    from femtune.cli.display import Display  # noqa: PLC0415

    with Display() as progress:
        document = document_of(run, progress)
    show_document(document)


def document_of(run: RunResult, progress: Progress) -> Document:
    """The report of a run as data, with the names of the files that were written."""
    progress.step("reading the results", 0, None)
    from femtune.document.document import Paragraph, Section  # noqa: PLC0415
    from femtune.steps.report.build import build_report  # noqa: PLC0415

    document = build_report(run.results, run.arrays)
    names = (*((run.report.name,) if run.report else ()), *run.files)
    files = Section("files", "Files", (Paragraph(f"{run.folder}: {', '.join(names)}"),))
    return replace(document, short=(*document.short, files))


def missed_optimum(run: RunResult) -> bool:
    """Whether the update ended without an optimum, which is said on standard error."""
    outcome = run.results.update
    if outcome is None or outcome.ok:
        return False
    click.echo(f"{outcome.status}: {outcome.message}", err=True)
    return True
