"""Residues for given poles, and the normal equations of a step of the poles: one pass over all functions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from femtune.arrays import Complexes, Reals
from femtune.modal import FrfSet
from femtune.modal.frf_set import KINDS

# ----------------------------------------------------------------------------------------------------
# Functions of frequency that the modal model is a sum of, and their derivatives by the poles.


OUT_OF_BAND = ("lower", "upper")
"""Real terms for what lies outside the band: a mass below it, a stiffness above it."""


@dataclass(frozen=True, eq=False)
class PartialFractions:
    """Columns of H(ω) = (iω)^d [Σ_r R_r/(iω − λ_r) + R̄_r/(iω − λ̄_r) + L/(iω)² + U].

    Parameters
    ----------
    columns : (k, 2m + terms) complex; those of Re R of every pole, then those of Im R, then the terms
    slopes : (k, 4m) derivatives by Re λ of the columns of Re R and of Im R, then those by Im λ
    """

    columns: NDArray
    slopes: NDArray


def modal_basis(freq_hz: Reals, poles: Complexes, kind: str, terms: tuple[str, ...] = OUT_OF_BAND) -> PartialFractions:
    """The columns at frequency lines.

    Parameters
    ----------
    freq_hz : (k,) above 0
    poles : (m,) in rad/s, upper half plane
    kind : of the functions
    terms : names out of OUT_OF_BAND
    """
    i_omega = 2j * np.pi * freq_hz[:, None]
    factor = i_omega ** KINDS.index(kind)
    up, down = 1.0 / (i_omega - poles), 1.0 / (i_omega - poles.conj())
    columns = [up + down, 1j * (up - down)]
    columns += [{"lower": i_omega**-2, "upper": np.ones_like(i_omega)}[name] for name in terms]
    a, b = up**2, down**2
    slopes = [a + b, 1j * (a - b), 1j * (a - b), -(a + b)]
    return PartialFractions(factor * np.hstack(columns), factor * np.hstack(slopes))


def real_rows(values: NDArray) -> Reals:
    """Real parts above imaginary parts, (2k, …)."""
    return np.concatenate([values.real, values.imag])


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
class _WeightGroup:
    """Functions that share their weights of lines."""

    coefficients: Reals
    squares: Reals
    own: Reals
    effect: Reals
    inner: Reals
    slopes_by_errors: Reals


def solve_residues(values: Complexes, basis: PartialFractions, weights: Reals | None) -> Solved:
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


def _part(values: Complexes, basis: PartialFractions, line: Reals) -> _WeightGroup:
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
    return _WeightGroup((half @ coordinates).T, squares, half @ half.T, -half @ shadow, inner, across.T @ errors)


def _variances(values: Complexes, part: _WeightGroup, basis: PartialFractions) -> Reals:
    k, q = basis.columns.shape
    freedom = max(2 * k - q - basis.slopes.shape[1] / (2 * len(values)), 1.0)
    least = LEAST_NOISE**2 * np.mean(np.abs(values) ** 2, axis=1)
    return np.maximum(part.squares / freedom, np.maximum(least, np.finfo(float).tiny))


def _together(parts: list[_WeightGroup], at: list[NDArray], variance: Reals, basis: PartialFractions) -> Solved:
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


def _shares(part: _WeightGroup, weight: Reals, m: int) -> Reals:
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


def _effects(part: _WeightGroup, m: int) -> Reals:
    """(F, m, 2, 2m)."""
    c = part.coefficients[:, : 2 * m].reshape(-1, 2, m)
    effect = part.effect[: 2 * m].reshape(2, m, 2, 2, m)
    every = np.einsum("xtapr,fpr->ftxar", effect, c, optimize=True)
    return every.reshape(len(c), m, 2, 2 * m)


# ----------------------------------------------------------------------------------------------------
# Sums over the lines that normal equations of shapes and participations are made of, function by function.


@dataclass(frozen=True, eq=False)
class LineSums:
    """With N = [1/(iω − λ), 1/(iω − λ̄), 1] at the lines that a function h has.

    Parameters
    ----------
    grams : NᴴN, (2m + 1, 2m + 1), one for each pattern of lines
    pattern : (n, u) which of them a function has
    rights : (n, u, 2m + 1) Nᴴh
    squares_of : (n, u) |h|²
    weights : (n,) of the responses
    """

    grams: tuple[Complexes, ...]
    pattern: NDArray[np.int64]
    rights: Complexes
    squares_of: Reals
    weights: Reals

    @property
    def responses(self) -> int:
        """Number of responses."""
        return len(self.pattern)

    @property
    def references(self) -> int:
        """Number of references."""
        return int(self.pattern.shape[1])

    def shape_of(self, i: int, participations: Complexes, direct: bool) -> tuple[Complexes, Reals]:
        """ψ (m,) and D (u,) of a response for given participations (m, u)."""
        m, u = participations.shape
        normal, right = np.zeros((2 * m + u, 2 * m + u)), np.zeros(2 * m + u)
        for j in range(u):
            gram, factors = self.grams[self.pattern[i, j]], participations[:, j]
            normal[: 2 * m, : 2 * m] += _normal(gram, factors)
            normal[: 2 * m, 2 * m + j] = normal[2 * m + j, : 2 * m] = _right(gram[:, -1], factors)
            normal[2 * m + j, 2 * m + j] = gram[-1, -1].real
            right[: 2 * m] += _right(self.rights[i, j], factors)
            right[2 * m + j] = self.rights[i, j, -1].real
        size = 2 * m + (u if direct else 0)
        x = _solved(normal[:size, :size], right[:size])
        return x[:m] + 1j * x[m : 2 * m], x[2 * m :] if direct else np.zeros(u)

    def factor_of(self, references: Iterable[int], shapes: Complexes, ends: Complexes, direct: Reals) -> Complexes:
        """x (m,) of Σ_r ψ_ir x_r e_jr/(iω − λ_r) for given ψ (n, m), e (u, m), over all responses."""
        m = shapes.shape[1]
        normal, right = np.zeros((2 * m, 2 * m)), np.zeros(2 * m)
        for j in references:
            for i, weight in enumerate(self.weights):
                gram, factors = self.grams[self.pattern[i, j]], shapes[i] * ends[j]
                normal += weight * _normal(gram, factors)
                right += weight * _right(self.rights[i, j] - direct[i, j] * gram[:, -1], factors)
        x = _solved(normal, right)
        return x[:m] + 1j * x[m:]

    def squares(self, shapes: Complexes, participations: Complexes, direct: Reals) -> float:
        """Weighted sum of squared errors."""
        total = 0.0
        for i, weight in enumerate(self.weights):
            for j in range(self.references):
                residue = shapes[i] * participations[:, j]
                x = np.concatenate([residue, residue.conj(), [direct[i, j]]])
                model = (x.conj() @ self.grams[self.pattern[i, j]] @ x).real
                cross = (x.conj() @ self.rights[i, j]).real
                total += weight * (self.squares_of[i, j] - 2.0 * cross + model)
        return float(max(total, 0.0))


def line_sums(frfs: FrfSet, near: Complexes) -> LineSums:
    """All sums; all responses have equal weight.

    Parameters
    ----------
    near : (k, 2m) columns 1/(iω − λ), then 1/(iω − λ̄)
    """
    n, u, k = frfs.values.shape
    known = np.isfinite(frfs.values).reshape(n * u, k)
    values = np.where(known, frfs.values.reshape(n * u, k), 0.0)
    columns = np.hstack([near, np.ones((k, 1))])
    patterns, which = np.unique(known, axis=0, return_inverse=True)
    grams = tuple(columns[p].conj().T @ columns[p] for p in patterns)
    rights = (values @ columns.conj()).reshape(n, u, -1)
    squares = np.sum(np.abs(values) ** 2, axis=1).reshape(n, u)
    mean = squares.sum(axis=1) / known.sum(axis=1).reshape(n, u).sum(axis=1)
    return LineSums(grams, which.reshape(n, u), rights, squares, 1.0 / np.where(mean > 0.0, mean, 1.0))


def _normal(gram: Complexes, factors: Complexes) -> Reals:
    """Real normal matrix of the real and imaginary parts of x in x f/(iω − λ) + conjugates."""
    m = len(factors)
    f = np.concatenate([factors, factors.conj()])
    whole = f.conj()[:, None] * gram[: 2 * m, : 2 * m] * f
    a, b, c, d = whole[:m, :m], whole[:m, m:], whole[m:, :m], whole[m:, m:]
    cross = (1j * (a - b + c - d)).real
    return np.block([[(a + b + c + d).real, cross], [cross.T, (a - b - c + d).real]])


def _right(products: Complexes, factors: Complexes) -> Reals:
    m = len(factors)
    up, down = factors.conj() * products[:m], factors * products[m : 2 * m]
    return np.concatenate([(up + down).real, (up - down).imag])


def _solved(normal: Reals, right: Reals) -> Reals:
    size = np.sqrt(np.diag(normal))
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(normal / np.outer(size, size), right / size, rcond=1e-14)[0] / size)
