"""Binary OP4: Fortran records with their length in bytes before and after, in either byte order."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Where
from femtune.files.matrices.op4_columns import Header, Run, check_extent, cut, header_of, op4_error, paired, unpacked


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


def binary_matrices(path: Path) -> Iterator[tuple[Header, Iterator[Run]]]:
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
    raise op4_error("the file does not begin with the header of a matrix", Where(str(path), None, "byte 0"),
                    {"first bytes": start.hex(" ")})  # fmt: skip


def _header(record: bytes, layout: _Layout, end: int) -> Header:
    where = layout.where(end - len(record) - 4)
    if len(record) != 6 * layout.word:
        raise op4_error("the header of a matrix has another length", where, {"bytes": len(record)})
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
        raise op4_error("a record does not end where its length says", layout.where(begin), {"bytes": length})
    return content


def _rest(file: BinaryIO) -> int:
    at = file.tell()
    end = file.seek(0, 2)
    file.seek(at)
    return end - at


def _runs(file: BinaryIO, layout: _Layout, header: Header) -> Iterator[Run]:
    column = 0
    while True:
        begin = file.tell()
        record = _record(file, layout, header, column)
        if len(record) < 3 * layout.word:
            raise op4_error("a column has no header", layout.where(begin, header.name), {"bytes": len(record)})
        number, row, words = layout.integers(record, 3)
        if number == header.columns + 1:
            return
        if not column < number <= header.columns:
            raise op4_error("columns are out of order", layout.where(begin, header.name), {"column": number})
        column = number
        body = record[3 * layout.word :]
        if len(body) != words * layout.word:
            shown: dict[str, object] = {"words": words, "bytes": len(body)}
            raise op4_error("a column has another length than it says", layout.where(begin, header.name), shown)
        where = layout.where(begin, header.name)
        for first, content in _strings(layout, header, row, body):
            yield Run(number - 1, first, _values(layout, header, number, first, content, where), where)


def _values(layout: _Layout, header: Header, column: int, first: int, content: bytes, where: Where) -> NDArray:
    real = layout.real(header)
    if len(content) % real.itemsize:
        shown: dict[str, object] = {"column": column, "bytes": len(content), "bytes a number": real.itemsize}
        raise op4_error("a string of values holds no whole number of them", where, shown)
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
            raise op4_error("a column ends inside the head of a string", header.where, {"bytes": len(body) - at})
        if header.big:
            length, first = layout.integers(body[at : at + 2 * w], 2)
            length, first, head = length - 1, first - 1, 2
        else:
            (length, first), head = unpacked(layout.integers(body[at : at + w], 1)[0]), 1
        if length < 0 or at + (head + length) * w > len(body):
            raise op4_error("a string of values is longer than its column", header.where, {"words": length})
        yield first, body[at + head * w : at + (head + length) * w]
        at += (head + length) * w
