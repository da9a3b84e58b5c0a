"""Sensitivity indices of a function over a box: elementary effects, and parts of the variance.

Elementary effects need few runs and tell factors without influence from the others. The indices of Sobol need thousands
of evaluations and are meant for a surrogate. The function is called with all points of a design at once.

Sources: Morris 1991, Campolongo, Cariboni and Saltelli 2007 (elementary effects); Saltelli et al. 2010 (Sobol's
indices, as in SciPy).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import sobol_indices as scipy_indices
from scipy.stats import uniform

from femtune.arrays import Reals
from femtune.errors import FemtuneError


@dataclass(frozen=True, eq=False)
class ElementaryEffects:
    """Of n factors on m responses, per edge of the unit cube.

    Parameters
    ----------
    mean : (n, m) mean effect
    absolute : (n, m) mean of the absolute effects: importance
    spread : (n, m) standard deviation of the effects: curvature and interaction; NaN for a single trajectory
    """

    mean: Reals
    absolute: Reals
    spread: Reals


@dataclass(frozen=True, eq=False)
class VarianceIndices:
    """Of n factors on m responses: part of the variance that a factor explains alone, and with all interactions."""

    first: Reals
    total: Reals


def morris_design(factors: int, trajectories: int, levels: int = 4, seed: int = 0) -> Reals:
    """(trajectories, n + 1, n) points of the unit cube: from each to the next, one factor changes by about half."""
    if levels < 2 or levels % 2:
        raise FemtuneError("design.morris-levels", levels=levels)
    rng = np.random.default_rng(seed)
    step = levels / (2.0 * (levels - 1.0))
    low = np.arange(levels // 2) / (levels - 1.0)
    paths = np.empty((trajectories, factors + 1, factors))
    for path in paths:
        up = rng.random(factors) < 0.5
        path[0] = rng.choice(low, factors) + np.where(up, 0.0, step)
        for i, factor in enumerate(rng.permutation(factors)):
            path[i + 1] = path[i]
            path[i + 1, factor] += step if up[factor] else -step
    return paths


def elementary_effects(paths: Reals, responses: Reals) -> ElementaryEffects:
    """Elementary effects of runs on a `morris_design`.

    Parameters
    ----------
    paths : (trajectories, n + 1, n)
    responses : (trajectories, n + 1, m)
    """
    steps, changes = np.diff(paths, axis=1), np.diff(responses, axis=1)
    factor = np.argmax(np.abs(steps), axis=2)
    size = np.take_along_axis(steps, factor[:, :, None], axis=2)
    effects = np.empty((len(paths), paths.shape[2], responses.shape[2]))
    np.put_along_axis(effects, factor[:, :, None], changes / size, axis=1)
    spread = np.std(effects, axis=0, ddof=1) if len(paths) > 1 else np.full(effects.shape[1:], np.nan)
    return ElementaryEffects(effects.mean(axis=0), np.abs(effects).mean(axis=0), spread)


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
    if points < 2 or points & (points - 1):
        raise FemtuneError("design.power-of-two", points=points)
    found = scipy_indices(
        func=lambda x: np.asarray(function(x.T)).T,
        n=points,
        dists=[uniform()] * factors,
        rng=np.random.default_rng(seed),
    )
    return VarianceIndices(np.atleast_2d(found.first_order).T, np.atleast_2d(found.total_order).T)
