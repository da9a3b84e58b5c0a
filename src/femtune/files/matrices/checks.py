"""What entries of a matrix must be: in range, finite, each once, and symmetric where both triangles are there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.files.matrices.entries import Entries, row_label

# entries with eight digits, beside the diagonal of their row and column
SYMMETRY = 1e-7
# rows for each entry that no model has, beyond a small matrix
_EMPTY_ROWS, _SMALL = 10, 1000
LARGEST = 1e100
"""Entries above this are no stiffness or mass in any units, and their products overflow."""


def _at(entries: Entries, i: int, where: Where) -> Where:
    return where if entries.line is None else replace(entries.line(i), record=where.record)


def _named(entries: Entries, i: int) -> str:
    return row_label(entries.rows, i)


def check_range(entries: Entries, where: Where) -> None:
    """Refuse a row or column that the matrix does not have (error ``matrices.index``)."""
    n = entries.size[0]
    if n > _EMPTY_ROWS * len(entries.value) + _SMALL:
        raise _too_many_rows(entries, n, where)
    bad = np.flatnonzero((entries.row < 0) | (entries.col < 0) | (entries.row >= n) | (entries.col >= n))
    if bad.size:
        i = int(bad[0])
        raise FemtuneError(
            "matrices.index",
            f"an entry lies outside the matrix of {n} rows",
            where=_at(entries, i, where),
            values={"row": int(entries.row[i]) + 1, "column": int(entries.col[i]) + 1, "such entries": bad.size},
            hint="write the matrix again; its rows are counted from 1, and the list of DOFs must be that of this run",
        )


def _too_many_rows(entries: Entries, n: int, where: Where) -> FemtuneError:
    """Rows are made of the largest number in some files: one wrong digit must not fill the memory."""
    at = int(np.argmax(np.maximum(entries.row, entries.col))) if len(entries.value) else 0
    return FemtuneError(
        "matrices.index",
        f"the matrix has {n} rows and {len(entries.value)} entries, so nearly all rows would be empty",
        where=_at(entries, at, where) if len(entries.value) else where,
        hint="correct the row number of this entry, or the size in the header; or the file was cut",
    )


def check_finite(entries: Entries, where: Where) -> None:
    """Refuse NaN and infinity (error ``matrices.not-finite``)."""
    bad = np.flatnonzero(~np.isfinite(entries.value))
    if bad.size:
        i = int(bad[0])
        raise FemtuneError(
            "matrices.not-finite",
            "an entry of the matrix is no finite number",
            where=_at(entries, i, where),
            values={**_entry(entries, i), "such entries": bad.size},
            hint="the solver itself failed at this DOF: look at its elements there, then write the matrix again",
        )


def check_magnitude(entries: Entries, where: Where) -> None:
    """Refuse numbers whose products overflow (error ``matrices.huge``)."""
    bad = np.flatnonzero(np.maximum(np.abs(entries.value.real), np.abs(entries.value.imag)) > LARGEST)
    if bad.size:
        i = int(bad[0])
        raise FemtuneError(
            "matrices.huge",
            f"an entry of the matrix is larger than {LARGEST:g}",
            where=_at(entries, i, where),
            values={**_entry(entries, i), "such entries": bad.size},
            hint="the file is damaged, or holds a penalty: write the matrix again, held DOFs without penalties",
        )


def _entry(entries: Entries, i: int) -> dict[str, Any]:
    return {
        "row": _named(entries, int(entries.row[i])),
        "column": _named(entries, int(entries.col[i])),
        "value": entries.value[i],
    }


def check_duplicates(entries: Entries, where: Where) -> None:
    """Refuse an entry that is given twice (error ``matrices.duplicate``)."""
    key = entries.row * np.int64(entries.size[1]) + entries.col
    if not (np.diff(np.sort(key)) == 0).any():
        return
    order = np.argsort(key, kind="stable")
    twice = np.flatnonzero(np.diff(key[order]) == 0)
    if twice.size:
        first, second = int(order[twice[0]]), int(order[twice[0] + 1])
        raise FemtuneError(
            "matrices.duplicate",
            "an entry of the matrix is given twice",
            where=_at(entries, second, where),
            values={
                **_entry(entries, second),
                "value before": entries.value[first],
                "first given at": str(_at(entries, first, where)),
                "such entries": twice.size,
            },
            hint="the file may hold two matrices, or the same one twice: keep one of them in it",
        )


def symmetrised(
    row: NDArray[np.int64], col: NDArray[np.int64], value: NDArray, entries: Entries, where: Where
) -> sp.csr_array:
    """Upper triangle of the mean of a matrix and its transpose (error ``matrices.not-symmetric``)."""
    A = sp.csr_array((value, (row, col)), shape=entries.size)
    D = sp.coo_array(A - A.T)
    size = np.sqrt(np.abs(A.diagonal()))
    scale = np.maximum(size[D.row] * size[D.col], 1e-12 * np.abs(value).max())
    gap = np.abs(D.data) / scale
    if gap.size and gap.max() > SYMMETRY:
        raise _not_symmetric(A, entries, where, D, gap)
    upper = sp.csr_array(sp.triu(0.5 * (A + A.T), format="csr"))
    upper.sort_indices()
    return upper


def _not_symmetric(A: sp.csr_array, entries: Entries, where: Where, D: sp.coo_array, gap: NDArray) -> FemtuneError:
    k = int(np.argmax(gap))
    i, j = int(D.row[k]), int(D.col[k])
    some = int((gap > SYMMETRY).sum()) // 2
    return FemtuneError(
        "matrices.not-symmetric",
        "the matrix is not symmetric",
        where=where,
        values={
            "row": _named(entries, i), "column": _named(entries, j), "value": A[i, j], "its mirror": A[j, i],
            "pairs that differ": some,
        },
        hint="write symmetric matrices only: leave follower loads, friction and gyroscopic terms out of the solver's "
        "step, and check that the file was not cut",
    )  # fmt: skip
