"""ReadMatrix: a matrix of another solver as sparse entries, with the identity of its rows where the file has it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.matrices.checks import check_duplicates, check_finite, check_magnitude, check_range, symmetrised
from femtune.files.matrices.entries import Entries, row_label

Integers = NDArray[np.int64]


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

    def row_name(self, i: int) -> str:
        """A row in words: node and component, or its number from 1."""
        return row_label(self.rows, i)


def matrix_from(entries: Entries, name: str, where: Where, held: Integers | None = None) -> ReadMatrix:
    """The symmetric matrix of the entries; one triangle stands for both.

    Raises
    ------
    FemtuneError : ``matrices.not-square``, ``matrices.index``, ``matrices.not-finite``, ``matrices.huge``,
        ``matrices.duplicate``, ``matrices.not-symmetric``
    """
    if entries.size[0] != entries.size[1]:
        raise FemtuneError(
            "matrices.not-square",
            f"{name} has {entries.size[0]} rows and {entries.size[1]} columns",
            where=where,
            hint="name a stiffness or mass matrix: they are square",
        )
    check_range(entries, where)
    check_finite(entries, where)
    check_magnitude(entries, where)
    check_duplicates(entries, where)
    upper, facts = _upper(entries, where)
    return ReadMatrix(name, upper, where, entries.rows, np.zeros(0, np.int64) if held is None else held, facts)


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
