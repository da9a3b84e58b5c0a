"""Robust mean and covariance of repeats, and repeats that are outliers: the minimum covariance determinant.

Mean and covariance are those of the h repeats whose covariance has the smallest determinant (Rousseeuw and Van Driessen
1999), followed by one reweighting: the repeats within the 97.5 % ellipsoid of that estimate. Outliers in different
directions cannot hide each other, because they do not enter the estimate.

All steps are affine equivariant: for normally distributed repeats the distances do not depend on mean and covariance,
only on the numbers of repeats and outputs. The cut of the reweighting, the consistency factor of the covariance and the
limit of the distances are therefore found by simulation of standard normal tables of the same size with the same
algorithm; asymptotic ones name far too many repeats when there are few (Pison, Van Aelst and Willems 2002).

With few repeats robust distances detect a single outlier less often than distances from mean and covariance of all
repeats do. Both are used: a repeat beyond either limit is an outlier, and the limits are such that 5 % of all clean
tests have one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from femtune.arrays import Flags, Integers, Reals

LEVEL = 0.05
"""Significance level of the test for outliers, over all repeats of a table together."""
_SPARE_REPEATS = 4
"""Repeats beyond the number of outputs for which the estimate is made."""
_SUBSET_SHARE = 0.75
"""Share of the repeats in the subset of the smallest determinant: a quarter may be outliers. Half would tolerate more
and be far less efficient for few repeats (Rousseeuw and Van Driessen 1999)."""
_REWEIGHTING_QUANTILE = 0.975
"""Quantile of the distances within which repeats enter the reweighted estimate (Rousseeuw and Van Driessen 1999)."""
_STARTS = 40
"""Random subsets that concentration steps begin with. Tables are small: FAST-MCD takes 500 for large ones."""
_FIRST_STEPS = 3
"""Concentration steps from each."""
_KEPT = 3
"""Best of them that are concentrated further."""
_MORE_STEPS = 12
"""Further steps of these; steps after convergence change nothing."""
_CALIBRATION_TABLES = 1000
"""Normal tables from which limits are calibrated: p-values near 0.05 are known to ± 0.7 %."""
_FLOATS_AT_ONCE = 2_000_000
"""Numbers of tables that are worked on at once: 16 MB."""
_SINGULAR_VARIANCE = 1e-10
"""Geometric mean of the eigenvalues of a subset of standardised outputs, at or below which its covariance is
singular."""


@dataclass(frozen=True)
class RobustMoments:
    """Robust mean and covariance of n repeats of m outputs.

    Parameters
    ----------
    mean, covariance : (m,), (m, m), consistent for normally distributed repeats
    distance : (n,) robust distance of each repeat
    limit : of these distances
    plain_distance, plain_limit : the same for mean and covariance of all repeats
    p_value : probability that a clean test has as large a distance of one of the two kinds
    """

    mean: Reals
    covariance: Reals
    distance: Reals
    limit: float
    plain_distance: Reals
    plain_limit: float
    p_value: float

    @property
    def outliers(self) -> Integers:
        """Positions of the repeats beyond a limit."""
        return np.flatnonzero((self.distance > self.limit) | (self.plain_distance > self.plain_limit))


WhyNot = Literal["few", "flat"]


def subset_size(repeats: int, outputs: int) -> int:
    """Number h of repeats whose covariance has the smallest determinant: three quarters of them, m + 2 at least."""
    return min(repeats, max(int(np.ceil(_SUBSET_SHARE * repeats)), outputs + 2))


def robust_moments(table: Reals) -> RobustMoments | WhyNot:
    """Robust moments of repeats (n, m) without gaps.

    "few" is returned for fewer than m + 4 repeats, "flat" where three quarters of the repeats have a singular
    covariance (values that are rounded too much, or outputs that are functions of each other).

    Source: Rousseeuw and Van Driessen (1999), A fast algorithm for the minimum covariance determinant estimator,
    Technometrics 41, 212-223; Pison, Van Aelst and Willems (2002), Small sample corrections for LTS and MCD,
    Metrika 55, 111-123.

    Examples
    --------
    >>> import numpy as np
    >>> table = np.random.default_rng(3).normal(size=(30, 2))
    >>> table[4] += 20.0
    >>> [int(i) for i in robust_moments(table).outliers]
    [4]
    """
    n, m = table.shape
    if n < m + _SPARE_REPEATS:
        return "few"
    centre, sd = np.median(table, axis=0), table.std(axis=0)
    try:
        root = np.linalg.cholesky(np.atleast_2d(np.cov(((table - centre) / sd).T)))
    except np.linalg.LinAlgError:
        return "flat"
    white = np.linalg.solve(root, ((table - centre) / sd).T).T[None]
    raw, flat = raw_distances(white)
    if flat[0]:
        return "flat"
    usual, back = calibration(n, m), root.T * sd
    mean, covariance, d2 = (a[0] for a in _reweighted(white, raw, usual.cut))
    distance = np.sqrt(d2 / usual.factor)
    plain = np.linalg.norm(white[0] - white[0].mean(axis=0), axis=1)
    limits, p = usual.judged(np.array([distance.max(), plain.max()]))
    covariance = usual.factor * back.T @ covariance @ back
    return RobustMoments(centre + mean @ back, covariance, distance, limits[0], plain, limits[1], p)


@dataclass(frozen=True)
class _Calibration:
    """Calibration by clean tables of one size.

    Parameters
    ----------
    cut : squared distance from the raw estimate that 97.5 % of the repeats stay below
    factor : consistency factor of the reweighted covariance
    largest : (2, tables) largest robust and plain distance of each table
    """

    cut: float
    factor: float
    largest: Reals

    def judged(self, largest: Reals) -> tuple[Reals, float]:
        """Limits of both kinds (2,), and the p-value of the largest distances (2,) of a data set.

        The level of each kind is that at which one table in twenty has a distance beyond either limit.
        """
        ordered, count = np.sort(self.largest, axis=1), self.largest.shape[1]

        def smallest(of: Reals) -> Reals:
            shares = [1.0 - np.searchsorted(row, one, side="left") / count for row, one in zip(ordered, of)]
            return np.asarray(np.min(shares, axis=0))

        of_tables = smallest(self.largest)
        limits = np.quantile(self.largest, 1.0 - np.quantile(of_tables, LEVEL), axis=1)
        p = (1 + (of_tables <= smallest(largest)).sum()) / (1 + count)
        return limits, float(p)


@lru_cache(maxsize=32)
def calibration(n: int, m: int) -> _Calibration:
    tables = np.random.default_rng(0).standard_normal((_CALIBRATION_TABLES, n, m))
    at_once = max(1, int(_FLOATS_AT_ONCE / (_STARTS * n * m)))
    parts = np.split(tables, range(at_once, _CALIBRATION_TABLES, at_once))
    raw = [raw_distances(part)[0] for part in parts]
    cut = float(np.quantile(np.concatenate(raw), _REWEIGHTING_QUANTILE))
    reweighted = [_reweighted(part, d2, cut) for part, d2 in zip(parts, raw)]
    covariance, d2 = (np.concatenate([f[i] for f in reweighted]) for i in (1, 2))
    factor = float(m / np.trace(covariance, axis1=1, axis2=2).mean())
    plain = np.linalg.norm(_whitened(tables), axis=2).max(axis=1)
    return _Calibration(cut, factor, np.stack([np.sqrt(d2.max(axis=1) / factor), plain]))


def _whitened(tables: Reals) -> Reals:
    """Tables (b, n, m) of zero mean and unit covariance, but for a rotation of each."""
    centred = tables - tables.mean(axis=1, keepdims=True)
    covariance = np.swapaxes(centred, 1, 2) @ centred / (tables.shape[1] - 1)
    return np.asarray(np.swapaxes(np.linalg.solve(np.linalg.cholesky(covariance), np.swapaxes(centred, 1, 2)), 1, 2))


def _reweighted(tables: Reals, raw: Reals, cut: float) -> tuple[Reals, Reals, Reals]:
    """Means (b, m), covariances (b, m, m) and squared distances (b, n) from the repeats whose raw ones are small."""
    weights = (raw <= cut).astype(float)[:, None, :]
    mean, covariance = _weighted(tables, weights, spare=1.0)
    return mean[:, 0], covariance[:, 0], _distances(tables, mean, covariance)[:, 0]


def raw_distances(tables: Reals) -> tuple[Reals, Flags]:
    """Squared distances (b, n) from the subset with the smallest determinant, by concentration steps."""
    b, n, m = tables.shape
    h = subset_size(n, m)
    chosen = _starts(n, m)
    weights = np.broadcast_to(chosen, (b, *chosen.shape)).astype(float)
    weights, _ = _concentrated(tables, weights, h, _FIRST_STEPS)
    size = _log_determinants(tables, weights)
    kept = np.argsort(size, axis=1)[:, :_KEPT]
    weights, d2 = _concentrated(tables, np.take_along_axis(weights, kept[:, :, None], axis=1), h, _MORE_STEPS)
    size = _log_determinants(tables, weights)
    best = size.argmin(axis=1)
    rows = np.arange(b)
    return d2[rows, best], size[rows, best] <= np.log(_SINGULAR_VARIANCE) * m


@lru_cache(maxsize=32)
def _starts(n: int, m: int) -> Reals:
    """(starts, n) of 0 and 1: subsets of m + 1 repeats, and all repeats."""
    rng, rows = np.random.default_rng(1), np.ones((_STARTS + 1, n))
    for i in range(_STARTS):
        rows[i] = 0.0
        rows[i, rng.permutation(n)[: m + 1]] = 1.0
    return rows


def _concentrated(tables: Reals, weights: Reals, h: int, steps: int) -> tuple[Reals, Reals]:
    """Subsets (b, s, n) after steps that take the h repeats nearest to the moments of the last subset."""
    d2 = np.zeros_like(weights)
    for _ in range(steps):
        d2 = _distances(tables, *_weighted(tables, weights))
        new = (d2 <= np.partition(d2, h - 1, axis=2)[:, :, h - 1 : h]).astype(float)
        if np.array_equal(new, weights):
            break
        weights = new
    return weights, d2


def _weighted(tables: Reals, weights: Reals, spare: float = 0.0) -> tuple[Reals, Reals]:
    """Means (b, s, m) and covariances (b, s, m, m) of subsets (b, s, n)."""
    b, n, m = tables.shape
    count = weights.sum(axis=2)[:, :, None]
    mean = weights @ tables / count
    products = (tables[:, :, :, None] * tables[:, :, None, :]).reshape(b, n, m * m)
    second = (weights @ products / count).reshape(b, -1, m, m)
    covariance = second - mean[:, :, :, None] * mean[:, :, None, :]
    return mean, covariance * (count / np.maximum(count - spare, 1.0))[..., None]


def _distances(tables: Reals, mean: Reals, covariance: Reals) -> Reals:
    """Squared distances (b, s, n)."""
    b, n, m = tables.shape
    trace = np.trace(covariance, axis1=2, axis2=3)[..., None, None] / m
    inverse = np.linalg.inv(covariance + (1e-12 * trace + 1e-300) * np.eye(m))
    products = (tables[:, :, :, None] * tables[:, :, None, :]).reshape(b, n, m * m)
    along = np.einsum("bsij,bsj->bsi", inverse, mean)
    quadratic = inverse.reshape(b, -1, m * m) @ np.swapaxes(products, 1, 2)
    cross = along @ np.swapaxes(tables, 1, 2)
    return np.asarray(np.maximum(quadratic - 2.0 * cross + np.einsum("bsi,bsi->bs", along, mean)[..., None], 0.0))


def _log_determinants(tables: Reals, weights: Reals) -> Reals:
    """(b, s)."""
    size = np.linalg.det(_weighted(tables, weights)[1])
    return np.asarray(np.log(np.maximum(size, 1e-300)))
