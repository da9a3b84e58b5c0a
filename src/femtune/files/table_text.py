"""Lines and cells of tables of text: a heading, then lines of values, separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

LARGEST_BYTES = 1_000_000_000
"""Size of the largest table that is read; as text in memory it takes several times as much."""
_SEPARATORS = ",;\t"
_BINARY = re.compile(r"[\x00-\x08\x0e-\x1f]")


class NotATable(ValueError):  # noqa: N818  the readers make their own errors of it
    """The file is not a table of text; the message says why, and `line` where, if it is one line."""

    def __init__(self, reason: str, line: int | None = None) -> None:
        self.line = line
        super().__init__(reason)


@dataclass(frozen=True)
class TableText:
    """A table that was read.

    Parameters
    ----------
    lines : number of the line of each row, from 1; lines without text in any cell are left out
    rows : cells, without blanks around them; the first row is the heading
    separator : between the cells
    """

    lines: tuple[int, ...]
    rows: tuple[tuple[str, ...], ...]
    separator: str

    def number(self, cell: str) -> float:
        """The finite number in a cell, infinity where there is none.

        A comma is a decimal comma where it does not separate the cells.
        """
        text = cell if self.separator == "," else cell.replace(",", ".")
        try:
            value = float(text) if "_" not in text else math.inf
        except ValueError:
            return math.inf
        return value if math.isfinite(value) else math.inf


def read_table_text(path: Path, largest: int = LARGEST_BYTES) -> TableText:
    """Read a table of text.

    Raises
    ------
    NotATable : the file cannot be read, has more than `largest` bytes, or is no text; a line has an unclosed quotation
        mark
    """
    try:
        if path.stat().st_size > largest:
            raise NotATable(f"it is larger than {largest // 1_000_000} MB")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise NotATable(error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise NotATable("it is not text in UTF-8 (Latin-1, for example): save it as CSV in UTF-8") from error
    # DOS programs end a file with Ctrl-Z
    text = text.rstrip("\n\x1a")
    if _BINARY.search(text):
        raise NotATable("it is a binary file, not a table of text")
    # reading has made \n of all ends of lines; splitlines would split at other characters too
    numbered = list(enumerate(text.split("\n"), start=1))
    heading = next((line for _, line in numbered if line.strip()), "")
    separator = max(_SEPARATORS, key=heading.count)
    rows = [(i, cells) for i, line in numbered if any(cells := _cells(i, line, separator))]
    return TableText(tuple(i for i, _ in rows), tuple(cells for _, cells in rows), separator)


def _cells(number: int, line: str, separator: str) -> tuple[str, ...]:
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=separator, strict=True)))
    except csv.Error as error:
        unclosed = "a quotation mark is not closed in the line; a cell cannot contain a line break"
        raise NotATable(unclosed if "unexpected end" in str(error) else str(error), number) from error
