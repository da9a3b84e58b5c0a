"""Channels of a record that measured nothing, too much, or something else: found and named."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.modal import TimeSeries

DEAD = 1e-3
"""A channel whose rms is below this part of the median of its quantity is dead."""
CLIPPED_RUNS = 3
"""Runs of equal extreme samples that are more than chance."""
CLIPPED_SAMPLES = 10
"""Samples at an extreme beyond which it may be clipped."""
CLIPPED_RATIO = 4
"""Samples at an extreme relative to those of any of the next values, beyond which they are more than chance."""
NEXT_LEVELS = 5
"""Next values that the extreme is compared with."""
DRIFT = 0.5
"""Part of a channel's power in its trend (a polynomial of third degree) above which it drifts."""
CUT = 0.02
"""Part of a record at its end in which nothing changes on any channel, above which it was cut short."""
SPIKE_RATIO = 10.0
"""Size of a spike relative to all samples around it. Of Gaussian noise the largest of a hundred samples is 2.5 standard
deviations: 25 make a spike."""
SPIKE_SAMPLES = 2
"""Samples that a spike lasts."""
SPIKE_SURROUNDINGS = 50
"""Samples on each side that it is compared with."""
SPIKES = 1e-3
"""Part of the samples up to which spikes are errors; more are a signal of impacts."""
OTHER_UNIT = 200.0
"""Level of a channel, by the median of the others of its quantity, unit and role, above which its unit is doubted."""


def check_record(record: TimeSeries) -> tuple[Notice, ...]:
    """Notices of lost samples, of spikes, of dead, clipped, drifting and doubled channels, and of an early end.

    Returns
    -------
    ``record.lost-samples``, ``record.spikes``, ``record.dead``, ``record.other-unit``, ``record.clipped``,
    ``record.drifting``, ``record.same-signal``, ``record.cut-short``; each names its channels
    """
    return tuple(_checks(record))


def dead_channels(record: TimeSeries) -> NDArray[np.bool_]:
    """(channels,) True where a channel hardly moves; lost samples count as zero."""
    return _dead(record, _filled(record))


def level_ratios(record: TimeSeries) -> Reals:
    """(channels,) rms by the median of the others of the same quantity, unit and role where this is beyond
    `OTHER_UNIT`, else 1; spikes are not counted.
    """
    return _level_ratios(record, _without_spikes(_filled(record), _spikes(record)))


def _checks(record: TimeSeries) -> Iterator[Notice]:
    values = record.values
    lost = np.isnan(values).sum(axis=1)
    yield from _told(record, "record.lost-samples/channels", lost > 0)
    spikes = _spikes(record)
    yield from _spikes_told(record, spikes)
    filled = _without_spikes(_filled(record), spikes)
    dead = _dead(record, filled)
    yield from _told(record, "record.dead", dead)
    yield from _levels_told(record, _level_ratios(record, filled))
    yield from _told(record, "record.clipped", _clipped(filled) & ~dead)
    yield from _told(record, "record.drifting", _drifting(filled) & ~dead)
    yield from _same(record, filled, dead)
    still = _still_at_end(values)
    if still > CUT * record.samples and not dead.all():
        first = record.time_s[record.samples - still - 1]
        yield Notice("record.cut-short", last_change_s=first, n_constant=still, samples=record.samples)


def _told(record: TimeSeries, code: str, bad: NDArray[np.bool_]) -> Iterator[Notice]:
    names = [str(record.channels[i]) for i in np.flatnonzero(bad)]
    if names:
        yield Notice(code, channels=", ".join(names))


def _filled(record: TimeSeries) -> Reals:
    """Values with zeros for lost samples."""
    return np.where(np.isnan(record.values), 0.0, record.values)


def _spikes(record: TimeSeries) -> NDArray[np.bool_]:
    """(channels, samples) Single samples, or two, far beyond all others around them.

    Not of inputs: a short impact of a hammer is such a sample.
    """
    at_spike = np.zeros(record.values.shape, bool)
    for i, row in enumerate(_filled(record)):
        if record.channels[i].role != "input" and len(row) > 2 * SPIKE_SURROUNDINGS:
            at_spike[i] = _spikes_of(row)
    return at_spike


def _spikes_of(row: Reals) -> NDArray[np.bool_]:
    """Against the medians of pieces, so that a slow motion does not count."""
    pieces = len(row) // SPIKE_SURROUNDINGS
    middles = np.median(row[: pieces * SPIKE_SURROUNDINGS].reshape(pieces, SPIKE_SURROUNDINGS), axis=1)
    away = np.abs(row - np.interp(np.arange(len(row)), SPIKE_SURROUNDINGS * (np.arange(pieces) + 0.5), middles))
    shift = SPIKE_SAMPLES + SPIKE_SURROUNDINGS // 2
    largest = maximum_filter1d(np.pad(away, shift), SPIKE_SURROUNDINGS, mode="constant")
    before, after = largest[: len(row)], largest[2 * shift :]
    # single steps of a converter between equal samples are no spikes
    moving = away[away > 0.0]
    least = np.median(moving) if len(moving) else np.inf
    at = away > SPIKE_RATIO * np.maximum(np.maximum(before, after), least)
    return at if at.sum() <= max(SPIKES * len(row), 1.0) else np.zeros(len(row), bool)


