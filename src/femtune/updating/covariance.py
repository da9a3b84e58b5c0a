"""Standard deviations and intervals of updated parameters.

Source: G. A. F. Seber, C. J. Wild, Nonlinear Regression, 1989, sections 2.1 and 5.1 (linear approximation).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from femtune.arrays import Reals
from femtune.residuals.kinds import Scatter
from femtune.selection import determined
from femtune.updating.posterior import BoxPosterior, box_posterior

NOTHING_LOST: Mapping[str, int] = MappingProxyType({})

_UNDETERMINED_SHARE = 0.05
"""A parameter has no σ if undetermined combinations hold this share of it or more; as in the bootstrap."""
_BY_CHANCE = 0.01
"""Significance level above which residuals are larger than stated."""
_LEAST_FREEDOM = 0.5
"""Degrees of freedom, which need not be integers, at or below which residuals say nothing of their own size."""


@dataclass(frozen=True)
class ParameterCovariance:
    """Covariance of x (k, k), NaN in rows and columns for which none is given, with the reason by position.

    Parameters
    ----------
    without_bounds : (k, k) of the linear estimate, in which parameters at a bound are fixed
    misfit : by kind of residual, the root mean square of the residuals in units of their stated standard deviations,
        corrected for the fitted parameters: 1 if the stated standard deviations are correct
    degrees_of_freedom : of the variance estimate; infinite for stated standard deviations
    widened : kinds whose residuals are significantly larger than stated, so that their variance was estimated
    freedom : by kind of residual, how many residuals the parameters leave free
    posterior : distribution within the bounds; None if it is not known
    """

    without_bounds: Reals
    reasons: dict[int, str]
    misfit: dict[str, float]
    degrees_of_freedom: float = np.inf
    widened: tuple[str, ...] = ()
    freedom: dict[str, float] = field(default_factory=dict)
    posterior: BoxPosterior | None = field(default=None, repr=False)

    @cached_property
    def matrix(self) -> Reals:
        """(k, k) covariance; of the distribution within the bounds where they cut off a part of it."""
        if self.posterior is None or not self.posterior.truncated:
            return self.without_bounds
        return np.where(np.isnan(self.without_bounds), np.nan, self.posterior.covariance)

    @property
    def sd(self) -> Reals:
        """(k,) standard deviations, NaN if none is given."""
        return np.sqrt(np.diag(self.matrix))

    def coverage_factor(self, level: float = 0.95) -> float:
        """Half width of an interval in standard deviations: normal, or Student's t if the variance is estimated."""
        return float(stdtrit(self.degrees_of_freedom, 0.5 + 0.5 * level))


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds of the parameters, and the other constraints on them.

    Parameters
    ----------
    x : (k,) parameters at the solution
    lower, upper : (k,) their bounds
    prior_residuals : (m,) values of the rows of the prior
    pull : (k,) gradient of side constraints that are no information
    """

    x: Reals
    lower: Reals
    upper: Reals
    prior_residuals: Reals
    pull: Reals


@dataclass(frozen=True)
class _Fit:
    """The linear estimate: x̂ = −E r, E = H⁻¹·rowsᵀ (k, n + m) for data and prior rows, on determined combinations."""

    rows: Reals
    inverse: Reals
    undetermined: Reals

    @property
    def estimator(self) -> Reals:
        return np.asarray(self.inverse @ self.rows.T)

    def covariance(self, sizes: Reals, noise: Reals | None) -> Reals:
        """Covariance of the estimate, from the sizes of the errors of the rows (n + m,).

        With `noise`, the covariance of rowsᵀ·errors, from that instead.
        """
        if noise is not None:
            return np.asarray(self.inverse @ noise @ self.inverse)
        spread = self.estimator * sizes
        return np.asarray(spread @ spread.T)


def parameter_covariance(
    r: Reals,
    J: Reals,
    kinds: Sequence[str],
    extra: Reals,
    at_bound: NDArray[np.bool_],
    prior_sd: Reals,
    moving: NDArray[np.bool_] | None = None,
    scatter: Scatter = "stated",
    lost: Mapping[str, int] = NOTHING_LOST,
    box: Box | None = None,
    noise: Reals | None = None,
) -> ParameterCovariance:
    """Covariance of the least-squares estimate, H⁻¹(JᵀS²J + RᵀR)H⁻¹ with H = JᵀJ + RᵀR, of parameters not at a bound.

    With stated standard deviations S is one, except for kinds of residual whose sum of squares is significant (one
    per cent point of χ² with the freedom that the parameters leave them): there it is their misfit, so that the result
    is wider. A kind that fits better does not narrow it: a large standard deviation of the shapes does not concern the
    frequencies. With
    estimated variance the stated deviations are relative weights, and S² = rᵀr/(n − rank) for all residuals.

    Parameters
    ----------
    r, J : (n,), (n, k) residuals in units of their standard deviations, and Jacobian
    kinds : (n,) kind of each residual
    extra : (m, k) rows R of a prior, (0, k) without
    at_bound : (k,) parameters at a bound get no standard deviation
    prior_sd : (k,) spreads that tell whether a parameter is determined
    moving : (k,) parameters that the update moves, all where it is None; the others get no standard deviation
    lost : by kind, combinations of residuals that vanish whatever the noise: one of each shape of unit norm
    box : bounds; with them the result has the distribution within the bounds
    noise : (k, k) covariance of Jᵀe in units of `prior_sd`, for errors e of the data that are not independent, such as
        those of identified tests; it takes the place of the stated standard deviations, and of S
    """
    moving = np.ones(len(at_bound), bool) if moving is None else moving
    free = np.flatnonzero(moving & ~at_bound)
    fit = _fit(np.vstack([J, extra])[:, free] * prior_sd[free], bool(len(extra)))
    freedom = {kind: free - lost.get(kind, 0) for kind, free in _freedom(fit, kinds).items()}
    misfit = _misfit(r, kinds, freedom)
    noise = None if noise is None else noise + (extra * prior_sd).T @ (extra * prior_sd)
    size = _size(r, misfit, freedom, scatter, noise)
    known = np.linalg.norm(fit.undetermined, axis=0) < _UNDETERMINED_SHARE
    reasons = {int(i): "fixed in this update, σ not given" for i in np.flatnonzero(~moving)}
    reasons |= {int(i): "at bound, σ not given" for i in np.flatnonzero(at_bound)}
    reasons |= {int(i): "not determined by the data, σ not given" for i in free[~known]}
    if size is None:
        reasons |= {
            int(i): "no degrees of freedom left to estimate the residual variance, σ not given" for i in free[known]
        }
        size, known = _Size({}, np.inf), np.zeros(len(free), bool)
    rows = np.concatenate([[size.by_kind.get(kind, 1.0) for kind in kinds], np.ones(len(extra))])
    own = fit.covariance(rows, None if noise is None else noise[np.ix_(free, free)])
    matrix = np.full((len(at_bound), len(at_bound)), np.nan)
    matrix[np.ix_(free[known], free[known])] = (np.outer(prior_sd[free], prior_sd[free]) * own)[np.ix_(known, known)]
    widened = tuple(size.by_kind) if scatter == "stated" else ()
    scatter = scatter if noise is None else "stated"
    posterior = (
        None if box is None else _posterior(r, J, kinds, extra, prior_sd, moving, scatter, lost, box, size, noise)
    )
    return ParameterCovariance(matrix, reasons, misfit, size.degrees, widened, freedom, posterior)


def _posterior(
    r: Reals, J: Reals, kinds: Sequence[str], extra: Reals, prior_sd: Reals, moving: NDArray[np.bool_],
    scatter: Scatter, lost: Mapping[str, int], box: Box, size: _Size, noise: Reals | None,
) -> BoxPosterior | None:  # fmt: skip
    """None if the residual variance is to be estimated and no degrees of freedom are left."""
    if scatter == "estimated":
        linear = _estimated_without_bounds(r, J, kinds, extra, prior_sd, moving, lost, box)
        if linear is None:
            return None
        size = linear
    sizes = np.array([size.by_kind.get(kind, 1.0) for kind in kinds])
    return box_posterior(
        r, J, extra, box.prior_residuals, prior_sd, moving, box.x, (box.lower, box.upper), sizes, size.degrees,
        box.pull if box.pull.any() else None, noise,
    )  # fmt: skip


def _estimated_without_bounds(
    r: Reals, J: Reals, kinds: Sequence[str], extra: Reals, prior_sd: Reals, moving: NDArray[np.bool_],
    lost: Mapping[str, int], box: Box,
) -> _Size | None:  # fmt: skip
    """Variance of the residuals at the solution without bounds, where the number of parameters is that of all moving.

    The distribution itself accounts for what a bound adds to the residuals.
    """
    fit = _fit(np.vstack([J, extra])[:, moving] * prior_sd[moving], bool(len(extra)))
    freedom = {kind: free - lost.get(kind, 0) for kind, free in _freedom(fit, kinds).items()}
    change = -fit.estimator @ np.concatenate([r, box.prior_residuals])
    left = r if box.pull.any() else r + fit.rows[: len(r)] @ change
    return _estimated(left, freedom)


@dataclass(frozen=True)
class _Size:
    """Factor on the stated standard deviations by kind of residual (others: one), and its degrees of freedom."""

    by_kind: dict[str, float]
    degrees: float


def _estimated(r: Reals, freedom: dict[str, float]) -> _Size | None:
    """One factor for all; None without degrees of freedom."""
    degrees = sum(freedom.values())
    return _Size(dict.fromkeys(freedom, float(np.sqrt(r @ r / degrees))), degrees) if degrees > _LEAST_FREEDOM else None


def _size(
    r: Reals, misfit: dict[str, float], freedom: dict[str, float], scatter: Scatter, noise: Reals | None
) -> _Size | None:
    """Sizes as stated if the noise is known."""
    if noise is not None:
        return _Size({}, np.inf)
    return _estimated(r, freedom) if scatter == "estimated" else _widened(misfit, freedom)


def _widened(misfit: dict[str, float], freedom: dict[str, float]) -> _Size:
    large = {kind: s for kind, s in misfit.items() if _larger_than_stated(s, freedom[kind])}
    return _Size(large, min((freedom[kind] for kind in large), default=np.inf))


def _fit(rows: Reals, has_prior: bool) -> _Fit:
    s, vt = _directions(rows)
    good = s > 0.0 if has_prior else determined(s)
    return _Fit(rows, (vt[good].T / s[good] ** 2) @ vt[good], vt[~good])


def _freedom(fit: _Fit, kinds: Sequence[str]) -> dict[str, float]:
    """Degrees of freedom of each kind after the fit: Σ(1 − h) with the diagonal h of the hat matrix."""
    left = 1.0 - np.einsum("ia,ai->i", fit.rows, fit.estimator)[: len(kinds)]
    names = np.asarray(kinds)
    return {kind: float(left[names == kind].sum()) for kind in dict.fromkeys(kinds)}


def _misfit(r: Reals, kinds: Sequence[str], freedom: dict[str, float]) -> dict[str, float]:
    """Root mean square by kind, over its degrees of freedom, or over its count if there are none."""
    names = np.asarray(kinds)
    counts = {kind: free if free > _LEAST_FREEDOM else float((names == kind).sum()) for kind, free in freedom.items()}
    return {kind: float(np.sqrt(np.sum(r[names == kind] ** 2) / count)) for kind, count in counts.items()}


def _larger_than_stated(misfit: float, freedom: float) -> bool:
    return freedom > _LEAST_FREEDOM and freedom * misfit**2 > chdtri(freedom, _BY_CHANCE)


def _directions(rows: Reals) -> tuple[Reals, Reals]:
    k = rows.shape[1]
    _, s, vt = np.linalg.svd(np.vstack([rows, np.zeros((max(0, k - len(rows)), k))]), full_matrices=False)
    return s, vt
