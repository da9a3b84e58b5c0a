"""Standard deviations and intervals of updated parameters.

The rule for the size of the errors stands in `_size`. With stated standard deviations a kind of residual counts with
its estimated factor where that is above one and the residuals are larger than the stated deviations easily explain; it
never counts with less. With standard deviations that are relative weights one factor is common to all kinds. It may be
below one, so that intervals become narrower than the weights alone would make them, unless a test of the fit fails.

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
from femtune.updating.error_scales import FEWEST_DEGREES, Project, estimated_factors
from femtune.updating.posterior import BoxPosterior, box_posterior

NOTHING_LOST: Mapping[str, int] = MappingProxyType({})

_UNDETERMINED_SHARE = 0.05
"""A parameter has no σ if undetermined combinations hold this share of it or more; as in the bootstrap."""
_WIDENED_BELOW = 0.2
"""p value of the size of a kind's residuals below which its factor widens the intervals.

A stated deviation that is three times too small escapes with three degrees of freedom in 8 % of all tests, and then its
intervals hold the truth in one of two; a level of 1 % would miss 26 %. Where the stated deviations are right the
intervals hold the truth in at most 0.8·95 + 20 = 96 % of all tests."""
_BY_CHANCE = 0.01
"""The same with fewer degrees of freedom than a factor needs: the estimate is too poor to act on less than that."""
_LEAST_FREEDOM = 0.5
"""Degrees of freedom, which need not be integers, at or below which residuals say nothing of their own size."""
_RANK = 1e-9
"""Singular value relative to the largest below which a column of weighted rows is a combination of the others."""


@dataclass(frozen=True)
class ParameterCovariance:
    """Covariance of x (k, k), NaN in rows and columns for which none is given, with the reason by position.

    Parameters
    ----------
    without_bounds : (k, k) of the linear estimate, in which parameters at a bound are fixed
    misfit : by kind of residual, the root mean square of the residuals in units of their stated standard deviations,
        corrected for the fitted parameters: 1 if the stated standard deviations are correct
    degrees_of_freedom : of the variance estimate; infinite for stated standard deviations
    factors : actual over stated standard deviation with which errors of a kind count; kinds that count as stated are
        not in it
    freedom : by kind of residual, how many residuals the parameters leave free
    posterior : distribution within the bounds; None if it is not known
    """

    without_bounds: Reals
    reasons: dict[int, str]
    misfit: dict[str, float]
    degrees_of_freedom: float = np.inf
    factors: Mapping[str, float] = field(default_factory=dict)
    freedom: dict[str, float] = field(default_factory=dict)
    posterior: BoxPosterior | None = field(default=None, repr=False)

    @property
    def narrowed(self) -> bool:
        """True if errors count with less than their stated standard deviations."""
        return min(self.factors.values(), default=1.0) < 1.0

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
    may_narrow: bool = True,
) -> ParameterCovariance:
    """Covariance of the least-squares estimate, H⁻¹(JᵀS²J + RᵀR)H⁻¹ with H = JᵀJ + RᵀR, of parameters not at a bound.

    With stated standard deviations S is one, except for kinds of residual that are larger than these explain (20 per
    cent point of χ² with the freedom that the parameters leave them): there it is the factor that the residuals show
    (`estimated_factors`), so that the result is wider. A kind that fits better does not narrow it: a large standard
    deviation of the shapes does not concern the frequencies. Intervals are then those of Student's t, with the degrees
    of freedom of the variance of the parameter for which they are fewest (Satterthwaite 1946). With estimated variance
    the stated deviations are relative weights, and S² = rᵀr/(n − rank) for all residuals.

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
    may_narrow : False where a test of the fit fails: estimated errors are then not smaller than the stated ones
    """
    moving = np.ones(len(at_bound), bool) if moving is None else moving
    free = np.flatnonzero(moving & ~at_bound)
    fit = _fit(np.vstack([J, extra])[:, free] * prior_sd[free], bool(len(extra)))
    freedom = {kind: free - lost.get(kind, 0) for kind, free in _freedom(fit, kinds).items()}
    misfit = _misfit(r, kinds, freedom)
    noise = None if noise is None else noise + (extra * prior_sd).T @ (extra * prior_sd)
    prior_residuals = np.zeros(len(extra)) if box is None else box.prior_residuals
    size = _size(
        fit=fit,
        r=r,
        kinds=kinds,
        prior_residuals=prior_residuals,
        freedom=freedom,
        lost=lost,
        scatter=scatter,
        noise=noise,
        may_narrow=may_narrow,
    )
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
    of_fit = fit.covariance(rows, None if noise is None else noise[np.ix_(free, free)])
    matrix = np.full((len(at_bound), len(at_bound)), np.nan)
    matrix[np.ix_(free[known], free[known])] = (np.outer(prior_sd[free], prior_sd[free]) * of_fit)[np.ix_(known, known)]
    estimated = scatter == "estimated" and noise is None
    posterior = (
        None
        if box is None
        else _posterior(
            r=r,
            J=J,
            kinds=kinds,
            extra=extra,
            prior_sd=prior_sd,
            moving=moving,
            estimated=estimated,
            lost=lost,
            box=box,
            size=size,
            noise=noise,
            may_narrow=may_narrow,
        )
    )
    return ParameterCovariance(matrix, reasons, misfit, size.degrees, size.by_kind, freedom, posterior)


def _posterior(
    r: Reals, J: Reals, kinds: Sequence[str], extra: Reals, prior_sd: Reals, moving: NDArray[np.bool_],
    estimated: bool, lost: Mapping[str, int], box: Box, size: _Size, noise: Reals | None, may_narrow: bool,
) -> BoxPosterior | None:  # fmt: skip
    """None if the residual variance is to be estimated and no degrees of freedom are left."""
    if estimated:
        linear = _estimated_without_bounds(
            r=r,
            J=J,
            kinds=kinds,
            extra=extra,
            prior_sd=prior_sd,
            moving=moving,
            lost=lost,
            box=box,
            may_narrow=may_narrow,
        )
        if linear is None:
            return None
        size = linear
    sizes = np.array([size.by_kind.get(kind, 1.0) for kind in kinds])
    return box_posterior(
        r=r,
        J=J,
        extra=extra,
        extra_r=box.prior_residuals,
        prior_sd=prior_sd,
        moving=moving,
        at=box.x,
        ends=(box.lower, box.upper),
        sizes=sizes,
        degrees=size.degrees,
        pull=box.pull if box.pull.any() else None,
        noise=noise,
    )


def _estimated_without_bounds(
    r: Reals, J: Reals, kinds: Sequence[str], extra: Reals, prior_sd: Reals, moving: NDArray[np.bool_],
    lost: Mapping[str, int], box: Box, may_narrow: bool,
) -> _Size | None:  # fmt: skip
    """Variance of the residuals at the solution without bounds, where the number of parameters is that of all moving.

    The distribution itself accounts for what a bound adds to the residuals.
    """
    fit = _fit(np.vstack([J, extra])[:, moving] * prior_sd[moving], bool(len(extra)))
    freedom = {kind: free - lost.get(kind, 0) for kind, free in _freedom(fit, kinds).items()}
    change = -fit.estimator @ np.concatenate([r, box.prior_residuals])
    left = r if box.pull.any() else r + fit.rows[: len(r)] @ change
    return _estimated(left, freedom, may_narrow)


@dataclass(frozen=True)
class _Size:
    """Factor on the stated standard deviations by kind of residual (others: one), and its degrees of freedom."""

    by_kind: dict[str, float]
    degrees: float


def _size(
    fit: _Fit, r: Reals, kinds: Sequence[str], prior_residuals: Reals, freedom: dict[str, float],
    lost: Mapping[str, int], scatter: Scatter, noise: Reals | None, may_narrow: bool,
) -> _Size | None:  # fmt: skip
    """The rule: as stated if the noise is known, one size for all kinds if it is asked for, else never below one."""
    if noise is not None:
        return _Size({}, np.inf)
    if scatter == "estimated":
        return _estimated(r, freedom, may_narrow)
    names = np.asarray(kinds)
    places = {kind: np.flatnonzero(names == kind) for kind in freedom}
    large = {
        kind: max(1.0, float(np.sqrt(np.sum(r[at] ** 2) / freedom[kind])))
        for kind, at in places.items()
        if _larger_than_stated(float(np.sum(r[at] ** 2)), freedom[kind])
    }
    if large:
        factors, degrees = estimated_factors(
            places, _projection(fit, np.concatenate([r, prior_residuals]), places, lost)
        )
        large |= {kind: max(1.0, factors[kind]) for kind in large if degrees[kind] >= FEWEST_DEGREES}
    return _Size(large, _degrees(fit, places, large, freedom))


def _larger_than_stated(q: float, freedom: float) -> bool:
    level = _BY_CHANCE if freedom < FEWEST_DEGREES else _WIDENED_BELOW
    return freedom > _LEAST_FREEDOM and q > chdtri(freedom, level)


def _estimated(r: Reals, freedom: dict[str, float], may_narrow: bool) -> _Size | None:
    """One factor for all; None without degrees of freedom."""
    degrees = sum(freedom.values())
    if degrees <= _LEAST_FREEDOM:
        return None
    factor = float(np.sqrt(r @ r / degrees))
    return _Size(dict.fromkeys(freedom, factor if may_narrow else max(1.0, factor)), degrees)


def _projection(fit: _Fit, r: Reals, places: Mapping[str, NDArray[np.int64]], lost: Mapping[str, int]) -> Project:
    """P r and tr P_kk for factors on the rows of each kind; rows of a prior have the factor one."""

    def project(factors: Mapping[str, float]) -> tuple[Reals, dict[str, float]]:
        by = np.ones(len(r))
        for kind, at in places.items():
            by[at] = factors[kind]
        columns = fit.rows @ (np.eye(fit.rows.shape[1]) - fit.undetermined.T @ fit.undetermined) / by[:, None]
        U, s, _ = np.linalg.svd(columns, full_matrices=False)
        U = U[:, s > _RANK * s.max(initial=0.0)]
        taken = np.sum(U**2, axis=1)
        return r / by - U @ (U.T @ (r / by)), {
            kind: len(at) - float(taken[at].sum()) - lost.get(kind, 0) for kind, at in places.items()
        }

    return project


def _degrees(
    fit: _Fit, places: Mapping[str, NDArray[np.int64]], large: Mapping[str, float], freedom: Mapping[str, float]
) -> float:
    """Degrees of freedom of the variance of a parameter, the fewest of all; infinite where nothing was estimated."""
    if not large:
        return np.inf
    sizes = np.ones(len(fit.rows))
    for kind, size in large.items():
        sizes[places[kind]] = size
    parts = (fit.estimator * sizes) ** 2
    uncertain = sum((parts[:, places[k]].sum(axis=1) ** 2 / freedom[k] for k in large), np.zeros(len(parts)))
    whole = parts.sum(axis=1) ** 2
    return float(np.min(whole[uncertain > 0.0] / uncertain[uncertain > 0.0], initial=np.inf))


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


def _directions(rows: Reals) -> tuple[Reals, Reals]:
    k = rows.shape[1]
    _, s, vt = np.linalg.svd(np.vstack([rows, np.zeros((max(0, k - len(rows)), k))]), full_matrices=False)
    return s, vt
