"""Time-frequency instantaneous estimators (Bonato, Ceravolo, De Stefano and Molinari 2000).

Two channels of a structure that vibrates in one mode keep their phase difference whatever the excitation does. So in
the cross distribution D_ij(t, f) of the channels the standard deviation of arg D_ij over time is nearly zero where a
mode is, and there the mean of D_ij/D_jj is the ratio of the shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from femtune.arrays import Complexes, Reals

_LEAST_POWER = 0.01
"""Power of the strongest channel relative to its mean, below which an instant is left out of the published mean."""


@dataclass(frozen=True, eq=False)
class PhaseScatter:
    """How steady phases are.

    Parameters
    ----------
    freq_hz : (k,) lines
    sd_rad : (k,) standard deviation over time of the phase differences of all channels to the strongest one at each
        line, weighted by how far they stand out of their own level; it reaches 1.8 where phases are random
    strength : (k,) mean square amplitude of all channels in units of their medians
    ratios : (k, s) mean of D_ij/D_jj with j the strongest channel, weighted with D_jj: complex shapes
    magnitudes : (k, s) mean over time of |D_ij|/D_jj, the published form, with the phases of `ratios`, which tell signs
        and quantities apart. Noise makes them too large, most at points that hardly move
    """

    freq_hz: Reals
    sd_rad: Reals
    strength: Reals
    ratios: Complexes
    magnitudes: Complexes


def phase_scatter(
    values: Reals, rate_hz: float, segment: int, overlap: float = 0.75, window: str = "hann"
) -> PhaseScatter:
    """Standard deviation of the phase differences over all instants of the short-time transforms of channels (s, n)."""
    freq, _, z = signal.stft(
        values, rate_hz, window, segment, int(segment * overlap), boundary=None, padded=False, detrend="constant"
    )
    power = (np.abs(z) ** 2).mean(axis=2)
    # channels may have different units: what counts is how far each stands out of its own level
    power = power / np.median(power, axis=1, keepdims=True)
    strongest = power.argmax(axis=0)
    reference = z[strongest, np.arange(len(freq))]
    cross = z * reference.conj()
    steady = np.abs(_mean_direction(cross))
    others = np.sqrt(power)
    others[strongest, np.arange(len(freq))] = 0.0
    mean = (others * steady).sum(axis=0) / np.maximum(others.sum(axis=0), np.finfo(float).tiny)
    scatter = np.sqrt(-2.0 * np.log(np.clip(mean, 0.2, 1.0)))
    ratios = cross.mean(axis=2) / np.maximum((np.abs(reference) ** 2).mean(axis=1), np.finfo(float).tiny)
    # instants at which the channel j hardly moves have no ratio
    own = np.abs(reference) ** 2
    moving = own > _LEAST_POWER * own.mean(axis=1, keepdims=True)
    each = np.divide(np.abs(cross), own, out=np.zeros_like(own * np.abs(cross)), where=moving)
    magnitudes = each.sum(axis=2) / np.maximum(moving.sum(axis=1), 1) * np.exp(1j * np.angle(ratios))
    return PhaseScatter(freq, scatter, power.sum(axis=0), ratios.T, magnitudes.T)


def _mean_direction(cross: Complexes) -> Complexes:
    """(s, k) mean over time of e^{2i arg D}: twice the phase, so that opposition counts like agreement."""
    size = np.abs(cross)
    unit = np.divide(cross, size, out=np.zeros_like(cross), where=size > 0.0)
    return np.asarray((unit**2 * size).sum(axis=2) / np.maximum(size.sum(axis=2), np.finfo(float).tiny))


def steady_lines(found: PhaseScatter, band_hz: tuple[float, float], most_rad: float = 0.7) -> list[int]:
    """Lines of the band where the standard deviation has a minimum below `most_rad`."""
    inside = (found.freq_hz >= band_hz[0]) & (found.freq_hz <= band_hz[1])
    depth = np.where(inside, -found.sd_rad, -2.0)
    at, _ = signal.find_peaks(depth, height=-most_rad, prominence=0.15)
    return [int(i) for i in at]


def mode_at(found: PhaseScatter, line: int, ratios: Complexes | None = None, reach: int = 3) -> tuple[float, Complexes]:
    """Frequency and shape (s,) of unit norm at a steady line, complex; by `ratios` of `found` or its `magnitudes`.

    The frequency is the centre of gravity of the steady lines around it, weighted by their strength.
    """
    near = slice(max(line - reach, 0), line + reach + 1)
    weights = found.strength[near] * (found.sd_rad[near] <= 2.0 * found.sd_rad[line] + 0.05)
    shape = (found.ratios if ratios is None else ratios)[line]
    return float(np.average(found.freq_hz[near], weights=weights)), np.asarray(shape / np.linalg.norm(shape))
