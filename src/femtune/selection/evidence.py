"""The evidence of a set of parameters: the likelihood, averaged over the prior within the bounds.

At an optimum the residuals are taken as linear, so that the likelihood is a normal density of the parameters, which the
bounds truncate. Its integral over the box is that of a sequence of one-dimensional conditional densities, averaged over
quasi-random points that are shifted to where the integral is. Combinations without any curvature are limited by the box
alone, and parameters at a bound keep the slope that they have there.

Sources: A. Genz, Numerical computation of multivariate normal probabilities, Journal of Computational and Graphical
Statistics 1, 1992; Z. I. Botev, The normal law under linear restrictions: simulation and estimation via minimax
tilting, Journal of the Royal Statistical Society B 79, 2017 (here both with the factor of the inverse covariance, which
exists for undetermined combinations too).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.truncated_normal import line_sample, log_mass, mean_between

_POINTS = 4096
"""Quasi-random points."""
_FEWEST = 40.0
"""Effective number of points below which the integral is not given; its logarithm is then wrong by 0.15 and more."""
_MOST_STEPS = 50
"""Steps of Newton's method; nearly all densities need fewer than 20."""
_FLAT = 1e-8
"""Curvature that is added along each edge of the box, of length one: it changes the density by this part at most."""
_INSIDE = (1e-12, 1.0 - 1e-12)
"""Range of the quasi-random numbers, so that no logarithm of zero is taken."""


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Residuals r + J d of parameters that move by d, their bounds and priors.

    Parameters
    ----------
    curvature : (k, k) JᵀJ, residuals in their standard deviations
    slope : (k,) Jᵀr
    lower, upper : (k,) bounds of d
    mean, sd : (k,) mean of the prior as a value of d, and its standard deviation; infinite for a prior between the
        bounds alone
    """

    curvature: Reals
    slope: Reals
    lower: Reals
    upper: Reals
    mean: Reals
    sd: Reals


def log_evidence(chi2: float, fit: LinearFit, size: float = 1.0) -> float:
    """ln Z = −½ rᵀr/s² + ln ∫ exp(−½(|r + J d|² − rᵀr)/s²) π(d) dd over the box, without constants of the data.

    The prior π is uniform between the bounds, or the stated normal density, both of integral one within the bounds.
    NaN where the integral is not found, see `log_box_integral`.

    Parameters
    ----------
    chi2 : rᵀr
    size : s, standard deviation of the residuals in units of the stated one

    Examples
    --------
    A parameter with a standard deviation far below the width of its bounds: √(2π) σ / width.

    >>> zero, one = np.zeros(1), np.ones(1)
    >>> fit = LinearFit(np.array([[100.0]]), zero, -one, one, zero, np.array([np.inf]))
    >>> print(f"{log_evidence(0.0, fit):.4f}, {np.log(np.sqrt(2.0 * np.pi) * 0.1 / 2.0):.4f}")
    -2.0768, -2.0768
    """
    value = -0.5 * chi2 / size**2
    if not len(fit.slope):
        return value
    known = np.isfinite(fit.sd)
    weight = np.where(known, fit.sd, np.inf) ** -2.0
    H = fit.curvature / size**2 + np.diag(weight)
    g = fit.slope / size**2 - weight * np.where(known, fit.mean, 0.0)
    for i in range(len(known)):
        if known[i]:
            low, high = (fit.lower[i] - fit.mean[i]) / fit.sd[i], (fit.upper[i] - fit.mean[i]) / fit.sd[i]
            value -= 0.5 * (fit.mean[i] / fit.sd[i]) ** 2 + np.log(fit.sd[i]) + 0.5 * np.log(2.0 * np.pi)
            value -= float(log_mass(low, high))
        else:
            value -= np.log(fit.upper[i] - fit.lower[i])
    return value + log_box_integral(H, g, fit.lower, fit.upper)


def log_box_integral(H: Reals, g: Reals, lower: Reals, upper: Reals) -> float:
    """ln ∫ exp(−gᵀd − ½ dᵀH d) dd over lower ≤ d ≤ upper; H is symmetric and may be singular.

    NaN where fewer than 40 of 4,096 points carry the integral.

    Parameters
    ----------
    H, g : (k, k) and (k,)
    lower, upper : (k,)

    Examples
    --------
    Over the half of a normal density.

    >>> print(f"{log_box_integral(np.eye(1), np.zeros(1), np.zeros(1), np.full(1, 20.0)):.4f}")
    0.2258
    """
    width, k = upper - lower, len(g)
    # the box is the unit cube; those that the data determine best are sampled last, given the others
    order = np.argsort(np.diag(H) * width**2)[::-1]
    H = (H * width[:, None] * width)[np.ix_(order, order)]
    rounding = 10.0 * k * np.finfo(float).eps * float(np.max(np.diag(H), initial=0.0))
    U: Reals = np.asarray(np.linalg.cholesky(H + max(_FLAT, rounding) * np.eye(k)), dtype=float).T
    centre: Reals = np.asarray(np.linalg.solve(U.T, -(g * width)[order]), dtype=float)
    density = _BoxDensity(U, centre, (lower / width)[order], (upper / width)[order])
    log_weight = density.log_weights(density.saddle(), _quasi_random(k))
    largest = log_weight.max()
    weight = np.exp(log_weight - largest)
    if weight.sum() ** 2 < _FEWEST * (weight @ weight):
        return float("nan")
    return density.log_constant + float(np.log(width).sum() + largest + np.log(np.mean(weight)))


@dataclass(frozen=True, eq=False)
class _BoxDensity:
    """exp(−½|U d − c|²) over low ≤ d ≤ high, sampled from the last coordinate to the first, each given those after it.

    With z = U d − c each z is standard normal between bounds that the coordinates after it set. Where the density is
    cut in its tail, normal variables of mean μ in place of zero bring the samples to where the integral is.

    Parameters
    ----------
    U : (k, k) upper triangular
    centre : (k,) c
    low, high : (k,)
    """

    U: Reals
    centre: Reals
    low: Reals
    high: Reals

    @property
    def log_constant(self) -> float:
        """What the mean of the weights is multiplied by; for exp(−gᵀd − ½ dᵀUᵀU d), whose c is −U⁻ᵀg."""
        constant = 0.5 * len(self.U) * np.log(2.0 * np.pi) - np.log(np.diag(self.U)).sum()
        return float(0.5 * self.centre @ self.centre + constant)

    def saddle(self) -> Reals:
        """(k,) means μ with the smallest largest weight, by Newton's method from zero.

        The Newton step is one of a concave function of d, the logarithm of the weight at the means of z, so that a
        part of it increases this function.
        """
        mu = np.zeros(len(self.U))
        value, slope = self._at_means(mu)
        for _ in range(_MOST_STEPS):
            ends = [mu + h * e for h, e in zip(1e-6 * (1.0 + np.abs(mu)), np.eye(len(mu)))]
            jacobian = np.column_stack([(self._at_means(end)[1] - slope) / (end - mu).sum() for end in ends])
            try:
                step = -np.linalg.solve(jacobian, slope)
            except np.linalg.LinAlgError:
                break
            part = 1.0
            new = self._at_means(mu + step)
            while not new[0] >= value - 1e-12 * abs(value) and part > 1e-9:
                part *= 0.5
                new = self._at_means(mu + part * step)
            if not new[0] >= value - 1e-12 * abs(value):
                break
            change, mu = new[0] - value, mu + part * step
            value, slope = new
            if part == 1.0 and abs(change) < 1e-9 * (1.0 + abs(value)):
                break
        return mu

    def _at_means(self, mu: Reals) -> tuple[float, Reals]:
        """Logarithm of the weight where each z is at its mean, and what is zero at the saddle point."""
        k = len(mu)
        d, of_z, value = np.zeros(k), np.zeros(k), 0.0
        for i in range(k - 1, -1, -1):
            rest = self.U[i, i + 1 :] @ d[i + 1 :] - self.centre[i]
            a, b = self.U[i, i] * self.low[i] + rest - mu[i], self.U[i, i] * self.high[i] + rest - mu[i]
            of_z[i] = mean_between(a, b)
            value += float(log_mass(a, b)) - (0.5 * mu[i] + of_z[i]) * mu[i]
            d[i] = np.clip((mu[i] + of_z[i] - rest) / self.U[i, i], self.low[i], self.high[i])
        return value, mu + of_z - np.linalg.solve(self.U.T, np.diag(self.U) * of_z)

    def log_weights(self, mu: Reals, at: Reals) -> Reals:
        """(n,) logarithm of the normal density over that of the samples, of points (n, k) of the unit cube."""
        n, k = at.shape
        d, log_weight = np.zeros((n, k)), np.zeros(n)
        for i in range(k - 1, -1, -1):
            rest = d[:, i + 1 :] @ self.U[i, i + 1 :] - self.centre[i]
            a, b = self.U[i, i] * self.low[i] + rest - mu[i], self.U[i, i] * self.high[i] + rest - mu[i]
            off = line_sample(np.zeros(n), np.ones(n), a, b, at[:, i])
            log_weight += log_mass(a, b) - (0.5 * mu[i] + off) * mu[i]
            d[:, i] = np.clip((mu[i] + off - rest) / self.U[i, i], self.low[i], self.high[i])
        return log_weight


def _quasi_random(k: int) -> Reals:
    """(points, k) of the unit cube: multiples of the roots of the first primes, folded (Richtmyer)."""
    primes: list[int] = []
    number = 2
    while len(primes) < k:
        if all(number % p for p in primes):
            primes.append(number)
        number += 1
    steps = np.sqrt(np.array(primes, float))
    points = np.mod(np.arange(1, _POINTS + 1)[:, None] * steps + 0.5, 1.0)
    return np.clip(np.abs(2.0 * points - 1.0), *_INSIDE)
