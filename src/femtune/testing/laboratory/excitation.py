"""What shakes a structure in the laboratory: signals (n,) or (r, n), sampled at a step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Reals = NDArray[np.float64]


def white_noise(rng: np.random.Generator, channels: int, count: int, rms: float = 1.0) -> Reals:
    """Independent Gaussian noise (channels, count), white up to half the sampling rate."""
    return np.asarray(rms * rng.standard_normal((channels, count)))


def narrow_line(
    rng: np.random.Generator, count: int, step_s: float, freq_hz: float, width_hz: float, rms: float
) -> Reals:
    """A machine that runs at about one frequency: Gaussian noise in a band of half-power width `width_hz`."""
    pole = np.exp((-np.pi * width_hz + 2j * np.pi * freq_hz) * step_s)
    raw = signal.lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], rng.standard_normal(count))
    return np.asarray(rms * raw / np.std(raw))


def multisine(rng: np.random.Generator, lines: NDArray[np.int64], count: int, periods: int, rms: float = 1.0) -> Reals:
    """Periodic signal (count·periods,) of equal amplitudes and random phases.

    Parameters
    ----------
    lines : numbers of the excited lines of one period, each above 0 and below count/2
    count : samples of a period
    """
    spectrum = np.zeros(count // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    period = np.fft.irfft(spectrum, count)
    return np.tile(rms * period / np.std(period), periods)


def chirp(count: int, step_s: float, from_hz: float, to_hz: float, periods: int = 1, peak: float = 1.0) -> Reals:
    """Sine whose frequency runs linearly through a band in every period of `count` samples."""
    t = step_s * np.arange(count)
    return np.tile(peak * signal.chirp(t, from_hz, count * step_s, to_hz), periods)


def burst_random(rng: np.random.Generator, count: int, blocks: int, share: float = 0.6, rms: float = 1.0) -> Reals:
    """Noise in the first `share` of every block of `count` samples and silence after it."""
    raw = rms * rng.standard_normal((blocks, count))
    raw[:, int(share * count) :] = 0.0
    return np.asarray(raw.ravel())
