"""Text OP4: a header line with the format of the numbers, then columns of fixed width."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Where
from femtune.files.matrices.op4_columns import Header, Run, check_extent, cut, header_of, op4_error, paired, unpacked

_FORMAT = re.compile(r"\s*,?(?:1P,?)?\s*(\d{1,4})[ED](\d{1,3})\.\d+", re.IGNORECASE)


@dataclass
class _Reader:
    """Lines of a file with their numbers."""

    path: str
    file: BinaryIO
    number: int = 0

    def line(self) -> str:
        """The next line without its end, "" after the last."""
        self.number += 1
        return self.file.readline().decode("latin-1").rstrip("\r\n")

    @property
    def where(self) -> Where:
        """The line read last."""
        return Where(self.path, self.number)


@dataclass(frozen=True)
class _Style:
    """Width of integers, numbers a line, and their width."""

    integer: int
    per_line: int
    width: int

    def integers(self, line: str, count: int) -> list[int] | None:
        """Integers of a line, None where they are none."""
        try:
            return [int(line[i * self.integer : (i + 1) * self.integer]) for i in range(count)]
        except ValueError:
            return None


def text_matrices(path: Path) -> Iterator[tuple[Header, Iterator[Run]]]:
    """As `binary_matrices`, of a text file."""
    with path.open("rb") as file:
        reader = _Reader(str(path), file)
        while (line := reader.line()).strip():
            style = _style(line)
            found = style.integers(line, 4)
            if found is None or not style.per_line * style.width:
                raise op4_error("this line is no header of a matrix", reader.where, {"line": f"'{line[:60]}'"})
            name = line[4 * style.integer : 4 * style.integer + 8] if style.integer == 8 else line[48:56]
            columns, rows, form, kind = found
            header = header_of(columns, rows, form, kind, name, reader.where)
            yield header, _runs(reader, style, header)


def _style(line: str) -> _Style:
    body, wide = line.rstrip(), line.rstrip().endswith("|I16")
    match = _FORMAT.match((body[56:-4] if wide else body[40:]).strip() or "5E16.9")
    per_line, width = (int(match[1]), int(match[2])) if match else (0, 0)
    return _Style(16 if wide else 8, per_line, width)


def _runs(reader: _Reader, style: _Style, header: Header) -> Iterator[Run]:
    column = 0
    while True:
        number, row, words = _integers(reader, style, header, column, 3)
        if number == header.columns + 1:
            reader.line()
            return
        if not column < number <= header.columns:
            raise op4_error("columns are out of order", reader.where, {"column": number})
        column, where = number, reader.where
        for first, count in _strings(reader, style, header, number, row, words):
            check_extent(header, number, first, count, where)
            values = _values(reader, style, header, number, count)
            yield Run(number - 1, first, paired(values, header), where)


def _integers(reader: _Reader, style: _Style, header: Header, column: int, count: int) -> list[int]:
    line = reader.line()
    found = style.integers(line, count)
    if found is None and not line.strip():
        raise cut(header, column, reader.where)
    if found is None:
        raise op4_error("this line is no header of a column", reader.where, {"line": f"'{line[:60]}'"})
    return found


def _strings(
    reader: _Reader, style: _Style, header: Header, column: int, row: int, words: int
) -> Iterator[tuple[int, int]]:
    """First row, from 0, and number of reals of each string of a column."""
    if row > 0:
        yield row - 1, words
        return
    size = 2 if header.double else 1
    while words > 0:
        if header.big:
            length, first = _integers(reader, style, header, column, 2)
            length, first, head = length - 1, first - 1, 2
        else:
            (length, first), head = unpacked(_integers(reader, _Style(12, 1, 1), header, column, 1)[0]), 1
        if length < 0 or length + head > words:
            raise op4_error("a string of values is longer than its column", reader.where, {"words": length})
        yield first, length // size
        words -= length + head


def _values(reader: _Reader, style: _Style, header: Header, column: int, count: int) -> NDArray[np.float64]:
    text = []
    for _ in range(-(-count // style.per_line)):
        line = reader.line()
        if not line:
            raise cut(header, column, reader.where)
        text += [line[i : i + style.width] for i in range(0, len(line), style.width)]
    if len(text) != count or any(len(t) != style.width for t in text):
        raise _bad(reader, line)
    try:
        return np.array([t.replace("D", "E").replace("d", "e") for t in text]).astype(float)
    except ValueError as error:
        raise _bad(reader, line) from error


def _bad(reader: _Reader, line: str) -> Exception:
    return op4_error("the numbers of a column do not fit the format of the header", reader.where,
                     {"line": f"'{line[:80]}'"})  # fmt: skip
