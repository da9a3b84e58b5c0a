"""Sparse symmetric matrices kept as their upper triangle; on one pattern K − σM is arithmetic of numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

_COLUMNS_AT_ONCE = 16
"""Columns that are multiplied together, so that a product makes no further arrays of the size of its result."""
_SMALL_PATTERN = 20_000
"""Entries up to which the pattern of both triangles is kept: for small models finding it takes longer than the
factors."""


@dataclass(frozen=True, eq=False)
class SymmetricMatrix:
    """A = Aᵀ, real or complex, as the upper triangle with its whole diagonal: csr with sorted columns.

    Matrices of one model share `indptr` and `indices`; `data` (nnz,) is their own.
    """

    data: NDArray
    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]

    @property
    def shape(self) -> tuple[int, int]:
        """(n, n)."""
        n = len(self.indptr) - 1
        return n, n

    @property
    def upper(self) -> sp.csr_array:
        """The upper triangle, a view of the same numbers."""
        return sp.csr_array((self.data, self.indices, self.indptr), shape=self.shape)

    def diagonal(self) -> NDArray:
        """(n,); the diagonal entry is the first of its row."""
        return np.asarray(self.data[self.indptr[:-1]])

    def plus(self, factor: complex, other: SymmetricMatrix) -> SymmetricMatrix:
        """A + factor·B for matrices of one pattern."""
        assert other.indices is self.indices or np.array_equal(other.indices, self.indices)
        return SymmetricMatrix(self.data + factor * other.data, self.indices, self.indptr)

    def __matmul__(self, x: NDArray) -> NDArray:
        """A x for x of shape (n,) or (n, k)."""
        if x.ndim == 1:
            return self._times(x, self.diagonal())
        out = np.empty(x.shape, np.result_type(self.data, x))
        for first in range(0, x.shape[1], _COLUMNS_AT_ONCE):
            part = slice(first, first + _COLUMNS_AT_ONCE)
            out[:, part] = self._times(x[:, part], self.diagonal()[:, None])
        return out

    def _times(self, x: NDArray, diagonal: NDArray) -> NDArray:
        upper = self.upper
        return np.asarray(upper @ x + upper.T @ x - diagonal * x)

    def full(self) -> sp.csr_array:
        """Both triangles."""
        return BothTriangles.of(self.indptr, self.indices).matrix(self.data)

    def dense(self) -> NDArray:
        """(n, n) array of a small matrix."""
        return BothTriangles.of(self.indptr, self.indices).dense(self.data)


@dataclass(frozen=True, eq=False)
class BothTriangles:
    """csr pattern of a whole matrix, and the place `source` of each of its entries in the upper triangle."""

    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    source: NDArray[np.int32]

    @classmethod
    def of(cls, indptr: NDArray[np.int32], indices: NDArray[np.int32]) -> BothTriangles:
        """From the pattern of the upper triangle."""
        if len(indices) <= _SMALL_PATTERN:
            return _known(indptr.astype(np.int32).tobytes(), indices.astype(np.int32).tobytes())
        return cls._found(indptr, indices)

    @classmethod
    def _found(cls, indptr: NDArray[np.int32], indices: NDArray[np.int32]) -> BothTriangles:
        n = len(indptr) - 1
        # places count from one, since the sum of sparse matrices leaves zeros out
        upper = sp.csr_array((np.arange(1, len(indices) + 1, dtype=np.int32), indices, indptr), shape=(n, n))
        whole = sp.csr_array(upper + sp.triu(upper, 1).T)
        whole.sort_indices()
        return cls(whole.indptr, whole.indices, whole.data - 1)

    def matrix(self, data: NDArray) -> sp.csr_array:
        """The whole matrix from the numbers of its upper triangle."""
        n = len(self.indptr) - 1
        return sp.csr_array((data[self.source], self.indices, self.indptr), shape=(n, n))

    def dense(self, data: NDArray) -> NDArray:
        """(…, n, n) arrays from numbers (…, nnz) of upper triangles, of a small matrix."""
        n = len(self.indptr) - 1
        out = np.zeros((*data.shape[:-1], n * n), data.dtype)
        out[..., self._places] = data[..., self.source]
        return out.reshape(*data.shape[:-1], n, n)

    @cached_property
    def _places(self) -> NDArray[np.int64]:
        """(entries,) of the whole matrix in an array."""
        n = len(self.indptr) - 1
        return np.repeat(np.arange(n, dtype=np.int64) * n, np.diff(self.indptr)) + self.indices


@lru_cache(maxsize=16)
def _known(indptr: bytes, indices: bytes) -> BothTriangles:
    return BothTriangles._found(np.frombuffer(indptr, np.int32), np.frombuffer(indices, np.int32))


def symmetric(matrix: sp.sparray) -> SymmetricMatrix:
    """The upper triangle of a symmetric matrix; zeros are put on its diagonal where it has no entry."""
    upper = sp.csr_array(sp.triu(matrix, format="csr"))
    upper.sum_duplicates()
    missing = upper.diagonal() == 0.0
    if missing.any():
        upper = _with_diagonal(upper)
    return SymmetricMatrix(upper.data, upper.indices.astype(np.int32), upper.indptr.astype(np.int32))


def _with_diagonal(upper: sp.csr_array) -> sp.csr_array:
    n = upper.shape[0]
    coo = upper.tocoo()
    at = np.arange(n)
    rows, cols = np.concatenate([at, coo.row]), np.concatenate([at, coo.col])
    out = sp.csr_array((np.concatenate([np.zeros(n, upper.dtype), coo.data]), (rows, cols)), shape=upper.shape)
    out.sort_indices()
    return out
