"""CHOLMOD through scikit-sparse, where a user has it: positive definite real matrices only."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.interface import Analysis, Factor, least_bytes, ran_out, require_for_factors


@lru_cache(maxsize=1)
def library() -> Any:
    """The module, or a sentence (str) why it cannot be used."""
    try:
        module = importlib.import_module("sksparse.cholmod")
    except ModuleNotFoundError:
        return "scikit-sparse is not installed"
    except Exception as broken:
        return f"scikit-sparse is installed but cannot be loaded: {broken}"
    return module if hasattr(module, "analyze") else "this scikit-sparse is not of the series 0.4"


class CholmodAnalysis:
    """Ordering and symbolic factorisation of one pattern; `otherwise` analyses for matrices that are indefinite."""

    name = "CHOLMOD"

    def __init__(self, matrix: SymmetricMatrix, otherwise: Callable[[SymmetricMatrix], Analysis]) -> None:
        self._module = library()
        # the supernodal form alone refuses an indefinite matrix
        self._symbolic = self._module.analyze(_lower(matrix), mode="supernodal")
        self._otherwise = otherwise
        self.factor_bytes = least_bytes(matrix, triangles=1)

    def factorise(self, matrix: SymmetricMatrix) -> Factor:
        """LLᵀ, or factors by another solver where the matrix is not positive definite.

        Raises
        ------
        FemtuneError : ``model.memory``, ``solver.failed``
        """
        require_for_factors(matrix, self.factor_bytes)
        try:
            return CholmodFactor(self._symbolic.cholesky(_lower(matrix)))
        except self._module.CholmodNotPositiveDefiniteError:
            return self._otherwise(matrix).factorise(matrix)
        except self._module.CholmodError as failed:
            raise self._failure(failed, matrix) from failed

    def _failure(self, failed: Exception, matrix: SymmetricMatrix) -> FemtuneError:
        if isinstance(failed, getattr(self._module, "CholmodOutOfMemoryError", ())):
            return ran_out(matrix.shape[0], self.factor_bytes)
        return FemtuneError(
            "solver.failed", values={"equations": matrix.shape[0], "entries": len(matrix.data)}, reason=failed
        )


class CholmodFactor:
    """LLᵀ of a positive definite matrix."""

    name = "CHOLMOD"
    negative_pivots: int | None = 0

    def __init__(self, factor: Any) -> None:
        self._factor = factor

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b for b of shape (n,) or (n, k)."""
        if not b.size:
            return np.zeros_like(b)
        if np.iscomplexobj(b):
            return np.asarray(self.solve(b.real) + 1j * self.solve(b.imag))
        return np.asarray(self._factor.solve_A(np.asarray(b, dtype=float)))


def _lower(matrix: SymmetricMatrix) -> sp.csc_matrix:
    """The lower triangle: the rows of the upper one read as columns."""
    return sp.csc_matrix((matrix.data, matrix.indices, matrix.indptr), shape=matrix.shape)
