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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import stats
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize
from scipy.stats import qmc

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.surrogates.correlations import CORRELATIONS, NO_CORRELATION, CorrelationFunction
from femtune.surrogates.trend import term_count, term_slopes, terms

ESTIMATED, NO_NOISE = "estimate", "none"
"""Keys of the noise in a study."""
_JITTER = 1e-10
"""Smallest g: without it K is numerically singular for smooth correlations."""
_LENGTHS = (0.05, 50.0)
"""Range of the lengths, in edges of the box."""
_MOST_NOISE = 10.0
_FIRST_LENGTH = 2.0
_FIRST_NOISE = 1e-4
_TRIED = 8
"""Points at which the likelihood is computed for each hyperparameter, before the best are improved."""
_MOST_STEPS = 100


@dataclass(frozen=True)
class KrigingRules:
    """How a surrogate is fitted.

    Parameters
    ----------
    trend : constant, linear or quadratic
    correlation : gaussian, matern-5/2, matern-3/2; none for a response surface
    noise : estimate, or none: the surrogate then passes through all runs
    logarithms : fit the logarithms of the responses over those of the parameters, all of which must be positive
    starts : number of points from which the likelihood is improved: the best of many
    seed : of these points
    """

    trend: str = "constant"
    correlation: str = "gaussian"
    noise: str = ESTIMATED
    logarithms: bool = False
    starts: int = 3
    seed: int = 0


