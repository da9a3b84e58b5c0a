"""The report as data: sections of blocks, independent of HTML and terminals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Literal

from femtune.study.record import Level

if TYPE_CHECKING:
    from femtune.document.page_view import PageView


Tone = Literal["", "good", "poor", "muted"]
Align = Literal["left", "right"]


@dataclass(frozen=True)
class Paragraph:
    """Running text; `tone` "muted" is for remarks."""

    text: str
    tone: Tone = ""
    kind: ClassVar[str] = "paragraph"


@dataclass(frozen=True)
class Heading:
    """A heading inside a section."""

    text: str
    kind: ClassVar[str] = "heading"


@dataclass(frozen=True)
class Listing:
    """A list of sentences, one per item."""

    items: tuple[str, ...]
    kind: ClassVar[str] = "listing"


@dataclass(frozen=True)
class AlertBox:
    """An alert that the reader should not overlook."""

    level: Level
    code: str
    sentence: str
    where: str = ""
    kind: ClassVar[str] = "alert"


@dataclass(frozen=True)
class KeyNumber:
    """A number before and after; `after` is "" if there is only one."""

    name: str
    before: str
    after: str = ""
    remark: str = ""


@dataclass(frozen=True)
class KeyNumbers:
    """The most important numbers."""

    numbers: tuple[KeyNumber, ...]
    kind: ClassVar[str] = "key_numbers"


@dataclass(frozen=True)
class Bar:
    """A bar behind a number: from `start` to `end` on a scale from 0 to 1, with a mark at `zero`."""

    start: float
    end: float
    zero: float = 0.0


@dataclass(frozen=True)
class Cell:
    """One cell of a table."""

    text: str
    bar: Bar | None = None
    tone: Tone = ""


@dataclass(frozen=True)
class Column:
    """Head of a column; `group` joins neighbours under one head."""

    title: str
    align: Align = "left"
    group: str = ""


@dataclass(frozen=True)
class Table:
    """A table; rows have a cell for each column; a `folded` one is shown on demand, and in print; the last column of
    one in `prose` has sentences."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    folded: bool = False
    prose: bool = False
    kind: ClassVar[str] = "table"

    def __post_init__(self) -> None:
        wrong = [len(row) for row in self.rows if len(row) != len(self.columns)]
        if wrong:
            raise ValueError(f"table '{self.title}' has {len(self.columns)} columns, a row has {wrong[0]}")

    @property
    def groups(self) -> tuple[tuple[str, int], ...]:
        """Groups of neighbouring columns with the number of columns; () if no column has a group."""
        spans: list[tuple[str, int]] = []
        for column in self.columns:
            joined = spans and column.group and spans[-1][0] == column.group
            spans[-1:] = [(column.group, spans[-1][1] + 1)] if joined else [*spans[-1:], (column.group, 1)]
        return tuple(spans) if any(name for name, _ in spans) else ()


@dataclass(frozen=True)
class Figure:
    """A picture: `alt` says in words what it shows; a `wide` one may be scrolled.

    `draw` returns a whole SVG file; it is called when somebody asks for `svg`, so a terminal never waits for it.
    """

    draw: Callable[[], str]
    caption: str
    alt: str
    wide: bool = False
    kind: ClassVar[str] = "figure"

    @cached_property
    def svg(self) -> str:
        """The picture, drawn once."""
        return self.draw()


@dataclass(frozen=True)
class FigureRow:
    """Pictures side by side if there is room."""

    figures: tuple[Figure, ...]
    kind: ClassVar[str] = "figure_row"


@dataclass(frozen=True)
class Details:
    """Preformatted text that is shown on demand."""

    summary: str
    text: str
    kind: ClassVar[str] = "details"


@dataclass(frozen=True)
class TwoColumns:
    """Two columns of blocks, side by side if there is room."""

    left: tuple[Block, ...]
    right: tuple[Block, ...]
    kind: ClassVar[str] = "beside"


Block = Paragraph | Heading | Listing | AlertBox | KeyNumbers | Table | Figure | FigureRow | Details | TwoColumns


def flat(blocks: Iterable[Block]) -> Iterator[Block]:
    """The blocks, with those of columns one after another."""
    for block in blocks:
        if isinstance(block, TwoColumns):
            yield from flat((*block.left, *block.right))
        else:
            yield block


@dataclass(frozen=True)
class Approval:
    """The lines for signatures: roles with names, "" for one that is not stated, and digests of what is signed.

    `digests` are names of files with the SHA-256 of their bytes.
    """

    roles: tuple[tuple[str, str], ...]
    digests: tuple[tuple[str, str], ...]
    note: str = ""


@dataclass(frozen=True)
class Section:
    """A section of the page, or of the short form; `folded` where its step did not run, and it only says so."""

    id: str
    title: str
    blocks: tuple[Block, ...]
    folded: bool = False


@dataclass(frozen=True)
class Document:
    """The whole report: `verdict` is one sentence, `facts` are lines under the title, `short` fits a terminal.

    `genre` says what kind of report it is, above the title. `collect` returns what moves on the page, for who asks for
    `view`; None for text and still pictures alone. `approval` stands below the first section.
    """

    title: str
    verdict: str
    verdict_level: Level
    facts: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]
    short: tuple[Section, ...] = ()
    genre: str = "Model updating report"
    collect: Callable[[], PageView] | None = None
    approval: Approval | None = None

    @cached_property
    def view(self) -> PageView | None:
        """The data of the interactive view, made once."""
        return None if self.collect is None else self.collect()


def row(*cells: Cell | str) -> tuple[Cell, ...]:
    """A row of a table; texts become plain cells."""
    return tuple(cell if isinstance(cell, Cell) else Cell(cell) for cell in cells)


def columns(*titles: str) -> tuple[Column, ...]:
    """Heads of columns; a title that begins with ">" is aligned right."""
    return tuple(Column(t.removeprefix(">"), "right" if t.startswith(">") else "left") for t in titles)


def without_column(table: Table, title: str) -> Table:
    """The table without the column of that title."""
    kept = [i for i, column in enumerate(table.columns) if column.title != title]
    rows = tuple(tuple(cells[i] for i in kept) for cells in table.rows)
    return replace(table, columns=tuple(table.columns[i] for i in kept), rows=rows)


def table_or_none(title: str, heads: tuple[Column, ...], rows: Iterable[tuple[Cell, ...]], none: str) -> Block:
    """A table, or the sentence `none` if it would have no rows."""
    listed = tuple(rows)
    return Table(title, heads, listed) if listed else Paragraph(none)


# ----------------------------------------------------------------------------------------------------
# How much fits a terminal of 100 columns.


WIDTH = 100
"""Columns of a terminal that tables are fitted to."""
GAP = 2
"""Spaces between two columns."""


def column_groups(titles: Sequence[str], taken: int, least: int) -> list[tuple[str, ...]]:
    """Columns in groups that fit a line of the terminal.

    Parameters
    ----------
    titles : heads of the columns
    taken : width of the columns with which every group begins
    least : width of the numbers, for heads that are shorter
    """
    groups: list[tuple[str, ...]] = []
    room = 0
    for title in titles:
        width = max(len(title), least) + GAP
        if width > room:
            groups.append(())
            room = WIDTH - taken
        groups[-1] += (title,)
        room -= width
    return groups


def widest(texts: Iterable[str]) -> int:
    """Length of the longest text; 0 if there is none."""
    return max(map(len, texts), default=0)
