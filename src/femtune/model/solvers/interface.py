"""What every sparse factorisation offers: an analysis of a pattern, and factors of matrices that have it."""

from __future__ import annotations

from typing import Protocol

from numpy.typing import NDArray

from femtune.model.symmetric import SymmetricMatrix


class Factor(Protocol):
    """LDLᵀ or LU factors of a real or complex symmetric matrix (A = Aᵀ, not Hermitian)."""

    name: str

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues (Sylvester's law), None where the pivoting hides it or A is complex."""

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b for b of shape (n,) or (n, k), real or complex; blocks are quickest in Fortran's order."""


class Analysis(Protocol):
    """The symbolic work on one pattern, for real or for complex numbers: done once, used for every factorisation."""

    name: str

    @property
    def factor_bytes(self) -> int | None:
        """Forecast of the memory that one numerical factorisation takes; None where nobody can tell."""

    def factorise(self, matrix: SymmetricMatrix) -> Factor:
        """Factors of a matrix of the analysed pattern; any number of them may be alive at a time.

        Raises
        ------
        SingularMatrixError : a pivot is exactly zero
        FemtuneError : ``model.memory``, ``solver.failed``
        """


class SingularMatrixError(Exception):
    """The factorisation met a pivot that is exactly zero."""


class NotPositiveDefiniteError(Exception):
    """A solver for positive definite matrices met another one."""
