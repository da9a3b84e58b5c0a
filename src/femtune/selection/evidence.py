"""The evidence of a set of parameters: the likelihood, averaged over the prior within the bounds.

At an optimum the residuals are taken as linear, so that the likelihood is a normal density of the parameters, which the
bounds truncate. Its integral over the box is that of a sequence of one-dimensional conditional densities, averaged over
quasi-random points. Combinations without any curvature are limited by the box alone, and parameters at a bound keep the
slope that they have there.

Source: A. Genz, Numerical computation of multivariate normal probabilities, Journal of Computational and Graphical
Statistics 1, 1992 (here with the factor of the inverse covariance, which exists for undetermined combinations too).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

from femtune.arrays import Reals

_POINTS = 4096
"""Quasi-random points: the logarithm of the integral is right to a few thousandths with twelve parameters."""
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
            mass = float(_log_mass(np.array([low]), np.array([high]))[0])
            value -= 0.5 * (fit.mean[i] / fit.sd[i]) ** 2 + np.log(fit.sd[i]) + 0.5 * np.log(2.0 * np.pi) + mass
        else:
            value -= np.log(fit.upper[i] - fit.lower[i])
    return value + log_box_integral(H, g, fit.lower, fit.upper)


def log_box_integral(H: Reals, g: Reals, lower: Reals, upper: Reals) -> float:
    """ln ∫ exp(−gᵀd − ½ dᵀH d) dd over lower ≤ d ≤ upper; H is symmetric and may be singular.

    Parameters
    ----------
    H, g : (k, k) and (k,)
    lower, upper : (k,)
    """
    width, k = upper - lower, len(g)
    # the box is the unit cube; those that the data determine best are sampled last, given the others
    order = np.argsort(np.diag(H) * width**2)[::-1]
    H = (H * width[:, None] * width)[np.ix_(order, order)] + _FLAT * np.eye(k)
    g, low, high = (g * width)[order], (lower / width)[order], (upper / width)[order]
    U = np.linalg.cholesky(H).T
    shift = np.linalg.solve(U.T, -g)
    at = _quasi_random(k)
    d, log_weight = np.zeros((len(at), k)), np.zeros(len(at))
    for i in range(k - 1, -1, -1):
        centre = (shift[i] - d[:, i + 1 :] @ U[i, i + 1 :]) / U[i, i]
        a, b = U[i, i] * (low[i] - centre), U[i, i] * (high[i] - centre)
        log_weight += _log_mass(a, b)
        d[:, i] = np.clip(centre + _between(a, b, at[:, i]) / U[i, i], low[i], high[i])
    largest = log_weight.max()
    log_mass = largest + float(np.log(np.mean(np.exp(log_weight - largest))))
    constant = 0.5 * k * np.log(2.0 * np.pi) - float(np.sum(np.log(np.diag(U)))) + float(np.sum(np.log(width)))
    return float(0.5 * shift @ shift + constant + log_mass)


def _log_mass(a: Reals, b: Reals) -> Reals:
    """Logarithm of the standard normal probability of a ≤ z ≤ b."""
    turned = a + b > 0.0
    far, near = np.where(turned, -b, a), np.where(turned, -a, b)
    top = log_ndtr(near)
    gap = np.minimum(log_ndtr(far) - top, 0.0)
    # the density times the width where the two logarithms are equal to rounding
    thin = -0.5 * (0.5 * (a + b)) ** 2 - 0.5 * np.log(2.0 * np.pi) + np.log(np.maximum(b - a, 1e-300))
    with np.errstate(divide="ignore"):
        return np.where(-gap < 1e-7, thin, top + np.log(-np.expm1(gap)))


def _between(a: Reals, b: Reals, share: Reals) -> Reals:
    """z with a share of the probability of a ≤ z ≤ b below it."""
    turned = a + b > 0.0
    far, near = np.where(turned, -b, a), np.where(turned, -a, b)
    part = np.where(turned, 1.0 - share, share)
    top = log_ndtr(near)
    gap = np.minimum(log_ndtr(far) - top, 0.0)
    z = ndtri_exp(np.minimum(top + np.log(part + (1.0 - part) * np.exp(gap)), -1e-300))
    z = np.where(-gap < 1e-7, far + part * (near - far), z)
    return np.asarray(np.where(turned, -z, z))


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
