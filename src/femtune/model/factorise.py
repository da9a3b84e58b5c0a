"""Factorisation of sparse symmetric matrices, real (with inertia) or complex, behind one small interface."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model import pardiso


class Factor(Protocol):
    """LDLᵀ or LU factors of a real or complex symmetric matrix (A = Aᵀ, not Hermitian)."""

    name: str

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues (Sylvester's law), None where the pivoting hides it or A is complex."""

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b for b of shape (n,) or (n, k)."""


class SingularMatrixError(Exception):
    """The factorisation met a pivot that is exactly zero."""


class SuperLuFactor:
    """SciPy's SuperLU in symmetric mode: diagonal pivots, so their signs are the inertia."""

    name = "SuperLU"

    def __init__(self, matrix: sp.csr_array) -> None:
        options = {"SymmetricMode": True, "Equil": False}
        try:
            self._lu = spla.splu(
                sp.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
            )
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from error

    @property
    def negative_pivots(self) -> int | None:
        """Count of negative diagonal entries of U, where rows and columns were permuted alike."""
        if self._lu.U.dtype == complex or (self._lu.perm_r != self._lu.perm_c).any():
            return None
        return int((self._lu.U.diagonal() < 0).sum())

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b; real where A and b are."""
        if self._lu.U.dtype == complex or not np.iscomplexobj(b):
            return self._lu.solve(np.ascontiguousarray(b, dtype=self._lu.U.dtype))
        return self.solve(b.real) + 1j * self.solve(b.imag)


PARDISO_FROM, PARDISO_FROM_COMPLEX = 3000, 300
"""Below these sizes the start of the threaded library costs more than it gains. SuperLU's complex kernels are slower by
far where their threads wait for one another."""


def factorise(matrix: sp.csr_array, solver: str | None = None) -> Factor:
    """Factorise a real or complex symmetric matrix with the fastest solver at hand, or with the one named.

    Raises
    ------
    SingularMatrixError : a pivot is exactly zero
    FemtuneError : ``solver.unavailable`` for a name that is not at hand
    """
    if solver is None:
        least = PARDISO_FROM_COMPLEX if np.iscomplexobj(matrix.data) else PARDISO_FROM
        big = matrix.shape[0] >= least and "PARDISO" in available_solvers()
        solver = "PARDISO" if big else "SuperLU"
    if solver not in available_solvers():
        raise FemtuneError(
            "solver.unavailable",
            f"the solver '{solver}' is not at hand",
            values={"available": ", ".join(available_solvers())},
            hint='pip install "femtune[fast]"',
        )
    return pardiso.PardisoFactor(matrix) if solver == "PARDISO" else SuperLuFactor(matrix)


@lru_cache(maxsize=1)
def available_solvers() -> tuple[str, ...]:
    """Names of the sparse solvers that can be used here, the fastest first."""
    return ("PARDISO", "SuperLU") if pardiso.library() is not None else ("SuperLU",)
