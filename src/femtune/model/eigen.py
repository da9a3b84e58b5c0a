"""Eigen-solution of K φ = λ M φ with rigid-body modes, checked by the Sturm count."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.model.configured import ModelPoint
from femtune.model.factorise import Factor, SingularMatrixError, factorise
from femtune.model.mechanisms import check_mechanisms

DENSE_UP_TO = 400
_EXTRA_MODES = 6
_ACCURACY = 1e-5


@dataclass(frozen=True)
class EigenSolution:
    """The lowest modes of a model point.

    Parameters
    ----------
    eigenvalues : (m,) λ = ω² in rad²/s², ascending
    shapes : (n_free, m), φᵀMφ = 1
    wanted : number of modes that were asked for; the others serve the derivatives
    shift, factor : σ and the factors of K − σM
    sturm_shift, sturm_count : number of eigenvalues below a shift that separates the modes found from the rest,
        counted from the inertia of K − σM; −1 where it could not be counted
    """

    point: ModelPoint = field(repr=False)
    eigenvalues: NDArray[np.float64]
    shapes: NDArray[np.float64] = field(repr=False)
    wanted: int
    shift: float
    factor: Factor = field(repr=False)
    sturm_shift: float
    sturm_count: int
    notices: tuple[Notice, ...] = ()

    @property
    def freq_hz(self) -> NDArray[np.float64]:
        """Natural frequencies of the wanted modes; rigid-body modes come out as (nearly) zero."""
        return np.sqrt(np.maximum(self.eigenvalues[: self.wanted], 0.0)) / (2.0 * np.pi)


def solve_modes(point: ModelPoint, count: int | None = None, max_hz: float | None = None) -> EigenSolution:
    """The `count` lowest modes, or all up to `max_hz`, proven complete by the Sturm count.

    Raises
    ------
    FemtuneError : ``eigen.mechanism`` (a motion without stiffness and mass, naming the DOFs), ``eigen.no-mass``,
        ``eigen.no-dofs``, ``eigen.missed-modes``, ``eigen.inaccurate`` or ``eigen.negative``
    """
    K, M = point.stiffness, point.mass
    _check_matrices(point, M)
    shift, factor = _spectral_shift(point, K, M)
    possible = int((np.abs(M).sum(axis=1) > 0).sum())
    if max_hz is not None:
        count = _count_below(K, M, (2.0 * np.pi * max_hz) ** 2) or 1
    wanted = min(count or 10, possible)
    for extra in (_EXTRA_MODES, 4 * _EXTRA_MODES):
        values, shapes = _lowest(K, M, factor, shift, min(wanted + extra, possible))
        checked, below = _sturm(K, M, values, wanted)
        if below is None or below == checked[1]:
            break
    else:
        raise FemtuneError(
            "eigen.missed-modes",
            f"{below} eigenvalues lie below {checked[0]:.6g} rad²/s², but {checked[1]} were found",
            hint="ask for a few modes more",
        )
    wanted, notices = _whole_wanted(values, wanted, below)
    return EigenSolution(
        point, values, shapes, wanted, shift, factor, checked[0], -1 if below is None else below, notices
    )


def _whole_wanted(values: NDArray, wanted: int, below: int | None) -> tuple[int, tuple[Notice, ...]]:
    wanted = min(wanted, len(values))
    if below is not None:
        return wanted, ()
    text = "the modes could not be counted: the factorisation's pivots hide the inertia"
    return wanted, (Notice("eigen.not-counted", text),)


def _check_matrices(point: ModelPoint, M: sp.csr_array) -> None:
    name = point.configured.configuration.name
    if not point.configured.n_free:
        raise FemtuneError(
            "eigen.no-dofs", f"configuration {name}: every DOF is held", hint="remove supports; femtune info lists them"
        )
    if not np.abs(M.data).sum():
        raise FemtuneError(
            "eigen.no-mass", f"configuration {name}: the model has no mass", hint="give the materials a density"
        )


def _spectral_shift(point: ModelPoint, K: sp.csr_array, M: sp.csr_array) -> tuple[float, Factor]:
    """A shift below zero of the size of the lowest elastic eigenvalues, and the factors there.

    A shift much nearer to zero loses digits of the higher modes to the rigid-body ones; one much further away
    slows the iteration.
    """
    k, m = K.diagonal(), M.diagonal()
    ratios = k[m > 0] / m[m > 0]
    positive = ratios[ratios > 0]
    size = 1e-4 * positive.min() if positive.size else 1.0
    factor = _factor_below(point, K, M, size)
    better = _elastic_size(K, M, factor, size)
    if not 1e-3 < size / better < 1e2:
        size = better
        factor = _factor_below(point, K, M, size)
    return -size, factor


def _factor_below(point: ModelPoint, K: sp.csr_array, M: sp.csr_array, size: float) -> Factor:
    shifted = sp.csr_array(K + size * M)
    try:
        factor = factorise(shifted)
    except SingularMatrixError:
        factor = None
    check_mechanisms(point, shifted, factor)
    assert factor is not None
    if factor.negative_pivots:
        raise FemtuneError(
            "eigen.negative",
            f"the stiffness matrix has {factor.negative_pivots} negative eigenvalues",
            values={"configuration": point.configured.configuration.name},
            hint="look for negative stiffness, moduli or masses",
        )
    return factor


def _elastic_size(K: sp.csr_array, M: sp.csr_array, factor: Factor, size: float) -> float:
    """Rough size of the lowest elastic eigenvalue, by a few inverse iterations on a small block."""
    n = K.shape[0]
    block = np.random.default_rng(0).standard_normal((n, min(n, 8)))
    for _ in range(3):
        block = la.qr(factor.solve(M @ block), mode="economic")[0]
    k, m = block.T @ (K @ block), block.T @ (M @ block)
    theta = la.eigvalsh(m, k + size * m)
    values = 1.0 / theta[theta > 1e-8 * theta[-1]] - size
    elastic = values[values > 1e-6 * values.max()]
    return float(elastic.min()) if elastic.size and elastic.min() > 0 else size


def _lowest(
    K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n = K.shape[0]
    dense = n <= DENSE_UP_TO or count >= n - 1
    values, shapes = (_dense if dense else _iterative)(K, M, factor, shift, count)
    order = np.argsort(values)
    values, shapes = values[order], shapes[:, order]
    _check_accuracy(K, M, factor, shift, values, shapes)
    return values, shapes


def _check_accuracy(
    K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, values: NDArray, shapes: NDArray
) -> None:
    """Refuse modes whose residual Kφ − λMφ, measured as energy in (K − σM)⁻¹, is not small."""
    residual = K @ shapes - (M @ shapes) * values
    energy = np.einsum("ij,ij->j", residual, factor.solve(residual))
    error = np.sqrt(np.abs(energy) / (values - shift))
    worst = int(np.argmax(error))
    if not error[worst] <= _ACCURACY:
        raise FemtuneError(
            "eigen.inaccurate",
            f"mode {worst + 1} could not be computed accurately: its relative residual is {error[worst]:.1e}",
            values={"frequency (Hz)": f"{np.sqrt(max(values[worst], 0.0)) / (2 * np.pi):.6g}"},
            hint="look for stiffnesses that are many orders of magnitude apart, and for nearly loose parts",
        )


def _dense(
    K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """By the inverse: eigenvalues θ = 1/(λ − σ) of L⁻¹ML⁻ᵀ; M may be singular."""
    L = la.cholesky((K - shift * M).toarray(), lower=True)
    half = la.solve_triangular(L, M.toarray(), lower=True)
    inverse = la.solve_triangular(L, half.T, lower=True)
    n = K.shape[0]
    theta, y = la.eigh(0.5 * (inverse + inverse.T), subset_by_index=[max(0, n - count), n - 1])
    finite = theta > 1e-14 * theta[-1]
    theta, y = theta[finite], y[:, finite]
    return shift + 1.0 / theta, la.solve_triangular(L, y, lower=True, trans="T") / np.sqrt(theta)


def _iterative(
    K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n = K.shape[0]
    inverse = spla.LinearOperator((n, n), matvec=factor.solve, dtype=np.float64)
    start = factor.solve(M @ np.random.default_rng(1).standard_normal(n))
    values, shapes = spla.eigsh(K, k=count, M=M, sigma=shift, OPinv=inverse, v0=start, tol=0.0)
    return values, shapes / np.sqrt(np.einsum("ij,ij->j", shapes, M @ shapes))


def _sturm(
    K: sp.csr_array, M: sp.csr_array, values: NDArray[np.float64], wanted: int
) -> tuple[tuple[float, int], int | None]:
    """((shift, number of modes found below it), number of eigenvalues below it).

    The shift lies in the widest relative gap at or above the wanted modes.
    """
    if len(values) <= wanted:
        shift, found = float(values[-1]) * 1.01 + 1e-6 * abs(float(values[0])), len(values)
    else:
        upper = values[wanted - 1 :]
        i = int(np.argmax(np.diff(upper) / np.abs(upper[1:])))
        shift, found = 0.5 * float(upper[i] + upper[i + 1]), wanted + i
    return (shift, found), _count_below(K, M, shift)


def _count_below(K: sp.csr_array, M: sp.csr_array, eigenvalue: float) -> int | None:
    """Number of eigenvalues below a value: negative pivots of K − λM."""
    for nudge in (1.0, 1.0 + 1e-7):
        try:
            return factorise(sp.csr_array(K - nudge * eigenvalue * M)).negative_pivots
        except SingularMatrixError:
            continue
    return None
