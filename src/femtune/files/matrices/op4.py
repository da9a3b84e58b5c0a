"""Nastran OP4 files: the matrices of a file one after the other, binary or text; each column is a record.

A column is dense (a run of values from its first row) or sparse: strings of values, each behind a word that packs
length and row (16 bits each), or behind two words of their own ("big matrix"). Lengths count words of 4 bytes in
binary files, and of single precision in text ones.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.files.matrices.read_matrix import Entries, ReadMatrix, matrix_from, no_such_matrix

# ----------------------------------------------------------------------------------------------------
# What binary and text OP4 files share: headers, runs of values in a column, and how sparse strings are packed.


_MOST_ROWS = 50_000_000
"""Rows and columns beyond which a header is no header: larger models than any."""


@dataclass(frozen=True)
class Header:
    """One matrix of a file.

    Parameters
    ----------
    name : as the file spells it, without blanks
    rows, columns : its size
    big : True where sparse strings have two words for length and row
    form : 1 square, 2 rectangular, 6 symmetric …
    type : 1 real single, 2 real double, 3 complex single, 4 complex double
    where : place of the header
    """

    name: str
    rows: int
    columns: int
    big: bool
    form: int
    type: int
    where: Where

    @property
    def complex(self) -> bool:
        """True for complex values."""
        return self.type > 2

    @property
    def double(self) -> bool:
        """True for eight bytes a real number."""
        return self.type % 2 == 0


@dataclass(frozen=True, eq=False)
class ColumnString:
    """Values of consecutive rows of a column, both from 0."""

    column: int
    row: int
    values: NDArray
    where: Where


def header_of(columns: int, rows: int, form: int, kind: int, name: str, where: Where) -> Header:
    """A header that makes sense (error ``matrices.op4``)."""
    if not (0 <= columns <= _MOST_ROWS and abs(rows) <= _MOST_ROWS and kind in (1, 2, 3, 4)):
        raise op4_error(
            "matrices.op4/not-a-header", where, {"columns": columns, "rows": rows, "form": form, "type": kind}
        )
    return Header(name.strip("\0 "), abs(rows), columns, rows < 0, form, kind, where)


def op4_error(code: str, where: Where, values: dict[str, object], **facts: Any) -> FemtuneError:
    """The error that the file breaks a rule of OP4 files."""
    return FemtuneError(code, where=where, values=values, **facts)


def cut(header: Header, column: int, where: Where) -> FemtuneError:
    """The file ends inside a matrix."""
    return FemtuneError(
        "matrices.truncated/inside-matrix",
        where=where,
        values={"column": column + 1, "columns": header.columns},
        header_name=header.name,
    )


def check_extent(header: Header, column: int, row: int, count: int, where: Where) -> None:
    """`count` reals from a row, from 0, make whole values inside the matrix (error ``matrices.op4``)."""
    parts = 2 if header.complex else 1
    if count < 0 or count % parts:
        shown: dict[str, object] = {"column": column, "row": row + 1, "real numbers": count}
        raise op4_error("matrices.op4/partial-value", where, shown, header_name=header.name)
    last = row + count // parts
    if row < 0 or last > header.rows:
        shown = {"column": column, "rows": f"{row + 1} to {last}"}
        raise op4_error("matrices.op4/column-too-long", where, shown, header_name=header.name, rows=header.rows)


def unpacked(word: int) -> tuple[int, int]:
    """Length in words and row from 0 of a packed string header: 65536·(length + 1) + row."""
    length = (word >> 16) - 1
    return length, (word & 0xFFFF) - 1


def paired(values: NDArray[np.float64], header: Header) -> NDArray:
    """Real values as the matrix's own kind."""
    return values[0::2] + 1j * values[1::2] if header.complex else values


# ----------------------------------------------------------------------------------------------------
# Binary OP4: Fortran records with their length in bytes before and after, in either byte order.


@dataclass(frozen=True)
class _Layout:
    """Byte order and size of integers: 4, or 8 in files of 64-bit words."""

    file: str
    order: str
    word: int

    def integers(self, content: bytes, count: int) -> tuple[int, ...]:
        """The first integers of a record."""
        kind = "i" if self.word == 4 else "q"
        return struct.unpack(f"{self.order}{count}{kind}", content[: count * self.word])

    def real(self, header: Header) -> np.dtype:
        """Type of the real numbers."""
        return np.dtype(f"{self.order}f{8 if header.double or self.word == 8 else 4}")

    def where(self, byte: int, name: str = "") -> Where:
        """A place by its byte."""
        return Where(self.file, None, f"{name + ', ' if name else ''}byte {byte}")


