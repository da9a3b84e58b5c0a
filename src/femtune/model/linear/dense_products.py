"""Products of tall blocks of vectors, by the threads of the library that factorises, if it is available.

Two libraries with threads of their own disturb each other: each waits, busy, for its next work.
"""

from __future__ import annotations

import ctypes

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.model.linear.blocks import empty_block
from femtune.model.solvers import pardiso

# numbers of cblas.h and lapacke.h
_BY_ROWS = 101
_BY_COLUMNS = 102
_PLAIN = 111
_TRANSPOSED = 112
_ROWS_AT_ONCE = 1 << 14
"""Rows that are multiplied together, so that no second array of the size of the whole is made."""
LIBRARY_FROM = 200_000
"""Numbers in the tall matrix from which on the threads of the library save more than their start costs."""
_EIGEN_FROM = 64
"""The same for the rows of a small symmetric matrix: below, its threads have nothing to do."""


def multiply(A: Reals, B: Reals) -> Reals:
    """A B, in Fortran's order, for A in Fortran's order and a small B."""
    return _product(A, B, empty_block(A.shape[0], B.shape[1]), 1.0, 0.0)


def subtract(W: Reals, V: Reals, C: Reals) -> None:
    """W ← W − V C in place, for W and V in Fortran's order."""
    _product(V, C, W, -1.0, 1.0)


def add(W: Reals, V: Reals, C: Reals) -> None:
    """W ← W + V C in place, for W and V in Fortran's order."""
    _product(V, C, W, 1.0, 1.0)


def turn(V: Reals, Y: Reals) -> Reals:
    """V Y in the place of V's first columns, a piece of rows at a time: no second array of V's size is made."""
    for first in range(0, len(V), _ROWS_AT_ONCE):
        rows = V[first : first + _ROWS_AT_ONCE]
        rows[:, : Y.shape[1]] = rows[:, : Y.shape[0]] @ Y
    return V[:, : Y.shape[1]]


def transposed_times(V: Reals, W: Reals) -> Reals:
    """VᵀW for both in Fortran's order."""
    mkl = pardiso.library() if V.size >= LIBRARY_FROM else None
    if mkl is None or not W.size or not (V.flags.f_contiguous and W.flags.f_contiguous):
        return np.asarray(V.T @ W)
    out = np.empty((V.shape[1], W.shape[1]), order="F")
    _call(mkl, _TRANSPOSED, V, W, out, (1.0, 0.0), (V.shape[1], W.shape[1], V.shape[0]))
    return out


def in_any_order(A: Reals, B: Reals) -> Reals:
    """A B, in C's order, of arrays that are each in C's or Fortran's order, views that are transposed among them."""
    mkl = pardiso.library() if max(A.size, B.size) >= LIBRARY_FROM else None
    kinds = [_order_of(M) for M in (A, B)]
    if mkl is None or None in kinds or not A.size or not B.size:
        return np.ascontiguousarray(A @ B)
    out = np.empty((A.shape[0], B.shape[1]))
    leading = (M.shape[1] if kind == _PLAIN else M.shape[0] for M, kind in zip((A, B), kinds))
    first, second = (max(number, 1) for number in leading)
    mkl.cblas_dgemm(
        _BY_ROWS, *kinds, *out.shape, A.shape[1], ctypes.c_double(1.0), _pointer(A), first, _pointer(B), second,
        ctypes.c_double(0.0), _pointer(out), out.shape[1],
    )  # fmt: skip
    return out


def _order_of(M: Reals) -> int | None:
    """How a product by rows takes an array of doubles; None for a view with gaps."""
    if M.dtype != np.float64:
        return None
    return _PLAIN if M.flags.c_contiguous else _TRANSPOSED if M.flags.f_contiguous else None


def symmetric_eigen(A: Reals) -> tuple[Reals, Reals]:
    """Eigenvalues of a symmetric matrix, ascending, and its vectors."""
    mkl = pardiso.library() if len(A) >= _EIGEN_FROM else None
    if mkl is None:
        values, vectors = la.eigh(A)
        return np.asarray(values), np.asarray(vectors)
    n = len(A)
    # the rounding of the library depends on where its arrays begin: at a line of the cache
    memory = np.empty(n * (n + 1) + 16)
    aligned = memory[-memory.ctypes.data % 64 // 8 :]
    vectors, values = aligned[: n * n].reshape((n, n), order="F"), aligned[n * n : n * (n + 1)]
    vectors[...] = A
    jobs = ctypes.c_char(b"V"), ctypes.c_char(b"U")
    if mkl.LAPACKE_dsyevd(_BY_COLUMNS, *jobs, n, _pointer(vectors), n, _pointer(values)):
        raise la.LinAlgError("the eigenvalues of a small matrix did not converge")
    return values, vectors


def _product(A: Reals, B: Reals, out: Reals, alpha: float, beta: float) -> Reals:
    """out ← α A B + β out."""
    if not A.size or not B.size:
        out *= beta
        return out
    mkl = pardiso.library() if A.size >= LIBRARY_FROM else None
    B = np.asfortranarray(B)
    if mkl is not None and A.flags.f_contiguous and out.flags.f_contiguous:
        _call(mkl, _PLAIN, A, B, out, (alpha, beta), (A.shape[0], B.shape[1], B.shape[0]))
        return out
    new = la.blas.dgemm(alpha, A, B, beta=beta, c=out, overwrite_c=True)
    if new is not out:
        out[...] = new
    return out


def _call(
    mkl: ctypes.CDLL, kind: int, A: Reals, B: Reals, out: Reals, factors: tuple[float, float],
    sizes: tuple[int, int, int],
) -> None:  # fmt: skip
    alpha, beta = (ctypes.c_double(f) for f in factors)
    mkl.cblas_dgemm(
        _BY_COLUMNS, kind, _PLAIN, *sizes, alpha, _pointer(A), A.shape[0], _pointer(B), B.shape[0], beta,
        _pointer(out), out.shape[0],
    )  # fmt: skip


def _pointer(array: Reals) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
