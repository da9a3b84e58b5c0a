"""MUMPS through python-mumps, where a user has it: symmetric indefinite, real and complex, with inertia."""

from __future__ import annotations

import importlib
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.interface import (
    SingularMatrixError,
    least_bytes,
    ran_out,
    require_for_factors,
    scaled,
    unit_diagonal,
)

# numbers of the MUMPS users' guide: an entry of INFOG, from 1, and errors in INFOG(1)
_NEGATIVE_PIVOTS = 12
_STRUCTURALLY_SINGULAR = -6
_SINGULAR = -10
_NO_MEMORY = -13


@lru_cache(maxsize=1)
def library() -> Any:
    """The module, or a sentence (str) why it cannot be used."""
    try:
        module = importlib.import_module("mumps")
    except ModuleNotFoundError:
        return "python-mumps is not installed"
    except Exception as broken:
        return f"python-mumps is installed but cannot be loaded: {broken}"
    return module if hasattr(module, "Context") else "the module 'mumps' here is not that of python-mumps"


class MumpsAnalysis:
    """The wrapper keeps analysis and numbers together: each factorisation orders anew."""

    name = "MUMPS"

    def __init__(self, matrix: SymmetricMatrix) -> None:
        self.factor_bytes = least_bytes(matrix, triangles=1)

    def factorise(self, matrix: SymmetricMatrix) -> MumpsFactor:
        """LDLᵀ of a matrix.

        Raises
        ------
        SingularMatrixError : a pivot is exactly zero
        FemtuneError : ``model.memory``, ``solver.failed``
        """
        require_for_factors(matrix, self.factor_bytes)
        return MumpsFactor(matrix)


class MumpsFactor:
    """LDLᵀ of a real or complex symmetric matrix."""

    name = "MUMPS"

    def __init__(self, matrix: SymmetricMatrix) -> None:
        module = library()
        self._scale = unit_diagonal(matrix)
        self._real = not np.iscomplexobj(matrix.data)
        self._context = module.Context()
        upper = matrix.upper
        upper.data = scaled(matrix, self._scale)
        self._context.set_matrix(upper.tocoo(), overwrite_a=True, symmetric=True)
        try:
            self._context.factor()
        except module.MUMPSError as failed:
            raise failure(failed.error, matrix) from failed

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues; None for a complex matrix."""
        return int(self._context.mumps_instance.infog[_NEGATIVE_PIVOTS]) if self._real else None

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b for b of shape (n,) or (n, k)."""
        if not b.size:
            return np.zeros_like(b)
        if self._real and np.iscomplexobj(b):
            return np.asarray(self.solve(b.real) + 1j * self.solve(b.imag))
        scale = self._scale if b.ndim == 1 else self._scale[:, None]
        block = np.asarray(b * scale, dtype=float if self._real else complex, order="F")
        return np.asarray(self._context.solve(block, overwrite_b=True) * scale)


def failure(number: int, matrix: SymmetricMatrix) -> Exception:
    """The exception for one of MUMPS' error numbers."""
    if number in (_STRUCTURALLY_SINGULAR, _SINGULAR):
        return SingularMatrixError(f"MUMPS' error {number}")
    if number == _NO_MEMORY:
        return ran_out(matrix.shape[0], least_bytes(matrix, triangles=1))
    return FemtuneError(
        "solver.failed/mumps", values={"equations": matrix.shape[0], "entries": len(matrix.data)}, number=number
    )
