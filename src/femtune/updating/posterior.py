"""Distribution of the parameters after an update: that of the linearised problem, truncated to the bounds.

With residuals r and Jacobian J at the solution, the density of a change d of the parameters is exp(−½|r + J d|²) inside
the bounds and zero outside, times that of the prior where the update uses one. Without one the prior is uniform between
the bounds. Where the bounds are far away this is the normal distribution of the linear least-squares estimate.

Source: A. Tarantola, Inverse Problem Theory, 2005, sections 1.2 and 3.2; D. Gamerman, H. F. Lopes, Markov Chain Monte
Carlo, 2006, chapter 5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.parameters import Jet
from femtune.selection import determined
from femtune.updating.kinds import IntervalKind
from femtune.updating.truncated import BoxSamples, SamplerRules, sample_box

NEGLIGIBLE = 1e-3
"""Probability outside the bounds, summed over all bounds, below which they are ignored."""
_HARDLY = 0.9
"""Standard deviation over that of the uniform distribution between the bounds, above which the bounds alone count."""


@dataclass(frozen=True)
class Marginal:
    """Mean, median, interval and standard deviation of one quantity, see `interval_with`."""

    mean: float
    median: float
    interval: tuple[float, float]
    sd: float
    kind: IntervalKind


@dataclass(frozen=True, eq=False)
class BoxPosterior:
    """Density exp(−½|A d + b|²), or that of Student's t, of changes d of the moving parameters within the bounds.

    Parameters
    ----------
    at : (k,) parameters x̂ at which the problem is linearised
    moving : (k,) which of them have a distribution; the others are fixed
    rows, offset : A (m, k′) and b (m,) of the k′ moving ones; m < k′ where the data leave combinations undetermined
    lower, upper : (k′,) bounds less x̂
    degrees : degrees of freedom of Student's t; infinite for a normal distribution
    """

    at: Reals
    moving: NDArray[np.bool_]
    rows: Reals
    offset: Reals
    lower: Reals
    upper: Reals
    degrees: float = np.inf
    rules: SamplerRules = field(default_factory=SamplerRules)

    @cached_property
    def _root(self) -> Reals | None:
        """(k′, k′) G with GGᵀ the covariance without bounds (the scale matrix of Student's t), if it is finite."""
        return la.inv(self.rows) if len(self.rows) == len(self.lower) else None

    @cached_property
    def truncated(self) -> bool:
        """True if more than NEGLIGIBLE of the distribution is outside the bounds."""
        if self._root is None:
            return True
        sd, centre = np.linalg.norm(self._root, axis=1), -self._root @ self.offset
        ends = np.concatenate([(self.lower - centre) / sd, (centre - self.upper) / sd])
        return bool(stdtr(self.degrees, ends).sum() > NEGLIGIBLE)

    @cached_property
    def drawn(self) -> BoxSamples | None:
        """Samples of d; None if the bounds are ignored."""
        if not self.truncated:
            return None
        return sample_box(self.rows, self.offset, self.lower, self.upper, self.degrees, self.rules)

    @cached_property
    def samples(self) -> Reals:
        """(n, k) samples of x; with fixed seed, so that they are the same every time."""
        d = self._unbounded_samples() if self.drawn is None else self.drawn.values
        x = np.tile(self.at, (len(d), 1))
        x[:, self.moving] += d
        return x

    def _unbounded_samples(self) -> Reals:
        """About x̂; the few beyond a bound are left out."""
        assert self._root is not None
        rng = np.random.default_rng(self.rules.seed)
        z = rng.standard_normal((4 * self.rules.least, len(self.lower)))
        if np.isfinite(self.degrees):
            z *= np.sqrt(self.degrees / rng.chisquare(self.degrees, size=(len(z), 1)))
        d = z @ self._root.T
        return d[((d >= self.lower) & (d <= self.upper)).all(axis=1)]

    @cached_property
    def covariance(self) -> Reals:
        """(k, k) of the truncated distribution; zero for fixed parameters."""
        return np.atleast_2d(np.cov(self.samples, rowvar=False))

    def of(self, jet: Jet, values: Callable[[Reals], Reals], level: float = 0.95) -> Marginal | None:
        """The distribution of a quantity; None if it depends on no moving parameter, or has no finite values.

        Parameters
        ----------
        jet : value at x̂, gradient and Hessian in x
        values : (n,) the quantity at samples (n, k)
        """
        if not np.any(jet.grad[self.moving]):
            return None
        if not self.truncated and not np.any(jet.hess):
            return self._linear(jet, level)
        try:
            sampled = values(self.samples)
        except FemtuneError:
            return None
        low, high = interval_with(float(jet.value), sampled, level)
        kind = self._kind if not self.truncated else "bounds" if self._is_of_bounds(jet, sampled) else "truncated"
        return Marginal(float(sampled.mean()), float(np.median(sampled)), (low, high), float(sampled.std()), kind)

    @property
    def _kind(self) -> IntervalKind:
        return "Student's t" if np.isfinite(self.degrees) else "normal"

    def _linear(self, jet: Jet, level: float) -> Marginal:
        """The distribution of the linear least-squares estimate, for bounds far away."""
        assert self._root is not None
        sd, value = float(np.linalg.norm(jet.grad[self.moving] @ self._root)), float(jet.value)
        half = float(stdtrit(self.degrees, 0.5 + 0.5 * level)) * sd
        return Marginal(value, value, (value - half, value + half), sd, self._kind)

    def _is_of_bounds(self, jet: Jet, found: Reals) -> bool:
        """Whether a quantity that follows one parameter is about as wide as its bounds."""
        used = np.flatnonzero(jet.grad[self.moving])
        if len(used) != 1 or np.any(jet.hess):
            return False
        width = (self.upper - self.lower)[used[0]] * abs(jet.grad[self.moving][used[0]])
        return bool(found.std() > _HARDLY * width / np.sqrt(12.0))


def interval_with(value: float, samples: Reals, level: float) -> tuple[float, float]:
    """The interval of a probability that contains an estimate: equal-tailed, or moved towards the estimate.

    The estimate is the most probable point of all parameters together. On a bound, or where bounds cut off most of the
    distribution, it lies in a tail of the distribution of a single one. The tail on its side then becomes smaller and
    the other one larger, down to the one-sided interval that ends at the estimate. The probability stays the same.

    Parameters
    ----------
    value : the estimate
    samples : (n,) of the distribution
    level : probability of the interval

    Examples
    --------
    >>> import numpy as np
    >>> samples = np.linspace(0.0, 1.0, 1001)
    >>> [[round(end, 2) for end in interval_with(value, samples, 0.9)] for value in (0.5, 0.97, 1.0)]
    [[0.05, 0.95], [0.07, 0.97], [0.1, 1.0]]
    """
    outside = 1.0 - level
    below = float(np.mean(samples < value)), float(np.mean(samples <= value))
    lower_tail = min(max(0.5 * outside, below[0] - level), below[1], outside)
    low, high = np.quantile(samples, [lower_tail, lower_tail + level])
    return min(float(low), value), max(float(high), value)


def box_posterior(
    r: Reals,
    J: Reals,
    extra: Reals,
    extra_r: Reals,
    prior_sd: Reals,
    moving: NDArray[np.bool_],
    at: Reals,
    ends: tuple[Reals, Reals],
    sizes: Reals,
    degrees: float = np.inf,
    pull: Reals | None = None,
    noise: Reals | None = None,
) -> BoxPosterior:
    """The distribution of parameters x between bounds.

    Parameters
    ----------
    r, J : (n,), (n, k) residuals in units of their standard deviations, and Jacobian
    extra, extra_r : (m, k), (m,) rows of a prior and their values, (0, k) without
    prior_sd : (k,) spreads that tell whether a combination is determined; one that is not has only its bounds
    at : (k,) where the problem is linearised
    ends : lower and upper bounds of x
    sizes : (n,) actual over stated standard deviation of each residual
    pull : (k,) gradient of side constraints that are no information: they move the estimate, and do not narrow it
    noise : (k, k) covariance of the gradient of the rows' errors in units of `prior_sd`, in place of `sizes`
    """
    used = np.flatnonzero(moving)
    rows = np.vstack([J, extra])[:, used] * prior_sd[used]
    left, s, right = np.linalg.svd(rows, full_matrices=False)
    good = s > 0.0 if len(extra) else determined(s)
    left, s, right = left[:, good], s[good], right[good]
    target = left.T @ np.concatenate([r, extra_r])
    if pull is not None:
        target = target + (right @ (pull[used] * prior_sd[used])) / s
    spread = left * np.concatenate([sizes, np.ones(len(extra))])[:, None]
    errors = spread.T @ spread if noise is None else right @ noise[np.ix_(used, used)] @ right.T / np.outer(s, s)
    lower = la.cholesky(errors, lower=True) if len(s) else np.zeros((0, 0))
    A = la.solve_triangular(lower, s[:, None] * right, lower=True) / prior_sd[used] if len(s) else right
    b = la.solve_triangular(lower, target, lower=True) if len(s) else target
    # rounding may put x just outside
    low, high = np.minimum(ends[0] - at, 0.0)[used], np.maximum(ends[1] - at, 0.0)[used]
    return BoxPosterior(at, moving, A, b, low, high, degrees)


def posterior_of_covariance(
    at: Reals, covariance: Reals, known: NDArray[np.bool_], ends: tuple[Reals, Reals]
) -> BoxPosterior:
    """A normal distribution about `at`, of the parameters that are known, truncated to their bounds."""
    variances, V = la.eigh(covariance[np.ix_(known, known)])
    variances = np.maximum(variances, 1e-14 * variances.max(initial=0.0))
    low, high = np.minimum(ends[0] - at, 0.0)[known], np.maximum(ends[1] - at, 0.0)[known]
    return BoxPosterior(at, known, (V / np.sqrt(variances)).T, np.zeros(len(variances)), low, high)