def binary_matrices(path: Path) -> Iterator[tuple[Header, Iterator[ColumnString]]]:
    """Headers of the matrices with the runs of each; the runs must be used up before the next header.

    Raises
    ------
    FemtuneError : ``matrices.op4``, ``matrices.truncated``
    """
    with path.open("rb") as file:
        layout = _layout(path, file.read(4))
        file.seek(0)
        while record := _record(file, layout, None, 0):
            header = _header(record, layout, file.tell())
            yield header, _runs(file, layout, header)


def _layout(path: Path, start: bytes) -> _Layout:
    for order in "<>":
        for word, length in ((4, 24), (8, 48)):
            if start == struct.pack(f"{order}i", length):
                return _Layout(str(path), order, word)
    raise op4_error("matrices.op4", Where(str(path), None, "byte 0"), {"first bytes": start.hex(" ")})


def _header(record: bytes, layout: _Layout, end: int) -> Header:
    where = layout.where(end - len(record) - 4)
    if len(record) != 6 * layout.word:
        raise op4_error("matrices.op4/header-length", where, {"bytes": len(record)})
    columns, rows, form, kind = layout.integers(record, 4)
    name = record[4 * layout.word :].decode("latin-1").replace("\0", " ")
    return header_of(columns, rows, form, kind, "".join(name.split()), where)


def _record(file: BinaryIO, layout: _Layout, header: Header | None, column: int) -> bytes:
    """The next record; b"" at the end of the file before a header."""
    begin = file.tell()
    marker = file.read(4)
    if not marker and header is None:
        return b""
    length = struct.unpack(f"{layout.order}i", marker)[0] if len(marker) == 4 else -1
    # a length out of the blue must not fill the memory
    content = file.read(length) if 0 <= length <= _rest(file) else b""
    if len(marker) < 4 or len(content) != length or len(last := file.read(4)) < 4:
        known = header or Header("a header", 0, 0, False, 0, 2, layout.where(begin))
        raise cut(known, column, layout.where(begin, known.name))
    if last != marker:
        raise op4_error("matrices.op4/record-length", layout.where(begin), {"bytes": length})
    return content


def _rest(file: BinaryIO) -> int:
    at = file.tell()
    end = file.seek(0, 2)
    file.seek(at)
    return end - at


def _runs(file: BinaryIO, layout: _Layout, header: Header) -> Iterator[ColumnString]:
    column = 0
    while True:
        begin = file.tell()
        record = _record(file, layout, header, column)
        if len(record) < 3 * layout.word:
            raise op4_error("matrices.op4/no-column-header", layout.where(begin, header.name), {"bytes": len(record)})
        number, row, words = layout.integers(record, 3)
        if number == header.columns + 1:
            return
        if not column < number <= header.columns:
            raise op4_error("matrices.op4/column-order", layout.where(begin, header.name), {"column": number})
        column = number
        body = record[3 * layout.word :]
        if len(body) != words * layout.word:
            shown: dict[str, object] = {"words": words, "bytes": len(body)}
            raise op4_error("matrices.op4/column-length", layout.where(begin, header.name), shown)
        where = layout.where(begin, header.name)
        for first, content in _strings(layout, header, row, body):
            yield ColumnString(number - 1, first, _values(layout, header, number, first, content, where), where)


