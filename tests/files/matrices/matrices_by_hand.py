"""Matrices with a known form, and the whole of what was read."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.files.matrices.read_matrix import ReadMatrix


def full(matrix: ReadMatrix) -> NDArray:
    """Both triangles."""
    upper = matrix.upper.toarray()
    return np.asarray(upper + np.triu(upper, 1).T)


def symmetric_example(n: int = 30, seed: int = 1) -> NDArray[np.float64]:
    """A sparse symmetric matrix with a heavy diagonal."""
    some = sp.random_array((n, n), density=0.1, rng=np.random.default_rng(seed)).toarray()
    return np.asarray(some + some.T + 3.0 * np.eye(n))
