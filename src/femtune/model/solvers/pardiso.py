"""PARDISO of the Math Kernel Library (extra "fast"), called directly for symmetric indefinite matrices.

The Python bindings that exist serve the unsymmetric type only; the symmetric types halve the work, and type −2 reports
the inertia.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
import sys
from functools import lru_cache
from pathlib import Path
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.linear.blocks import empty_block
from femtune.model.linear.memory import require_memory
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.interface import (
    SingularMatrixError,
    ran_out,
    require_for_factors,
    scaled,
    unit_diagonal,
)

Integers = NDArray[np.int32]

_NAMES = {"linux": "libmkl_rt.so", "win32": "mkl_rt", "darwin": "libmkl_rt"}
# Numbers of the reference of Intel oneMKL PARDISO.
# mtype:
_SYMMETRIC_INDEFINITE = -2
_COMPLEX_SYMMETRIC = 6
# phase:
_ANALYSE = 11
_FACTORISE = 22
_SOLVE = 33
_RELEASE_FACTOR = 0
_RELEASE_ALL = -1
# positions in iparm, from 0; those of memory are in KiB:
_ORDERING = 4
_REFINEMENTS = 7
_REPLACED_PIVOTS = 13
_NEGATIVE_EIGENVALUES = 22
_KIB_OF_FACTOR = 16
# values of iparm[_ORDERING]:
_GIVEN = 1
_RETURNED = 2
# error:
_ZERO_PIVOT = -4
_SINGULAR_DIAGONAL = -7
_NO_MEMORY = -2
_SLOTS = 8
"""Factors that one handle keeps at a time; the ninth opens another handle with the same ordering."""
_ANALYSIS_BYTES_PER_ENTRY = 40
"""Bytes per entry of the matrix that the ordering takes at its peak: 37 were measured for shells."""


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


class PardisoHandle:
    """PARDISO's memory for one pattern: the symbolic factorisation and up to `_SLOTS` numerical ones."""

    def __init__(self, matrix: SymmetricMatrix, ordering: Integers | None) -> None:
        self.n = matrix.shape[0]
        self.starts, self.columns = matrix.indptr, matrix.indices
        self.dtype = np.dtype(complex if np.iscomplexobj(matrix.data) else float)
        self.kind = _COMPLEX_SYMMETRIC if self.dtype == complex else _SYMMETRIC_INDEFINITE
        self.ordering = np.zeros(self.n, np.int32) if ordering is None else ordering
        self.memory, self.lock, self.open = np.zeros(64, np.int64), Lock(), False
        self.settings = _settings()
        self.settings[_ORDERING] = _RETURNED if ordering is None else _GIVEN
        # this phase reads the pattern only
        self.run(_ANALYSE, 1, np.zeros(len(self.columns), self.dtype), self.settings)
        self.settings[_ORDERING], self.open = 0, True

    def run(
        self, phase: int, slot: int, values: NDArray, settings: Integers, b: NDArray | None = None
    ) -> NDArray | None:
        """One phase on the factor in a slot; the solution where `b` (n, k) in Fortran's order is given."""
        x = None if b is None else _empty(b.shape, self.dtype)
        numbers = (_SLOTS, slot, self.kind, phase, self.n)
        most, which, kind, step, size = (ctypes.byref(ctypes.c_int32(i)) for i in numbers)
        columns = ctypes.c_int32(1 if b is None else b.shape[1])
        silent, error = ctypes.c_int32(0), ctypes.c_int32(0)
        mkl = library()
        assert mkl is not None
        with self.lock:
            mkl.pardiso(
                _pointer(self.memory), most, which, kind, step, size,
                _pointer(values), _pointer(self.starts), _pointer(self.columns), _pointer(self.ordering),
                ctypes.byref(columns), _pointer(settings), ctypes.byref(silent),
                _pointer(b), _pointer(x), ctypes.byref(error),
            )  # fmt: skip
        if error.value:
            raise failure(error.value, self.n, len(self.columns), self.needed_bytes)
        return x

    @property
    def needed_bytes(self) -> int:
        """Memory of one factorisation where the ordering is done, else that of the ordering."""
        if not self.open:
            return _ANALYSIS_BYTES_PER_ENTRY * len(self.columns)
        return 1024 * int(self.settings[_KIB_OF_FACTOR]) + self.dtype.itemsize * len(self.columns)

    def release(self, phase: int, slot: int = 1) -> None:
        """Give memory back; of a cycle of garbage the handle may go before its factors."""
        # while the interpreter ends nothing can be imported, and the memory goes anyway
        if library is not None and sys.meta_path is not None and self.open:
            self.open = phase != _RELEASE_ALL
            # this phase writes its own numbers over the forecast of the analysis
            self.run(phase, slot, np.zeros(1, self.dtype), self.settings.copy())

    def __del__(self) -> None:
        if getattr(self, "open", False):
            self.release(_RELEASE_ALL)


