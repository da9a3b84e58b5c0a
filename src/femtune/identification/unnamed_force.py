"""A channel that is taken as a response and looks like a force.

A hammer pushes: its pulses have one sign, they are short, and the structure moves after each of them. A response swings
to both sides, and after a spike of a cable nothing else moves. The force of a shaker is coherent with all channels and
has no peaks where they resonate, as has the motion of a base that is shaken.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce

import numpy as np
from scipy.ndimage import median_filter

from femtune.arrays import Complexes, Flags, Reals
from femtune.identification.hammer import hit_spans, is_impulsive
from femtune.modal import Channel, TimeSeries

ONE_SIGN = 0.25
"""Largest value of the smaller sign relative to that of the larger one: a filter rings by less, a response by more."""
LEAST_RISE = 4.0
"""Ratio of the mean squares of the other channels after and before each of three hits or more."""
CLEAR_RISE = 30.0
"""The same for one or two hits: narrow-band motion can grow by less within such a time by chance."""
SEVERAL = 3
"""Hits from which the lower ratio is enough."""
_ASIDE = 8
"""Samples beside the first one of a hit that are not counted, where a pulse reaches other channels through cables."""
_LEAST_SAMPLES = 16
"""Samples after and before a hit, at least."""
PEAKS = 0.2
"""Height of the peaks of the spectrum of a force, relative to those of the other channels at the same lines, both as
logarithms. In simulated records random forces and sweeps have 0.1, responses 0.3 and more."""
CLEAR_PEAKS = 1.0
"""Height (natural logarithm) from which a line of the other channels is one of a peak."""
_LEAST_PEAKS = 4
"""Lines of peaks, at least."""
COHERENT = 0.5
"""Coherence of a force with the other channels, mean over these and median over the lines, at least."""
_SEGMENTS = 48
"""Segments of a record that follow each other."""
_LEAST_SEGMENT = 128
"""Samples of a segment, at least: with 64, 1 of 240 records without a force was told."""
_LARGEST_SEGMENT = 4096
"""Samples of a segment, at most, so that channels and lines fit into the memory."""
_AROUND = 31
"""Lines around one, over whose median its peak stands."""
_EMPTY = 1e-3
"""Power beside that of the strongest lines, below which a force has nothing in a line."""
_LEAST_LINES = 20
"""Lines with something in them, at least."""


def unnamed_force(record: TimeSeries, alive: Flags) -> tuple[int, int] | None:
    """Position of a response that looks like the force of a hammer and the number of its hits, or None.

    Parameters
    ----------
    record : without lost samples
    alive : (channels,) the channels that move
    """
    if record.positions("input") or alive.sum() < 2:
        return None
    for i in np.flatnonzero(alive).tolist():
        row = record.values[i] - np.median(record.values[i])
        if min(row.max(), -row.min()) > ONE_SIGN * max(row.max(), -row.min()):
            continue
        force = Channel(record.channels[i].dof, "force", role="input")
        single = TimeSeries(row[None], (force,), record.even_hz)
        if not is_impulsive(single):
            continue
        others = np.flatnonzero(alive & (np.arange(len(alive)) != i))
        y = record.values[others] - np.median(record.values[others], axis=1, keepdims=True)
        rises = _rises(y, hit_spans(single))
        if len(rises) and rises.min() >= (LEAST_RISE if len(rises) >= SEVERAL else CLEAR_RISE):
            return i, len(rises)
    return None


def steady_force(record: TimeSeries, alive: Flags) -> int | None:
    """Position of a response that looks like the force of a shaker or the motion of a base, or None.

    Parameters
    ----------
    record : without lost samples
    alive : (channels,) the channels that move
    """
    size = min(2 ** int(np.log2(max(record.samples / _SEGMENTS, 1.0))), _LARGEST_SEGMENT)
    moving = np.flatnonzero(alive)
    if record.positions("input") or len(moving) < 2 or size < _LEAST_SEGMENT:
        return None
    values = record.values[moving] / record.values[moving].std(axis=1, keepdims=True)
    power = reduce(np.add, (np.abs(part) ** 2 for part in _transforms(values, size)))
    logs = np.log(np.maximum(power, np.finfo(float).tiny))
    found: list[tuple[float, int]] = []
    for i in range(len(moving)):
        filled = power[i] > _EMPTY * np.median(np.sort(power[i])[-len(power[i]) // 4 :])
        if filled.sum() < _LEAST_LINES:
            continue
        others = np.delete(np.arange(len(moving)), i)
        own, rest = _over_median(logs[i])[filled], _over_median(logs[others].mean(axis=0))[filled]
        at_peaks = rest > CLEAR_PEAKS
        if at_peaks.sum() < _LEAST_PEAKS:
            continue
        ratio = float(np.median(own[at_peaks]) / np.median(rest[at_peaks]))
        if ratio > PEAKS:
            continue
        cross = reduce(np.add, (part[i] * part[others].conj() for part in _transforms(values, size)))
        coherence = np.abs(cross) ** 2 / np.maximum(power[i] * power[others], np.finfo(float).tiny)
        if np.median(coherence.mean(axis=0)[filled]) >= COHERENT:
            found.append((ratio, int(moving[i])))
    return min(found)[1] if found else None


def _transforms(values: Reals, size: int) -> Iterator[Complexes]:
    """(n, lines) of segments that overlap by half, without the first lines and the last tenth."""
    window = np.hanning(size)
    for begin in range(0, values.shape[1] - size + 1, size // 2):
        part = values[:, begin : begin + size]
        whole = np.fft.rfft((part - part.mean(axis=1, keepdims=True)) * window, axis=1)
        yield whole[:, 2 : int(0.9 * whole.shape[1])]


def _over_median(logs: Reals) -> Reals:
    return np.asarray(logs - median_filter(logs, _AROUND))


def _rises(y: Reals, hits: list[tuple[int, int, bool]]) -> Reals:
    """Of each hit after enough samples, the median over channels (n, samples) of the mean square after over before."""
    out, last = [], 0
    for begin, end, _ in hits:
        width = max((end - begin) // 4, _LEAST_SAMPLES)
        before = y[:, max(begin - _ASIDE - width, last) : max(begin - _ASIDE, 0)]
        after = y[:, begin + _ASIDE : begin + _ASIDE + width]
        if before.shape[1] >= _LEAST_SAMPLES and after.shape[1] >= _LEAST_SAMPLES:
            rest = np.maximum(np.mean(before**2, axis=1), np.finfo(float).tiny)
            out.append(float(np.median(np.mean(after**2, axis=1) / rest)))
        last = begin + _ASIDE
    return np.array(out)
