"""Poles far from the band that stand for all modes there: their number is what the functions want.

Each has a fixed place and one shape and participation. Too few of them leave a systematic error where a function is
small, at its antiresonances, and parameters of a model that is compared there follow it. One more is taken as long as
it lowers the errors by more than noise does.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from femtune.arrays import Complexes
from femtune.errors import FemtuneError
from femtune.identification.modal_solve import LEAST_NOISE
from femtune.identification.state_space_fit import SystemFit, residual_poles, system_fit
from femtune.modal import FrfSet

LEAST = (1, 2)
"""Poles below and above the band at least."""
MOST = (3, 6)
"""The same at most: with more, shapes and participations are hardly determined, even without noise."""
CHANCE = 1e-4
"""A further pole is taken where noise lowers the errors as much with a smaller probability."""


def system_beyond(
    frfs: FrfSet,
    inside: Complexes,
    band_hz: tuple[float, float],
    low: int | None,
    high: int | None,
    *,
    reciprocal: bool,
    decay: float = 0.0,
) -> SystemFit:
    """The system with the poles of the modes, and poles that stand for what lies far from the band.

    Parameters
    ----------
    frfs : (n, u, k) complete
    inside : poles of the modes
    band_hz : of the identification
    low, high : poles below and above the band; None: as many as the functions want
    reciprocal : as for `system_fit`
    decay : σ in rad/s that an exponential window subtracts from all poles

    Raises
    ------
    FemtuneError : as `system_fit`
    """
    number = [LEAST[0] if low is None else low, LEAST[1] if high is None else high]
    poles = np.concatenate([inside, residual_poles(band_hz, *number) - decay])
    fit = system_fit(frfs, poles, reciprocal=reciprocal)
    deviance = _deviance(fit, frfs)
    n, u, k = frfs.values.shape
    # the shape is the participation too in a reciprocal system
    wanted = float(chdtri(2 * (n if reciprocal else n + u - 1), CHANCE))
    for side in (1, 0):
        if (low, high)[side] is not None:
            continue
        while number[side] < MOST[side] and 2 * k > 2 * (len(fit.poles) + 1) + 1:
            at = number[side] + 1
            further = residual_poles(band_hz, 0, at)[-1] if side else residual_poles(band_hz, at, 0)[0]
            trial = _with(fit, frfs, further - decay, reciprocal=reciprocal)
            if trial is None:
                break
            now = _deviance(trial, frfs)
            # the noise is found from the errors: each function has only as many as its numbers leave free
            free = 1.0 - (2 * len(trial.poles) + 1) / (2.0 * k)
            if (deviance - now) * free <= wanted:
                break
            fit, deviance, number[side] = trial, now, at
    return fit


def _with(fit: SystemFit, frfs: FrfSet, pole: complex, *, reciprocal: bool) -> SystemFit | None:
    """The fit with a further pole; None if it has no definite solution."""
    start = np.vstack([fit.participations, np.full((1, fit.participations.shape[1]), np.nan)])
    try:
        trial = system_fit(frfs, np.append(fit.poles, pole), reciprocal=reciprocal, start=None if reciprocal else start)
    except (np.linalg.LinAlgError, FemtuneError):
        return None
    return trial if trial.converged else None


def _deviance(fit: SystemFit, frfs: FrfSet) -> float:
    """−2 log likelihood but for a constant, for the likeliest noise level of each function."""
    k = len(frfs.freq_hz)
    squares = np.sum(np.abs(frfs.values - fit.system.frf(frfs.freq_hz).values) ** 2, axis=2)
    least = LEAST_NOISE**2 * np.sum(np.abs(frfs.values) ** 2, axis=2)
    return float(2.0 * k * np.sum(np.log(np.maximum(squares, np.maximum(least, np.finfo(float).tiny)))))
