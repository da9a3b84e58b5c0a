"""Lines of rotating machines and of the mains in records of responses: found, and subtracted from the record.

The narrow-band response of a structure to random forces has a random envelope, however small its damping is: the
band-passed signal is Gaussian, with a kurtosis of 3. A machine has a line with a steady envelope and a kurtosis of 1.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import BSpline
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.sparse import csc_array, hstack
from scipy.sparse.linalg import splu

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.modal import TimeSeries

LEAST_DAMPING = 5e-4
"""Damping ratio below which a line is not taken for the mode of a structure: welded steel without joints
has as much."""
WANDER = 5e-4
"""Relative deviation of the speed of a machine from its mean that a line may have: the slip of a motor changes with its
load by as much."""
_SEGMENTS = 8
"""Segments of the envelope in a record at least: fewer do not show that it is steady."""
_OVERLAP = 4
"""Segments that begin within the length of one; three quarters of each Hann window overlap with the next."""
STANDS_OUT = 25.0
"""Power of a spectral line, relative to the median around it, from which it is looked at (14 dB). Among 10,000 lines of
noise the largest is 10 times the mean, which is 14 times the median."""
_AROUND = 61
"""Spectral lines over which the median is taken."""
_SPREAD = (1, 4, 16)
"""Spectral lines that the power of a machine whose speed varies may be spread over."""
_MOST_CANDIDATES = 100
"""Lines that are looked at, the highest first."""

_CRITICAL_A = np.array([0.5, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512])
_CRITICAL_ENVELOPE = np.array([0.008, 0.016, 0.033, 0.074, 0.135, 0.221, 0.359, 0.486, 0.602, 0.681, 0.776])
_CRITICAL_REST = np.array([0.007, 0.014, 0.033, 0.067, 0.134, 0.244, 0.466, 0.668, 0.802, 0.889, 0.945])
"""Values of `Line.envelope` and `Line.rest` that a mode with the damping `LEAST_DAMPING` falls below once in a thousand
records, by ζωT; 7,000 to 20,000 simulated envelopes each (`benchmarks/identification/harmonics.py --critical`)."""


@dataclass(frozen=True)
class Line:
    """A line in the spectra of a record whose envelope is steadier than that of a mode can be.

    Parameters
    ----------
    freq_hz : its mean frequency
    width_hz : half the bandwidth within which it was judged; a pole nearer than this is that of the line
    envelope : variance of the squared envelope relative to its squared mean: 0 for a sine, 1 for Gaussian noise
    rest : share of the power in the bandwidth that a sine of constant frequency leaves
    share : part of the power of all channels, each relative to its own, that is in this bandwidth
    """

    freq_hz: float
    width_hz: float
    envelope: float
    rest: float
    share: float

    @property
    def kurtosis(self) -> float:
        """Kurtosis of the band-passed signal: 1.5 for a sine, 3 for Gaussian noise."""
        return 1.5 * (1.0 + self.envelope)


def find_lines(record: TimeSeries, band_hz: tuple[float, float], freq_hz: Sequence[float] = ()) -> tuple[Line, ...]:
    """Lines in a band that are no response of a structure to random forces, by ascending frequency.

    A line is one if its envelope is steadier, or a sine of constant frequency leaves less of it, than in 999 of 1,000
    records of a mode with the damping ratio `LEAST_DAMPING`. In a record of less than about 1 / (ζω) of such a mode
    hardly any line can be told from it.

    Parameters
    ----------
    record : responses without lost samples
    band_hz : where lines are looked for
    freq_hz : of identified modes, which are looked at in addition to the lines that stand out

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> from femtune.modal import Channel
    >>> t = np.arange(20_000) / 100.0
    >>> noise = np.random.default_rng(0).standard_normal(t.size)
    >>> record = ft.TimeSeries([noise + np.sin(2.0 * np.pi * 11.0 * t)], [Channel(ft.Dof(1, "Z"))], sampling_hz=100.0)
    >>> [(round(line.freq_hz, 3), round(line.kurtosis, 1)) for line in find_lines(record, (1.0, 40.0))]
    [(11.0, 1.6)]

    Source: R. Brincker, P. Andersen, N. Møller (2000), An indicator for separation of structural and harmonic modes in
    output-only modal testing, IMAC 18; N.-J. Jacobsen, P. Andersen, R. Brincker (2007), Eliminating the influence of
    harmonic components in operational modal analysis, IMAC 25 (kurtosis of the band-passed signal).
    """
    rate, duration = record.even_hz, record.samples / record.even_hz
    moving = record.values - record.values.mean(axis=1, keepdims=True)
    size = moving.std(axis=1)
    moving = moving[size > 0.0] / size[size > 0.0, None]
    if not len(moving):
        return ()
    lines_hz, level = _standing_out(moving, rate, band_hz)
    lines = [_judged(moving, rate, duration, f) for f in _candidates(lines_hz, level, freq_hz)]
    return distinct([line for line in lines if line is not None])


def _standing_out(moving: Reals, rate: float, band_hz: tuple[float, float]) -> tuple[Reals, Reals]:
    """Lines of the band, and their power relative to the median around them: mean of the channels, largest spread."""
    freq = np.fft.rfftfreq(moving.shape[1], 1.0 / rate)
    beside = _AROUND + max(_SPREAD)
    first, last = np.searchsorted(freq, band_hz).tolist()
    used = slice(max(first - beside, 0), last + beside)
    freq = freq[used]
    power = np.abs(np.fft.rfft(moving * np.hanning(moving.shape[1]), axis=1)[:, used]) ** 2
    middle = np.maximum(median_filter(power, size=(1, _AROUND)), np.finfo(float).tiny)
    ratio = np.minimum(power / middle, 1e12).mean(axis=0)
    level: Reals = np.max([uniform_filter1d(ratio, n) for n in _SPREAD], axis=0)
    inside = (freq >= band_hz[0]) & (freq <= band_hz[1])
    return np.asarray(freq[inside], float), np.asarray(level[inside], float)


def _candidates(freq: Reals, level: Reals, modes_hz: Sequence[float]) -> list[float]:
    """Frequencies of the lines that stand out, the highest of each neighbourhood, and of the peaks beside modes."""
    hertz: list[float] = []
    high = np.flatnonzero(level > STANDS_OUT)
    for i in high[np.argsort(-level[high], kind="stable")]:
        if len(hertz) < _MOST_CANDIDATES and all(abs(freq[i] - f) > 4.0 * WANDER * f for f in hertz):
            hertz.append(float(freq[i]))
    for f in modes_hz:
        near = np.flatnonzero(np.abs(freq - f) <= 4.0 * WANDER * f)
        at = float(freq[near[np.argmax(level[near])]]) if len(near) else float(f)
        hertz += [] if at in hertz else [at]
    return hertz


def _judged(moving: Reals, rate: float, duration: float, hz: float) -> Line | None:
    """The line at a frequency, None where it may be that of a mode or of noise."""
    samples = int(rate * min(duration / _SEGMENTS, 0.25 / (WANDER * hz)))
    if samples < 4 * rate / hz:
        return None
    of_channels = envelopes(moving, rate, hz, samples)
    mixed = np.linalg.svd(of_channels, full_matrices=False)[0][:, 0].conj() @ of_channels
    power = np.abs(mixed) ** 2
    mean = power.mean()
    if mean <= 0.0:
        return None
    envelope = float(power.var() / mean**2)
    count = len(mixed)
    steady = float((np.abs(np.fft.fft(mixed, 8 * count)) ** 2).max() / count / power.sum())
    a = LEAST_DAMPING * 2.0 * np.pi * hz * duration
    rest = 1.0 - steady
    if envelope > np.interp(a, _CRITICAL_A, _CRITICAL_ENVELOPE, left=0.0) and rest > np.interp(
        a, _CRITICAL_A, _CRITICAL_REST, left=0.0
    ):
        return None
    hop = max(samples // _OVERLAP, 1) / rate
    turn = float(np.angle((mixed[1:] * mixed[:-1].conj()).sum())) / (2.0 * np.pi * hop)
    share = float((np.abs(of_channels) ** 2).mean()) * 2.0
    return Line(hz + turn, rate / samples, envelope, rest, min(share, 1.0))


def envelopes(values: Reals, rate: float, hz: float, samples: int) -> Complexes:
    """(channels, segments) complex amplitudes at a frequency, of Hann segments with an overlap of three quarters."""
    hop = max(samples // _OVERLAP, 1)
    window = np.hanning(samples + 2)[1:-1]
    starts = np.arange(0, values.shape[1] - samples + 1, hop)
    kernel = window / window.sum() * np.exp(-2j * np.pi * hz * np.arange(samples) / rate)
    pieces = sliding_window_view(values, samples, axis=1)[:, ::hop]
    return np.asarray((pieces @ kernel) * np.exp(-2j * np.pi * hz * starts / rate))


def distinct(lines: Sequence[Line]) -> tuple[Line, ...]:
    """By ascending frequency; of lines nearer to each other than their bandwidth, the one with the larger share."""
    kept: list[Line] = []
    for line in sorted(lines, key=lambda line: -line.share):
        if all(abs(line.freq_hz - other.freq_hz) > other.width_hz for other in kept):
            kept.append(line)
    return tuple(sorted(kept, key=lambda line: line.freq_hz))


# ----------------------------------------------------------------------------------------------------
# Integer ratios.

MAINS_HZ = (50.0, 60.0)
_MAINS_TOLERANCE = 4e-3
"""Relative deviation of the frequency of the mains: 0.2 Hz of 50 Hz."""
_MOST_MULTIPLE = 10
"""Largest integer ratio that is told: larger ones are met by chance."""


def multiples(lines: Sequence[Line]) -> tuple[str, ...]:
    """What integer ratio each line has to the lowest other line or to the mains; "" where none."""
    return tuple(_multiple(line, lines) for line in lines)


def _multiple(line: Line, lines: Sequence[Line]) -> str:
    for base in sorted(lines, key=lambda other: other.freq_hz):
        n = round(line.freq_hz / base.freq_hz)
        if 2 <= n <= _MOST_MULTIPLE and abs(line.freq_hz - n * base.freq_hz) <= 0.25 * max(
            line.width_hz, base.width_hz
        ):
            return f"{n} times {base.freq_hz:.4g} Hz"
    for hz in MAINS_HZ:
        n = round(line.freq_hz / hz)
        if 1 <= n <= _MOST_MULTIPLE and abs(line.freq_hz / (n * hz) - 1.0) <= _MAINS_TOLERANCE:
            return f"mains of {hz:g} Hz" if n == 1 else f"{n} times the mains of {hz:g} Hz"
    return ""


# ----------------------------------------------------------------------------------------------------
# Lines subtracted from a record.

_SEARCH = 2e-3
"""Relative distance from the stated frequency within which the line is looked for."""
_KNOTS = (1, 2, 4, 8, 16, 32, 64, 128)
"""Pieces of the record in each of which amplitude and phase may drift, as a cubic polynomial of time."""


@dataclass(frozen=True, eq=False)
class Removed:
    """A line that was subtracted.

    Parameters
    ----------
    freq_hz : its frequency, as it was found in the record
    share : of the power of the channels, each relative to its own
    pieces : of the record between which amplitude and phase were allowed to drift
    """

    freq_hz: float
    share: float
    pieces: int


def without_lines(record: TimeSeries, freq_hz: Sequence[float]) -> tuple[TimeSeries, tuple[Removed, ...]]:
    """The record without sines of these frequencies, which are refined first; inputs are left as they are.

    Amplitude and phase are splines in time, with as few pieces as Akaike's criterion allows, so that a line may wander
    as the speed of a machine does. The fit takes a bandwidth of the number of pieces over the duration out of the
    spectra; modes beneath a line or near it are wider than this and stay.

    Parameters
    ----------
    record : without lost samples, evenly sampled
    freq_hz : of the lines, within 0.2 % or two spectral lines

    Raises
    ------
    FemtuneError : ``identify.no-line`` where no line stands out there

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> from femtune.modal import Channel
    >>> t = np.arange(20_000) / 100.0
    >>> noise = np.random.default_rng(0).standard_normal(t.size)
    >>> values = [noise + 5.0 * np.sin(2.0 * np.pi * 11.003 * t)]
    >>> record = ft.TimeSeries(values, [Channel(ft.Dof(1, "Z"))], sampling_hz=100.0)
    >>> clean, (line,) = without_lines(record, [11.0])
    >>> round(line.freq_hz, 3), round(float(clean.values.std()), 1)
    (11.003, 1.0)
    """
    rows = [i for i, c in enumerate(record.channels) if c.role != "input"]
    values = np.array(record.values)
    moving = values[rows] - values[rows].mean(axis=1, keepdims=True)
    size = moving.std(axis=1, keepdims=True)
    unit = moving / np.where(size > 0.0, size, 1.0)
    refined = [_refined(unit, record.even_hz, hz) for hz in freq_hz]
    pieces = [_pieces(unit, record.even_hz, hz) for hz in refined]
    parts = [_sines(unit.shape[1], record.even_hz, hz, n) for hz, n in zip(refined, pieces)]
    design = csc_array(hstack(parts))
    weights = splu(csc_array(design.T @ design)).solve(np.asarray(design.T @ unit.T))
    values[rows] -= size * (design @ weights).T
    ends = np.cumsum([0, *(part.shape[1] for part in parts)])
    removed = tuple(
        Removed(hz, float(((part @ weights[a:b]) ** 2).mean() / max((unit**2).mean(), 1e-300)), n)
        for hz, n, part, a, b in zip(refined, pieces, parts, ends, ends[1:])
    )
    return replace(record, values=values), removed


def _refined(unit: Reals, rate: float, hz: float) -> float:
    """Frequency of the highest line beside the stated one."""
    step = rate / unit.shape[1]
    away = max(_SEARCH * hz, 2.0 * step)
    freq, level = _standing_out(unit, rate, (hz - away, hz + away))
    if not len(freq) or level.max() < STANDS_OUT:
        raise FemtuneError("identify.no-line", frequency_hz=hz)
    at = float(freq[level.argmax()])
    samples = int(unit.shape[1] / _SEGMENTS)
    of_channels = envelopes(unit, rate, at, samples)
    mixed = np.linalg.svd(of_channels, full_matrices=False)[0][:, 0].conj() @ of_channels
    hop = max(samples // _OVERLAP, 1) / rate
    return at + float(np.angle((mixed[1:] * mixed[:-1].conj()).sum())) / (2.0 * np.pi * hop)


def _pieces(unit: Reals, rate: float, hz: float) -> int:
    """The number of pieces with the least value of Akaike's criterion, in the band that most of them can fill."""
    duration = unit.shape[1] / rate
    most = [n for n in _KNOTS if n <= max(32.0 * WANDER * hz * duration, 1.0)]
    # the band of the fit, sampled twice as fast as it is wide: the rest of the record says nothing about the drift
    samples = max(int(unit.shape[1] / (4.0 * most[-1] + 8.0)), 4)
    z = envelopes(unit, rate, hz, samples)
    t = np.linspace(0.0, 1.0, z.shape[1])
    # overlapping segments: half of them are independent of each other
    independent = z.shape[1] * 2.0 / _OVERLAP

    def criterion(n: int) -> float:
        basis = _splines(t, n).toarray()
        rest = z - np.linalg.lstsq(basis, z.T, rcond=None)[0].T @ basis.T
        left = float((np.abs(rest) ** 2).sum())
        return independent * np.log(max(left, 1e-300)) + 2.0 * basis.shape[1]

    return min(most, key=criterion)


def _sines(samples: int, rate: float, hz: float, pieces: int) -> csc_array:
    """(samples, 2 (pieces + 3)) cosines and sines, each times the splines of its amplitude."""
    t = np.arange(samples)
    splines = _splines(t / max(samples - 1, 1), pieces)
    angle = 2.0 * np.pi * hz * t / rate
    return csc_array(hstack([splines.multiply(f(angle)[:, None]) for f in (np.cos, np.sin)]))


def _splines(t: Reals, pieces: int) -> csc_array:
    """Cubic B-splines at times between 0 and 1."""
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, pieces + 1), np.ones(3)])
    return csc_array(BSpline.design_matrix(t, knots, 3))
