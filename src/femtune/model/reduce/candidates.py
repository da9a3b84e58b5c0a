"""Points of the box of the parameters at which a reduced model is tried."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

Reals = NDArray[np.float64]

_SEED = 2026


def candidates(lower: Reals, upper: Reals, count: int, corners: int = 0, seed: int = _SEED) -> Reals:
    """(count + corners, k) points: a Sobol sequence in the box, and corners of it that differ from one another.

    A corner where all parameters go the same way scales a structure without changing its shapes much; the corners
    taken are the signs of another Sobol sequence, in which half of the parameters go up and half down on the average.
    """
    k = len(lower)
    inner = qmc.scale(_sobol(k, count, seed), lower, upper)
    signs = _sobol(k, corners, seed + 1) > 0.5
    return np.vstack([inner, np.where(signs, upper, lower)])


def _sobol(k: int, count: int, seed: int) -> Reals:
    """Points of a Sobol sequence, turned by a random shift that is the same with every version of SciPy."""
    power = int(np.ceil(np.log2(max(count, 1))))
    points = qmc.Sobol(k, scramble=False).random_base2(power)[:count]
    return np.asarray((points + np.random.default_rng(seed).random(k)) % 1.0)