def _without_spikes(values: Reals, spikes: NDArray[np.bool_]) -> Reals:
    """Spikes replaced by the median of their channel."""
    return np.where(spikes, np.median(values, axis=1, keepdims=True), values)


def _spikes_told(record: TimeSeries, spikes: NDArray[np.bool_]) -> Iterator[Notice]:
    count = spikes.sum(axis=1)
    if count.any():
        names = [
            f"{record.channels[i]} ({count[i]}, the first at {record.time_s[np.argmax(spikes[i])]:.6g} s)"
            for i in np.flatnonzero(count)
        ]
        yield Notice("record.spikes", channels=", ".join(names))


def _level_ratios(record: TimeSeries, values: Reals) -> Reals:
    rms = np.std(values, axis=1)
    kinds = [(c.quantity, c.unit, c.role == "input") for c in record.channels]
    ratios = np.ones(len(kinds))
    for i, kind in enumerate(kinds):
        others = [rms[j] for j, other in enumerate(kinds) if other == kind and j != i and rms[j] > 0.0]
        # of two channels it is not known which one is wrong
        if len(others) > 1 and rms[i] > OTHER_UNIT * np.median(others):
            ratios[i] = rms[i] / np.median(others)
    return ratios


def _levels_told(record: TimeSeries, ratios: Reals) -> Iterator[Notice]:
    odd = np.flatnonzero(ratios > 1.0)
    if len(odd):
        names = [f"{record.channels[i]} ({ratios[i]:.3g} times)" for i in odd]
        yield Notice("record.other-unit", channels=", ".join(names))


def _dead(record: TimeSeries, values: Reals) -> NDArray[np.bool_]:
    moving = values - values.mean(axis=1, keepdims=True)
    rms = np.sqrt(np.mean(moving**2, axis=1))
    # the mean of equal numbers is not quite that number
    dead = rms <= 1e-13 * np.abs(values).max(axis=1, initial=0.0)
    for quantity in {(c.quantity, c.unit) for c in record.channels}:
        same = np.array([(c.quantity, c.unit) == quantity for c in record.channels])
        dead |= same & (rms < DEAD * np.median(rms[same]))
    return dead


def _clipped(values: Reals) -> NDArray[np.bool_]:
    """Many equal samples at an extreme other than zero, the value of a force between impacts.

    Several runs of three or more: a wave has one such sample, coarse steps a few. Or single samples, where the signal
    is fast, that are far more than those of the values next to the extreme.
    """
    clipped = []
    for row in values:
        levels, counts = np.unique(row, return_counts=True)
        ends = [
            (levels[-1], counts[-1], counts[-1 - NEXT_LEVELS : -1]),
            (levels[0], counts[0], counts[1 : 1 + NEXT_LEVELS]),
        ]
        clipped.append(
            len(levels) > 16
            and any(
                _runs(row == extreme) >= CLIPPED_RUNS
                or (count >= CLIPPED_SAMPLES and count > CLIPPED_RATIO * beside.max())
                for extreme, count, beside in ends
                if extreme != 0.0
            )
        )
    return np.array(clipped)


def _runs(at: NDArray[np.bool_]) -> int:
    """Runs of three or more."""
    steps = np.diff(np.concatenate([[False], at, [False]]).astype(int))
    return int(np.sum(np.flatnonzero(steps == -1) - np.flatnonzero(steps == 1) >= 3))


def _drifting(values: Reals) -> NDArray[np.bool_]:
    t = np.linspace(-1.0, 1.0, values.shape[1])
    basis = np.linalg.qr(np.vander(t, 4, increasing=True))[0]
    moving = values - values.mean(axis=1, keepdims=True)
    power = np.sum(moving**2, axis=1)
    trend = np.sum((moving @ basis) ** 2, axis=1)
    return trend > DRIFT * np.where(power > 0.0, power, np.inf)


def _same(record: TimeSeries, values: Reals, dead: NDArray[np.bool_]) -> Iterator[Notice]:
    """Two channels that correlate to all digits are one signal on two plugs."""
    live = np.flatnonzero(~dead)
    moving = values[live] - values[live].mean(axis=1, keepdims=True)
    unit = moving / np.linalg.norm(moving, axis=1, keepdims=True)
    alike = np.triu(np.abs(unit @ unit.T) > 1.0 - 1e-9, 1)
    for i, j in np.argwhere(alike)[:5]:
        names = f"{record.channels[live[i]]} and {record.channels[live[j]]}"
        yield Notice("record.same-signal", channels=names)


def _still_at_end(values: Reals) -> int:
    """Samples at the end in which no channel changes."""
    changes = np.flatnonzero((np.diff(values, axis=1) != 0.0).any(axis=0))
    return int(values.shape[1] - 2 - changes[-1]) if len(changes) else values.shape[1]
