"""Frequency domain decomposition, plain and enhanced (Brincker, Zhang and Andersen 2001).

The first singular value of the spectral matrix peaks at the modes and its vector is the shape there; around each peak
the spectrum of one mode alone, turned into its correlation function, gives damping and a better frequency.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from femtune.arrays import Complexes, Reals
from femtune.identification.averaging import CrossSpectra

_CLIMB = 4.0
"""Six decibels above the lowest line so far is the flank of another peak, and no random error of the spectrum."""


@dataclass(frozen=True, eq=False)
class Decomposition:
    """Singular values (k, s), largest first, and first vectors (k, s) of spectral matrices at each line."""

    freq_hz: Reals
    singular_values: Reals
    vectors: Complexes


@dataclass(frozen=True, eq=False)
class Bell:
    """One mode by (E)FDD.

    Parameters
    ----------
    freq_hz, damping_ratio : of its correlation function; the damping NaN where the bell is too narrow to tell
    peak_hz : the line of the peak
    shape : (s,) complex, unit norm
    band_hz : where the first vector is parallel to the shape
    """

    freq_hz: float
    damping_ratio: float
    peak_hz: float
    shape: Complexes
    band_hz: tuple[float, float]


def decompose(spectra: CrossSpectra) -> Decomposition:
    """Singular value decomposition line by line."""
    values, vectors = np.linalg.eigh(spectra.values)
    return Decomposition(spectra.freq_hz, np.maximum(values[:, ::-1], 0.0), vectors[:, :, -1])


def peaks(found: Decomposition, band_hz: tuple[float, float], prominence_db: float = 6.0) -> list[int]:
    """Lines where the first singular value stands out of its neighbourhood by `prominence_db`."""
    level = 10.0 * np.log10(np.maximum(found.singular_values[:, 0], np.finfo(float).tiny))
    inside = (found.freq_hz >= band_hz[0]) & (found.freq_hz <= band_hz[1])
    at, _ = signal.find_peaks(np.where(inside, level, level[inside].min()), prominence=prominence_db)
    return [int(i) for i in at]


def enhanced(spectra: CrossSpectra, found: Decomposition, line: int, mac: float = 0.9, levels_db: float = 25.0) -> Bell:
    """The mode at one peak from its spectral bell.

    The bell reaches as far as the first vector keeps a MAC of `mac` with the shape at the peak and the spectrum stays
    within `levels_db` of it. Its inverse transform is the free decay of the mode; damping and frequency are a straight
    line through the logarithm and the phase of that decay.
    """
    shape = found.vectors[line]
    low, high = _edges(found, line, mac, levels_db)
    auto = np.einsum("s,kst,t->k", shape.conj(), spectra.values[low : high + 1], shape).real
    step = found.freq_hz[1] - found.freq_hz[0]
    damping, shift = _decay(auto, found.freq_hz[low : high + 1] - found.freq_hz[line], step, spectra.window)
    freq = float(found.freq_hz[line] + shift)
    ratio = damping / (2.0 * np.pi * freq)
    return Bell(freq, ratio, float(found.freq_hz[line]), shape, (float(found.freq_hz[low]), float(found.freq_hz[high])))


def _edges(found: Decomposition, line: int, mac: float, levels_db: float) -> tuple[int, int]:
    alike = np.abs(found.vectors @ found.vectors[line].conj()) ** 2 >= mac
    level = found.singular_values[:, 0]
    good = alike & (level >= level[line] * 10.0 ** (-levels_db / 10.0))
    down = _reach(good[:line][::-1], level[:line][::-1])
    up = _reach(good[line + 1 :], level[line + 1 :])
    return line - down, line + up


def _reach(good: NDArray[np.bool_], level: Reals) -> int:
    """Lines from a peak outwards that belong to its bell: to the valley before the next peak of the same shape."""
    inside = good.cumprod().sum()
    lowest = np.minimum.accumulate(level[:inside])
    climbs = np.flatnonzero(level[:inside] > _CLIMB * lowest)
    return int(level[: climbs[0]].argmin()) + 1 if climbs.size else int(inside)


def _decay(auto: Reals, offset_hz: Reals, step_hz: float, window: Reals) -> tuple[float, float]:
    """Decay rate ζω in 1/s and frequency above the reference in Hz of the correlation of a bell.

    Welch's estimate is the true correlation times that of the window, which is taken out again. Only the part between
    90 and 30 % of the first value is used: the beginning contains noise, the end mostly random errors.
    """
    if len(auto) < 5:
        return float("nan"), float(np.average(offset_hz, weights=auto))
    t = np.linspace(0.0, 0.6 / step_hz, 600)
    correlation = np.correlate(window, window, "full")[len(window) - 1 :]
    faded = np.interp(t * step_hz, np.arange(len(window)) / len(window), correlation / correlation[0])
    decay = np.exp(2j * np.pi * t[:, None] * offset_hz) @ auto / faded
    size = np.abs(decay)
    begin, end = int(np.argmax(size < 0.9 * size[0])), int(np.argmax(size < 0.3 * size[0]))
    if end - begin < 5:
        return float("nan"), float(np.average(offset_hz, weights=auto))
    some = slice(begin, end)
    rate = -np.polyfit(t[some], np.log(size[some]), 1)[0]
    turn = np.polyfit(t[some], np.unwrap(np.angle(decay[some])), 1)[0]
    return float(rate), float(turn / (2.0 * np.pi))
