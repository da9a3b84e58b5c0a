"""What every sparse factorisation offers: an analysis of a pattern, and factors of matrices that have it."""

from __future__ import annotations

from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.linear.memory import GIB, free_memory, require_memory
from femtune.model.linear.symmetric import SymmetricMatrix


class Factor(Protocol):
    """LDLᵀ or LU factors of a real or complex symmetric matrix (A = Aᵀ, not Hermitian)."""

    name: str

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues (Sylvester's law), None if the pivoting does not show it or A is complex."""

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b for b of shape (n,) or (n, k), real or complex; blocks are quickest in Fortran's order."""


class Analysis(Protocol):
    """The symbolic work on one pattern, for real or for complex numbers: done once, used for every factorisation."""

    name: str

    @property
    def factor_bytes(self) -> int | None:
        """Forecast of the memory that one numerical factorisation takes; None if it is not known."""

    def factorise(self, matrix: SymmetricMatrix) -> Factor:
        """Factors of a matrix of the analysed pattern; any number of them may be alive at a time.

        Raises
        ------
        SingularMatrixError : a pivot is exactly zero
        FemtuneError : ``model.memory``, ``solver.failed``
        """


class SingularMatrixError(Exception):
    """The factorisation met a pivot that is exactly zero."""


# ----------------------------------------------------------------------------------------------------
# Scaling of rows and columns, so that pivots are judged alike where stiffness spans many decades.


_ENTRIES_AT_ONCE = 1 << 20
"""Entries that are scaled together: 8 MB of factors beside the matrix."""


def unit_diagonal(matrix: SymmetricMatrix) -> NDArray[np.float64]:
    """(n,) factors of rows and columns that bring the diagonal to ±1; 1 where it is zero."""
    size = np.abs(matrix.diagonal())
    return np.asarray(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))


def scaled(matrix: SymmetricMatrix, scale: NDArray[np.float64]) -> NDArray:
    """Entries with their rows and columns scaled, in pieces, so that no second array of their length is made."""
    values, starts = matrix.data * 1.0, matrix.indptr
    rows = np.searchsorted(starts, np.arange(0, len(values), _ENTRIES_AT_ONCE))
    bounds = np.unique([0, *rows, len(starts) - 1])
    for first, last in pairwise(bounds.tolist()):
        part = slice(starts[first], starts[last])
        values[part] *= scale[matrix.indices[part]]
        values[part] *= np.repeat(scale[first:last], np.diff(starts[first : last + 1]))
    return values


# ----------------------------------------------------------------------------------------------------
# Memory of factors if the solver itself gives no forecast.


_BYTES_PER_NUMBER = 5.0
"""Eight bytes of a real number times the measured factor 0.6 of `least_bytes`, rounded up."""


def least_bytes(matrix: SymmetricMatrix, triangles: int) -> int:
    """A rough lower bound of the memory of factors: 5 bytes · entries · log₂ n for each triangle that is kept.

    Nested dissection of a surface leaves about entries · log₂ n numbers (George, SIAM J. Numer. Anal. 10, 1973). The
    factor 0.6 was measured on shells of 15,000 to 560,000 DOF; solids take two to five times more.
    """
    n = max(matrix.shape[0], 2)
    size = 2.0 if np.iscomplexobj(matrix.data) else 1.0
    return int(_BYTES_PER_NUMBER * size * triangles * len(matrix.indices) * np.log2(n))


def require_for_factors(matrix: SymmetricMatrix, factor_bytes: int) -> None:
    """Refuse a factorisation whose factors have no room.

    Raises
    ------
    FemtuneError : ``model.memory``
    """
    require_memory(factor_bytes, "model.memory/factorising", equations=matrix.shape[0])


def ran_out(equations: int, needed_bytes: int, code: str = "model.memory/ran-out") -> FemtuneError:
    """The error for work on a number of equations that was started and had no room."""
    free = free_memory()
    return FemtuneError(
        code,
        values={"needed_bytes": needed_bytes, **({} if free is None else {"free_bytes": free})},
        equations=equations,
        needed_gib=needed_bytes / GIB,
    )
