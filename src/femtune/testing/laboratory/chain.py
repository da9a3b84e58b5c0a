"""The measuring chain: sensors that add noise and drift, amplifiers that clip, converters that round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class MeasuringChain:
    """What stands between a motion and its record.

    Parameters
    ----------
    noise_db : signal to noise ratio of every channel in dB by its own rms; infinite for none
    bits : of the converter over `range_rms` times the largest rms of all channels to each side; 0: no rounding
    range_rms : where it clips
    """

    noise_db: float = 60.0
    bits: int = 0
    range_rms: float = 10.0


def record(rng: np.random.Generator, chain: MeasuringChain, motion: Reals) -> Reals:
    """The motion (s, n) as the chain writes it down."""
    rms = motion.std(axis=1, keepdims=True)
    noisy = motion + 10.0 ** (-chain.noise_db / 20.0) * rms * rng.standard_normal(motion.shape)
    if not chain.bits:
        return np.asarray(noisy)
    full = chain.range_rms * rms.max()
    step = 2.0 * full / 2**chain.bits
    return np.asarray(step * np.round(np.clip(noisy, -full, full) / step))
