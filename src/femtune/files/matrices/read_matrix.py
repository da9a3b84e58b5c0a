"""ReadMatrix: a matrix of another solver as sparse entries, with the identity of its rows where the file has it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Integers
from femtune.errors import FemtuneError, Notice, Where, did_you_mean

# ----------------------------------------------------------------------------------------------------
# Entries of a matrix as a file lists them.


_LARGEST_TABLE = 100_000_000
"""Largest number up to which a table replaces sorting: it takes 900 MB for this one."""


@dataclass(frozen=True, eq=False)
class Entries:
    """Entries of a matrix as a file lists them.

    Parameters
    ----------
    row, col : (m,) from 0
    value : (m,) real or complex
    size : (rows, columns)
    rows : (n, 2) node and component of each row, or None
    line : line or byte of an entry from its position; None where the file has no such thing
    """

    row: Integers
    col: Integers
    value: NDArray
    size: tuple[int, int]
    rows: Integers | None = None
    line: Callable[[int], Where] | None = None


def numbered(first: Integers, second: Integers) -> tuple[Integers, tuple[Integers, Integers]]:
    """Distinct numbers of both, ascending, and the place of each among them."""
    most = int(max(first.max(initial=0), second.max(initial=0))) + 1
    if most > _LARGEST_TABLE or min(first.min(initial=0), second.min(initial=0)) < 0:
        names, at = np.unique(np.concatenate([first, second]), return_inverse=True)
        return names, (at[: len(first)], at[len(first) :])
    # a table is faster than sorting and takes less memory
    seen = np.zeros(most, bool)
    seen[first] = seen[second] = True
    place = np.cumsum(seen) - 1
    return np.flatnonzero(seen), (place[first], place[second])


def row_label(rows: Integers | None, i: int) -> str:
    """A row in words: node and component where they are known, or its number from 1."""
    if rows is None or i >= len(rows):
        return f"row {i + 1}"
    return f"{rows[i, 0]}:{rows[i, 1]}"


# ----------------------------------------------------------------------------------------------------
# What entries of a matrix must be: in range, finite, given once, and symmetric if both triangles are given.


SYMMETRY = 1e-7
"""Difference of a_ij and a_ji relative to √(a_ii·a_jj): files may have as few as eight digits."""
_ROWS_PER_ENTRY = 10
_SMALL_MATRIX_ROWS = 1000
"""A matrix with more rows than the first times its entries, plus the second, is a mistake in the file."""
_ROUNDING = 1e-12
"""Entries below this part of the largest one are compared with it instead of with their own diagonal."""
LARGEST = 1e100
"""Entries above this are no stiffness or mass in any units, and their products overflow."""


def _at(entries: Entries, i: int, where: Where) -> Where:
    return where if entries.line is None else replace(entries.line(i), record=where.record)


def _named(entries: Entries, i: int) -> str:
    return row_label(entries.rows, i)


def check_range(entries: Entries, where: Where) -> None:
    """Refuse a row or column that the matrix does not have (error ``matrices.index``)."""
    n = entries.size[0]
    if n > _ROWS_PER_ENTRY * len(entries.value) + _SMALL_MATRIX_ROWS:
        raise _too_many_rows(entries, n, where)
    bad = np.flatnonzero((entries.row < 0) | (entries.col < 0) | (entries.row >= n) | (entries.col >= n))
    if bad.size:
        i = int(bad[0])
        raise FemtuneError(
            "matrices.index/outside",
            where=_at(entries, i, where),
            values={"row": int(entries.row[i]) + 1, "column": int(entries.col[i]) + 1, "such entries": bad.size},
            n=n,
        )


def _too_many_rows(entries: Entries, n: int, where: Where) -> FemtuneError:
    """In some files the largest number decides how many rows there are: one wrong digit must not fill the memory."""
    at = int(np.argmax(np.maximum(entries.row, entries.col))) if len(entries.value) else 0
    return FemtuneError(
        "matrices.index/too-many-rows",
        where=_at(entries, at, where) if len(entries.value) else where,
        n=n,
        n_entries=len(entries.value),
    )


def check_finite(entries: Entries, where: Where) -> None:
    """Refuse NaN and infinity (error ``matrices.not-finite``)."""
    bad = np.flatnonzero(~np.isfinite(entries.value))
    if bad.size:
        i = int(bad[0])
        raise FemtuneError(
            "matrices.not-finite", where=_at(entries, i, where), values={**_entry(entries, i), "such entries": bad.size}
        )


def check_magnitude(entries: Entries, where: Where) -> None:
    """Refuse numbers whose products overflow (error ``matrices.huge``)."""
    bad = np.flatnonzero(np.maximum(np.abs(entries.value.real), np.abs(entries.value.imag)) > LARGEST)
    if bad.size:
        i = int(bad[0])
        raise FemtuneError(
            "matrices.huge/entry",
            where=_at(entries, i, where),
            values={**_entry(entries, i), "such entries": bad.size},
            largest=LARGEST,
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
            "matrices.duplicate/entry",
            where=_at(entries, second, where),
            values={
                **_entry(entries, second),
                "value before": entries.value[first],
                "first given at": str(_at(entries, first, where)),
                "such entries": twice.size,
            },
        )


def symmetrised(
    row: NDArray[np.int64], col: NDArray[np.int64], value: NDArray, entries: Entries, where: Where
) -> sp.csr_array:
    """Upper triangle of the mean of a matrix and its transpose (error ``matrices.not-symmetric``)."""
    A = sp.csr_array((value, (row, col)), shape=entries.size)
    D = sp.coo_array(A - A.T)
    size = np.sqrt(np.abs(A.diagonal()))
    scale = np.maximum(size[D.row] * size[D.col], _ROUNDING * np.abs(value).max())
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
    return FemtuneError("matrices.not-symmetric/entries", where=where, values={
            "row": _named(entries, i), "column": _named(entries, j), "value": A[i, j], "its mirror": A[j, i],
            "pairs that differ": some,
        })  # fmt: skip


@dataclass(frozen=True, eq=False)
class ReadMatrix:
    """A square symmetric matrix as it was read.

    Parameters
    ----------
    name : its name in the file, "KAA"; the file's own name without one
    upper : (n, n) upper triangle with the diagonal, csr with sorted columns, real or complex
    where : the file and the record
    rows : (n, 2) node and component (1 to 6, 0 of a scalar point) of each row; None where the file has none
    held : rows that the file says are held
    facts : what was found, for people: "lower triangle, 17 entries"
    """

    name: str
    upper: sp.csr_array
    where: Where
    rows: Integers | None = None
    held: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    facts: str = ""
    notices: tuple[Notice, ...] = ()

    @property
    def size(self) -> int:
        """n."""
        return int(self.upper.shape[0])


def matrix_from(entries: Entries, name: str, where: Where, held: Integers | None = None) -> ReadMatrix:
    """The symmetric matrix of the entries; one triangle stands for both.

    Raises
    ------
    FemtuneError : ``matrices.not-square``, ``matrices.index``, ``matrices.not-finite``, ``matrices.huge``,
        ``matrices.duplicate``, ``matrices.not-symmetric``
    """
    if entries.size[0] != entries.size[1]:
        raise FemtuneError(
            "matrices.not-square/entries",
            where=where,
            name=name,
            rows=entries.size[0],
            columns=entries.size[1],
        )
    check_range(entries, where)
    check_finite(entries, where)
    check_magnitude(entries, where)
    check_duplicates(entries, where)
    upper, facts = _upper(entries, where)
    return ReadMatrix(name, upper, where, entries.rows, np.zeros(0, np.int64) if held is None else held, facts)


def matrix_of_array(given: NDArray | sp.sparray, name: str, where: Where) -> ReadMatrix:
    """The symmetric matrix of a square array; one triangle stands for both. Errors as of `matrix_from`."""
    full = sp.coo_array(given)
    # entries of SciPy's coordinate format that stand twice are added
    full.sum_duplicates()
    entries = Entries(full.row.astype(np.int64), full.col.astype(np.int64), full.data, full.shape)
    return matrix_from(entries, name, where)


def _upper(entries: Entries, where: Where) -> tuple[sp.csr_array, str]:
    row, col, value = entries.row, entries.col, entries.value
    if not value.all():
        some = value != 0.0
        row, col, value = row[some], col[some], value[some]
    below, above = bool((row > col).any()), bool((row < col).any())
    if below and above:
        return symmetrised(row, col, value, entries, where), f"both triangles, {len(value)} entries"
    half = sp.csr_array((value, (np.minimum(row, col), np.maximum(row, col))), shape=entries.size)
    half.sort_indices()
    names = {(True, False): "lower triangle", (False, True): "upper triangle", (False, False): "a diagonal"}
    return half, f"{names[below, above]}, {len(value)} entries"


# ----------------------------------------------------------------------------------------------------
# A matrix that a file does not hold.


def no_such_matrix(path: Path, name: str | None, known: Sequence[str]) -> FemtuneError:
    """The file does not hold the matrix that was asked for."""
    where, values = Where(str(path)), {"matrices": ", ".join(known[:20]) or "none"}
    if not name:
        return FemtuneError("matrices.no-such-matrix/empty-file", where=where, values=values)
    return FemtuneError(
        "matrices.no-such-matrix", where=where, values=values, hint=did_you_mean(name, known), matrix=name
    )
