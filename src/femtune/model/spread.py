"""Sums of matrix entries by their place in a pattern and by their coefficient, as a sparse matrix."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals

Places = NDArray[np.int32]

AT_ONCE = 4_000_000
"""Entries that are summed together: 32 MB."""
PASSES = 40
"""Passes over the pattern per entry up to which they cost less than sorting the entries."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Entries of m elements: their places (m, q), −1 for nowhere; the column (m,) of each; rows -> values (r, q)."""

    places: Places
    columns: Integers
    values: Callable[[Integers], Reals]


def spread_of(pieces: Sequence[Piece], n_columns: int, nnz: int) -> sp.csc_array:
    """(nnz, n_columns) sums of the values."""
    total = sum(p.places.size for p in pieces)
    passes = not pieces or n_columns * nnz <= PASSES * total
    columns = _by_passes(pieces, n_columns, nnz) if passes else _by_sorting(pieces, n_columns, nnz)
    data, indices, ends = np.empty(total), np.empty(total, np.int32), [0]
    for places, values in columns:
        at = slice(ends[-1], ends[-1] + len(places))
        indices[at], data[at] = places, values
        ends.append(at.stop)
    # only what was written to takes memory, and the rest is given back
    data.resize(ends[-1], refcheck=False)
    indices.resize(ends[-1], refcheck=False)
    kind = np.int32 if ends[-1] < 2**31 else np.int64
    return sp.csc_array((data, indices, np.array(ends, kind)), shape=(nnz, n_columns))


def _by_passes(pieces: Sequence[Piece], n_columns: int, nnz: int) -> Iterator[tuple[Places, Reals]]:
    """Places and sums of each column, through arrays as long as the pattern."""
    rows = [_rows_by_column(piece.columns, n_columns) for piece in pieces]
    touched, local = np.zeros(nnz, bool), np.empty(nnz, np.int32)
    for c in range(n_columns):
        mine = [(piece, chunk) for piece, of_column in zip(pieces, rows) for chunk in _chunks(piece, of_column[c])]
        for piece, chunk in mine:
            places = piece.places[chunk].ravel()
            touched[places[places >= 0]] = True
        some = np.flatnonzero(touched).astype(np.int32)
        local[some] = np.arange(len(some), dtype=np.int32)
        touched[some] = False
        yield some, _sums(mine, local, len(some))


def _rows_by_column(columns: Integers, n_columns: int) -> list[Integers]:
    order = np.argsort(columns, kind="stable")
    return np.split(order, np.searchsorted(columns[order], np.arange(1, n_columns)))


def _chunks(piece: Piece, rows: Integers) -> Iterator[Integers]:
    step = max(AT_ONCE // max(piece.places.shape[1], 1), 1)
    return (rows[i : i + step] for i in range(0, len(rows), step))


def _sums(chunks: list[tuple[Piece, Integers]], local: Places, count: int) -> Reals:
    sums = np.zeros(count)
    for piece, chunk in chunks:
        places, values = _entries(piece, chunk)
        if len(places):
            at = local[places]
            # neighbours in a mesh are neighbours in the pattern, so that a chunk spans a part of it
            low = int(at.min())
            added = np.bincount(at - low, values)
            sums[low : low + len(added)] += added
    return sums


def _entries(piece: Piece, rows: Integers) -> tuple[Places, Reals]:
    places, values = piece.places[rows].ravel(), piece.values(rows).ravel()
    some = places >= 0
    return (places, values) if some.all() else (places[some], values[some])


def _by_sorting(pieces: Sequence[Piece], n_columns: int, nnz: int) -> Iterator[tuple[Places, Reals]]:
    """The same for very many columns, each of which has few entries: blocks of columns at once."""
    for start, stop in _column_blocks(pieces, n_columns):
        parts = [_column_entries(piece, start, stop) for piece in pieces]
        columns, places, values = (np.concatenate(arrays) for arrays in zip(*parts))
        block = sp.csr_array(sp.coo_array((values, (columns, places)), shape=(stop - start, nnz)))
        block.sort_indices()
        for lo, hi in zip(block.indptr[:-1], block.indptr[1:]):
            yield block.indices[lo:hi], block.data[lo:hi]


def _column_blocks(pieces: Sequence[Piece], n_columns: int) -> Iterator[tuple[int, int]]:
    """First and last + 1 of columns that have about AT_ONCE entries together."""
    sizes = np.zeros(n_columns, np.int64)
    for piece in pieces:
        sizes += np.bincount(piece.columns, minlength=n_columns) * piece.places.shape[1]
    limits = np.unique(np.searchsorted(np.cumsum(sizes), np.arange(AT_ONCE, sizes.sum(), AT_ONCE)))
    ends = [0, *limits[(limits > 0) & (limits < n_columns)].tolist(), n_columns]
    return itertools.pairwise(ends)


def _column_entries(piece: Piece, start: int, stop: int) -> tuple[Places, Places, Reals]:
    rows = np.flatnonzero((piece.columns >= start) & (piece.columns < stop))
    columns = np.repeat((piece.columns[rows] - start).astype(np.int32), piece.places.shape[1])
    places, values = piece.places[rows].ravel(), piece.values(rows).ravel()
    some = places >= 0
    return columns[some], places[some], values[some]