class PardisoAnalysis:
    """Ordering and symbolic factorisation of one pattern, kept while any of its factors lives."""

    name = "PARDISO"

    def __init__(self, matrix: SymmetricMatrix, ordering: Integers | None = None) -> None:
        work = _ANALYSIS_BYTES_PER_ENTRY * len(matrix.indices)
        require_memory(work, "model.memory/ordering", equations=matrix.shape[0])
        self._handle = PardisoHandle(matrix, ordering)
        self._slots = list(range(_SLOTS, 0, -1))
        self._further: PardisoAnalysis | None = None

    @property
    def factor_bytes(self) -> int:
        """Forecast of the memory of one numerical factorisation, from the symbolic one."""
        return self._handle.needed_bytes

    def factorise(self, matrix: SymmetricMatrix) -> PardisoFactor:
        """LDLᵀ of a matrix of the same pattern.

        Raises
        ------
        FemtuneError : ``model.memory``, ``solver.failed``
        """
        if not self._slots:
            if self._further is None:
                self._further = PardisoAnalysis(matrix, self._handle.ordering)
            return self._further.factorise(matrix)
        require_for_factors(matrix, self.factor_bytes)
        return PardisoFactor(self._handle, self._slots, matrix)


class PardisoFactor:
    """LDLᵀ of a real or complex symmetric matrix; its memory goes with it."""

    name = "PARDISO"

    def __init__(self, handle: PardisoHandle, slots: list[int], matrix: SymmetricMatrix) -> None:
        # pivots are judged by the largest entry, so rows of very different stiffness are scaled alike
        self._scale = unit_diagonal(matrix)
        self._values = scaled(matrix, self._scale)
        self._settings = handle.settings.copy()
        self._handle, self._slots, self._slot = handle, slots, slots.pop()
        handle.run(_FACTORISE, self._slot, self._values, self._settings)
        # later calls write over these numbers with those of other factors
        replaced = bool(self._settings[_REPLACED_PIVOTS])
        hidden = replaced or handle.kind == _COMPLEX_SYMMETRIC
        self._negative = None if hidden else int(self._settings[_NEGATIVE_EIGENVALUES])
        self._settings[_REFINEMENTS] = 2 if replaced else 0

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues; None where pivots were replaced and for a complex matrix."""
        return self._negative

    def solve(self, b: NDArray) -> NDArray:
        """A⁻¹ b for b of shape (n,) or (n, k); the result is in Fortran's order."""
        columns = b.reshape(len(self._scale), -1)
        if self._handle.dtype == float and np.iscomplexobj(b):
            k = columns.shape[1]
            both = self._solve(np.concatenate([columns.real, columns.imag], axis=1))
            return np.asarray(both[:, :k] + 1j * both[:, k:]).reshape(b.shape, order="A")
        return self._solve(columns).reshape(b.shape, order="A")

    def _solve(self, columns: NDArray) -> NDArray:
        scale = self._scale[:, None]
        if not columns.size:
            return np.empty(columns.shape, self._handle.dtype)
        block = np.multiply(columns, scale, out=_empty(columns.shape, self._handle.dtype))
        x = self._handle.run(_SOLVE, self._slot, self._values, self._settings, block)
        assert x is not None
        x *= scale
        return x

    def __del__(self) -> None:
        if getattr(self, "_slot", None) is not None:
            self._handle.release(_RELEASE_FACTOR, self._slot)
            self._slots.append(self._slot)


def failure(number: int, equations: int, entries: int, needed_bytes: int) -> Exception:
    """The exception for one of PARDISO's error numbers."""
    if number == _NO_MEMORY:
        return ran_out(equations, needed_bytes, "model.memory/ran-out-in-pardiso")
    if number in (_ZERO_PIVOT, _SINGULAR_DIAGONAL):
        return SingularMatrixError(f"PARDISO's error {number}")
    return FemtuneError("solver.failed/pardiso", values={"equations": equations, "entries": entries}, number=number)


def _settings() -> Integers:
    settings = np.zeros(64, dtype=np.int32)
    settings[0] = 1  # no defaults
    settings[1] = 2  # nested dissection
    settings[9] = 13  # pivots below 1e-13 are replaced
    settings[20] = 1  # Bunch-Kaufman pivots
    settings[34] = 1  # rows and columns count from zero
    return settings


def _empty(shape: tuple[int, ...], dtype: np.dtype) -> NDArray:
    return empty_block(shape[0], shape[1]) if dtype.kind == "f" else np.empty(shape, dtype, order="F")


def _pointer(array: NDArray | None) -> ctypes.c_void_p | None:
    return None if array is None else array.ctypes.data_as(ctypes.c_void_p)
