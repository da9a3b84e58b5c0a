"""Lines and cells of tables of text: a heading, then lines of values, separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

_SEPARATORS = ",;\t"
_LARGEST = 1 << 30
_TEXT_CONTROLS = frozenset("\t\n\r\f\v\x1a")


class NotATable(ValueError):  # noqa: N818  the readers make their own errors of it
    """The file is no table of text; the message says why."""


@dataclass(frozen=True)
class TableText:
    """A table that was read.

    Parameters
    ----------
    lines : number of the line of each row, from 1; lines without text are left out
    rows : cells, without blanks around them; the first row is the heading
    separator : between the cells
    """

    lines: tuple[int, ...]
    rows: tuple[tuple[str, ...], ...]
    separator: str

    def decimal(self, cell: str) -> str:
        """A number with a decimal point; a comma is a decimal comma where it does not separate the cells."""
        return cell if self.separator == "," else cell.replace(",", ".")


def read_table_text(path: Path, largest: int = _LARGEST) -> TableText:
    """Read a table of text.

    Raises
    ------
    NotATable : the file cannot be read, has more than `largest` bytes, or is no text
    """
    try:
        if path.stat().st_size > largest:
            raise NotATable(f"it is larger than {largest / 1e6:.0f} MB")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise NotATable(error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise NotATable("it is not a text file in UTF-8") from error
    if any(ord(c) < 32 and c not in _TEXT_CONTROLS for c in text):
        raise NotATable("it is a binary file, not a table of text")
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip()]
    separator = separator_of(numbered[0][1]) if numbered else ","
    try:
        rows = tuple(tuple(x.strip() for x in next(csv.reader([line], delimiter=separator))) for _, line in numbered)
    except csv.Error as error:
        raise NotATable(str(error)) from error
    return TableText(tuple(i for i, _ in numbered), rows, separator)


def separator_of(heading: str) -> str:
    """The character that separates the fields of a table: the most frequent one in its heading."""
    return max(_SEPARATORS, key=heading.count)
