"""The lowest eigenpairs through (K − σM)⁻¹, densely or by Lanczos, and how accurate they are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.factorise import Factor

Reals = NDArray[np.float64]
Pairs = tuple[Reals, Reals]

DENSE_UP_TO = 400
_MOST_ENTRIES = 20_000_000
_ACCURACY = 1e-5
_INFINITE = 1e-14
"""θ below this fraction of the largest are directions without mass."""
_POLLUTED = 1e-7
"""θ below this fraction of the largest have lost digits to the large ones."""


def lowest(
    K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, count: int, wanted: int
) -> tuple[Reals, Reals, int]:
    """At most `count` lowest eigenvalues (ascending) and mass-normalised shapes, and how many of them are accurate.

    Raises
    ------
    FemtuneError : ``eigen.inaccurate`` where one of the wanted is not, ``eigen.no-convergence``, ``eigen.negative``
    """
    try:
        values, shapes = _way(M, count)(K, M, factor, shift, count)
    except la.LinAlgError as broken:
        raise _indefinite() from broken
    order = np.argsort(values)
    values, shapes = values[order], shapes[:, order]
    _check_negative(K, values, shapes)
    error = _errors(K, M, factor, shift, values, shapes)
    bad = np.flatnonzero(~(error <= _ACCURACY))
    known = int(bad[0]) if bad.size else len(values)
    if known < min(wanted, len(values)):
        raise _inaccurate(known, float(values[known]), float(error[known]))
    return values, shapes, known


def _way(M: sp.csr_array, count: int) -> Callable[..., Pairs]:
    """Dense for small models, condensed where few DOFs have mass or most modes are wanted, Lanczos else."""
    n, heavy = M.shape[0], _with_mass(M).size
    if n <= DENSE_UP_TO:
        return _dense
    few = heavy <= DENSE_UP_TO and n * heavy <= _MOST_ENTRIES
    return _condensed if few or 2 * count >= heavy else _iterative


def _with_mass(M: sp.csr_array) -> NDArray[np.int64]:
    return np.flatnonzero(np.abs(M).sum(axis=1) > 0.0)


def _errors(K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, values: Reals, shapes: Reals) -> Reals:
    """Relative residuals Kφ − λMφ of all modes, measured as energy in (K − σM)⁻¹."""
    residual = K @ shapes - (M @ shapes) * values
    energy = np.einsum("ij,ij->j", residual, factor.solve(residual))
    return np.asarray(np.sqrt(np.abs(energy) / (values - shift)))


def _inaccurate(mode: int, value: float, error: float) -> FemtuneError:
    return FemtuneError(
        "eigen.inaccurate",
        f"mode {mode + 1} could not be computed accurately: its relative residual is {error:.1e}",
        values={"frequency (Hz)": f"{np.sqrt(max(value, 0.0)) / (2 * np.pi):.6g}"},
        hint="look for stiffnesses that are many orders of magnitude apart, and for nearly loose parts",
    )


def _indefinite() -> FemtuneError:
    """A matrix that one factorisation found positive definite, another one not."""
    return FemtuneError(
        "eigen.inaccurate",
        "the modes cannot be computed: rounding makes the stiffness matrix indefinite",
        hint="look for stiffnesses that are many orders of magnitude apart, and for nearly loose parts",
    )


def _check_negative(K: sp.csr_array, values: Reals, shapes: Reals) -> None:
    """Refuse modes of negative strain energy; that of a rigid-body mode is rounding of large parts."""
    below = np.flatnonzero(values < 0.0)
    strain = np.einsum("ij,ij->j", shapes[:, below], K @ shapes[:, below])
    parts = np.einsum("ij,ij->j", np.abs(shapes[:, below]), np.abs(K) @ np.abs(shapes[:, below]))
    if (strain < -1e-8 * parts).any():
        raise FemtuneError(
            "eigen.negative",
            f"a mode has negative strain energy: λ = {values[0]:.6g} rad²/s²",
            hint="look for negative stiffness or moduli",
        )


def _dense(K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, count: int) -> Pairs:
    """By the inverse: eigenvalues θ = 1/(λ − σ) of L⁻¹ML⁻ᵀ; M may be singular."""
    L = la.cholesky((K - shift * M).toarray(), lower=True)
    half = la.solve_triangular(L, M.toarray(), lower=True)
    inverse = la.solve_triangular(L, half.T, lower=True)
    n = K.shape[0]
    theta, y = la.eigh(0.5 * (inverse + inverse.T), subset_by_index=[max(0, n - count), n - 1])
    theta, y = _finite(theta, y)
    shapes = la.solve_triangular(L, y, lower=True, trans="T") / np.sqrt(theta)
    return _polished(K, M, shift, theta, shapes)


def _finite(theta: Reals, vectors: Reals) -> Pairs:
    finite = theta > _INFINITE * theta.max()
    return theta[finite], vectors[:, finite]


def _polished(K: sp.csr_array, M: sp.csr_array, shift: float, theta: Reals, shapes: Reals) -> Pairs:
    """Modes far above the lowest, freed of these and solved once more among themselves."""
    values, shapes = shift + 1.0 / theta, shapes.copy()
    high = theta < _POLLUTED * theta.max()
    if not high.any():
        return values, shapes
    good, X = shapes[:, ~high], shapes[:, high]
    for _ in range(2):
        X = X - good @ (good.T @ (M @ X))
    values[high], y = la.eigh(X.T @ (K @ X), X.T @ (M @ X))
    shapes[:, high] = X @ y
    return values, shapes


def _condensed(K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, count: int) -> Pairs:
    """All modes from the flexibility G of the DOFs with mass: θ of LᵀML with G = LLᵀ."""
    heavy = _with_mass(M)
    unit = np.zeros((M.shape[0], heavy.size))
    unit[heavy, np.arange(heavy.size)] = 1.0
    X = factor.solve(unit)
    G, m = X[heavy], M[heavy][:, heavy].toarray()
    L = la.cholesky(0.5 * (G + G.T), lower=True)
    first = max(0, heavy.size - count)
    theta, y = _finite(*la.eigh(L.T @ m @ L, subset_by_index=[first, heavy.size - 1]))
    return _polished(K, M, shift, theta, X @ (m @ (L @ y)) / theta**1.5)


def _iterative(K: sp.csr_array, M: sp.csr_array, factor: Factor, shift: float, count: int) -> Pairs:
    n = K.shape[0]
    inverse = spla.LinearOperator((n, n), matvec=factor.solve, dtype=np.float64)
    start = factor.solve(M @ np.random.default_rng(1).standard_normal(n))
    mass = M.copy()
    mass.eliminate_zeros()
    try:
        values, shapes = spla.eigsh(K, k=count, M=mass, sigma=shift, OPinv=inverse, v0=start, tol=0.0)
    except spla.ArpackError as error:
        raise FemtuneError(
            "eigen.no-convergence",
            f"the iteration for {count} modes did not converge: {error}",
            hint="ask for fewer modes; look for nearly loose parts",
        ) from error
    theta, shapes = _finite(1.0 / (values - shift), shapes)
    return shift + 1.0 / theta, shapes / np.sqrt(np.einsum("ij,ij->j", shapes, mass @ shapes))
