"""Results on the terminal and as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel
from rich.console import Console

from femtune.study.history import HISTORY_FILE
from femtune.study.journal import from_journal
from femtune.study.progress import Progress
from femtune.study.results import Results
from femtune.study.run_folder import ARRAYS_FILE, RESULTS_FILE
from femtune.study.steps import RunFolder

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.report.document import Document

PIPE_WIDTH = 160
"""Columns where the output is no terminal."""


def as_text(result: BaseModel | Sequence[BaseModel]) -> str:
    """A result as JSON: an object, or an array where a step gives several records."""
    if isinstance(result, BaseModel):
        data: Any = result.model_dump(mode="json")
    else:
        data = [record.model_dump(mode="json") for record in result]
    return json.dumps(data, indent=1, ensure_ascii=True, allow_nan=False)


def document_of_step(step: str, path: Path, result: Any, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """What the terminal shows of the result of one step; `arrays` are those of the comparison."""
    from femtune.report import steps  # noqa: PLC0415

    subject = steps.subject_of(path)
    if step == "info":
        return steps.info_document(subject, result)
    if step == "modes":
        return steps.modes_document(subject, result)
    if step == "correlate":
        return steps.correlation_document(subject, result, arrays)
    if step == "quantify":
        return steps.quantify_document(subject, result)
    if step == "respond":
        return steps.responses_document(subject, result)
    if step == "validate":
        return steps.validation_document(subject, result)
    return steps.selection_document(subject, result)


def remarks_of(results: Results) -> list[str]:
    """How much of a run came from the journal of an earlier one."""
    journal = results.journal
    return [from_journal(journal.recalled, journal.solved)] if journal is not None and journal.recalled else []


def document_of(run: RunFolder, progress: Progress) -> Document:
    """The report of a run as data, with the names of the files that were written."""
    progress.step("reading the results", 0, None)
    from femtune.report import build_report  # noqa: PLC0415
    from femtune.report.document import Paragraph, Section  # noqa: PLC0415

    document = build_report(run.results, run.arrays)
    files = Section("files", "Files", (Paragraph(f"{run.folder}: {', '.join(_written(run))}"),))
    return replace(document, short=(*document.short, files))


def _written(run: RunFolder) -> list[str]:
    deck = run.results.write_back.files if run.results.write_back else ()
    page = (run.report.name,) if run.report else ()
    frfs = sorted(f.name for f in Path(run.folder).glob("frfs*.uff")) if run.results.responses else []
    return [*page, *frfs, RESULTS_FILE, ARRAYS_FILE, HISTORY_FILE, *deck]


def show_document(document: Document) -> None:
    """Print the short form of a report."""
    from femtune.report import print_terminal  # noqa: PLC0415

    print_terminal(document, _console())


def _console() -> Console:
    """Standard output; a file or pipe is wider than the terminal of old that rich takes it for."""
    console = Console(highlight=False)
    return console if console.is_terminal or "COLUMNS" in os.environ else Console(highlight=False, width=PIPE_WIDTH)
