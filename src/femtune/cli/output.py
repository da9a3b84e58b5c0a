"""Results on the terminal and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel
from rich.console import Console
from rich.table import Table
from rich.text import Text

from femtune.errors import printable


def as_text(result: BaseModel | Sequence[BaseModel]) -> str:
    """A result as JSON: an object, or an array where a step gives several records."""
    if isinstance(result, BaseModel):
        data: Any = result.model_dump(mode="json")
    else:
        data = [record.model_dump(mode="json") for record in result]
    return json.dumps(data, indent=1, ensure_ascii=True, allow_nan=False)


def show(result: BaseModel | Sequence[BaseModel], console: Console | None = None) -> None:
    """Print a result: single values as lines, lists of records as tables."""
    console = console or Console(highlight=False)
    for record in [result] if isinstance(result, BaseModel) else result:
        _show_record(record, console, "")


def _show_record(record: BaseModel, console: Console, heading: str) -> None:
    for name, value in record:
        title = f"{heading}{name.replace('_', ' ')}"
        if isinstance(value, BaseModel):
            _show_record(value, console, f"{title}, ")
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            console.print(_table(title, value))
        elif value not in (None, "", ()):
            console.print(Text(f"{title}: {_cell(value)}"))


def _table(title: str, records: Sequence[BaseModel]) -> Table:
    table = Table(title=Text(title), title_justify="left")
    names = list(type(records[0]).model_fields)
    for name in names:
        table.add_column(Text(name.replace("_", " ")))
    for record in records:
        table.add_row(*(Text(_cell(getattr(record, name))) for name in names))
    return table


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return ", ".join(_cell(entry) for entry in value)
    if isinstance(value, BaseModel):
        return ", ".join(f"{name} {_cell(entry)}" for name, entry in value)
    return "" if value is None else printable(str(value))
