"""Products of one symmetric sparse matrix with many blocks of vectors, in the fastest available way."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Integers, Reals
from femtune.model.linear.blocks import empty_block
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers import pardiso

LIBRARY_FROM = 50_000
"""Entries from which on the threads of the library save more than their start costs."""
DENSE_UP_TO = 100
"""Rows up to which a full array is multiplied: preparing a sparse matrix takes longer than a hundred such products."""
_NEARLY_DIAGONAL = 1.25
"""Entries per row, at most, of a matrix whose diagonal is multiplied separately."""
_FEW_ZEROS = 0.9
"""Part of the entries that are not zero from which on removing the zeros would save little."""
_ROWS_AT_ONCE = 1 << 11
"""Rows that are reordered together, few enough for the cache."""
# numbers of mkl_spblas.h
_SUCCESS = 0
_PLAIN = 10
_BY_ROWS = 101
_FROM_ZERO = 0
_SYMMETRIC = 21
_UPPER = 41
_NON_UNIT = 50


@dataclass(frozen=True, eq=False)
class Product:
    """x ↦ A x for x of shape (n,) or (n, k); blocks are quickest, and come, in Fortran's order."""

    shape: tuple[int, int]
    times: Callable[[Reals], Reals]

    def __matmul__(self, x: Reals) -> Reals:
        """A x."""
        return self.times(x)


def product(matrix: SymmetricMatrix, block: int = 0) -> Product:
    """Make a real matrix ready for products; entries that are zero are left out.

    `block` is the usual number of columns if many products follow: the library may then keep a copy of the matrix
    in the order that is fastest for it.
    """
    n = matrix.shape[0]
    if n <= DENSE_UP_TO:
        array = matrix.dense()
        return Product(matrix.shape, lambda x: column_major(np.asarray(array @ x)))
    lean = without_zeros(matrix)
    if lean.nnz <= _NEARLY_DIAGONAL * n:
        return Product(matrix.shape, _NearlyDiagonal.of(lean))
    if lean.nnz >= LIBRARY_FROM and pardiso.library() is not None:
        return Product(matrix.shape, _LibraryMatrix(lean, block))
    full = sp.csr_array(lean + sp.triu(lean, 1).T)
    return Product(matrix.shape, lambda x: column_major(np.asarray(full @ x)))


@dataclass(frozen=True, eq=False)
class _NearlyDiagonal:
    """A symmetric matrix of which few rows have more than a diagonal: these are `rows`, and `rest` what they have."""

    diagonal: Reals
    rows: Integers
    rest: sp.csr_array

    @classmethod
    def of(cls, upper: sp.csr_array) -> _NearlyDiagonal:
        """From the upper triangle."""
        strict = sp.triu(upper, 1, format="coo")
        rows = np.union1d(strict.row, strict.col)
        n, at = len(rows), (np.searchsorted(rows, strict.row), np.searchsorted(rows, strict.col))
        half = sp.csr_array((strict.data, at), shape=(n, n))
        return cls(upper.diagonal(), rows, sp.csr_array(half + half.T))

    def __call__(self, x: Reals) -> Reals:
        """A x."""
        if x.ndim == 1:
            out = np.asarray(self.diagonal * x)
        else:
            out = np.multiply(self.diagonal[:, None], x, out=empty_block(len(x), x.shape[1]))
        if len(self.rows):
            out[self.rows] += self.rest @ x[self.rows]
        return out


def without_zeros(matrix: SymmetricMatrix) -> sp.csr_array:
    """The upper triangle with its whole diagonal and no other zeros, where these are many."""
    keep = matrix.data != 0.0
    if np.count_nonzero(keep) > _FEW_ZEROS * len(keep):
        return matrix.upper
    keep[matrix.indptr[:-1]] = True
    starts = np.concatenate([[0], np.cumsum(keep, dtype=np.int32)]).astype(np.int32)[matrix.indptr]
    return sp.csr_array((matrix.data[keep], matrix.indices[keep], starts), shape=matrix.shape)


class _Description(ctypes.Structure):
    """The library's `matrix_descr`."""

    _fields_ = [("type", ctypes.c_int), ("mode", ctypes.c_int), ("diag", ctypes.c_int)]


_KIND = _Description(_SYMMETRIC, _UPPER, _NON_UNIT)


class _LibraryMatrix:
    """A matrix in the Math Kernel Library's sparse format; the library reads our arrays."""

    def __init__(self, upper: sp.csr_array, block: int) -> None:
        mkl = pardiso.library()
        assert mkl is not None
        self._library = mkl
        self._n, self._upper = upper.shape[0], upper
        self._handle = ctypes.c_void_p()
        starts = upper.indptr.ctypes.data
        _check(
            self._library.mkl_sparse_d_create_csr(
                ctypes.byref(self._handle), _FROM_ZERO, self._n, self._n, ctypes.c_void_p(starts),
                ctypes.c_void_p(starts + upper.indptr.itemsize), ctypes.c_void_p(upper.indices.ctypes.data),
                ctypes.c_void_p(upper.data.ctypes.data),
            )
        )  # fmt: skip
        if block:
            self._library.mkl_sparse_set_mm_hint(self._handle, _PLAIN, _KIND, _BY_ROWS, block, 1000)
            self._library.mkl_sparse_optimize(self._handle)

    def __call__(self, x: Reals) -> Reals:
        """A x; the library is several times as fast on rows, and the change of order costs little."""
        if not x.size:
            # the library refuses a block without columns
            return np.zeros(x.shape)
        block = row_major(np.asarray(x.reshape(self._n, -1), dtype=np.float64))
        out = empty_block(self._n, block.shape[1], "C")
        columns = ctypes.c_int(block.shape[1])
        _check(
            self._library.mkl_sparse_d_mm(
                _PLAIN, ctypes.c_double(1.0), self._handle, _KIND, _BY_ROWS,
                ctypes.c_void_p(block.ctypes.data), columns, columns, ctypes.c_double(0.0),
                ctypes.c_void_p(out.ctypes.data), columns,
            )
        )  # fmt: skip
        return column_major(out) if x.ndim == 2 else out.ravel()

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._library.mkl_sparse_destroy(self._handle)


def row_major(x: Reals) -> Reals:
    """The same in C's order; a piece of rows at a time, so that it is reordered in the cache."""
    return _reordered(x, "C")


def column_major(x: Reals) -> Reals:
    """The same in Fortran's order."""
    return _reordered(x, "F")


def _reordered(x: Reals, order: Literal["C", "F"]) -> Reals:
    if x.flags.c_contiguous if order == "C" else x.flags.f_contiguous:
        return x
    out = empty_block(x.shape[0], x.shape[1], order)
    for first in range(0, len(x), _ROWS_AT_ONCE):
        out[first : first + _ROWS_AT_ONCE] = x[first : first + _ROWS_AT_ONCE]
    return out


def _check(status: int) -> None:
    if status != _SUCCESS:
        raise MemoryError(f"the sparse library could not multiply: status {status}")
