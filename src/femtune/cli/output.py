"""Results on the terminal and as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from femtune.errors import printable
from femtune.study.history import HISTORY_FILE
from femtune.study.progress import Progress
from femtune.study.run_folder import ARRAYS_FILE, RESULTS_FILE
from femtune.study.steps import RunFolder

if TYPE_CHECKING:
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


def show(result: BaseModel | Sequence[BaseModel], console: Console | None = None) -> None:
    """Print a result: single values as lines, lists of plain records as tables, other records one after the other."""
    console = console or _console()
    if isinstance(result, BaseModel):
        _show_record(result, console, 0)
    else:
        _show_records("", result, console, 0)


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
    return [*page, RESULTS_FILE, ARRAYS_FILE, HISTORY_FILE, *deck]


def show_document(document: Document) -> None:
    """Print the short form of a report."""
    from femtune.report import print_terminal  # noqa: PLC0415

    print_terminal(document, _console())


def _console() -> Console:
    """Standard output; a file or pipe is wider than the terminal of old that rich takes it for."""
    console = Console(highlight=False)
    return console if console.is_terminal or "COLUMNS" in os.environ else Console(highlight=False, width=PIPE_WIDTH)


def _show_record(record: BaseModel, console: Console, indent: int) -> None:
    for name, value in record:
        title = name.replace("_", " ")
        if isinstance(value, BaseModel):
            _show_records(title, [value], console, indent)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            _show_records(title, value, console, indent)
        elif value is not None and value not in ("", ()):
            _line(f"{title}: {_cell(value)}", console, indent)


def _show_records(title: str, records: Sequence[BaseModel], console: Console, indent: int) -> None:
    if title:
        _line(f"{title}:", console, indent)
    if len(records) > 1 and all(map(_is_plain, records)):
        console.print(Padding(_table(records), (0, 0, 0, indent + 2)))
        return
    for i, record in enumerate(records):
        if i:
            console.print()
        _show_record(record, console, indent + 2)


def _line(text: str, console: Console, indent: int) -> None:
    console.print(Padding(Text(text), (0, 0, 0, indent)))


def _is_plain(record: BaseModel) -> bool:
    """True for a record without records and longer lists in it: a row of a table."""
    return not any(
        isinstance(value, BaseModel) or (isinstance(value, tuple) and _is_long(value)) for _, value in record
    )


def _is_long(values: tuple[object, ...]) -> bool:
    return len(values) > 3 or any(isinstance(value, BaseModel) for value in values)


def _table(records: Sequence[BaseModel]) -> Table:
    """One row a record; columns that are empty throughout are left out."""
    table = Table(box=None, pad_edge=False)
    columns = {name: [_cell(getattr(r, name)) for r in records] for name in type(records[0]).model_fields}
    shown = {name: cells for name, cells in columns.items() if any(cells)}
    for name in shown:
        table.add_column(Text(name.replace("_", " ")))
    for row in zip(*shown.values()):
        table.add_row(*map(Text, row))
    return table


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return ", ".join(_cell(entry) for entry in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "" if value is None else printable(str(value))