def _values(layout: _Layout, header: Header, column: int, first: int, content: bytes, where: Where) -> NDArray:
    real = layout.real(header)
    if len(content) % real.itemsize:
        shown: dict[str, object] = {"column": column, "bytes": len(content), "bytes a number": real.itemsize}
        raise op4_error("matrices.op4/partial-value-of-string", where, shown)
    check_extent(header, column, first, len(content) // real.itemsize, where)
    return paired(np.frombuffer(content, real).astype(float), header)


def _strings(layout: _Layout, header: Header, row: int, body: bytes) -> Iterator[tuple[int, bytes]]:
    """First row, from 0, and bytes of the values of each string of a column."""
    if row > 0:
        yield row - 1, body
        return
    at, w = 0, layout.word
    while at < len(body):
        if len(body) - at < (2 if header.big else 1) * w:
            raise op4_error("matrices.op4/cut-string-header", header.where, {"bytes": len(body) - at})
        if header.big:
            length, first = layout.integers(body[at : at + 2 * w], 2)
            length, first, head = length - 1, first - 1, 2
        else:
            (length, first), head = unpacked(layout.integers(body[at : at + w], 1)[0]), 1
        if length < 0 or at + (head + length) * w > len(body):
            raise op4_error("matrices.op4/string-too-long", header.where, {"words": length})
        yield first, body[at + head * w : at + (head + length) * w]
        at += (head + length) * w


# ----------------------------------------------------------------------------------------------------
# Text OP4: a header line with the format of the numbers, then columns of fixed width.


_FORMAT = re.compile(r"\s*,?(?:1P,?)?\s*(\d{1,4})[ED](\d{1,3})\.\d+", re.IGNORECASE)


@dataclass
class _Op4Reader:
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


def text_matrices(path: Path) -> Iterator[tuple[Header, Iterator[ColumnString]]]:
    """As `binary_matrices`, of a text file."""
    with path.open("rb") as file:
        reader = _Op4Reader(str(path), file)
        while (line := reader.line()).strip():
            style = _style(line)
            sizes = style.integers(line, 4)
            if sizes is None or not style.per_line * style.width:
                raise op4_error("matrices.op4/matrix-header-line", reader.where, {"line": f"'{line[:60]}'"})
            name = line[4 * style.integer : 4 * style.integer + 8] if style.integer == 8 else line[48:56]
            columns, rows, form, kind = sizes
            header = header_of(columns, rows, form, kind, name, reader.where)
            yield header, _text_runs(reader, style, header)


def _style(line: str) -> _Style:
    body, wide = line.rstrip(), line.rstrip().endswith("|I16")
    match = _FORMAT.match((body[56:-4] if wide else body[40:]).strip() or "5E16.9")
    per_line, width = (int(match[1]), int(match[2])) if match else (0, 0)
    return _Style(16 if wide else 8, per_line, width)


def _text_runs(reader: _Op4Reader, style: _Style, header: Header) -> Iterator[ColumnString]:
    column = 0
    while True:
        number, row, words = _integers(reader, style, header, column, 3)
        if number == header.columns + 1:
            reader.line()
            return
        if not column < number <= header.columns:
            raise op4_error("matrices.op4/column-order", reader.where, {"column": number})
        column, where = number, reader.where
        for first, count in _text_strings(reader, style, header, number, row, words):
            check_extent(header, number, first, count, where)
            values = _text_values(reader, style, header, number, count)
            yield ColumnString(number - 1, first, paired(values, header), where)


def _integers(reader: _Op4Reader, style: _Style, header: Header, column: int, count: int) -> list[int]:
    line = reader.line()
    integers = style.integers(line, count)
    if integers is None and not line.strip():
        raise cut(header, column, reader.where)
    if integers is None:
        raise op4_error("matrices.op4/column-header-line", reader.where, {"line": f"'{line[:60]}'"})
    return integers


def _text_strings(
    reader: _Op4Reader, style: _Style, header: Header, column: int, row: int, words: int
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
            raise op4_error("matrices.op4/string-too-long", reader.where, {"words": length})
        yield first, length // size
        words -= length + head


def _text_values(reader: _Op4Reader, style: _Style, header: Header, column: int, count: int) -> NDArray[np.float64]:
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


def _bad(reader: _Op4Reader, line: str) -> Exception:
    return op4_error("matrices.op4/text-values", reader.where, {"line": f"'{line[:80]}'"})


_LOWEST_TEXT_BYTE = 9
"""A tab; the first eight bytes of a binary file have lower ones, since it begins with a record length of 24 or 48."""


def read_op4(path: Path, name: str | None = None) -> ReadMatrix:
    """A matrix of an OP4 file; the first one where no name is asked for.

    Raises
    ------
    FemtuneError : ``matrices.no-such-matrix``, ``matrices.truncated``, ``matrices.op4``, ``matrices.*``
    """
    known = []
    for header, runs in _matrices(path):
        if name is None or header.name.upper() == name.upper():
            return _read(path, header, runs)
        known.append(header.name)
        for _ in runs:
            pass
    raise no_such_matrix(path, name, known)


def op4_names(path: Path) -> tuple[Header, ...]:
    """Headers of all matrices of a file."""
    headers = []
    for header, runs in _matrices(path):
        headers.append(header)
        for _ in runs:
            pass
    return tuple(headers)


def _matrices(path: Path) -> Iterator[tuple[Header, Iterator[ColumnString]]]:
    try:
        with path.open("rb") as file:
            start = file.read(8)
    except OSError as error:
        raise FemtuneError("matrices.unreadable", where=Where(str(path)), strerror=error.strerror) from error
    text = bool(start) and min(start) >= _LOWEST_TEXT_BYTE
    return text_matrices(path) if text else binary_matrices(path)


def _read(path: Path, header: Header, runs: Iterator[ColumnString]) -> ReadMatrix:
    row, col, value, places = [], [], [], []
    for run in runs:
        row.append(np.arange(run.row, run.row + len(run.values)))
        col.append(np.full(len(run.values), run.column))
        value.append(run.values)
        places.append(run.where)
    starts = np.cumsum([0, *(len(v) for v in value)])

    def place(i: int) -> Where:
        return places[int(np.searchsorted(starts, i, side="right")) - 1]

    values: NDArray = np.concatenate(value) if value else np.zeros(0)
    rows, cols = (np.concatenate(x).astype(np.int64) if x else np.zeros(0, np.int64) for x in (row, col))
    entries = Entries(rows, cols, values, (header.rows, header.columns), None, place)
    return matrix_from(entries, header.name, Where(str(path), None, header.name))
