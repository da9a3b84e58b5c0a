"""What weighted samples look like: quantiles, pairs of parameters that bend, points far from all samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from femtune.arrays import Reals

_FAR = 2.0
"""Distance of a point to the nearest sample, over the largest distance of a sample to its own nearest one, from which
the point is no part of the sampled region."""
_BENT = 0.1
"""Part of the variance of a parameter that a parabola in another explains beyond a line, from which a pair bends."""


def weighted_quantiles(values: Reals, weights: Reals, at: Reals) -> Reals:
    """Quantiles of samples (n,) with weights that sum to one.

    Examples
    --------
    >>> weighted_quantiles(np.array([3.0, 1.0, 2.0]), np.full(3, 1 / 3), np.array([0.5])).tolist()
    [2.0]
    """
    order = np.argsort(values, kind="stable")
    w = weights[order]
    return np.asarray(np.interp(at, np.cumsum(w) - 0.5 * w, values[order]))


@dataclass(frozen=True)
class Bend:
    """Two parameters by position, and the part of the variance of the second that a parabola explains beyond a line."""

    first: int
    second: int
    share: float


def bends(x: Reals, weights: Reals) -> list[Bend]:
    """Pairs of parameters (n, k) whose joint distribution is bent, the most bent first; each pair once.

    Examples
    --------
    >>> t = np.linspace(-1.0, 1.0, 201)
    >>> [(b.first, b.second) for b in bends(np.column_stack([t, t**2]), np.full(201, 1 / 201))]
    [(0, 1)]
    """
    k = x.shape[1]
    z = x - weights @ x
    sd = np.sqrt(weights @ z**2)
    z = z / np.where(sd > 0.0, sd, 1.0)
    best: dict[tuple[int, int], Bend] = {}
    for i in range(k):
        # the square without what a constant and a line explain
        square = z[:, i] ** 2 - weights @ z[:, i] ** 2
        square = square - (weights @ (square * z[:, i])) * z[:, i]
        size = float(weights @ square**2)
        if size <= 0.0:
            continue
        share = (weights @ (square[:, None] * z)) ** 2 / size
        for j in range(k):
            key = (min(i, j), max(i, j))
            if j != i and share[j] > _BENT and (key not in best or share[j] > best[key].share):
                best[key] = Bend(i, j, float(share[j]))
    return sorted(best.values(), key=lambda b: -b.share)


def far_from(x: Reals, point: Reals) -> bool:
    """Whether a point (k,) is outside the region of samples (n, k), in their own standard deviations.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal((500, 2))
    >>> far_from(x, np.zeros(2)), far_from(x, np.array([9.0, 0.0]))
    (False, True)
    """
    covariance = np.atleast_2d(np.cov(x.T))
    values, V = np.linalg.eigh(covariance)
    root = V / np.sqrt(np.maximum(values, 1e-14 * values.max()))
    tree = cKDTree(np.unique(x, axis=0) @ root)
    spacing = float(tree.query(tree.data, k=2)[0][:, 1].max())
    return bool(tree.query(point @ root)[0] > _FAR * spacing)
