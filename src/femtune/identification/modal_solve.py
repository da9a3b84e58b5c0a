"""Residues for given poles, and the normal equations of a step of the poles: one pass over all functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from femtune.arrays import Complexes, Reals
from femtune.modal.frf_set import KINDS

# ----------------------------------------------------------------------------------------------------
# Functions of frequency that the modal model is a sum of, and their derivatives by the poles.


@dataclass(frozen=True)
class WindowedMass:
    """The term L/(iω + σ)² of a mass below the band in functions with an exponential window, σ in rad/s."""

    decay: float


OutsideTerms = tuple[str | WindowedMass, ...]
OUT_OF_BAND: OutsideTerms = ("lower", "upper")
"""Real terms for what lies outside the band: a mass below it, a stiffness above it."""


def outside_terms(decay: float) -> OutsideTerms:
    """`OUT_OF_BAND` of functions with an exponential window, σ = `decay` in rad/s."""
    return (WindowedMass(decay), "upper") if decay else OUT_OF_BAND


@dataclass(frozen=True, eq=False)
class PartialFractions:
    """Columns of H(ω) = (iω)^d [Σ_r R_r/(iω − λ_r) + R̄_r/(iω − λ̄_r) + L/(iω)² + U].

    Parameters
    ----------
    columns : (k, 2pm + terms) complex; those of Re R of every pole, then those of Im R, then the terms. With
        `transients` (p > 1) those of the residues of the transients follow Im R
    by_decay : (k, 2pm) derivatives by Re λ of the columns of every residue
    poles : m
    """

    columns: NDArray
    by_decay: NDArray
    poles: int

    @property
    def slopes(self) -> NDArray:
        """(k, 4pm) derivatives by Re λ of the columns of every residue, then those by Im λ."""
        return np.hstack([self.by_decay, turned(self.by_decay, self.poles)])

    def by_poles(self, residues: Complexes) -> Complexes:
        """(k, 2m) derivatives by Re λ and Im λ of a function with (m,) residues, without transients."""
        parts = self.slopes.reshape(-1, 2, 2, self.poles)
        return np.asarray((parts[:, :, 0] * residues.real + parts[:, :, 1] * residues.imag).reshape(len(parts), -1))


def turned(by_decay: NDArray, poles: int) -> NDArray:
    """Derivatives by Im λ of the columns of all residues, on the last axis, from those by Re λ.

    The column of Im R is i times that of Re R for each of the two fractions, and so is a step of λ.
    """
    values = by_decay.reshape(*by_decay.shape[:-1], -1, 2, poles)
    return np.stack([values[..., 1, :], -values[..., 0, :]], axis=-2).reshape(by_decay.shape)


def with_transients(
    basis: PartialFractions,
    freq_hz: Reals,
    poles: Complexes,
    force: Complexes,
    step_s: float,
    begins: Sequence[int] = (0,),
) -> PartialFractions:
    """The columns of H + T/U for the transform U of a force, where T is what the ends of a record leave out.

    T is the transform of sampled decays with residues of their own of each pole; two complex terms stand for poles
    outside of the band. Each piece of which a record consists has a T of its own, that begins where the piece does.

    Parameters
    ----------
    begins : first sample of each piece, from 0 on
    """
    turn = 2j * np.pi * step_s * freq_hz[:, None]
    up, down = np.exp(poles * step_s - turn), np.exp(poles.conj() * step_s - turn)
    a, b = (step_s / (1.0 - one) / force[:, None] for one in (up, down))
    c, d = (step_s**2 * one / (1.0 - one) ** 2 / force[:, None] for one in (up, down))
    z = freq_hz[:, None] / freq_hz[-1]
    ends = np.hstack([np.ones_like(z), 1j * np.ones_like(z), z, 1j * z]) / force[:, None]
    later = [np.exp(-turn * begin) for begin in begins]
    decays, slopes = np.hstack([a + b, 1j * (a - b)]), np.hstack([c + d, 1j * (c - d)])
    m = 2 * len(poles)
    return PartialFractions(
        np.hstack(
            [basis.columns[:, :m], *(decays * e for e in later), basis.columns[:, m:], *(ends * e for e in later)]
        ),
        np.hstack([basis.by_decay, *(slopes * e for e in later)]),
        len(poles),
    )


def with_cut_decays(
    basis: PartialFractions, freq_hz: Reals, poles: Complexes, kind: str, force: Complexes, pulse: Reals, step_s: float
) -> PartialFractions:
    """The columns of H + T/U for a record from rest, where T is the decay that its end cuts off.

    T has no residues of its own: at the end the response is R w(λ) with w = λ^d ∫ u e^{λ(t_end − τ)} dτ, and decays.

    Parameters
    ----------
    force : (k,) U at the lines, which are those of the transform of the record
    pulse : (samples,) u
    """
    m, d = len(poles), KINDS.index(kind)
    left_s = step_s * np.arange(len(pulse), 0, -1)
    at = np.flatnonzero(np.abs(pulse) > 0.0)
    decays = pulse[at, None] * np.exp(left_s[at, None] * poles)
    scale = step_s * poles**d
    size = scale * decays.sum(axis=0)
    slope = scale * (left_s[at, None] * decays).sum(axis=0) + size * d / poles
    i_omega, columns, slopes = 2j * np.pi * freq_hz[:, None], [], []
    for pole, w, dw in ((poles, size, slope), (poles.conj(), size.conj(), slope.conj())):
        turn = np.exp((pole - i_omega) * step_s)
        part = -1.0 / (1.0 - turn) / force[:, None]
        columns.append(w * part)
        slopes.append(dw * part + w * part * step_s * turn / (1.0 - turn))
    (up, down), (a, b) = columns, slopes
    return PartialFractions(
        basis.columns
        + np.hstack([up + down, 1j * (up - down), np.zeros((len(freq_hz), basis.columns.shape[1] - 2 * m))]),
        basis.by_decay + np.hstack([a + b, 1j * (a - b)]),
        m,
    )


def modal_basis(freq_hz: Reals, poles: Complexes, kind: str, terms: OutsideTerms = OUT_OF_BAND) -> PartialFractions:
    """The columns at frequency lines.

    Parameters
    ----------
    freq_hz : (k,) above 0
    poles : (m,) in rad/s, upper half plane
    kind : of the functions
    terms : out of OUT_OF_BAND, or of `outside_terms`
    """
    i_omega = 2j * np.pi * freq_hz[:, None]
    factor = i_omega ** KINDS.index(kind)
    up, down = 1.0 / (i_omega - poles), 1.0 / (i_omega - poles.conj())
    columns = [up + down, 1j * (up - down)]
    columns += [_outside(term, i_omega) for term in terms]
    a, b = up**2, down**2
    by_decay = np.hstack([a + b, 1j * (a - b)])
    return PartialFractions(factor * np.hstack(columns), factor * by_decay, len(poles))


def _outside(term: str | WindowedMass, i_omega: NDArray) -> NDArray:
    if isinstance(term, WindowedMass):
        return np.asarray((i_omega + term.decay) ** -2)
    return {"lower": i_omega**-2, "upper": np.ones_like(i_omega)}[term]


def real_rows(values: NDArray) -> Reals:
    """Real parts above imaginary parts, (2k, …)."""
    return np.concatenate([values.real, values.imag])


LEAST_NOISE = 1e-9
"""Noise of a function that is fitted exactly is taken as this part of its size, so that it stays a number."""


@dataclass(frozen=True, eq=False)
class _WeightGroup:
    """Functions that share their weights of lines."""

    coefficients: Reals
    squares: Reals
    own: Reals
    effect: Reals
    inner: Reals
    slopes_by_errors: Reals


@dataclass(frozen=True, eq=False)
class Solved:
    """F functions at given poles, q columns. What only the end of a fit needs is computed when it is requested.

    Parameters
    ----------
    coefficients : (F, q) of the basis
    squares : (F,) sums of squared errors, by the lines' weights
    variance : (F,) of one real part at weight 1
    normal, gradient : (2m, 2m), (2m,) of a Gauss-Newton step of (Re λ, Im λ)
    parts : the fits of functions that share their weights, in order
    """

    coefficients: Reals
    squares: Reals
    variance: Reals
    normal: Reals
    gradient: Reals
    parts: Sequence[_WeightGroup]

    @property
    def _poles(self) -> int:
        return len(self.gradient) // 2

    @cached_property
    def own(self) -> Reals:
        """(F, m, 2, 2) covariances of (Re R, Im R) at unit variance, for given poles."""
        m = self._poles
        return np.concatenate([np.repeat(_blocks(p.own, m)[None], len(p.coefficients), axis=0) for p in self.parts])

    @cached_property
    def pole_effect(self) -> Reals:
        """(F, m, 2, 2m) their change with (Re λ, Im λ)."""
        return np.concatenate([_effects(part, self._poles) for part in self.parts])

    @cached_property
    def shares(self) -> Reals:
        """(m,) sum over the functions of gᵀN⁻¹g of each pole, for their parts g and N of gradient and normal matrix."""
        ends = np.cumsum([len(part.coefficients) for part in self.parts])
        weights = np.split(1.0 / self.variance, ends[:-1])
        return np.asarray(sum(_shares(part, w, self._poles) for part, w in zip(self.parts, weights)))


def solve_residues(
    values: Complexes, basis: PartialFractions, weights: Reals | None, poles: int, line: Reals | None = None
) -> Solved:
    """Fit all functions.

    Parameters
    ----------
    values : (F, k)
    basis : of the lines
    weights : (F, k) inverses of the standard deviation of one real part, or None: one unknown level a function
    poles : m of the basis
    line : (k,) without `weights`, how the inverse of that standard deviation goes with the lines; constant where None
    """
    if weights is None and line is not None:
        part = _part(values, basis, line)
        return _together([part], _variances(values * line, part, basis, poles), poles)
    shared = weights is None or np.allclose(weights, weights[:1] * (weights[:, :1] / weights[:1, :1]), rtol=1e-9)
    if shared:
        line = np.ones(values.shape[1]) if weights is None else weights[0]
        level = np.ones(len(values)) if weights is None else weights[:, 0] / weights[0, 0]
        parts = [_part(values, basis, line)]
        variance = _variances(values, parts[0], basis, poles) if weights is None else level**-2.0
        return _together(parts, variance, poles)
    assert weights is not None
    parts = [_part(values[[f]], basis, weights[f]) for f in range(len(values))]
    return _together(parts, np.ones(len(values)), poles)


def _part(values: Complexes, basis: PartialFractions, line: Reals) -> _WeightGroup:
    rows = real_rows(np.hstack([basis.columns, basis.by_decay]) * line[:, None])
    q, m = basis.columns.shape[1], basis.poles
    columns, slopes, data = rows[:, :q], rows[:, q:], real_rows((values * line).T)
    scale = np.linalg.norm(columns, axis=0)
    Q, R = qr(columns / scale, mode="economic", check_finite=False)
    shadow = Q.T @ slopes
    across = slopes - Q @ shadow
    half = across.T @ across
    inner = np.hstack([half, turned(half, m)])
    inner = np.vstack([inner, turned(inner.T, m).T])
    coordinates = Q.T @ data
    errors = data - Q @ coordinates
    back = solve_triangular(R, np.eye(q)) / scale[:, None]
    squares, by_errors = np.sum(errors**2, axis=0), across.T @ errors
    by_errors = np.vstack([by_errors, turned(by_errors.T, m).T])
    shadow = np.hstack([shadow, turned(shadow, m)])
    return _WeightGroup((back @ coordinates).T, squares, back @ back.T, -back @ shadow, inner, by_errors)


def left_squares(values: Complexes, columns: Complexes, line: Reals | None = None) -> Reals:
    """(F,) the `squares` of a fit of one unknown level a function, which no step follows."""
    line = np.ones(values.shape[1]) if line is None else line
    rows, data = real_rows(columns * line[:, None]), real_rows((values * line).T)
    Q = qr(rows / np.linalg.norm(rows, axis=0), mode="economic", check_finite=False)[0]
    return np.asarray(np.sum((data - Q @ (Q.T @ data)) ** 2, axis=0))


def _variances(values: Complexes, part: _WeightGroup, basis: PartialFractions, poles: int) -> Reals:
    k, q = basis.columns.shape
    freedom = max(2 * k - q - 2 * poles / len(values), 1.0)
    least = LEAST_NOISE**2 * np.mean(np.abs(values) ** 2, axis=1)
    return np.maximum(part.squares / freedom, np.maximum(least, np.finfo(float).tiny))


def _together(parts: Sequence[_WeightGroup], variance: Reals, m: int) -> Solved:
    p = parts[0].inner.shape[0] // (2 * m)  # residues of a pole: real and imaginary parts
    normal, gradient = np.zeros((2, m, 2, m)), np.zeros((2, m))
    ends = np.cumsum([len(part.coefficients) for part in parts])
    for part, w in zip(parts, np.split(1.0 / variance, ends[:-1])):
        c = part.coefficients[:, : p * m]
        weighted = c * w[:, None]
        product = (weighted.T @ c).reshape(p, m, p, m)
        normal += np.einsum("aprbqs,prqs->arbs", part.inner.reshape(2, p, m, 2, p, m), product)
        slopes = part.slopes_by_errors.reshape(2, p, m, -1)
        gradient += np.einsum("aprf,fpr->ar", slopes, weighted.reshape(-1, p, m))
    return Solved(
        np.concatenate([part.coefficients for part in parts]),
        np.concatenate([part.squares for part in parts]),
        variance,
        normal.reshape(2 * m, 2 * m),
        gradient.reshape(2 * m),
        parts,
    )


def _shares(part: _WeightGroup, weight: Reals, m: int) -> Reals:
    """gᵀN⁻¹g summed over the functions of a part; of a function in which the mode does not move, nothing."""
    p = part.inner.shape[0] // (2 * m)
    c = part.coefficients[:, : p * m].reshape(-1, p, m)
    inner = np.einsum("aprbqr->apbqr", part.inner.reshape(2, p, m, 2, p, m))
    normal = np.einsum("apbqr,fpr,fqr->frab", inner, c, c, optimize=True)
    gradient = np.einsum("aprf,fpr->fra", part.slopes_by_errors.reshape(2, p, m, -1), c)
    steps = np.linalg.pinv(normal, hermitian=True) @ gradient[..., None]
    return np.einsum("fra,fra,f->r", gradient, steps[..., 0], weight)


def _blocks(own: Reals, m: int) -> Reals:
    """(m, 2, 2) of real and imaginary part of each residue."""
    whole = own[: 2 * m, : 2 * m].reshape(2, m, 2, m)
    return np.einsum("arbr->rab", whole)


def _effects(part: _WeightGroup, m: int) -> Reals:
    """(F, m, 2, 2m)."""
    p = part.inner.shape[0] // (2 * m)
    c = part.coefficients[:, : p * m].reshape(-1, p, m)
    effect = part.effect[: 2 * m].reshape(2, m, 2, p, m)
    every = np.einsum("xtapr,fpr->ftxar", effect, c, optimize=True)
    return every.reshape(len(c), m, 2, 2 * m)
