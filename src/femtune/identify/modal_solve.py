"""Residues for given poles, and the normal equations of a step of the poles: one pass over all functions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from femtune.identify.modal_basis import Basis, real_rows

Reals = NDArray[np.float64]
Complex = NDArray[np.complex128]

LEAST_NOISE = 1e-9
"""Noise of a function that is fitted exactly is taken as this part of its size, so that it stays a number."""


@dataclass(frozen=True, eq=False)
class Solved:
    """F functions at given poles, q columns.

    Parameters
    ----------
    coefficients : (F, q) of the basis
    squares : (F,) sums of squared errors, by the lines' weights
    variance : (F,) of one real part at weight 1
    own : (F, m, 2, 2) covariances of (Re R, Im R) at unit variance, for given poles
    pole_effect : (F, m, 2, 2m) their change with (Re λ, Im λ)
    normal, gradient : (2m, 2m), (2m,) of a Gauss-Newton step of (Re λ, Im λ)
    shares : (m,) sum over the functions of gᵀN⁻¹g of each pole, g and N being their parts of gradient and normal matrix
    """

    coefficients: Reals
    squares: Reals
    variance: Reals
    own: Reals
    pole_effect: Reals
    normal: Reals
    gradient: Reals
    shares: Reals


@dataclass(frozen=True, eq=False)
class _Part:
    """Functions that share their weights of lines."""

    coefficients: Reals
    squares: Reals
    own: Reals
    effect: Reals
    inner: Reals
    slopes_by_errors: Reals


def solve_residues(values: Complex, basis: Basis, weights: Reals | None) -> Solved:
    """Fit all functions.

    Parameters
    ----------
    values : (F, k)
    basis : of the lines
    weights : (F, k) inverses of the standard deviation of one real part, or None: one unknown level a function
    """
    shared = weights is None or np.allclose(weights, weights[:1] * (weights[:, :1] / weights[:1, :1]), rtol=1e-9)
    if shared:
        line = np.ones(values.shape[1]) if weights is None else weights[0]
        level = np.ones(len(values)) if weights is None else weights[:, 0] / weights[0, 0]
        parts = [_part(values, basis, line)]
        variance = _variances(values, parts[0], basis) if weights is None else level**-2.0
        return _together(parts, [np.arange(len(values))], variance, basis)
    assert weights is not None
    parts = [_part(values[[f]], basis, weights[f]) for f in range(len(values))]
    return _together(parts, [np.array([f]) for f in range(len(values))], np.ones(len(values)), basis)


def _part(values: Complex, basis: Basis, line: Reals) -> _Part:
    rows = real_rows(np.hstack([basis.columns, basis.slopes]) * line[:, None])
    q = basis.columns.shape[1]
    columns, slopes, data = rows[:, :q], rows[:, q:], real_rows((values * line).T)
    scale = np.linalg.norm(columns, axis=0)
    Q, R = qr(columns / scale, mode="economic", check_finite=False)
    shadow = Q.T @ slopes
    across = slopes - Q @ shadow
    coordinates = Q.T @ data
    errors = data - Q @ coordinates
    half = solve_triangular(R, np.eye(q)) / scale[:, None]
    squares, inner = np.sum(errors**2, axis=0), across.T @ across
    squares, inner = np.sum(errors**2, axis=0), across.T @ across
    return _Part((half @ coordinates).T, squares, half @ half.T, -half @ shadow, inner, across.T @ errors)


def _variances(values: Complex, part: _Part, basis: Basis) -> Reals:
    k, q = basis.columns.shape
    freedom = max(2 * k - q - basis.slopes.shape[1] / (2 * len(values)), 1.0)
    least = LEAST_NOISE**2 * np.mean(np.abs(values) ** 2, axis=1)
    return np.maximum(part.squares / freedom, np.maximum(least, np.finfo(float).tiny))


def _together(parts: list[_Part], at: list[NDArray], variance: Reals, basis: Basis) -> Solved:
    m = basis.slopes.shape[1] // 4
    normal, gradient = np.zeros((2, m, 2, m)), np.zeros((2, m))
    for part, f in zip(parts, at):
        c = part.coefficients[:, : 2 * m].reshape(-1, 2, m)
        product = np.einsum("fpr,fqs,f->prqs", c, c, 1.0 / variance[f], optimize=True)
        normal += np.einsum("aprbqs,prqs->arbs", part.inner.reshape(2, 2, m, 2, 2, m), product)
        gradient += np.einsum("aprf,fpr,f->ar", part.slopes_by_errors.reshape(2, 2, m, -1), c, 1.0 / variance[f])
    return Solved(
        np.concatenate([part.coefficients for part in parts]),
        np.concatenate([part.squares for part in parts]),
        variance,
        np.concatenate([np.repeat(_blocks(part.own, m)[None], len(f), axis=0) for part, f in zip(parts, at)]),
        np.concatenate([_effects(part, m) for part in parts]),
        normal.reshape(2 * m, 2 * m),
        gradient.reshape(2 * m),
        np.sum([_shares(part, 1.0 / variance[f], m) for part, f in zip(parts, at)], axis=0),
    )


def _shares(part: _Part, weight: Reals, m: int) -> Reals:
    """gᵀN⁻¹g summed over the functions of a part; of a function in which the mode does not move, nothing."""
    c = part.coefficients[:, : 2 * m].reshape(-1, 2, m)
    inner = np.einsum("aprbqr->apbqr", part.inner.reshape(2, 2, m, 2, 2, m))
    normal = np.einsum("apbqr,fpr,fqr->frab", inner, c, c, optimize=True)
    gradient = np.einsum("aprf,fpr->fra", part.slopes_by_errors.reshape(2, 2, m, -1), c)
    steps = np.linalg.pinv(normal, hermitian=True) @ gradient[..., None]
    return np.einsum("fra,fra,f->r", gradient, steps[..., 0], weight)


def _blocks(own: Reals, m: int) -> Reals:
    """(m, 2, 2) of real and imaginary part of each residue."""
    whole = own[: 2 * m, : 2 * m].reshape(2, m, 2, m)
    return np.einsum("arbr->rab", whole)


def _effects(part: _Part, m: int) -> Reals:
    """(F, m, 2, 2m)."""
    c = part.coefficients[:, : 2 * m].reshape(-1, 2, m)
    effect = part.effect[: 2 * m].reshape(2, m, 2, 2, m)
    every = np.einsum("xtapr,fpr->ftxar", effect, c, optimize=True)
    return every.reshape(len(c), m, 2, 2 * m)