@dataclass(frozen=True, eq=False)
class FittedResponse:
    """One response: what its likelihood found, on scaled parameters and responses.

    Parameters
    ----------
    lengths : (n,) correlation lengths, in edges of the box; empty without correlation
    noise : g
    variance : σ²
    trend : (q,) β
    weights : (N,) K⁻¹(y − Fβ)
    factor : (N, N) lower Cholesky factor of K
    trend_factor : (q, q) upper factor of L⁻¹F
    errors, error_sd : (N,) errors of leaving out each run, and their standard deviations
    log_likelihood : restricted
    """

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


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A fitted surrogate of m responses over n parameters.

    Parameters
    ----------
    parameters, responses : names
    x, y : (N, n) and (N, m) the runs
    lower, upper : (n,) the box that is scaled to the unit cube
    rules : how it was fitted
    fits : one per response
    centre, scale : (m,) of the responses, or of their logarithms
    """

    parameters: tuple[str, ...]
    responses: tuple[str, ...]
    x: Reals
    y: Reals
    lower: Reals
    upper: Reals
    rules: KrigingRules
    fits: tuple[FittedResponse, ...]
    centre: Reals
    scale: Reals

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the intervals: runs less coefficients of the trend."""
        return len(self.x) - term_count(self.x.shape[1], self.rules.trend)

    def predict(self, x: Reals) -> Reals:
        """(k, m) responses at points (k, n); accepts complex values."""
        u = self._unit(np.atleast_2d(x))
        trend = terms(u, self.rules.trend)
        scaled = [trend @ fit.trend + self._correlations(u, fit) @ fit.weights for fit in self.fits]
        found = self.centre + self.scale * np.stack(scaled, axis=1)
        return np.asarray(np.exp(found) if self.rules.logarithms else found)

    def predict_sd(self, x: Reals) -> Reals:
        """(k, m) standard deviations of a run at points (k, n); of its logarithm, with `logarithms`."""
        u = self._unit(np.atleast_2d(x))
        trend = terms(u, self.rules.trend)
        return np.stack([s * self._spread(u, trend, fit) for fit, s in zip(self.fits, self.scale, strict=True)], axis=1)

    def interval(self, x: Reals, level: float = 0.95) -> tuple[Reals, Reals]:
        """Two (k, m) limits between which a run at each point lies with a probability, by Student's t."""
        wide = stats.t.ppf(0.5 + 0.5 * level, self.freedom) * self.predict_sd(x)
        middle = self.predict(x)
        if self.rules.logarithms:
            return middle * np.exp(-wide), middle * np.exp(wide)
        return middle - wide, middle + wide

    def gradient(self, x: Reals) -> Reals:
        """(k, m, n) derivatives of the responses."""
        x = np.atleast_2d(x)
        u = self._unit(x)
        slopes = term_slopes(u, self.rules.trend)
        parts = []
        for fit in self.fits:
            slope = np.einsum("kqn,q->kn", slopes, fit.trend)
            if len(fit.lengths):
                kind = CORRELATIONS[self.rules.correlation]
                away = (u[:, None] - self._runs[None]) / fit.lengths
                bent = kind.slope(np.sum(away**2, axis=2)) * fit.weights
                slope = slope + 2.0 * np.einsum("ki,kin->kn", bent, away) / fit.lengths
            parts.append(slope)
        found = self.scale[:, None] * np.stack(parts, axis=1) / (self._edges[1] - self._edges[0])
        if self.rules.logarithms:
            found = found * self.predict(x)[:, :, None] / x[:, None, :]
        return np.asarray(found)

    @property
    def left_out(self) -> Reals:
        """(N, m) response of each run as predicted from all others."""
        scaled = np.stack([fit.errors for fit in self.fits], axis=1) * self.scale
        return np.asarray(self.y * np.exp(-scaled) if self.rules.logarithms else self.y - scaled)

    @property
    def left_out_ratio(self) -> Reals:
        """(N, m) errors of leaving out each run over their standard deviations; of unit variance if sound."""
        return np.stack([fit.errors / fit.error_sd for fit in self.fits], axis=1)

    @cached_property
    def _edges(self) -> tuple[Reals, Reals]:
        return (np.log(self.lower), np.log(self.upper)) if self.rules.logarithms else (self.lower, self.upper)

    @property
    def _scaled(self) -> Reals:
        """(N, m) responses, or their logarithms, of unit variance."""
        return np.asarray(((np.log(self.y) if self.rules.logarithms else self.y) - self.centre) / self.scale)

    @cached_property
    def _runs(self) -> Reals:
        return self._unit(self.x)

    def _unit(self, x: Reals) -> Reals:
        low, high = self._edges
        return np.asarray(((np.log(x) if self.rules.logarithms else x) - low) / (high - low))

    def _correlations(self, u: Reals, fit: FittedResponse) -> Reals:
        """(k, N) with the runs."""
        if not len(fit.lengths):
            return np.zeros((len(u), len(self.x)))
        away = (u[:, None] - self._runs[None]) / fit.lengths
        return CORRELATIONS[self.rules.correlation].value(np.sum(away**2, axis=2))

    def _spread(self, u: Reals, trend: Reals, fit: FittedResponse) -> Reals:
        """(k,) standard deviation of a run, scaled: process, noise, and what the trend's coefficients add."""
        across = solve_triangular(fit.factor, self._correlations(u, fit).T, lower=True)
        own = 1.0 if len(fit.lengths) else 0.0
        F = solve_triangular(fit.factor, terms(self._runs, self.rules.trend), lower=True)
        added = solve_triangular(fit.trend_factor, trend.T - F.T @ across, trans="T")
        variance = own + fit.noise - np.sum(across**2, axis=0) + np.sum(added**2, axis=0)
        return np.asarray(np.sqrt(fit.variance * np.maximum(variance, 0.0)))


def fit_surrogate(
    x: Reals,
    y: Reals,
    rules: KrigingRules | None = None,
    box: tuple[Reals, Reals] | None = None,
    parameters: Sequence[str] = (),
    responses: Sequence[str] = (),
) -> Surrogate:
    """A surrogate of a table of runs.

    Parameters
    ----------
    x : (N, n) parameters of the runs
    y : (N, m) responses
    rules : how to fit; None: Kriging with constant trend, Gaussian correlation and estimated noise
    box : (n,) lower and (n,) upper bounds, which are scaled to the unit cube; None: those of the runs
    parameters, responses : names, for messages

    Raises
    ------
    FemtuneError : ``surrogate.*``

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.surrogates import fit_surrogate
    >>> x = np.linspace(0.0, 1.0, 8)[:, None]
    >>> fitted = fit_surrogate(x, np.sin(6.0 * x))
    >>> bool(abs(fitted.predict([[0.4]])[0, 0] - np.sin(2.4)) < 1e-3)
    True
    """
    rules = rules or KrigingRules()
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    lower, upper = (x.min(axis=0), x.max(axis=0)) if box is None else map(np.asarray, box)
    names = tuple(parameters) or tuple(f"x{i + 1}" for i in range(x.shape[1]))
    called = tuple(responses) or tuple(f"y{i + 1}" for i in range(y.shape[1]))
    _check(x, y, rules, (lower, upper), names, called)
    values = np.log(y) if rules.logarithms else y
    spread = values.std(axis=0)
    scale = np.where(spread > 0.0, spread, 1.0)
    empty = Surrogate(names, called, x, y, lower, upper, rules, (), values.mean(axis=0), scale)
    return replace(empty, fits=tuple(_fitted(empty._runs, column, rules) for column in empty._scaled.T))


