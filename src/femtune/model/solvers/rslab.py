"""RSLAB (extra "light"), a small library for every platform: symmetric indefinite, real and complex, with inertia."""

from __future__ import annotations

import importlib
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.linear.memory import require_memory
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.interface import (
    SingularMatrixError,
    ran_out,
    require_for_factors,
    scaled,
    unit_diagonal,
)
from femtune.model.solvers.threads import threads

_ORDERING = "metis"
"""Nested dissection, as in PARDISO: the default of the library takes longer, for factors of the same size."""
_ANALYSIS_BYTES_PER_ENTRY = 60
"""Bytes per entry of the matrix that are required for the ordering at its peak, a forecast on the safe side."""


@lru_cache(maxsize=1)
def library() -> Any:
    """The module, or a sentence (str) why it cannot be used."""
    try:
        module = importlib.import_module("rslab")
    except ModuleNotFoundError:
        return "rslab is not installed"
    except Exception as broken:
        return f"rslab is installed but cannot be loaded: {broken}"
    return module if hasattr(module, "analyze") else "the module 'rslab' here has no function 'analyze'"


class RslabAnalysis:
    """Ordering and symbolic factorisation of one pattern."""

    name = "RSLAB"

    def __init__(self, matrix: SymmetricMatrix) -> None:
        work = _ANALYSIS_BYTES_PER_ENTRY * len(matrix.indices)
        require_memory(work, "model.memory/ordering", equations=matrix.shape[0])
        pattern = _lower(matrix, np.ones(len(matrix.indices)))
        self._symbolic = library().analyze(pattern, path="ldlt", ordering=_ORDERING, threads=threads())
        of_reals = int(self._symbolic.estimate_memory()["factor_bytes"])
        self.factor_bytes = of_reals * (2 if np.iscomplexobj(matrix.data) else 1)

    def factorise(self, matrix: SymmetricMatrix) -> RslabFactor:
        """LDLᵀ of a matrix of the same pattern.

        Raises
        ------
        SingularMatrixError : a pivot is exactly zero
        FemtuneError : ``model.memory``, ``solver.failed``
        """
        require_for_factors(matrix, self.factor_bytes)
        scale = unit_diagonal(matrix)
        try:
            factor = self._symbolic.factor(scaled(matrix, scale), threads=threads(), scaling="identity")
        except MemoryError as short:
            raise ran_out(matrix.shape[0], self.factor_bytes) from short
        except (RuntimeError, ValueError) as failed:
            raise _failure(failed, matrix) from failed
        return RslabFactor(factor, scale, bool(np.iscomplexobj(matrix.data)))


class RslabFactor:
    """LDLᵀ of a real or complex symmetric matrix."""

    name = "RSLAB"

    def __init__(self, factor: Any, scale: NDArray[np.float64], imaginary: bool) -> None:
        self._factor, self._scale, self._imaginary = factor, scale, imaginary

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues; None where pivots were replaced and for a complex matrix."""
        _, negative, zero = self._factor.inertia if not self._imaginary else (0, 0, 1)
        return None if zero or self._factor.n_perturbed else int(negative)

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b for b of shape (n,) or (n, k)."""
        if not b.size:
            return np.zeros_like(b)
        if np.iscomplexobj(b) and not self._imaginary:
            return np.asarray(self.solve(b.real) + 1j * self.solve(b.imag))
        scale = self._scale[:, None]
        block = np.ascontiguousarray(b.reshape(len(scale), -1) * scale, dtype=complex if self._imaginary else float)
        return np.asarray(np.asfortranarray(self._factor.solve_many(block) * scale).reshape(b.shape, order="A"))


def _lower(matrix: SymmetricMatrix, values: NDArray) -> sp.csc_matrix:
    """The lower triangle: the rows of the upper one read as columns."""
    return sp.csc_matrix((values, matrix.indices, matrix.indptr), shape=matrix.shape)


def _failure(failed: Exception, matrix: SymmetricMatrix) -> Exception:
    if "rank-deficient" in str(failed):
        return SingularMatrixError(f"RSLAB: {failed}")
    return FemtuneError(
        "solver.failed", values={"equations": matrix.shape[0], "entries": len(matrix.data)}, reason=failed
    )
