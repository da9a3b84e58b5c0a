"""Matrix Market files (.mtx, .mm), array or coordinate, real or complex.

The size line is held against the size of the file before anything is read: a header must not fill the memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femtune.errors import FemtuneError, Where
from femtune.files.matrices.read_matrix import Entries, ReadMatrix, matrix_from
from femtune.files.matrices.text_blocks import Listed, read_listed

_BANNER = b"%%matrixmarket"
_VALUES = {b"real": 1, b"double": 1, b"integer": 1, b"complex": 2}
_MOST_LINE_BYTES = 2048
"""Bytes of a header line that are read; lines of the format have at most 1024."""


@dataclass(frozen=True)
class _Header:
    """Form, numbers a value, symmetry, size and number of entries of a file; `lines` lines and `size` bytes long."""

    coordinate: bool
    values: int
    symmetric: bool
    rows: int
    columns: int
    count: int
    lines: int
    size: int

    @property
    def numbers(self) -> int:
        """Numbers a line."""
        return self.values + (2 if self.coordinate else 0)


def read_matrix_market(path: Path, name: str | None = None) -> ReadMatrix:
    """The matrix of a file; its symmetry is that of the banner, and of the numbers.

    Raises
    ------
    FemtuneError : ``matrices.text`` with the line, ``matrices.truncated``, ``matrices.*``
    """
    header = _header(path)
    _check_square(path, header, name or path.stem)
    _check_length(path, header)
    what = ("row, column and " if header.coordinate else "") + ("value" if header.values == 1 else "complex value")
    listed = read_listed(path, 2 if header.coordinate else 0, what, header.lines, b"%", header.values)
    _check_count(path, header, len(listed.value))
    entries = _by_number(listed, header) if header.coordinate else _by_place(listed, header)
    return matrix_from(entries, name or path.stem, Where(str(path)))


def _header(path: Path) -> _Header:
    with path.open("rb") as file:
        banner = file.readline(_MOST_LINE_BYTES).lower().split()
        coordinate, values, symmetric = _banner(path, banner)
        lines = 1
        while line := file.readline(_MOST_LINE_BYTES):
            lines += line.endswith(b"\n")
            if line.strip() and not line.lstrip().startswith(b"%"):
                break
        rows, columns, count = _size(path, lines, line, coordinate, symmetric)
        return _Header(coordinate, values, symmetric, rows, columns, count, lines, file.tell())


def _banner(path: Path, words: list[bytes]) -> tuple[bool, int, bool]:
    """Coordinate or array, numbers a value, symmetric or general."""
    where, shown = Where(str(path), 1), {"banner": b" ".join(words[:6]).decode("latin-1")}
    bad = {b"hermitian", b"skew-symmetric", b"pattern"} & set(words)
    if bad:
        raise FemtuneError("matrices.not-symmetric", where=where, values=shown, declared=min(bad).decode())
    good = len(words) == 5 and words[1] == b"matrix" and words[2] in (b"coordinate", b"array")
    if not good or words[3] not in _VALUES or words[4] not in (b"general", b"symmetric"):
        raise FemtuneError("matrices.text/banner", where=where, values=shown)
    return words[2] == b"coordinate", _VALUES[words[3]], words[4] == b"symmetric"


def _size(path: Path, number: int, line: bytes, coordinate: bool, symmetric: bool) -> tuple[int, int, int]:
    """Rows, columns and number of entries of the size line."""
    words = line.split()
    if len(words) != (3 if coordinate else 2) or not all(w.isdigit() and len(w) < 18 for w in words):
        raise FemtuneError(
            "matrices.text/size-line",
            where=Where(str(path), number),
            values={"line": f"'{line[:80].decode('latin-1').rstrip()}'"},
            and_entries=", and the number of entries" if coordinate else "",
        )
    rows, columns = int(words[0]), int(words[1])
    dense = rows * (rows + 1) // 2 if symmetric else rows * columns
    return rows, columns, int(words[2]) if coordinate else dense


def _check_square(path: Path, header: _Header, name: str) -> None:
    if header.rows != header.columns:
        raise FemtuneError(
            "matrices.not-square/size-line",
            where=Where(str(path), header.lines),
            name=name,
            rows=header.rows,
            columns=header.columns,
        )


def _check_length(path: Path, header: _Header) -> None:
    """A number takes a digit and a blank or line end at least."""
    rest = path.stat().st_size - header.size
    if header.count * header.numbers * 2 > rest + 1:
        raise _short(path, header, {"entries": header.count, "bytes after the size line": rest})


def _check_count(path: Path, header: _Header, count: int) -> None:
    if count < header.count:
        raise _short(path, header, {"entries": header.count, "found": count})
    if count > header.count:
        raise FemtuneError(
            "matrices.text/too-many-entries",
            where=Where(str(path), header.lines),
            values={"entries": header.count, "found": count},
        )


def _short(path: Path, header: _Header, values: dict[str, object]) -> FemtuneError:
    return FemtuneError("matrices.truncated/too-few-entries", where=Where(str(path), header.lines), values=values)


def _by_number(listed: Listed, header: _Header) -> Entries:
    """Entries by row and column; a pair of a symmetric matrix stands once, in either triangle."""
    keys = listed.keys.astype(np.int64) - 1
    row, col = keys[:, 0], keys[:, 1]
    if header.symmetric:
        row, col = np.maximum(row, col), np.minimum(row, col)
    return Entries(row, col, listed.value, (header.rows, header.columns), None, listed.line)


def _by_place(listed: Listed, header: _Header) -> Entries:
    """Column by column; of a symmetric matrix from the diagonal down."""
    if header.symmetric:
        col, row = np.triu_indices(header.rows)
    else:
        col, row = np.divmod(np.arange(header.count), max(header.rows, 1))
    size = (header.rows, header.columns)
    return Entries(row.astype(np.int64), col.astype(np.int64), listed.value, size, None, listed.line)
