"""The normal distribution between two bounds: its probability, its mean and its quantiles.

Everything holds for bounds of any distance from each other and from the centre, also where the probability itself is
zero in floating point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx, log_ndtr, ndtri_exp

from femtune.arrays import Reals

_HALF_LOG_2PI = 0.5 * float(np.log(2.0 * np.pi))
"""Logarithm of √(2π)."""
_THIN = 1e-3
"""Distance of two bounds, relative to the length on which the density changes, below which it is taken as a series."""
_ROOT_2 = float(np.sqrt(2.0))
"""Square root of two."""


def log_mass(a: Reals | float, b: Reals | float) -> Reals:
    """Logarithm of the standard normal probability of a ≤ z ≤ b, of the shape of a and b.

    Examples
    --------
    >>> print(log_mass(np.array([-1.96, 50.0]), np.array([1.96, 51.0])).round(4).tolist())
    [-0.0513, -1254.8314]
    """
    far, near = _turned(a, b)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        middle, width = 0.5 * (far + near), near - far
        thin = -0.5 * middle**2 - _HALF_LOG_2PI + np.log(width) + (middle**2 - 1.0) * width**2 / 24.0
        wide = log_ndtr(near) + np.log(-np.expm1(_log_ratios(far, near)[1]))
    return np.asarray(np.where(_is_thin(far, near), thin, wide))


def mean_between(a: Reals | float, b: Reals | float) -> Reals:
    """Mean of a standard normal z with a ≤ z ≤ b, of the shape of a and b: (φ(a) − φ(b)) / (Φ(b) − Φ(a)).

    Examples
    --------
    >>> print(mean_between(np.array([0.0, 1e8]), np.array([np.inf, 2e8])).round(6).tolist())
    [0.797885, 100000000.0]
    """
    far, near = _turned(a, b)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        thin = 0.5 * (far + near) * (1.0 - (near - far) ** 2 / 12.0)
        densities, tails = _log_ratios(far, near)
        wide = -np.sqrt(2.0 / np.pi) / erfcx(-near / _ROOT_2) * np.expm1(densities) / np.expm1(tails)
    found = _within(np.where(_is_thin(far, near), thin, wide), far, near)
    return np.asarray(np.where(a + b > 0.0, -found, found))


def _turned(a: Reals | float, b: Reals | float) -> tuple[Reals, Reals]:
    """The bounds, mirrored where the upper one is farther from the centre."""
    turned = a + b > 0.0
    return np.where(turned, -b, a), np.where(turned, -a, b)


def _is_thin(far: Reals, near: Reals) -> NDArray[np.bool_]:
    with np.errstate(over="ignore"):
        return np.asarray((near - far) * np.maximum(1.0, -near) < _THIN)


def _log_ratios(far: Reals, near: Reals) -> tuple[Reals, Reals]:
    """Logarithms of the ratios of the densities at two bounds, and of the tails beyond them, to the digits of both."""
    densities = 0.5 * (near - far) * (near + far)
    scaled = np.log(erfcx(-far / _ROOT_2) / erfcx(-near / _ROOT_2))
    return densities, np.where(near < 0.0, densities + scaled, log_ndtr(far) - log_ndtr(near))


_FLAT = 1e-8
"""Squared width of an interval in standard deviations, below which the density on it is exponential to half of the
digits."""
_FAR_TAIL = 1e3
"""Distance of an interval from the centre, in standard deviations, from which the tail is exponential to 1e-6, the
square of its reciprocal."""


def line_sample(tilt: Reals, curvature: Reals, low: Reals, high: Reals, share: Reals) -> Reals:
    """Points t of low ≤ t ≤ high at a share of the distribution with density exp(−tilt·t − ½ curvature·t²).

    Without curvature, and where the normal distribution is cut far from its centre, it is an exponential one.
    """
    width = np.maximum(high - low, 0.0)
    root = np.sqrt(curvature)
    safe = np.where(root > 0.0, root, 1.0)
    # in standard deviations from the centre, turned so that the nearer end to the centre is the upper one
    start, end = tilt / safe + root * low, tilt / safe + root * high
    turned = start + end > 0.0
    far, near = _turned(start, end)
    straight = (curvature * width**2 <= _FLAT) | (near < -_FAR_TAIL)
    part = np.where(turned, 1.0 - share, share)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        top = log_ndtr(near)
        z = ndtri_exp(np.minimum(top + np.log(part + (1.0 - part) * np.exp(log_ndtr(far) - top)), -1e-300))
        bent = (np.where(turned, -z, z) - tilt / safe) / safe
    if not straight.any():
        return _within(bent, low, high)
    rate = np.where(turned, tilt + curvature * low, -(tilt + curvature * high))
    from_near = _exponential(rate, width, np.where(turned, share, 1.0 - share))
    line = np.where(turned, low + from_near, high - from_near)
    return _within(np.where(straight, line, bent), low, high)


def _within(values: Reals, low: Reals, high: Reals) -> Reals:
    """As `np.clip`, which takes several times as long for few values."""
    return np.asarray(np.minimum(np.maximum(values, low), high))


def _exponential(rate: Reals, width: Reals, share: Reals) -> Reals:
    """Distance from the end, 0 to width, with density exp(−rate·s)."""
    decay = rate * width
    small = np.abs(decay) < 1e-6
    safe = np.where(small, 1.0, rate)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        distance = -np.log1p(share * np.expm1(-np.where(small, 1.0, decay))) / safe
    return np.where(small, share * width, distance)
