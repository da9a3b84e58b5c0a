"""Instances of a model that a test does not falsify: points at which no residual exceeds its limit.

Error-domain model falsification draws a population of instances and rejects those with a residual that measurement and
model errors do not explain. Those that are left are equally good; what they predict is a range. With several
parameters most instances of the whole box are rejected, so that a second population is drawn where the linearised
residuals keep a wider limit.

Source: J.-A. Goulet, I. F. C. Smith, Structural identification with systematic errors and unknown uncertainty
dependencies, Computers and Structures 128, 2013. Lines through the points (hit-and-run): R. L. Smith, Operations
Research 32, 1984.
"""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals

_SWEEPS = 20
"""Moves of each point along random lines, per parameter, so that it does not depend on where it began."""


def near_instances(
    J: Reals, r: Reals, lower: Reals, upper: Reals, limit: float, count: int, seed: int = 0, of_sum: bool = False
) -> Reals:
    """Points (count, k), uniformly distributed where the linearised residuals keep a limit within a box.

    Parameters
    ----------
    J, r : (n, k) and (n,) residuals r + J d, which keep the limit at d = 0
    lower, upper : (k,) of d
    limit : largest absolute residual; with `of_sum` the largest root of the sum of squares
    seed : of the points

    Examples
    --------
    >>> found = near_instances(np.eye(2), np.zeros(2), -np.ones(2), np.ones(2), 0.5, 2000)
    >>> bool(np.abs(found).max() <= 0.5), bool(np.abs(found.std(axis=0) - 0.5 / np.sqrt(3.0)).max() < 0.02)
    (True, True)
    """
    rng, k = np.random.default_rng(seed), len(lower)
    axes = _axes(J, upper - lower)
    d, at = np.zeros((count, k)), np.tile(r, (count, 1))
    for i in range(_SWEEPS * k):
        # axes of the linearised region, and random mixtures of them
        mixed = rng.standard_normal((count, k)) if i % 2 else np.eye(k)[rng.integers(k, size=count)]
        way = mixed @ axes
        slope = way @ J.T
        first, last = _within(d, way, lower, upper)
        if of_sum:
            low, high = _of_sum(at, slope, limit)
        else:
            low, high = _within(at, slope, np.full(len(r), -limit), np.full(len(r), limit))
        first, last = np.maximum(first, low), np.minimum(last, high)
        step = np.where(last > first, first + rng.random(count) * (last - first), 0.0)[:, None]
        d, at = d + step * way, at + step * slope
    return np.clip(d, lower, upper)


def _axes(J: Reals, width: Reals) -> Reals:
    """(k, k) rows: axes of the linearised region, each about as long as the region is wide."""
    _, s, axes = np.linalg.svd(J * width, full_matrices=len(J) < len(width))
    size = np.zeros(len(width))
    size[: len(s)] = s
    return np.asarray(axes / np.maximum(size, 1.0)[:, None] * width)


def _within(at: Reals, way: Reals, low: Reals, high: Reals) -> tuple[Reals, Reals]:
    """(count,) each, the steps t between which at + t way stays within limits."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - at) / way, (high - at) / way
    still = way == 0.0
    first = np.where(still, -np.inf, np.minimum(one, other)).max(axis=1)
    last = np.where(still, np.inf, np.maximum(one, other)).min(axis=1)
    return np.minimum(first, 0.0), np.maximum(last, 0.0)


def _of_sum(at: Reals, slope: Reals, limit: float) -> tuple[Reals, Reals]:
    """As `_within`, for the root of the sum of squares."""
    a, b = np.sum(slope**2, axis=1), np.sum(at * slope, axis=1)
    c = np.minimum(np.sum(at**2, axis=1) - limit**2, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
        first, last = (-b - root) / a, (-b + root) / a
    still = a == 0.0
    return np.where(still, -np.inf, first), np.where(still, np.inf, last)
