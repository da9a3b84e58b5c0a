"""The lowest eigenpairs, and the count of eigenvalues, by SLEPc and MUMPS over MPI."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.model.distributed.exchange import (
    exchange_folder,
    no_result,
    read_result,
    read_shapes,
    write_matrices,
    write_request,
)
from femtune.model.distributed.launch import expected_ranks, run, start
from femtune.model.linear.symmetric import SymmetricMatrix

_TOLERANCE = 1e-10
"""Relative residual at which SLEPc stops."""
_LOWEST_OF_SINGLE = 1e-4
"""First guess of the lowest elastic eigenvalue relative to k_ii/m_ii of the softest DOF, as in `eigen.shift`."""
_NEAREST_USABLE = 1e-3
_FARTHEST_USABLE = 1e2
"""Shift over the lowest elastic eigenvalue between which it is good enough: another solution would cost as much
again."""


@dataclass(frozen=True, eq=False)
class SlepcModes:
    """Eigenpairs nearest to a shift σ.

    Parameters
    ----------
    values : (m,) ascending
    shapes : (n, m), φᵀMφ = 1
    errors : (m,) relative residuals: the energy of Kφ − λMφ in (K − σM)⁻¹, its root over that of λ − σ
    shift : σ
    """

    values: Reals
    shapes: Reals = field(repr=False)
    errors: Reals
    shift: float


def slepc_pairs(K: SymmetricMatrix, M: SymmetricMatrix, shift: float, count: int) -> tuple[Reals, Reals]:
    """Eigenvalues and shapes of `slepc_modes`."""
    modes = slepc_modes(K, M, shift, count)
    return modes.values, modes.shapes


def slepc_modes(K: SymmetricMatrix, M: SymmetricMatrix, shift: float, count: int) -> SlepcModes:
    """The eigenpairs of K φ = λ M φ nearest to a shift: Krylov-Schur on (K − σM)⁻¹, factors by MUMPS.

    If fewer pairs converge, fewer are returned.

    Parameters
    ----------
    K, M : real, of one size; M may be singular
    shift : σ in rad²/s²; below the spectrum, what is nearest is lowest
    count : number of pairs

    Raises
    ------
    FemtuneError : ``slepc.not-installed``, ``slepc.launcher``, ``slepc.failed``, ``slepc.files``, ``slepc.no-result``
    """
    n = K.shape[0]
    start()  # wrong settings are reported before any file is written
    with exchange_folder(_bytes(K, M) + 8 * n * count) as folder:
        result = _solve(folder, K, M, task="modes", shift=shift, count=min(count, n), tolerance=_TOLERANCE)
        values, errors = (_numbers(result[name], count) for name in ("values", "errors"))
        if len(errors) != len(values):
            raise no_result("slepc.no-result/number-of-errors", errors=len(errors), eigenvalues=len(values))
        shapes = read_shapes(folder, _whole(result, "ranks"), (n, len(values)))
    order = np.argsort(values)
    return SlepcModes(values[order], _orthonormal(shapes[:, order], M), errors[order], shift)


def slepc_lowest(K: SymmetricMatrix, M: SymmetricMatrix, count: int) -> SlepcModes:
    """The lowest pairs, with a shift below the spectrum that is found on the way.

    As in `shift`: one of the size of the lowest elastic eigenvalue keeps the digits of the higher modes; where the
    first guess was far from it, the problem is solved once more.
    """
    k, m = K.diagonal(), M.diagonal()
    ratios = k[m > 0.0] / m[m > 0.0]
    positive = ratios[ratios > 0.0]
    size = _LOWEST_OF_SINGLE * float(positive.min()) if positive.size else 1.0
    modes = slepc_modes(K, M, -size, count)
    elastic = modes.values[modes.values > _NEAREST_USABLE * size]
    if not elastic.size or _NEAREST_USABLE < size / elastic[0] < _FARTHEST_USABLE:
        return modes
    return slepc_modes(K, M, -float(elastic[0]), count)


def slepc_count(K: SymmetricMatrix, M: SymmetricMatrix, eigenvalue: float) -> int | None:
    """Number of eigenvalues below a value: negative pivots of K − λM in MUMPS' LDLᵀ; None where a pivot is zero.

    Raises
    ------
    FemtuneError : as `slepc_pairs`
    """
    start()
    with exchange_folder(_bytes(K, M)) as folder:
        below = _whole(_solve(folder, K, M, task="count", shift=eigenvalue), "below")
    return below if below >= 0 else None


def _orthonormal(shapes: Reals, M: SymmetricMatrix) -> Reals:
    """Shapes with φᵀMφ = 1 to rounding; as they come, products of close modes are about 1e-10."""
    try:
        root = la.cholesky(shapes.T @ (M @ shapes), lower=True)
    except la.LinAlgError as dependent:
        raise no_result("slepc.no-result/dependent-shapes") from dependent
    return np.asarray(la.solve_triangular(root, shapes.T, lower=True).T)


def _numbers(entries: Any, count: int) -> Reals:
    try:
        values = np.asarray(entries, dtype=float)
    except (ValueError, TypeError) as words:
        raise no_result("slepc.no-result/not-numbers", reason=words) from words
    if values.ndim != 1 or not 0 < values.size <= count or not np.isfinite(values).all():
        raise no_result("slepc.no-result/number-of-values", given=values.size, requested=count)
    return values


def _whole(result: dict[str, Any], key: str) -> int:
    if type(result[key]) is not int:
        raise no_result("slepc.no-result/not-whole", key=key)
    return int(result[key])


def _bytes(K: SymmetricMatrix, M: SymmetricMatrix) -> int:
    return sum(a.nbytes for matrix in (K, M) for a in (matrix.data, matrix.indices, matrix.indptr))


def _solve(folder: Path, K: SymmetricMatrix, M: SymmetricMatrix, **request: Any) -> dict[str, Any]:
    write_matrices(folder, K, M)
    write_request(folder, ranks=expected_ranks(), **request)
    run(folder)
    result = read_result(folder)
    needed = {"values", "errors"} if request["task"] == "modes" else {"below"}
    missing = {"ranks", *needed} - set(result)
    if missing:
        raise no_result("slepc.no-result/missing-keys", missing=", ".join(sorted(missing)))
    return result
