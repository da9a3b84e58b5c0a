"""Peaks of the excitation that look like modes: the ground has them too, and added mass does not move them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.identification.averaging import CrossSpectra

STANDS_OUT_DB = 6.0
"""Level above its neighbourhood from which a line of the ground counts as a peak."""
_NEIGHBOURHOOD = 0.08
"""Distance relative to a frequency within which lines around a peak are its surroundings."""


@dataclass(frozen=True)
class InputVerdict:
    """Whether a peak belongs to the excitation.

    Parameters
    ----------
    freq_hz : of the peak
    ground_db : how far the ground's own spectrum stands out there of the level around it
    of_input : True where it is flagged
    sentence : why, or why not
    """

    freq_hz: float
    ground_db: float
    of_input: bool
    sentence: str


def judge_peaks(freq_hz: Sequence[float], spectra: CrossSpectra, ground: Sequence[int]) -> tuple[InputVerdict, ...]:
    """Peaks beside the auto-spectra of the channels that measure the ground.

    Parameters
    ----------
    freq_hz : of modes or peaks
    spectra : of all channels
    ground : positions of the channels of the ground
    """
    return tuple(_verdict(float(f), spectra, ground) for f in freq_hz)


def _verdict(freq: float, spectra: CrossSpectra, ground: Sequence[int]) -> InputVerdict:
    out = max(stands_out_db(spectra.freq_hz, spectra.values[:, i, i].real, freq) for i in ground)
    if out >= STANDS_OUT_DB:
        text = (
            f"the ground motion has a peak at {freq:.4g} Hz, {out:.0f} dB above its level there: treated as excitation"
        )
        return InputVerdict(freq, out, True, text)
    return InputVerdict(freq, out, False, f"the ground motion has no peak at {freq:.4g} Hz ({out:.0f} dB)")


def stands_out_db(lines_hz: Reals, power: Reals, freq_hz: float) -> float:
    """Highest power within two lines of a frequency over the median of its neighbourhood (8 % to each side), in dB."""
    step = lines_hz[1] - lines_hz[0]
    away = np.abs(lines_hz - freq_hz)
    near = away <= 2.0 * step
    around = (away > 4.0 * step) & (away <= max(_NEIGHBOURHOOD * freq_hz, 12.0 * step))
    if not near.any() or not around.any():
        return 0.0
    level = max(float(np.median(power[around])), np.finfo(float).tiny)
    return float(10.0 * np.log10(max(float(power[near].max()), np.finfo(float).tiny) / level))


def unmoved_by_mass(states_hz: Sequence[Reals], fixed: float = 2e-3, moved: float = 1e-2) -> tuple[float, ...]:
    """Frequencies that every mass configuration has alike although its modes move: lines of the excitation.

    Parameters
    ----------
    states_hz : frequencies of each configuration, two at least
    fixed : relative change below which a frequency counts as the same
    moved : change of the lowest mode from which on the masses count as felt
    """
    first, others = states_hz[0], states_hz[1:]
    felt = others and all(abs(other.min() / first.min() - 1.0) > moved for other in others)
    if not felt:
        return ()
    return tuple(float(f) for f in first if all((np.abs(o / f - 1.0) < fixed).any() for o in others))


def ground_to_floor(spectra: CrossSpectra, ground: int, floor: int) -> NDArray[np.complex128]:
    """(k,) transfer function H1 from a channel of the ground to one of a floor: the lines of the ground vanish."""
    return np.asarray(spectra.values[:, floor, ground] / spectra.values[:, ground, ground].real)
