"""Radial basis functions: y(x) = f(x)ᵀβ + Σ wᵢ φ(|x − xᵢ|) with Fᵀw = 0, through the runs or near them.

φ grows with the distance and has no length that must be found. It is conditionally positive definite: QᵀΦQ is
positive definite for Q orthogonal to the terms F of the trend. So this is Kriging with a generalised covariance
(Matheron 1973). With P = Q(QᵀΦQ + gI)⁻¹Qᵀ the weights are w = Py, the variance is σ² = yᵀPy/(N − q), the errors of
leaving out one run are (Py)ᵢ/Pᵢᵢ (Rippa 1999), and a prediction has a variance. g smooths: it maximises the restricted
likelihood, or is zero but for rounding. One eigenvalue decomposition of QᵀΦQ serves all responses and all g.

Sources: Duchon 1977 (thin plates); Wahba 1990 (smoothing and its likelihood); Fasshauer 2007.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize_scalar

from femtune.arrays import Reals
from femtune.surrogates.correlations import CorrelationFunction, KernelSum
from femtune.surrogates.kinds import KERNELS, Noise, RadialKernel, Trend
from femtune.surrogates.trend import term_count, term_curvatures, term_slopes, terms

_ROUNDING = 1e-12
"""Smallest g over the largest eigenvalue of QᵀΦQ."""
_MOST_NOISE = 10.0
"""Largest g over this eigenvalue."""


def _cubic(squared: Reals) -> Reals:
    return np.asarray(squared * np.sqrt(squared))


def _cubic_slope(squared: Reals) -> Reals:
    return np.asarray(1.5 * np.sqrt(squared))


def _cubic_curvature(squared: Reals) -> Reals:
    return _where_apart(squared, lambda s: 0.75 / np.sqrt(s))


def _quintic(squared: Reals) -> Reals:
    return np.asarray(-(squared**2) * np.sqrt(squared))


def _quintic_slope(squared: Reals) -> Reals:
    return np.asarray(-2.5 * squared * np.sqrt(squared))


def _quintic_curvature(squared: Reals) -> Reals:
    return np.asarray(-3.75 * np.sqrt(squared))


def _thin_plate(squared: Reals) -> Reals:
    return _where_apart(squared, lambda s: 0.5 * s * np.log(s))


def _thin_plate_slope(squared: Reals) -> Reals:
    return _where_apart(squared, lambda s: 0.5 * (np.log(s) + 1.0))


def _thin_plate_curvature(squared: Reals) -> Reals:
    return _where_apart(squared, lambda s: 0.5 / s)


def _where_apart(squared: Reals, function: Callable[[Reals], Reals]) -> Reals:
    """At the runs the limit of what the function is multiplied with is zero."""
    apart = squared != 0.0
    return np.asarray(np.where(apart, function(np.where(apart, squared, 1.0)), 0.0))


@dataclass(frozen=True)
class RadialFunction:
    """φ as a function of the squared distance, and the smallest trend with which it is positive definite."""

    function: CorrelationFunction
    trend: Trend


CUBIC = RadialFunction(CorrelationFunction("cubic", _cubic, _cubic_slope, _cubic_curvature), "linear")
QUINTIC = RadialFunction(CorrelationFunction("quintic", _quintic, _quintic_slope, _quintic_curvature), "quadratic")
THIN_PLATE = RadialFunction(
    CorrelationFunction("thin plate", _thin_plate, _thin_plate_slope, _thin_plate_curvature), "linear"
)
"""A thin plate has no second derivative at the runs."""


@dataclass(frozen=True)
class RadialRules:
    """How radial basis functions are fitted.

    Parameters
    ----------
    kernel : cubic, quintic or thin-plate
    noise : estimate, or none: the surrogate then passes through all runs
    logarithms : fit the logarithms of the responses over those of the parameters, all of which must be positive
    """

    kernel: RadialKernel = "cubic"
    noise: Noise = "estimate"
    logarithms: bool = False

    @property
    def function(self) -> RadialFunction:
        """The kernel with the trend that it needs."""
        radial: RadialFunction = KERNELS[self.kernel].load()
        return radial

    @property
    def trend(self) -> Trend:
        """The trend that the kernel needs."""
        return self.function.trend

    @property
    def label(self) -> str:
        """Name in messages."""
        return f"{self.kernel} radial basis functions, which have a {self.trend} trend"

    def least_runs(self, parameters: int) -> int:
        """Coefficients of the trend, and two."""
        return term_count(parameters, self.trend) + 2

    def fits(self, u: Reals, y: Reals) -> tuple[RadialResponse, ...]:
        """Fits of the responses (N, m) over scaled parameters (N, n)."""
        spectrum = _Spectrum.of(u, self)
        return tuple(spectrum.response(column, spectrum.smoothing(column)) for column in y.T)


@dataclass(frozen=True, eq=False)
class RadialResponse:
    """One response on scaled parameters and responses.

    Parameters
    ----------
    spectrum : of the runs
    noise : g
    variance : σ²
    trend : (q,) β
    weights : (N,) w
    errors, error_sd : (N,) errors of leaving out each run, and their standard deviations
    """

    spectrum: _Spectrum
    noise: float
    variance: float
    trend: Reals
    weights: Reals
    errors: Reals
    error_sd: Reals

    @property
    def freedom(self) -> int:
        """Runs less coefficients of the trend."""
        return len(self.weights) - len(self.trend)

    @property
    def _sum(self) -> KernelSum:
        return self.spectrum.kernels(self.weights)

    def value(self, u: Reals) -> Reals:
        """(k,) at points (k, n)."""
        return np.asarray(terms(u, self.spectrum.rules.trend) @ self.trend + self._sum.value(u))

    def slopes(self, u: Reals) -> Reals:
        """(k, n) first derivatives."""
        return np.asarray(
            np.einsum("kqn,q->kn", term_slopes(u, self.spectrum.rules.trend), self.trend) + self._sum.slopes(u)
        )

    def curvatures(self, u: Reals) -> Reals:
        """(k, n, n) second derivatives; of a thin plate only between the runs."""
        trend = term_curvatures(u, self.spectrum.rules.trend)
        return np.asarray(np.einsum("kqnm,q->knm", trend, self.trend) + self._sum.curvatures(u))

    def spread(self, u: Reals) -> Reals:
        """(k,) standard deviation of a run, as Kriging with this generalised covariance has it."""
        s = self.spectrum
        near, F = self._sum.each(u).T, terms(u, s.rules.trend).T
        # weights of the runs in the prediction: they reproduce the trend, and have the least variance of all that do
        fixed = s.trend_basis @ solve_triangular(s.trend_factor, F, trans="T")
        free = s.vectors.T @ (near - s.kernel @ fixed)
        each = fixed + s.vectors @ (free / (s.values + self.noise)[:, None])
        variance = self.noise - 2.0 * np.sum(each * near, axis=0)
        variance += np.sum(each * (s.kernel @ each + self.noise * each), axis=0)
        return np.asarray(np.sqrt(self.variance * np.maximum(variance, 0.0)))

    def again(self, u: Reals, y: Reals) -> RadialResponse:
        """The fit to other runs (N, n), (N,), with unchanged smoothing."""
        return _Spectrum.of(u, self.spectrum.rules).response(y, self.noise)


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """Decomposition that all responses of a set of runs share.

    Parameters
    ----------
    runs : (N, n)
    kernel : (N, N) Φ
    trend_basis, trend_factor : orthonormal (N, q) and triangular (q, q) factor of F
    vectors, values : (N, N − q) QV and (N − q,) e of QᵀΦQ = V diag(e) Vᵀ
    """

    rules: RadialRules
    runs: Reals
    kernel: Reals
    trend_basis: Reals
    trend_factor: Reals
    vectors: Reals
    values: Reals

    @classmethod
    def of(cls, u: Reals, rules: RadialRules) -> _Spectrum:
        F = terms(u, rules.trend)
        q = F.shape[1]
        basis, factor = np.linalg.qr(F, mode="complete")
        squared = np.sum((u[:, None] - u[None]) ** 2, axis=2)
        kernel = rules.function.function.value(squared)
        free = basis[:, q:]
        values, vectors = np.linalg.eigh(free.T @ kernel @ free)
        return cls(rules, u, kernel, basis[:, :q], factor[:q], free @ vectors, np.maximum(values, 0.0))

    def kernels(self, weights: Reals) -> KernelSum:
        """Σ wᵢ φ of the distances from the runs."""
        return KernelSum(self.rules.function.function, self.runs, np.ones(self.runs.shape[1]), weights)

    def smoothing(self, y: Reals) -> float:
        """g: at the maximum of the restricted likelihood, unless the surrogate must pass through the runs."""
        least = _ROUNDING * self.values.max()
        if self.rules.noise != "estimate" or np.ptp(y) == 0.0:
            return float(least)
        squares = (self.vectors.T @ y) ** 2

        def negative(log: float) -> float:
            shifted = self.values + np.exp(log)
            variance = max(np.mean(squares / shifted), np.finfo(float).tiny)
            return float(0.5 * len(squares) * np.log(variance) + 0.5 * np.sum(np.log(shifted)))

        # the likelihood may have several maxima: the best of a grid is improved
        grid = np.linspace(np.log(least), np.log(_MOST_NOISE * self.values.max()), 61)
        best = int(np.argmin([negative(log) for log in grid]))
        around = grid[max(best - 1, 0)], grid[min(best + 1, 60)]
        return float(np.exp(minimize_scalar(negative, bounds=around, method="bounded").x))

    def response(self, y: Reals, noise: float) -> RadialResponse:
        """The fit of a response (N,)."""
        shifted = self.values + noise
        inner = self.vectors.T @ y
        weights = self.vectors @ (inner / shifted)
        variance = max(float(np.mean(inner**2 / shifted)), np.finfo(float).tiny)
        each = np.sum(self.vectors**2 / shifted, axis=1)
        rest = y - self.kernel @ weights - noise * weights
        trend = solve_triangular(self.trend_factor, self.trend_basis.T @ rest)
        return RadialResponse(self, noise, variance, trend, weights, weights / each, np.sqrt(variance / each))
