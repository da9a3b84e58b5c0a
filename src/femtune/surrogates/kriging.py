"""Kriging: a trend fitted by generalised least squares, and a Gaussian process for what it leaves.

A response is y(x) = f(x)ᵀβ + z(x) + ε with Cov z = σ²R and Var ε = σ²g. With K = R + gI, F the terms of the trend at
the runs and P = K⁻¹ − K⁻¹F(FᵀK⁻¹F)⁻¹FᵀK⁻¹, everything follows from P: σ² = yᵀPy/(N − q), the restricted likelihood, and
the errors of leaving out one run, eᵢ = (Py)ᵢ/Pᵢᵢ with the variance σ²/Pᵢᵢ. Without correlation, K = I, this is the
response surface of ordinary least squares.

The lengths and g maximise the restricted likelihood, by a bounded quasi-Newton method with exact gradient from several
starts. Each response has its own. The parameters are scaled to the unit cube, responses to unit variance.

Sources: Sacks et al. 1989; Patterson and Thompson 1971 (restricted likelihood); Dubrule 1983 (leaving out one run);
Rasmussen and Williams 2006.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize
from scipy.special import stdtrit

from femtune.arrays import Reals
from femtune.surrogates.correlations import CorrelationFunction, KernelSum
from femtune.surrogates.kinds import CORRELATIONS, CorrelationKind, Noise, Trend
from femtune.surrogates.trend import term_count, term_curvatures, term_slopes, terms

_JITTER = 1e-10
"""Smallest g: without it K is numerically singular for smooth correlations."""
_LENGTHS = (0.05, 50.0)
"""Range of the lengths, in edges of the box."""
_MOST_NOISE = 10.0
"""Largest variance of the noise over that of the process: the runs then say nothing beyond the trend."""
_FIRST_LENGTH = 2.0
"""Correlation length of the first start, in edges of the box: responses of models are smooth across it."""
_FIRST_NOISE = 1e-4
"""Relative variance of the noise of the first start: computed responses have little."""
_TRIED = 8
"""Points at which the likelihood is computed for each hyperparameter, before the best are improved."""
_STEP = 1e-3
"""Difference of logarithms of lengths for second derivatives of the likelihood."""
_FARTHEST = 2.0
"""Largest distance of plausible logarithms of lengths from the best, where the likelihood is flat."""
_MOST_TRIALS = 8
"""Points at which the likelihood is computed until it is smaller by one half."""
_FOLDS = 5
"""Parts of the runs that are predicted from the others, each of which costs a fit."""
_NARROWEST = 0.9
"""Smallest factor: chance makes it smaller for a few of many responses."""
_RIGHT_RUNS = 10
"""Number of runs with the right standard deviation that the factor of widening is averaged with."""
_MOST_STEPS = 100
"""Steps of L-BFGS-B from each start at most; the best of several starts is taken."""


@dataclass(frozen=True)
class KrigingRules:
    """Options of Kriging.

    Parameters
    ----------
    trend : constant, linear or quadratic
    correlation : gaussian, matern-5/2, matern-3/2; none for a response surface
    noise : estimate, or none: the surrogate then passes through all runs
    logarithms : fit the logarithms of the responses over those of the parameters, all of which must be positive
    starts : number of points from which the likelihood is improved: the best of many
    seed : of these points
    """

    trend: Trend = "constant"
    correlation: CorrelationKind = "gaussian"
    noise: Noise = "estimate"
    logarithms: bool = False
    starts: int = 3
    seed: int = 0

    @property
    def label(self) -> str:
        """Name in messages."""
        return f"{self.trend} trend"

    def least_runs(self, parameters: int) -> int:
        """Coefficients of the trend, and two."""
        return term_count(parameters, self.trend) + 2

    def fits(self, u: Reals, y: Reals) -> tuple[KrigedResponse, ...]:
        """Fits of the responses (N, m) over scaled parameters (N, n), each with separate hyperparameters."""
        return tuple(_fitted(u, column, self) for column in y.T)


@dataclass(frozen=True, eq=False)
class KrigedResponse:
    """One response: what its likelihood found, on scaled parameters and responses.

    Parameters
    ----------
    rules : how it was fitted
    runs : (N, n) scaled parameters
    lengths : (n,) correlation lengths, in edges of the box; empty without correlation
    noise : g
    variance : σ²
    trend : (q,) β
    weights : (N,) K⁻¹(y − Fβ)
    factor : (N, N) lower Cholesky factor of K
    trend_factor : (q, q) upper factor of L⁻¹F
    errors, error_sd : (N,) errors of leaving out each run, and their standard deviations
    log_likelihood : restricted
    others : pairs of fits one standard deviation of the hyperparameters away, along the axes of the likelihood
    widened : factor of the standard deviations, from predictions of fifths of the runs by the others
    """

    rules: KrigingRules
    runs: Reals
    lengths: Reals
    noise: float
    variance: float
    trend: Reals
    weights: Reals
    factor: Reals
    trend_factor: Reals
    errors: Reals
    error_sd: Reals
    log_likelihood: float
    others: tuple[tuple[KrigedResponse, ...], ...] = ()
    widened: float = 1.0

    @property
    def freedom(self) -> int:
        """Runs less coefficients of the trend."""
        return len(self.runs) - len(self.trend)

    @property
    def _process(self) -> KernelSum | None:
        """The mean of the process; None without correlation."""
        if not len(self.lengths):
            return None
        return KernelSum(CORRELATIONS[self.rules.correlation].load(), self.runs, self.lengths, self.weights)

    def value(self, u: Reals) -> Reals:
        """(k,) at points (k, n)."""
        value = terms(u, self.rules.trend) @ self.trend
        return np.asarray(value if self._process is None else value + self._process.value(u))

    def slopes(self, u: Reals) -> Reals:
        """(k, n) first derivatives."""
        slope = np.einsum("kqn,q->kn", term_slopes(u, self.rules.trend), self.trend)
        return np.asarray(slope if self._process is None else slope + self._process.slopes(u))

    def curvatures(self, u: Reals) -> Reals:
        """(k, n, n) second derivatives; Matérn 3/2 has none at the runs."""
        curvature = np.einsum("kqnm,q->knm", term_curvatures(u, self.rules.trend), self.trend)
        return np.asarray(curvature if self._process is None else curvature + self._process.curvatures(u))

    def spread(self, u: Reals) -> Reals:
        """(k,) standard deviation of a run: process, noise, and the estimates of trend, lengths and noise."""
        variance, value = self._variance(u), self.value(u)
        total = variance.copy()
        for pair in self.others:
            for other in pair:
                total += 0.5 * (other._variance(u) - variance + (other.value(u) - value) ** 2)
        # an average of variances that lengths of equal support give is no smaller than half of the one at the best
        return np.asarray(self.widened * np.sqrt(np.maximum(total, 0.5 * variance)))

    def _variance(self, u: Reals) -> Reals:
        """(k,) variance of a run at these lengths and this noise."""
        trend = terms(u, self.rules.trend)
        process = self._process
        near = np.zeros((len(u), len(self.runs))) if process is None else process.each(u)
        across = solve_triangular(self.factor, near.T, lower=True)
        process_variance = 0.0 if process is None else 1.0
        F = solve_triangular(self.factor, terms(self.runs, self.rules.trend), lower=True)
        added = solve_triangular(self.trend_factor, trend.T - F.T @ across, trans="T")
        variance = process_variance + self.noise - np.sum(across**2, axis=0) + np.sum(added**2, axis=0)
        return np.asarray(self.variance * np.maximum(variance, 0.0))

    def again(self, u: Reals, y: Reals) -> KrigedResponse:
        """The fit to other runs (N, n), (N,), with unchanged lengths and noise."""
        likelihood = RestrictedLikelihood.of(u, y, self.rules)
        others = tuple(tuple(other.again(u, y) for other in pair) for pair in self.others)
        return replace(likelihood.solved(likelihood.logarithms(self))[0], others=others, widened=self.widened)


# ----------------------------------------------------------------------------------------------------
# The likelihood of one response.


@dataclass(frozen=True, eq=False)
class RestrictedLikelihood:
    """The restricted likelihood of a response over the logarithms of the lengths and of g."""

    rules: KrigingRules
    u: Reals
    y: Reals
    F: Reals
    kind: CorrelationFunction | None
    noise: float | None

    @classmethod
    def of(cls, u: Reals, y: Reals, rules: KrigingRules) -> RestrictedLikelihood:
        """The likelihood of responses under the rules."""
        kind = CORRELATIONS[rules.correlation].load()
        return cls(rules, u, y, terms(u, rules.trend), kind, None if rules.noise == "estimate" else _JITTER)

    @cached_property
    def away(self) -> Reals:
        """(N, N, n) squared distances along each parameter."""
        return np.asarray((self.u[:, None] - self.u[None]) ** 2)

    def parts(self, log: Reals) -> tuple[Reals, float]:
        """Lengths and g."""
        lengths = np.exp(log[: self.u.shape[1]]) if self.kind else np.empty(0)
        if self.kind is None:
            return lengths, 1.0
        return lengths, float(np.exp(log[-1])) if self.noise is None else self.noise

    def logarithms(self, fit: KrigedResponse) -> Reals:
        """The point of a fit."""
        if self.kind is None:
            return np.zeros(self.u.shape[1] + (self.noise is None))
        return np.log(fit.lengths) if self.noise is not None else np.log([*fit.lengths, fit.noise])

    def solved(self, log: Reals) -> tuple[KrigedResponse, Reals]:
        """The fit, and P."""
        lengths, noise = self.parts(log)
        N = len(self.y)
        R = np.zeros((N, N)) if self.kind is None else self.kind.value(self.away @ lengths**-2.0)
        L = cholesky(R + noise * np.eye(N), lower=True)
        F, y = (solve_triangular(L, a, lower=True) for a in (self.F, self.y))
        Q, T = np.linalg.qr(F)
        rest = y - Q @ (Q.T @ y)
        freedom = N - F.shape[1]
        variance = max(float(rest @ rest) / freedom, np.finfo(float).tiny)
        half = solve_triangular(L, Q, trans="T", lower=True)
        P = cho_solve((L, True), np.eye(N)) - half @ half.T
        weights = solve_triangular(L, rest, trans="T", lower=True)
        likelihood = -(
            0.5 * freedom * np.log(variance) + np.sum(np.log(np.diag(L))) + np.sum(np.log(np.abs(np.diag(T))))
        )
        each = np.diag(P)
        fit = KrigedResponse(
            rules=self.rules,
            runs=self.u,
            lengths=lengths,
            noise=noise,
            variance=variance,
            trend=solve_triangular(T, Q.T @ y),
            weights=weights,
            factor=L,
            trend_factor=T,
            errors=weights / each,
            error_sd=np.sqrt(variance / each),
            log_likelihood=float(likelihood),
        )
        return fit, P

    def negative(self, log: Reals) -> tuple[float, Reals]:
        """−log of the restricted likelihood, and its gradient."""
        assert self.kind is not None
        fit, P = self.solved(log)
        lengths, noise = self.parts(log)
        inner = P - np.outer(fit.weights, fit.weights) / fit.variance
        bent = inner * self.kind.slope(self.away @ lengths**-2.0)
        slopes = -np.einsum("ij,ijn->n", bent, self.away) * lengths**-2.0
        if self.noise is None:
            slopes = np.append(slopes, 0.5 * noise * np.trace(inner))
        return -fit.log_likelihood, slopes


def _fitted(u: Reals, y: Reals, rules: KrigingRules) -> KrigedResponse:
    """The response at the largest likelihood of several starts."""
    from scipy.stats import qmc  # noqa: PLC0415  slow to import, and every step reads the rules

    likelihood = RestrictedLikelihood.of(u, y, rules)
    noise = likelihood.noise
    if likelihood.kind is None or np.ptp(y) == 0.0:
        return likelihood.solved(np.zeros(u.shape[1] + (noise is None)))[0]
    bounds = [np.log(_LENGTHS)] * u.shape[1] + ([np.log((_JITTER, _MOST_NOISE))] if noise is None else [])
    low, high = np.array(bounds).T
    first = np.append(np.full(u.shape[1], np.log(_FIRST_LENGTH)), [np.log(_FIRST_NOISE)] if noise is None else [])
    drawn = qmc.LatinHypercube(len(bounds), rng=np.random.default_rng(rules.seed)).random(_TRIED * len(bounds))
    tried = [first, *(low + drawn * (high - low))]
    starts = sorted(tried, key=lambda point: likelihood.negative(point)[0])[: rules.starts]
    ends = [_most_likely(likelihood, start, low, high) for start in starts]
    best = max(ends, key=lambda end: likelihood.solved(end)[0].log_likelihood)
    fit = _with_others(likelihood, best, low, high)
    return replace(fit, widened=_widened(likelihood, best, low, high))


def _most_likely(likelihood: RestrictedLikelihood, start: Reals, low: Reals, high: Reals) -> Reals:
    how = {"jac": True, "bounds": np.stack([low, high], axis=1), "method": "L-BFGS-B"}
    return np.asarray(minimize(likelihood.negative, start, options={"maxiter": _MOST_STEPS}, **how).x)


def _with_others(likelihood: RestrictedLikelihood, at: Reals, low: Reals, high: Reals) -> KrigedResponse:
    return replace(likelihood.solved(at)[0], others=_plausible(likelihood, at, low, high))


def _widened(likelihood: RestrictedLikelihood, best: Reals, low: Reals, high: Reals) -> float:
    """The factor by which errors of predicted runs exceed their standard deviations, at their 90 % quantile.

    Fifths of the runs are predicted by the others, with lengths and noise that are found again. The factor is drawn
    towards one as a few runs with the right standard deviation would.
    """
    u, y, rules = likelihood.u, likelihood.y, likelihood.rules
    n = len(y)
    if n - (n + _FOLDS - 1) // _FOLDS < rules.least_runs(u.shape[1]):
        return 1.0
    order, ratio = np.random.default_rng(rules.seed).permutation(n), np.empty(n)
    for k in range(_FOLDS):
        out, kept = order[k::_FOLDS], np.delete(order, np.arange(k, n, _FOLDS))
        part = RestrictedLikelihood.of(u[kept], y[kept], rules)
        fit = _with_others(part, _most_likely(part, best, low, high), low, high)
        spread = np.maximum(fit.spread(u[out]), np.finfo(float).tiny)
        ratio[out] = np.abs(fit.value(u[out]) - y[out]) / (spread * stdtrit(fit.freedom, 0.95))
    # of n runs that were left out, the one below which a further run lies with this probability
    factor = float(np.quantile(ratio, 0.9, method="weibull"))
    return max(_NARROWEST, float(np.sqrt((_RIGHT_RUNS + n * factor**2) / (_RIGHT_RUNS + n))))


def _plausible(
    likelihood: RestrictedLikelihood, best: Reals, low: Reals, high: Reals
) -> tuple[tuple[KrigedResponse, ...], ...]:
    """Pairs of fits on both sides of the best, along the axes of the likelihood's curvature.

    Each is where the logarithm of the likelihood is smaller by one half, as at one standard deviation of a normal
    distribution, or at the range's end.
    """
    n, least = len(best), likelihood.negative(best)[0]
    H = np.empty((n, n))
    for i, side in enumerate(_STEP * np.eye(n)):
        H[i] = (likelihood.negative(best + side)[1] - likelihood.negative(best - side)[1]) / (2.0 * _STEP)
    values, axes = np.linalg.eigh(0.5 * (H + H.T))
    pairs = []
    for value, axis in zip(values, axes.T):
        pair = []
        for direction in (axis, -axis):
            point = _half_less(
                likelihood, best, direction, min(1.0 / np.sqrt(max(value, 1e-12)), _FARTHEST), least, low, high
            )
            pair.append(likelihood.solved(point)[0])
        pairs.append(tuple(pair))
    return tuple(pairs)


def _half_less(
    likelihood: RestrictedLikelihood, best: Reals, direction: Reals, step: float, least: float, low: Reals, high: Reals
) -> Reals:
    """The point along a direction at which the logarithm of the likelihood is smaller by one half."""

    def at(t: float) -> Reals:
        return np.clip(best + t * direction, low, high)

    for _ in range(_MOST_TRIALS):
        drop = likelihood.negative(at(step))[0] - least
        if 0.35 <= drop <= 0.7 or (drop < 0.35 and step >= _FARTHEST):
            break
        step = min(step * float(np.clip(np.sqrt(0.5 / max(drop, 1e-3)), 0.3, 2.0)), _FARTHEST)
    return at(step)
