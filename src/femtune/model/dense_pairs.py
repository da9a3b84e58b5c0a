"""The lowest eigenpairs of small problems: densely, or from the flexibility of the DOFs that have mass."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.model.pencil import Inverse, Pencil

Reals = NDArray[np.float64]
Pairs = tuple[Reals, Reals]

_INFINITE = 1e-14
"""θ below this fraction of the largest are directions without mass."""
_POLLUTED = 1e-7
"""θ below this fraction of the largest have lost digits to the large ones."""


def dense(pencil: Pencil, shift: float, count: int) -> Pairs:
    """By the inverse: eigenvalues θ = 1/(λ − σ) of L⁻¹ML⁻ᵀ; M may be singular."""
    L = la.cholesky(pencil.shifted(shift).full().toarray(), lower=True)
    half = la.solve_triangular(L, pencil.M.full().toarray(), lower=True)
    inverse = la.solve_triangular(L, half.T, lower=True)
    n = pencil.n
    theta, y = la.eigh(0.5 * (inverse + inverse.T), subset_by_index=[max(0, n - count), n - 1])
    theta, y = finite(theta, y)
    shapes = la.solve_triangular(L, y, lower=True, trans="T") / np.sqrt(theta)
    return _polished(pencil, shift, theta, shapes)


def condensed(inverse: Inverse, count: int) -> Pairs:
    """All modes from the flexibility G of the DOFs with mass: θ of LᵀML with G = LLᵀ."""
    pencil, heavy = inverse.pencil, inverse.pencil.heavy
    unit = np.zeros((pencil.n, heavy.size), order="F")
    unit[heavy, np.arange(heavy.size)] = 1.0
    X = inverse.solve(unit)
    G, m = X[heavy], pencil.M.full()[heavy][:, heavy].toarray()
    L = la.cholesky(0.5 * (G + G.T), lower=True)
    first = max(0, heavy.size - count)
    theta, y = finite(*la.eigh(L.T @ m @ L, subset_by_index=[first, heavy.size - 1]))
    return _polished(pencil, inverse.shift, theta, X @ (m @ (L @ y)) / theta**1.5)


def finite(theta: Reals, vectors: Reals) -> Pairs:
    """θ that are not zero, and their vectors."""
    some = theta > _INFINITE * theta.max()
    if some.all():
        return theta, vectors
    return theta[some], vectors[:, some]


def _polished(pencil: Pencil, shift: float, theta: Reals, shapes: Reals) -> Pairs:
    """Modes far above the lowest, freed of these and solved once more among themselves."""
    values, shapes = shift + 1.0 / theta, shapes.copy()
    high = theta < _POLLUTED * theta.max()
    if not high.any():
        return values, shapes
    good, X = shapes[:, ~high], shapes[:, high]
    for _ in range(2):
        X = X - good @ (good.T @ (pencil.mass @ X))
    values[high], y = la.eigh(X.T @ (pencil.stiffness @ X), X.T @ (pencil.mass @ X))
    shapes[:, high] = X @ y
    return values, shapes
