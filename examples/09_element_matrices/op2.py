"""Element matrices in an OUTPUT2 file of commercial Nastran: the data blocks KELM, MELM and their dictionaries.

An OUTPUT2 file is a sequence of Fortran records. A record of one integer announces a record of that many words where it
is positive, and ends a record of the data block where it is negative; zero ends the data block. Words have 4 bytes. A
dictionary (KDICT, MDICT) lists for each element its number, a loss factor and the rows of its grid points in the g-set;
the matrices (KELM, MELM) have a column for each element in the same order: the lower triangle, column by column.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int32]
Reals = NDArray[np.float64]

ELEMENT_FRAME = 4
"""Form of a matrix on the element's axes, with their directions after the rows of the grid points."""


@dataclass(frozen=True)
class ElementMatrix:
    """A matrix of one element.

    Parameters
    ----------
    element : number of the element
    rows : first row of each grid point in the g-set, from 0; −1 where the element has no grid point
    components : degrees of freedom of a grid point: 6, 3 (translations) or 1
    matrix : (n, n) in the grid points' displacement frames
    """

    element: int
    rows: tuple[int, ...]
    components: int
    matrix: Reals


def data_blocks(path: Path) -> dict[str, list[list[bytes]]]:
    """Records of each data block by its name, the trailer and the header first; a record is a list of parts."""
    blocks: dict[str, list[list[bytes]]] = {}
    records: list[list[bytes]] = [[]]
    for item in _items(path.read_bytes()):
        if isinstance(item, bytes):
            records[-1].append(item)
        elif item < 0:
            records.append([])
        else:
            # the name; the last record is open, the type of one that does not come; the file's own head is a block too
            if records[0]:
                blocks[records[0][0].decode("ascii", "replace").strip()] = records[1:-1]
            records = [[]]
    return blocks


def _items(raw: bytes) -> Iterator[bytes | int]:
    """Data, and the marks that end records (below zero) and data blocks (zero)."""
    at = 0
    while at < len(raw):
        mark, at = _record(raw, at)
        (words,) = struct.unpack("<i", mark)
        if words <= 0:
            yield words
        else:
            data, at = _record(raw, at)
            yield data


def _record(raw: bytes, at: int) -> tuple[bytes, int]:
    """A Fortran record and the place after it."""
    (size,) = struct.unpack_from("<i", raw, at)
    if size < 0 or at + size + 8 > len(raw) or raw[at : at + 4] != raw[at + size + 4 : at + size + 8]:
        raise ValueError(f"no record of an OUTPUT2 file at byte {at}")
    return raw[at + 4 : at + 4 + size], at + size + 8


def matrix_columns(records: list[list[bytes]]) -> Reals:
    """(rows, columns) of a real matrix in double precision; a string of values begins with the row of its first."""
    _, columns, rows, _, kind, *_ = (int(v) for v in np.frombuffer(records[0][0], "<i4"))
    if kind != 2:
        raise ValueError(f"values of type {kind}; only double precision is read here")
    out = np.zeros((rows, columns))
    for column, parts in enumerate(records[2 : 2 + columns]):
        for part in parts[1:]:
            (first,) = struct.unpack_from("<i", part)
            values = np.frombuffer(part[4:], "<f8")
            out[first - 1 : first - 1 + len(values), column] = values
    return out


def element_matrices(path: Path, kind: str) -> dict[int, ElementMatrix]:
    """Matrices by element number; `kind` is K (stiffness) or M (mass)."""
    blocks = data_blocks(path)
    columns = matrix_columns(blocks[f"{kind}ELM"])
    found = [entry for record in blocks[f"{kind}DICT"][2:] if len(record) > 1 for entry in _entries(record)]
    return {e.element: _matrix(e, columns[:, i]) for i, e in enumerate(found)}


@dataclass(frozen=True)
class _Entry:
    """A line of a dictionary: what is known of an element's matrix beside its values."""

    element: int
    rows: tuple[int, ...]
    components: int
    turn: Reals | None


def _entries(record: list[bytes]) -> list[_Entry]:
    """The elements of one type: a head of five words, and so many words for each of them."""
    words = np.frombuffer(b"".join(record[1:]), "<i4")
    _, size, grids, components, form = (int(v) for v in words[:5])
    return [_entry(line, grids, components, form) for line in words[5:].reshape(-1, size)]


def _entry(line: Integers, grids: int, components: int, form: int) -> _Entry:
    rows = tuple(int(v) - 1 for v in line[5 : 5 + grids] if v > 0)
    # nine doubles by columns: the element's axes in the basic frame, one column an axis of the basic frame
    turn = line[5 + grids :].tobytes() if form == ELEMENT_FRAME else b""
    axes = np.frombuffer(turn, "<f8").reshape(3, 3).T if turn else None
    return _Entry(int(line[0]), rows, components, axes)


def _matrix(entry: _Entry, column: Reals) -> ElementMatrix:
    n = len(entry.rows) * entry.components
    upper = np.zeros((n, n))
    upper[np.triu_indices(n)] = column[: n * (n + 1) // 2]
    matrix = upper + np.triu(upper, 1).T
    if entry.turn is not None:
        turn = np.kron(np.eye(n // 3), entry.turn)
        matrix = turn.T @ matrix @ turn
    return ElementMatrix(entry.element, entry.rows, entry.components, matrix)
