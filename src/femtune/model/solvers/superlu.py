"""SuperLU of SciPy: always available, one thread, real and complex."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.interface import SingularMatrixError, least_bytes, ran_out, require_for_factors


class SuperLuAnalysis:
    """SuperLU orders and counts inside its factorisation; nothing of that can be kept."""

    name = "SuperLU"

    def __init__(self, matrix: SymmetricMatrix) -> None:
        self.factor_bytes = least_bytes(matrix, triangles=2)

    def factorise(self, matrix: SymmetricMatrix) -> SuperLuFactor:
        """LU factors with diagonal pivots.

        Raises
        ------
        SingularMatrixError : a pivot is exactly zero
        FemtuneError : ``model.memory``
        """
        require_for_factors(matrix, self.factor_bytes)
        try:
            return SuperLuFactor(matrix)
        except MemoryError as short:
            raise ran_out(matrix.shape[0], self.factor_bytes) from short


class SuperLuFactor:
    """SciPy's SuperLU in symmetric mode: diagonal pivots, so their signs are the inertia."""

    name = "SuperLU"

    def __init__(self, matrix: SymmetricMatrix) -> None:
        options = {"SymmetricMode": True, "Equil": False}
        # rows and columns of a symmetric matrix are the same: csr read as csc is no copy
        full = matrix.full()
        columns = sp.csc_array((full.data, full.indices, full.indptr), shape=full.shape)
        try:
            self.factors = spla.splu(columns, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from error

    @property
    def negative_pivots(self) -> int | None:
        """Count of negative diagonal entries of U, where rows and columns were permuted alike."""
        if self.factors.U.dtype == complex or (self.factors.perm_r != self.factors.perm_c).any():
            return None
        return int((self.factors.U.diagonal() < 0).sum())

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b; real where A and b are."""
        if self.factors.U.dtype == complex or not np.iscomplexobj(b):
            return self.factors.solve(np.asarray(b, dtype=self.factors.U.dtype))
        return self.solve(b.real) + 1j * self.solve(b.imag)