def fitted_at(surrogate: Surrogate) -> Surrogate:
    """The surrogate with its runs as they are now, at the lengths and the noise that it has."""
    u, rules = surrogate._runs, surrogate.rules
    fits = []
    for fit, column in zip(surrogate.fits, surrogate._scaled.T, strict=True):
        likelihood = _likelihood(u, column, rules)
        log = np.log(fit.lengths) if likelihood.noise is not None else np.log([*fit.lengths, fit.noise])
        fits.append(likelihood.solved(log)[0])
    return replace(surrogate, fits=tuple(fits))


def _check(
    x: Reals, y: Reals, rules: KrigingRules, box: tuple[Reals, Reals], names: Sequence[str], called: Sequence[str]
) -> None:
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        bad = np.flatnonzero(~(np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)))
        raise FemtuneError("surrogate.not-finite", runs=", ".join(str(i + 1) for i in bad))
    still = [name for name, low, high in zip(names, *box, strict=True) if not high > low]
    if still:
        raise FemtuneError("surrogate.still", names=", ".join(still))
    needed = term_count(x.shape[1], rules.trend) + 2
    if len(x) < needed:
        raise FemtuneError("surrogate.too-few-runs", runs=len(x), trend=rules.trend, needed=needed)
    if rules.logarithms:
        low = [name for name, values in zip((*names, *called), (*x.T, *y.T), strict=True) if np.any(values <= 0.0)]
        if low:
            raise FemtuneError("surrogate.not-positive", names=", ".join(low))


# ----------------------------------------------------------------------------------------------------
# The likelihood of one response.


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """The restricted likelihood of a response over the logarithms of the lengths and of g."""

    u: Reals
    y: Reals
    F: Reals
    kind: CorrelationFunction | None
    noise: float | None

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

    def solved(self, log: Reals) -> tuple[FittedResponse, Reals]:
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
        fit = FittedResponse(
            lengths,
            noise,
            variance,
            solve_triangular(T, Q.T @ y),
            weights,
            L,
            T,
            weights / each,
            np.sqrt(variance / each),
            float(likelihood),
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


def _likelihood(u: Reals, y: Reals, rules: KrigingRules) -> _Likelihood:
    kind = None if rules.correlation == NO_CORRELATION else CORRELATIONS[rules.correlation]
    noise = None if rules.noise == ESTIMATED else _JITTER
    return _Likelihood(u, y, terms(u, rules.trend), kind, noise)


def _fitted(u: Reals, y: Reals, rules: KrigingRules) -> FittedResponse:
    """The response at the largest likelihood of several starts."""
    likelihood = _likelihood(u, y, rules)
    noise = likelihood.noise
    if likelihood.kind is None or np.ptp(y) == 0.0:
        return likelihood.solved(np.zeros(u.shape[1] + (noise is None)))[0]
    bounds = [np.log(_LENGTHS)] * u.shape[1] + ([np.log((_JITTER, _MOST_NOISE))] if noise is None else [])
    low, high = np.array(bounds).T
    first = np.append(np.full(u.shape[1], np.log(_FIRST_LENGTH)), [np.log(_FIRST_NOISE)] if noise is None else [])
    drawn = qmc.LatinHypercube(len(bounds), rng=np.random.default_rng(rules.seed)).random(_TRIED * len(bounds))
    tried = [first, *(low + drawn * (high - low))]
    starts = sorted(tried, key=lambda point: likelihood.negative(point)[0])[: rules.starts]
    how = {"jac": True, "bounds": bounds, "method": "L-BFGS-B", "options": {"maxiter": _MOST_STEPS}}
    ends = [minimize(likelihood.negative, start, **how) for start in starts]
    best = min(ends, key=lambda end: float(end.fun))
    return likelihood.solved(best.x)[0]
