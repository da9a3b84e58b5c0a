"""Cross-spectral density matrices of responses by Welch's method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CrossSpectra:
    """One-sided spectral densities.

    Parameters
    ----------
    freq_hz : (k,) lines
    values : (k, s, s) Hermitian: G[k, i, j] is E[Y_i conj(Y_j)], unit²/Hz
    averages : number of overlapping segments
    window : (segment,) weights of the samples of a segment
    """

    freq_hz: Reals
    values: NDArray[np.complex128]
    averages: int
    window: Reals


def cross_spectra(
    values: Reals, rate_hz: float, segment: int, overlap: float = 0.5, window: str = "hann"
) -> CrossSpectra:
    """Spectra of channels (s, n) from segments of `segment` samples, each without its mean."""
    step = max(1, round(segment * (1.0 - overlap)))
    weights = np.asarray(signal.get_window(window, segment), dtype=np.float64)
    starts = range(0, values.shape[1] - segment + 1, step)
    total = np.zeros((segment // 2 + 1, len(values), len(values)), dtype=complex)
    for begin in starts:
        piece = values[:, begin : begin + segment]
        lines = np.fft.rfft((piece - piece.mean(axis=1, keepdims=True)) * weights).T
        total += lines[:, :, None] * lines[:, None, :].conj()
    scale = 2.0 / (rate_hz * (weights**2).sum() * len(starts))
    freq_hz = np.asarray(np.fft.rfftfreq(segment, 1.0 / rate_hz), dtype=np.float64)
    return CrossSpectra(freq_hz, scale * total, len(starts), weights)
