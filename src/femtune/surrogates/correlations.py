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


GAUSSIAN = CorrelationFunction("Gaussian", _gaussian, _gaussian_slope, _gaussian_curvature)
MATERN_52 = CorrelationFunction("Matérn, ν = 5/2", _matern52, _matern52_slope, _matern52_curvature)
MATERN_32 = CorrelationFunction("Matérn, ν = 3/2", _matern32, _matern32_slope, _matern32_curvature)
NO_CORRELATION = None
"""The trend alone: a response surface fitted by least squares."""


@dataclass(frozen=True, eq=False)
class KernelSum:
    """Σ wᵢ k(h²) of the distances from the runs, with first and second derivatives.

    Parameters
    ----------
    kind : of the kernel
    runs : (N, n)
    lengths : (n,)
    weights : (N,)
    """

    kind: CorrelationFunction
    runs: Reals
    lengths: Reals
    weights: Reals

    def each(self, u: Reals) -> Reals:
        """(k, N) kernel between points (k, n) and runs."""
        return self.kind.value(np.sum(self._away(u) ** 2, axis=2))

    def value(self, u: Reals) -> Reals:
        """(k,)."""
        return np.asarray(self.each(u) @ self.weights)

    def slopes(self, u: Reals) -> Reals:
        """(k, n)."""
        away = self._away(u)
        bent = self.kind.slope(np.sum(away**2, axis=2)) * self.weights
        return np.asarray(2.0 * np.einsum("ki,kin->kn", bent, away) / self.lengths)

    def curvatures(self, u: Reals) -> Reals:
        """(k, n, n)."""
        away = self._away(u)
        squared = np.sum(away**2, axis=2)
        bent, curved = (part(squared) * self.weights for part in (self.kind.slope, self.kind.curvature))
        curvature = 4.0 * np.einsum("ki,kin,kim->knm", curved, away, away)
        curvature = curvature + 2.0 * np.sum(bent, axis=1)[:, None, None] * np.eye(len(self.lengths))
        return np.asarray(curvature / np.outer(self.lengths, self.lengths))

    def _away(self, u: Reals) -> Reals:
        return np.asarray((u[:, None] - self.runs[None]) / self.lengths)
