"""Scaling of rows and columns, so that pivots are judged alike where stiffness spans many decades."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from femtune.model.symmetric import SymmetricMatrix

_CHUNK = 1 << 20


def unit_diagonal(matrix: SymmetricMatrix) -> NDArray[np.float64]:
    """(n,) factors of rows and columns that bring the diagonal to ±1; 1 where it is zero."""
    size = np.abs(matrix.diagonal())
    return np.asarray(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))


def scaled(matrix: SymmetricMatrix, scale: NDArray[np.float64]) -> NDArray:
    """Entries with their rows and columns scaled, in pieces, so that no second array of their length is made."""
    values, starts = matrix.data * 1.0, matrix.indptr
    rows = np.searchsorted(starts, np.arange(0, len(values), _CHUNK))
    bounds = np.unique([0, *rows, len(starts) - 1])
    for first, last in pairwise(bounds.tolist()):
        part = slice(starts[first], starts[last])
        values[part] *= scale[matrix.indices[part]]
        values[part] *= np.repeat(scale[first:last], np.diff(starts[first : last + 1]))
    return values
