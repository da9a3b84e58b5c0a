"""Frequency lines: as many to a half bandwidth as a calibration or an identification needs.

The half bandwidth of a mode of frequency f and damping ratio ξ is 2ξf, the width of its peak at half power.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError

MOST_LINES = 100_000
"""More do not fit into the memory with the functions of many sensors."""

_DECAYED = np.log(1000.0)
"""Duration of a free decay to a thousandth (60 dB)."""


def calibration_lines(low_hz: float, high_hz: float, damping_ratio: float, per_half_band: int) -> Reals:
    """(lines,) logarithmically spaced: everywhere at least `per_half_band` lines to 2ξf.

    Raises
    ------
    FemtuneError : ``plan.too-many-lines``

    Examples
    --------
    >>> from femtune.planning import calibration_lines
    >>> lines = calibration_lines(55.0, 430.0, 0.002, 3)
    >>> len(lines), lines[[0, -1]]
    (1545, array([ 55., 430.]))
    """
    step = 2.0 * damping_ratio / per_half_band
    count = int(np.ceil(np.log(high_hz / low_hz) / np.log1p(step) - 1e-9)) + 1
    if count > MOST_LINES:
        raise FemtuneError("plan.too-many-lines", lines=f"{count:,}", most=f"{MOST_LINES:,}")
    return np.geomspace(low_hz, high_hz, count)


@dataclass(frozen=True)
class RecordLength:
    """Evenly spaced lines for an identification.

    Parameters
    ----------
    spacing_hz : resolution: the half bandwidth of the lowest mode over the number of lines to it
    duration_s : length of a record of that resolution, without windows and averages
    decay_s : time in which the lowest mode decays to a thousandth
    lines : number of lines from `low_hz` to `high_hz`
    """

    spacing_hz: float
    duration_s: float
    decay_s: float
    lines: int


def record_length(
    low_hz: float, high_hz: float, lowest_mode_hz: float, damping_ratio: float, per_half_band: int
) -> RecordLength:
    """The record that resolves the lowest mode."""
    spacing = 2.0 * damping_ratio * lowest_mode_hz / per_half_band
    decay = _DECAYED / (2.0 * np.pi * damping_ratio * lowest_mode_hz)
    return RecordLength(spacing, 1.0 / spacing, float(decay), int(np.floor((high_hz - low_hz) / spacing + 1e-9)) + 1)
