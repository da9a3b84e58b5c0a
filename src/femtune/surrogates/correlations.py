"""Correlation functions of Kriging: of the scaled distance h, h² = Σ (dᵢ/lᵢ)², with one length for each parameter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals


@dataclass(frozen=True)
class CorrelationFunction:
    """A correlation function and its derivatives, all of h²; they accept complex values.

    Parameters
    ----------
    label : name in the literature
    value, slope, curvature : k(h²), dk/d(h²) and d²k/d(h²)²; the last of Matérn 3/2 is infinite at h = 0
    """

    label: str
    value: Callable[[Reals], Reals]
    slope: Callable[[Reals], Reals]
    curvature: Callable[[Reals], Reals]


def _gaussian(squared: Reals) -> Reals:
    return np.asarray(np.exp(-0.5 * squared))


def _gaussian_slope(squared: Reals) -> Reals:
    return np.asarray(-0.5 * np.exp(-0.5 * squared))


def _gaussian_curvature(squared: Reals) -> Reals:
    return np.asarray(0.25 * np.exp(-0.5 * squared))


def _matern52(squared: Reals) -> Reals:
    s = np.sqrt(5.0 * squared)
    return np.asarray((1.0 + s + s * s / 3.0) * np.exp(-s))


def _matern52_slope(squared: Reals) -> Reals:
    s = np.sqrt(5.0 * squared)
    return np.asarray(-5.0 / 6.0 * (1.0 + s) * np.exp(-s))


def _matern52_curvature(squared: Reals) -> Reals:
    return np.asarray(25.0 / 12.0 * np.exp(-np.sqrt(5.0 * squared)))


def _matern32(squared: Reals) -> Reals:
    s = np.sqrt(3.0 * squared)
    return np.asarray((1.0 + s) * np.exp(-s))


def _matern32_slope(squared: Reals) -> Reals:
    return np.asarray(-1.5 * np.exp(-np.sqrt(3.0 * squared)))


def _matern32_curvature(squared: Reals) -> Reals:
    s = np.sqrt(3.0 * squared)
    return np.asarray(2.25 / s * np.exp(-s))


CORRELATIONS = {
    "gaussian": CorrelationFunction("Gaussian", _gaussian, _gaussian_slope, _gaussian_curvature),
    "matern-5/2": CorrelationFunction("Matérn, ν = 5/2", _matern52, _matern52_slope, _matern52_curvature),
    "matern-3/2": CorrelationFunction("Matérn, ν = 3/2", _matern32, _matern32_slope, _matern32_curvature),
}
"""By their keys in a study; in the order of their smoothness."""
NO_CORRELATION = "none"
"""The trend alone: a response surface fitted by least squares."""
