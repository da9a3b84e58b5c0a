"""Cross-spectral density matrices of responses by Welch's method."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
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


def segment_starts(samples: int, segment: int, overlap: float) -> range:
    """First samples of all whole segments that overlap by a part."""
    return range(0, samples - segment + 1, max(1, round(segment * (1.0 - overlap))))


def segment_transforms(
    values: Reals, starts: Iterable[int], window: Reals, keep_mean: bool = False
) -> Iterator[NDArray[np.complex128]]:
    """(channels, k) Fourier transforms of each windowed segment, without its mean unless that is kept."""
    for begin in starts:
        piece = values[:, begin : begin + len(window)]
        yield np.fft.rfft((piece if keep_mean else piece - piece.mean(axis=1, keepdims=True)) * window)


def cross_spectra(
    values: Reals, rate_hz: float, segment: int, overlap: float = 0.5, window: str = "hann"
) -> CrossSpectra:
    """Spectra of channels (s, n) from segments of `segment` samples, each without its mean."""
    weights = np.asarray(signal.get_window(window, segment), dtype=np.float64)
    starts = segment_starts(values.shape[1], segment, overlap)
    total = np.zeros((segment // 2 + 1, len(values), len(values)), dtype=complex)
    for lines in segment_transforms(values, starts, weights):
        total += lines.T[:, :, None] * lines.T[:, None, :].conj()
    scale = 2.0 / (rate_hz * (weights**2).sum() * len(starts))
    freq_hz = np.asarray(np.fft.rfftfreq(segment, 1.0 / rate_hz), dtype=np.float64)
    return CrossSpectra(freq_hz, scale * total, len(starts), weights)
