"""The short form of the document for a terminal."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table as RichTable
from rich.text import Text

from femtune.document.document import (
    AlertBox,
    Details,
    Figure,
    FigureRow,
    Heading,
    KeyNumbers,
    Listing,
    Paragraph,
    Table,
    flat,
)
from femtune.errors import printable

if TYPE_CHECKING:
    from femtune.document.document import Block, Cell, Document

_TONES = {"": "", "good": "green", "poor": "yellow", "muted": "dim"}
_LEVELS = {"info": "blue", "warning": "yellow", "problem": "bold red"}


def print_terminal(document: Document, console: Console | None = None) -> None:
    """Print title, verdict and the short form; pictures are left to the HTML file."""
    console = console or Console()
    console.print(_text(document.title, "bold"))
    console.print(_text(document.verdict, _LEVELS[document.verdict_level]))
    for section in document.short:
        console.rule(_text(section.title, "bold"), align="left")
        for block in flat(section.blocks):
            for renderable in _render(block):
                console.print(renderable)


def _text(text: str, style: str = "") -> Text:
    """Text without markup and control characters, so that the content of a file cannot control the terminal."""
    return Text(printable(text.expandtabs()), style=style)


def _render(block: Block) -> list[RenderableType]:
    return _RENDERERS[type(block)](block)


def _paragraph(block: Paragraph) -> list[RenderableType]:
    return [_text(block.text, _TONES[block.tone])]


def _heading(block: Heading) -> list[RenderableType]:
    return [_text(block.text, "bold")]


def _listing(block: Listing) -> list[RenderableType]:
    return [Padding(Text("• ") + _text(item), (0, 0, 0, 1)) for item in block.items]


def _alert(block: AlertBox) -> list[RenderableType]:
    place = f" ({block.where})" if block.where else ""
    return [_text(f"{block.level}: ", _LEVELS[block.level]) + _text(f"{block.sentence}{place} [{block.code}]")]


def _key_numbers(block: KeyNumbers) -> list[RenderableType]:
    table = RichTable(box=None, show_header=False, pad_edge=False)
    for n in block.numbers:
        shown = f"{n.before} → {n.after}" if n.after else n.before
        table.add_row(_text(n.name), _text(shown, "bold"), _text(n.remark, "dim"))
    return [table]


def _table(block: Table) -> list[RenderableType]:
    # a title of the table itself would be broken to the width of the table
    title = [_text(block.title, "bold")] if block.title else []
    table = RichTable(box=None, pad_edge=False)
    for column in block.columns:
        head = f"{column.group}\n{column.title}" if column.group else column.title
        table.add_column(_text(head), justify=column.align)
    for cells in block.rows:
        table.add_row(*map(_cell, cells))
    return [*title, table, *([_text(block.note, "dim")] if block.note else [])]


def _cell(cell: Cell) -> Text:
    return _text(cell.text, _TONES[cell.tone])


def _nothing(_: Figure | FigureRow | Details) -> list[RenderableType]:
    return []


_RENDERERS: dict[type, Callable[[Any], list[RenderableType]]] = {
    Paragraph: _paragraph,
    Heading: _heading,
    Listing: _listing,
    AlertBox: _alert,
    KeyNumbers: _key_numbers,
    Table: _table,
    Figure: _nothing,
    FigureRow: _nothing,
    Details: _nothing,
}
