"""LAPACK's dense factors of small symmetric matrices: without the overhead of sparse ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.interface import SingularMatrixError

DENSE_UP_TO = 150
"""Equations of a real matrix up to which dense factors take less time than sparse ones."""

_ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Pivot relative to the diagonal entry that elimination started from, below which it is rounding alone."""


class DenseAnalysis:
    """There is nothing to analyse."""

    name = "dense"
    factor_bytes = 8 * DENSE_UP_TO**2

    def factorise(self, matrix: SymmetricMatrix) -> DenseFactor:
        """LLᵀ of a positive definite matrix, or else LDLᵀ with symmetric exchange of pivots.

        Raises
        ------
        SingularMatrixError : a pivot is zero to rounding, or an entry is not a number
        """
        return DenseFactor(matrix)


class DenseFactor:
    """Cholesky's or Bunch and Kaufman's factors of a real symmetric matrix."""

    name = "dense"

    def __init__(self, matrix: SymmetricMatrix) -> None:
        array = matrix.dense().T
        # its sum is not finite if one entry is not
        if not np.isfinite(array.sum()):
            raise SingularMatrixError("an entry is not a finite number")
        self._factors, failed = lapack.dpotrf(array, lower=1)
        self._pivots: NDArray[np.int32] | None = None
        self.negative_pivots = 0
        """Number of negative eigenvalues."""
        if not failed:
            self._check(self._factors.diagonal() ** 2, array.diagonal())
            return
        self._factors, pivots, failed = lapack.dsytrf(array, lower=1)
        if failed:
            raise SingularMatrixError(f"pivot {failed} is zero")
        self._pivots = pivots
        self.negative_pivots = self._inertia(pivots)

    @staticmethod
    def _check(pivots: NDArray[np.float64], diagonal: NDArray[np.float64]) -> None:
        """A pivot that is what rounding leaves of its diagonal entry is zero."""
        zero = np.flatnonzero(pivots <= _ROUNDING * diagonal)
        if len(zero):
            raise SingularMatrixError(f"pivot {zero[0] + 1} is zero to rounding")

    def _inertia(self, pivots: NDArray[np.int32]) -> int:
        """A pivot of two rows has one negative eigenvalue: where both are of one sign, single ones are chosen."""
        d, single = self._factors.diagonal(), pivots > 0
        return int((d[single] < 0.0).sum() + (~single).sum() // 2)

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b; real where b is."""
        if np.iscomplexobj(b):
            return self.solve(b.real) + 1j * self.solve(b.imag)
        if not b.size:
            return np.zeros(b.shape)
        if self._pivots is None:
            x, failed = lapack.dpotrs(self._factors, b, lower=1)
        else:
            x, failed = lapack.dsytrs(self._factors, self._pivots, b, lower=1)
        assert not failed
        return np.asarray(x if b.ndim == 2 else x.ravel())
