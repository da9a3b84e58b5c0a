"""Sensitivity indices of a function over a box: elementary effects, and parts of the variance.

Elementary effects need few runs and tell factors without influence from the others. The indices of Sobol need thousands
of evaluations and are meant for a surrogate. Both are calculated from the responses at all points of a design, of which
some may be missing.

Sources: Morris 1991, Campolongo, Cariboni and Saltelli 2007 (elementary effects); Saltelli et al. 2010 (first indices),
Jansen 1999 (total indices); Archer, Saltelli and Sobol 1997 (their intervals by resampling).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError

_STILL = 1e-10
"""Variation of a response, relative to its mean, below which it is constant."""
_RESAMPLED = 500
"""Sets of rows drawn with replacement for the intervals of Sobol's indices."""


@dataclass(frozen=True, eq=False)
class ElementaryEffects:
    """Elementary effects of n factors on m responses, per edge of the unit cube.

    Parameters
    ----------
    mean : (n, m) mean effect
    absolute : (n, m) mean of the absolute effects: importance
    spread : (n, m) standard deviation of the effects: curvature and interaction; NaN for a single trajectory
    margin : (n, m) half width of the 95 % interval of `absolute` by Student's t; NaN for a single trajectory
    """

    mean: Reals
    absolute: Reals
    spread: Reals
    margin: Reals


@dataclass(frozen=True, eq=False)
class VarianceIndices:
    """Variance-based indices of n factors on m responses.

    Parameters
    ----------
    first : (n, m) part of the variance that a factor explains alone
    total : (n, m) part that it explains with all interactions
    first_interval, total_interval : (2, n, m) limits of the 95 % intervals that are due to the choice of points; None
        where the indices are those of a polynomial
    """

    first: Reals
    total: Reals
    first_interval: Reals | None = None
    total_interval: Reals | None = None


def morris_design(factors: int, trajectories: int, levels: int = 4, seed: int = 0) -> Reals:
    """(trajectories, n + 1, n) points of the unit cube: from each to the next, one factor changes by about half."""
    if levels < 2 or levels % 2:
        raise FemtuneError("design.morris-levels", levels=levels)
    rng = np.random.default_rng(seed)
    step, low = levels // 2, np.arange(levels // 2)
    # whole numbers of levels: what is the same point is equal
    paths = np.empty((trajectories, factors + 1, factors), dtype=int)
    for path in paths:
        up = rng.random(factors) < 0.5
        path[0] = rng.choice(low, factors) + np.where(up, 0, step)
        for i, factor in enumerate(rng.permutation(factors)):
            path[i + 1] = path[i]
            path[i + 1, factor] += step if up[factor] else -step
    return np.asarray(paths / (levels - 1.0))


def elementary_effects(paths: Reals, responses: Reals) -> ElementaryEffects:
    """Elementary effects of runs on a `morris_design`.

    Parameters
    ----------
    paths : (trajectories, n + 1, n)
    responses : (trajectories, n + 1, m); an effect between missing runs (NaN) is left out

    Raises
    ------
    FemtuneError : ``screen.too-few-effects`` where all effects of a factor are missing
    """
    steps, changes = np.diff(paths, axis=1), np.diff(responses, axis=1)
    factor = np.argmax(np.abs(steps), axis=2)
    size = np.take_along_axis(steps, factor[:, :, None], axis=2)
    effects = np.empty((len(paths), paths.shape[2], responses.shape[2]))
    np.put_along_axis(effects, factor[:, :, None], changes / size, axis=1)
    there: Flags = np.asarray(np.isfinite(effects))
    count = there.sum(axis=0)
    if not count.all():
        missing = np.flatnonzero(~count.all(axis=1)) + 1
        raise FemtuneError("screen.too-few-effects", factors=", ".join(map(str, missing)))
    mean, absolute = (np.sum(e, axis=0, where=there) / count for e in (effects, np.abs(effects)))
    spread, margin = (_deviation(e, there, m) for e, m in ((effects, mean), (np.abs(effects), absolute)))
    freedom = np.maximum(count - 1, 1)
    return ElementaryEffects(mean, absolute, spread, stdtrit(freedom, 0.975) * margin / np.sqrt(count))


def _deviation(values: Reals, there: Flags, mean: Reals) -> Reals:
    """(n, m) standard deviation over the trajectories; NaN of a single one."""
    count = there.sum(axis=0)
    squares = np.sum((values - mean) ** 2, axis=0, where=there)
    return np.where(count > 1, np.sqrt(squares / np.maximum(count - 1, 1)), np.nan)


def sobol_design(factors: int, points: int, seed: int = 0) -> Reals:
    """(n + 2, points, n) points of the unit cube for `variance_indices`.

    The first two blocks A and B are independent. Each of the others is A with one column of B.

    Parameters
    ----------
    factors : n
    points : a power of two

    Raises
    ------
    FemtuneError : ``design.power-of-two``
    """
    from scipy.stats import qmc  # noqa: PLC0415  slow to import, and every step reads the records of indices

    if points < 2 or points & (points - 1):
        raise FemtuneError("design.power-of-two", points=points)
    drawn = qmc.Sobol(2 * factors, bits=64, rng=np.random.default_rng(seed)).random(points)
    blocks = np.repeat(drawn[None, :, :factors], factors + 2, axis=0)
    blocks[1] = drawn[:, factors:]
    for i in range(factors):
        blocks[i + 2, :, i] = blocks[1, :, i]
    return blocks


def variance_indices(responses: Reals, seed: int = 0) -> VarianceIndices:
    """Sobol's indices of runs on a `sobol_design`, with intervals.

    Parameters
    ----------
    responses : (n + 2, points, m); points of which a run is missing (NaN) are left out
    seed : of the rows that are drawn for the intervals

    Raises
    ------
    FemtuneError : ``screen.too-few-points`` where fewer than two points are left
    """
    good = np.asarray(np.isfinite(responses).all(axis=(0, 2)))
    if good.sum() < 2:
        raise FemtuneError("screen.too-few-points", points=len(good), good=int(good.sum()))
    y = responses[:, good]
    mean = y[:2].mean(axis=(0, 1))
    # without the mean the estimates have less variance; what is left of a constant is rounding
    y = np.where(np.abs(y - mean).max(axis=(0, 1)) > _STILL * np.abs(mean), y - mean, 0.0)
    first, total = _indices(y)
    rows = np.random.default_rng(seed).integers(y.shape[1], size=(_RESAMPLED, y.shape[1]))
    again = np.array([_indices(y[:, row]) for row in rows])
    limits = np.quantile(again, (0.025, 0.975), axis=0)
    return VarianceIndices(first, total, limits[:, 0], limits[:, 1])


def _indices(y: Reals) -> tuple[Reals, Reals]:
    """(n, m) first and total indices; 0 of a response that does not vary."""
    a, b, mixed = y[0], y[1], y[2:]
    variance = np.var(y[:2], axis=(0, 1))
    size = np.where(variance > 0.0, variance, np.inf)
    return np.mean(b * (mixed - a), axis=1) / size, 0.5 * np.mean((a - mixed) ** 2, axis=1) / size


def sobol_indices(
    function: Callable[[Reals], Reals], factors: int, points: int = 1024, seed: int = 0
) -> VarianceIndices:
    """Sobol's indices of a function over the unit cube.

    Parameters
    ----------
    function : of (k, n) points, gives (k, m) responses; called with points·(n + 2) points in all
    factors : n
    points : a power of two
    """
    design = sobol_design(factors, points, seed)
    responses = np.asarray(function(design.reshape(-1, factors)))
    return variance_indices(responses.reshape(factors + 2, points, -1), seed)
