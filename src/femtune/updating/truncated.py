"""Samples of a normal, or of Student's t, distribution that is truncated to a box.

Each step moves a point along a line through it, to a sample of the exact conditional distribution on the part of the
line inside the box (hit-and-run). The lines are the coordinate axes (Gibbs sampler), the principal axes of the
quadratic form, and differences of two other points of an ensemble, which take the shape of the truncated distribution.
Combinations without any curvature are limited by the box alone; nothing is inverted.

Source: C. J. P. Bélisle, H. E. Romeijn, R. L. Smith, Hit-and-run algorithms for generating multivariate distributions,
Mathematics of Operations Research 18, 1993; C. J. F. ter Braak, Statistics and Computing 16, 2006 (differences of
members of an ensemble as directions).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.truncated_normal import line_sample


@dataclass(frozen=True)
class SamplerRules:
    """Number of samples; the seed makes them reproducible.

    Parameters
    ----------
    chains : points that move side by side
    least : effective number of samples of each coordinate, at least
    most : sweeps over all directions that are kept, at most
    """

    chains: int = 256
    least: int = 5_000
    most: int = 300
    seed: int = 0


Places = NDArray[np.int64]
_INSIDE = (1e-300, 1.0 - 2e-16)
"""Ends of the unit box, so that the distance to an end is never zero."""
_BLOCK = 20
"""Sweeps between two checks."""
_MOST_BLOCKS = 40
"""Blocks of sweeps after which chains that are not steady are given up."""
_FEW = 30
"""Parameters above which fewer sweeps are made, in proportion: a sweep costs the square of their number."""
_STEADY = 0.4
"""Largest change of a mean or standard deviation from block to block, in standard deviations, that ends the first
phase."""
_STEADY_ALL = 0.15
"""Root mean square of these changes that ends it; by chance alone the means of 256 chains differ by 0.09."""


def box_samples(
    A: Reals, b: Reals, lower: Reals, upper: Reals, degrees: float = np.inf, rules: SamplerRules = SamplerRules()
) -> Reals:
    """Samples (n, k) of d inside lower ≤ d ≤ upper, with density exp(−½|A d + b|²), or that of Student's t.

    Parameters
    ----------
    A, b : (m, k) and (m,); A may be singular, and has any condition
    lower, upper : (k,) ends of the box; it contains zero, where all points start
    degrees : degrees of freedom ν of Student's t, density (1 + |A d + b|²/ν)^(−(ν + m)/2)

    Examples
    --------
    >>> import numpy as np
    >>> found = box_samples(np.eye(1), np.zeros(1), np.zeros(1), np.full(1, 8.0))
    >>> bool(abs(found.mean() - np.sqrt(2 / np.pi)) < 0.02)
    True
    """
    return sample_box(A, b, lower, upper, degrees, rules).values


@dataclass(frozen=True, eq=False)
class BoxSamples:
    """Samples (n, k), and whether they are enough.

    Parameters
    ----------
    effective : effective number of independent samples of the coordinate with the fewest
    settled : whether the distribution of the points stopped changing before they were taken
    """

    values: Reals
    effective: float
    settled: bool


def sample_box(A: Reals, b: Reals, lower: Reals, upper: Reals, degrees: float, rules: SamplerRules) -> BoxSamples:
    """As `box_samples`."""
    width = upper - lower
    chains = _Chains.start(A * width, b + A @ lower, -lower / width, degrees, rules)
    settled = chains.settle()
    samples = chains.collected()
    return BoxSamples(lower + width * samples.reshape(-1, len(lower)), float(effective_number(samples).min()), settled)


@dataclass(eq=False)
class _Chains:
    """Points u (chains, k) of the unit box, and y = A u + b."""

    A: Reals
    b: Reals
    axes: Reals
    degrees: float
    rules: SamplerRules
    rng: np.random.Generator
    u: Reals
    y: Reals = field(init=False)
    size: Reals = field(init=False)

    @classmethod
    def start(cls, A: Reals, b: Reals, at: Reals, degrees: float, rules: SamplerRules) -> _Chains:
        """All points at one place."""
        _, _, axes = np.linalg.svd(A, full_matrices=len(A) < A.shape[1])
        u = np.tile(np.clip(at, *_INSIDE), (rules.chains, 1))
        return cls(A, b, axes, degrees, rules, np.random.default_rng(rules.seed), u)

    def __post_init__(self) -> None:
        self.y = self.u @ self.A.T + self.b
        self.size = np.ones(len(self.u))

    @property
    def _share(self) -> float:
        return min(1.0, _FEW / self.u.shape[1])

    def settle(self) -> bool:
        """Sweeps until mean and standard deviation of a block are those of the one before; False if they never are."""
        before = self._moments(self._sweeps(_BLOCK))
        for _ in range(max(2, int(_MOST_BLOCKS * self._share))):
            now = self._moments(self._sweeps(_BLOCK))
            change = np.concatenate([now[0] - before[0], now[1] - before[1]]) / np.tile(now[1], 2)
            if np.abs(change).max() <= _STEADY and np.sqrt(np.mean(change**2)) <= _STEADY_ALL:
                return True
            before = now
        return False

    @staticmethod
    def _moments(found: Reals) -> tuple[Reals, Reals]:
        return found.mean(axis=(0, 1)), found.std(axis=(0, 1))

    def collected(self) -> Reals:
        """(sweeps, chains, k) samples: as many sweeps as the effective number of samples requires."""
        samples, most = self._sweeps(_BLOCK), self._share * self.rules.most
        while len(samples) < most and effective_number(samples).min() < self.rules.least:
            samples = np.concatenate([samples, self._sweeps(max(_BLOCK, len(samples) // 2))])
        return samples

    def _sweeps(self, count: int) -> Reals:
        """(count, chains, k) points after each of several sweeps."""
        return np.array([self._sweep() for _ in range(count)])

    def _sweep(self) -> Reals:
        k, half = self.u.shape[1], len(self.u) // 2
        # where a direction does not change a coordinate, its bounds are infinitely far away
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for i in range(k):
                self._along_coordinate(i)
                self._along(slice(None), self.axes[i][None, :], (self.A @ self.axes[i])[None, :])
                order = self.rng.permutation(len(self.u))
                for moving, others in ((order[:half], order[half:]), (order[half:], order[:half])):
                    self._along_differences(moving, others)
        # sums of many steps carry rounding
        self.y = self.u @ self.A.T + self.b
        if np.isfinite(self.degrees):
            shape = 0.5 * (self.degrees + len(self.b))
            rate = 0.5 * (self.degrees + np.einsum("ci,ci->c", self.y, self.y))
            self.size = self.rng.gamma(shape, size=len(self.u)) / rate
        return self.u.copy()

    def _along_coordinate(self, i: int) -> None:
        slope = self.A[:, i]
        curvature, tilt = self.size * (slope @ slope), self.size * (self.y @ slope)
        t = line_sample(tilt, curvature, -self.u[:, i], 1.0 - self.u[:, i], self.rng.random(len(self.u)))
        self.u[:, i] = _between(self.u[:, i] + t, *_INSIDE)
        self.y += t[:, None] * slope

    def _along_differences(self, moving: Places, others: Places) -> None:
        one, other = others[: len(moving)], np.concatenate([others[-1:], others[:-1]])[: len(moving)]
        self._along(moving, self.u[one] - self.u[other], self.y[one] - self.y[other])

    def _along(self, at: slice | Places, direction: Reals, slope: Reals) -> None:
        u, y, size = self.u[at], self.y[at], self.size[at]
        inverse = 1.0 / direction
        forward, back = (1.0 - u) * inverse, -u * inverse
        low, high = np.minimum(forward, back).max(axis=1), np.maximum(forward, back).min(axis=1)
        # a direction of zero, of two points that are still the same, leads nowhere
        still = ~np.isfinite(low) | ~np.isfinite(high)
        low, high = np.where(still, 0.0, np.minimum(low, 0.0)), np.where(still, 0.0, np.maximum(high, 0.0))
        curvature = size * np.einsum("ci,ci->c", slope, slope)
        tilt = size * np.einsum("ci,ci->c", y, slope)
        t = line_sample(tilt, curvature, low, high, self.rng.random(len(u)))[:, None]
        self.u[at] = _between(u + t * direction, *_INSIDE)
        self.y[at] = y + t * slope


def _between(values: Reals, low: Reals | float, high: Reals | float) -> Reals:
    """As `np.clip`, which takes several times as long for few values."""
    return np.asarray(np.minimum(np.maximum(values, low), high))


def effective_number(found: Reals) -> Reals:
    """(k,) effective number of independent samples of each coordinate of (sweeps, chains, k) samples.

    Chains are independent of each other: the variance of their means shows how far their own samples are not.
    """
    sweeps, chains, _ = found.shape
    total, of_means = found.var(axis=(0, 1)), found.mean(axis=0).var(axis=0, ddof=1)
    most = np.full(len(total), float(sweeps * chains))
    return np.minimum(most, np.divide(chains * total, of_means, out=most.copy(), where=of_means > 0.0))
