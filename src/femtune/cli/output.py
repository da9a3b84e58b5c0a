"""Results on the terminal and as JSON; what is printed of a run."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femtune.cli.log import alerts_of, log_results
from femtune.errors import printable
from femtune.steps.step import coloured, load

if TYPE_CHECKING:
    from rich.console import Console

    from femtune.document.document import Document
    from femtune.steps.run.result import RunResult
    from femtune.steps.step import Command
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


def show(command: Command, path: Path, result: Any) -> None:
    """Print the tables of a result; `path` is the study or deck."""
    document = load(command.document)
    if command.shown is None:
        show_document(document(result))
    else:
        # the function of the subject reads the study file, which help does without
        show_document(document(load("subject:subject_of")(path), *command.shown(result)))


def name_page(page: Path | None, as_json: bool) -> None:
    """Print the name of the page that was written; beside JSON on standard error."""
    if page is not None:
        click.echo(f"report: {printable(str(page.resolve()))}", err=as_json)


def as_text(result: Any) -> str:
    """A record as JSON object, several records as an array; text is JSON already."""
    if isinstance(result, str):
        return result
    if isinstance(result, Sequence):
        data: Any = [record.model_dump(mode="json") for record in result]
    else:
        data = result.model_dump(mode="json")
    return json.dumps(data, indent=1, ensure_ascii=True, allow_nan=False)


def show_document(document: Document) -> None:
    """Print the short form of a report."""
    from femtune.reporting.terminal import print_terminal  # noqa: PLC0415

    print_terminal(document, _console())


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
    from femtune.files.whole_file import digest_of  # noqa: PLC0415
    from femtune.steps.report.build import build_report  # noqa: PLC0415

    document = build_report(run.results, run.arrays)
    names = (*((run.report.name,) if run.report else ()), *run.files)
    lines = [f"{run.folder}: {', '.join(names)}"]
    if run.report is not None:
        lines.append(f"SHA-256 of {run.report.name}: {digest_of(run.report)}")
    files = Section("files", "Files", tuple(map(Paragraph, lines)))
    return replace(document, short=(*document.short, files))
