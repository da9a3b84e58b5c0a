"""PARDISO of the Math Kernel Library (extra "fast"), called directly for symmetric indefinite matrices.

The Python bindings that exist serve the unsymmetric type only; the symmetric types halve the work, and type −2 reports
the inertia.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.metadata
import sys
from collections import OrderedDict
from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError

_NAMES = {"linux": "libmkl_rt.so", "win32": "mkl_rt", "darwin": "libmkl_rt"}
_SYMMETRIC_INDEFINITE, _COMPLEX_SYMMETRIC = -2, 6
_ANALYSE_AND_FACTORISE, _SOLVE, _RELEASE = 12, 33, -1
_ORDERING, _REPLACED_PIVOTS, _NEGATIVE_EIGENVALUES = 4, 13, 22
_GIVEN, _RETURNED = 1, 2
_ORDERINGS: OrderedDict[bytes, NDArray[np.int32]] = OrderedDict()
_MOST_ORDERINGS = 8


@lru_cache(maxsize=1)
def library() -> ctypes.CDLL | None:
    """The library's run-time, or None where it is not installed or does not load."""
    for path in _candidates():
        try:
            return ctypes.CDLL(str(path))
        except OSError:
            continue
    return None


def _candidates() -> list[Path]:
    name = _NAMES.get(sys.platform, "")
    try:
        files = importlib.metadata.files("mkl") or []
    except importlib.metadata.PackageNotFoundError:
        return []
    return [Path(str(f.locate())) for f in files if name and f.name.startswith(name)]


class PardisoFactor:
    """LDLᵀ of a real or complex symmetric matrix."""

    name = "PARDISO"

    def __init__(self, matrix: sp.csr_array) -> None:
        upper = sp.csr_array(sp.triu(matrix, format="csr"))
        upper.sort_indices()
        self._n = upper.shape[0]
        self._kind = _COMPLEX_SYMMETRIC if np.iscomplexobj(upper.data) else _SYMMETRIC_INDEFINITE
        # pivots are judged by the largest entry, so rows of very different stiffness are scaled alike
        self._scale = _unit_diagonal(matrix)
        rows = np.repeat(np.arange(self._n), np.diff(upper.indptr))
        self._values = upper.data * self._scale[rows] * self._scale[upper.indices]
        self._starts = (upper.indptr + 1).astype(np.int32)
        self._columns = (upper.indices + 1).astype(np.int32)
        self._handle = np.zeros(64, dtype=np.int64)
        self._settings = _settings()
        self._permutation = np.zeros(self._n, dtype=np.int32)
        self._factorise()

    def _factorise(self) -> None:
        """Analyse and factorise; a pattern that was met before keeps its ordering."""
        pattern = hashlib.blake2b(self._starts.tobytes() + self._columns.tobytes()).digest()
        known = _ORDERINGS.get(pattern)
        self._settings[_ORDERING] = _RETURNED if known is None else _GIVEN
        if known is not None:
            self._permutation[:] = known
        self._call(_ANALYSE_AND_FACTORISE, np.zeros((self._n, 1), self._values.dtype, order="F"))
        if known is None:
            _remember(pattern, self._permutation)

    def _call(self, phase: int, b: NDArray) -> NDArray:
        x = np.zeros_like(b, order="F")
        numbers = (1, 1, self._kind, phase, self._n)
        maxfct, mnum, kind, step, size = (ctypes.byref(ctypes.c_int32(i)) for i in numbers)
        columns, silent, error = ctypes.c_int32(b.shape[1]), ctypes.c_int32(0), ctypes.c_int32(0)
        found = library()
        assert found is not None
        found.pardiso(
            _pointer(self._handle), maxfct, mnum, kind, step, size,
            _pointer(self._values), _pointer(self._starts), _pointer(self._columns), _pointer(self._permutation),
            ctypes.byref(columns), _pointer(self._settings), ctypes.byref(silent),
            _pointer(b), _pointer(x), ctypes.byref(error),
        )  # fmt: skip
        if error.value:
            raise self._error(error.value)
        return x

    def _error(self, number: int) -> FemtuneError:
        return FemtuneError(
            "solver.failed",
            f"the sparse factorisation failed: PARDISO's error {number}",
            values={"equations": self._n, "entries": len(self._values)},
            hint="error -2 is too little memory: close other programs, or make the model smaller",
        )

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues; None where pivots were replaced and for a complex matrix."""
        hidden = self._settings[_REPLACED_PIVOTS] or self._kind == _COMPLEX_SYMMETRIC
        return None if hidden else int(self._settings[_NEGATIVE_EIGENVALUES])

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b for b of shape (n,) or (n, k)."""
        if self._kind == _SYMMETRIC_INDEFINITE and np.iscomplexobj(b):
            return np.asarray(self.solve(b.real) + 1j * self.solve(b.imag))
        block = np.asfortranarray(b.reshape(self._n, -1) * self._scale[:, None], dtype=self._values.dtype)
        return (self._call(_SOLVE, block) * self._scale[:, None]).reshape(b.shape)

    def __del__(self) -> None:
        # while the interpreter ends nothing can be imported, and the memory goes anyway
        if library is not None and sys.meta_path is not None and getattr(self, "_settings", None) is not None:
            self._call(_RELEASE, np.zeros((self._n, 1), self._values.dtype, order="F"))


def _unit_diagonal(matrix: sp.csr_array) -> NDArray[np.float64]:
    size = np.abs(matrix.diagonal())
    return np.asarray(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))


def _remember(pattern: bytes, permutation: NDArray[np.int32]) -> None:
    _ORDERINGS[pattern] = permutation.copy()
    if len(_ORDERINGS) > _MOST_ORDERINGS:
        _ORDERINGS.popitem(last=False)


def _settings() -> NDArray[np.int32]:
    settings = np.zeros(64, dtype=np.int32)
    settings[0] = 1  # no defaults
    settings[1] = 2  # nested dissection
    settings[7] = 0  # iterative refinement only where a pivot was replaced
    settings[9] = 13  # pivots below 1e-13 are replaced
    settings[20] = 1  # Bunch-Kaufman pivots
    return settings


def _pointer(array: NDArray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
