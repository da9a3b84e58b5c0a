"""Results as lines, tables and JSON."""

from __future__ import annotations

import io
import json

from pydantic import BaseModel
from rich.console import Console

from femtune.cli.output import as_text, show


class _Row(BaseModel):
    name: str
    value: float | None = None
    good: bool = True


class _Whole(BaseModel):
    title: str
    freq_hz: tuple[float, ...]
    rows: tuple[_Row, ...]
    inner: _Row


def _printed(*records: BaseModel) -> str:
    stream = io.StringIO()
    show(records[0] if len(records) == 1 else records, Console(file=stream, width=80))
    return stream.getvalue()


_WHOLE = _Whole(
    title="[bold]x[/bold]", freq_hz=(1.23456789, 2.0, 3.0, 4.0), rows=(_Row(name="a"), _Row(name="b")),
    inner=_Row(name="c", value=1e-9),
)  # fmt: skip


def test_lines_and_tables() -> None:
    lines = [line.rstrip() for line in _printed(_WHOLE).splitlines()]
    assert lines == [
        "title: [bold]x[/bold]",
        "freq hz: 1.23457, 2, 3, 4",
        "rows:",
        "  name  good",
        "  a     yes",
        "  b     yes",
        "inner:",
        "  name: c",
        "  value: 1e-09",
        "  good: yes",
    ]


def test_records_with_lists_stand_one_after_the_other() -> None:
    assert _printed(_WHOLE, _WHOLE).count("title: [bold]x[/bold]") == 2


def test_control_characters_are_spelled_out() -> None:
    assert "\x1b" not in _printed(_Row(name="\x1b[2J"))


def test_json_of_one_and_of_several() -> None:
    assert json.loads(as_text(_WHOLE))["rows"][1] == {"name": "b", "value": None, "good": True}
    assert [row["name"] for row in json.loads(as_text(_WHOLE.rows))] == ["a", "b"]
