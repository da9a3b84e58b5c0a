"""Channels of a record that measured nothing, too much, or something else: found and named."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label, maximum_filter1d
from scipy.special import ndtri

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.identification.unnamed_force import steady_force, unnamed_force
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
CLIPPED_BANDS = (0.01, 0.02)
"""Widths of the bands of values at an extreme that are compared, relative to the range of a channel: noise behind the
amplifier that is at its end spreads the clipped samples over one or two of them."""
CLIPPED_BAND_SAMPLES = 30
"""Samples in the band at the extreme from which it is compared."""
DRIFT = 0.3
"""Part of a channel's power in its trend, cosines of up to three periods over the record, above which it drifts."""
DRIFT_TERMS = 6
"""Half periods of the fastest of these cosines: a mode that has only three periods in a record cannot be identified."""
BURST_PIECES = 400
"""Pieces of a record whose powers are compared."""
BURST_SAMPLES = 16
"""Samples of a piece at least."""
BURST_LEVEL = 1e-3
"""Probability of a louder piece without a burst, over all pieces of a channel."""
BURST_POWER = 0.05
"""Part of the power of a channel that bursts have at least: less does not move a mode."""
BURST_TIME = 0.1
"""Part of the record that bursts last at most: more is how the structure was excited."""
MOST_BURSTS = 5
"""Bursts of a channel at most: many are its excitation, such as vehicles on a bridge."""
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
    """Notices of lost samples, spikes, bursts, of dead, clipped, drifting and doubled channels, and of an early end.

    Returns
    -------
    ``record.lost-samples``, ``record.spikes``, ``record.dead``, ``record.other-unit``, ``record.clipped``,
    ``record.drifting``, ``record.bursts``, ``record.same-signal``, ``record.unnamed-force``, ``record.cut-short``; each
    names its channels
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
    yield from _gaps_told(record)
    spikes = _spikes(record)
    yield from _spikes_told(record, spikes)
    filled = _without_spikes(_filled(record), spikes)
    dead = _dead(record, filled)
    yield from _told(record, "record.dead", dead)
    yield from _levels_told(record, _level_ratios(record, filled))
    yield from _told(record, "record.clipped", _clipped(record, filled) & ~dead)
    yield from _told(record, "record.drifting", _drifting(filled) & ~dead)
    yield from _bursts_told(record, filled, dead)
    yield from _same(record, filled, dead)
    looks = unnamed_force(replace(record, values=_filled(record)), ~dead)
    if looks is not None:
        yield Notice("record.unnamed-force", channel=str(record.channels[looks[0]]), count=looks[1])
    elif (steady := steady_force(replace(record, values=filled), ~dead)) is not None:
        yield Notice("record.unnamed-force/steady", channel=str(record.channels[steady]))
    still = _still_at_end(values)
    if still > CUT * record.samples and not dead.all():
        first = record.time_s[record.samples - still - 1]
        yield Notice("record.cut-short", last_change_s=first, n_constant=still, samples=record.samples)


def _told(record: TimeSeries, code: str, bad: NDArray[np.bool_]) -> Iterator[Notice]:
    names = [str(record.channels[i]) for i in np.flatnonzero(bad)]
    if names:
        yield Notice(code, channels=", ".join(names))


def _gaps_told(record: TimeSeries) -> Iterator[Notice]:
    """Channels with samples that are not finite, and where."""
    missing = np.isnan(record.values)
    names = []
    for i in np.flatnonzero(missing.any(axis=1)):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], missing[i], [False]]).astype(int))).reshape(-1, 2)
        begin, end = edges[np.argmax(edges[:, 1] - edges[:, 0])]
        place = f"{end - begin} from {record.time_s[begin]:.6g} s"
        several = f"{missing[i].sum()} in {len(edges)} gaps, the longest with " if len(edges) > 1 else ""
        names.append(f"{record.channels[i]} ({several}{place})")
    if names:
        yield Notice("record.lost-samples/channels", channels=", ".join(names))


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


def _clipped(record: TimeSeries, values: Reals) -> NDArray[np.bool_]:
    """Samples that pile up at an extreme other than zero, the value of a force between impacts.

    A force may be a binary sequence, whose values are at two levels.
    """
    roles = [c.role for c in record.channels]
    out = []
    for role, row in zip(roles, values):
        levels, counts = np.unique(row, return_counts=True)
        near = role != "input" and len(levels) >= 4.0 / min(CLIPPED_BANDS)
        out.append(_at_an_end(row, levels, counts) or (near and _near_an_end(row)))
    return np.array(out)


def _at_an_end(row: Reals, levels: Reals, counts: NDArray[np.int64]) -> bool:
    """Many equal samples at an extreme.

    Several runs of three or more: a wave has one such sample, coarse steps a few. Or single samples, where the signal
    is fast, that are far more than those of the values next to the extreme.
    """
    ends = [
        (levels[-1], counts[-1], counts[-1 - NEXT_LEVELS : -1]),
        (levels[0], counts[0], counts[1 : 1 + NEXT_LEVELS]),
    ]
    return len(levels) > 16 and any(
        _runs(row == extreme) >= CLIPPED_RUNS or (count >= CLIPPED_SAMPLES and count > CLIPPED_RATIO * beside.max())
        for extreme, count, beside in ends
        if extreme != 0.0
    )


def _near_an_end(row: Reals) -> bool:
    """Far more samples in the two bands at an extreme than in the two next ones; of a sine they are 3 times as many.

    None of the bands has zero.
    """
    low, high = float(row.min()), float(row.max())
    for width in (high - low) * np.array(CLIPPED_BANDS):
        for away, extreme in ((high - row, high), (row - low, -low)):
            counts = np.histogram(away, bins=4, range=(0.0, 4.0 * width))[0]
            most = counts[:2].max()
            if extreme > 4.0 * width and most >= CLIPPED_BAND_SAMPLES and most > CLIPPED_RATIO * counts[2:].max():
                return True
    return False


def _runs(at: NDArray[np.bool_]) -> int:
    """Runs of three or more."""
    steps = np.diff(np.concatenate([[False], at, [False]]).astype(int))
    return int(np.sum(np.flatnonzero(steps == -1) - np.flatnonzero(steps == 1) >= 3))


def _drifting(values: Reals) -> NDArray[np.bool_]:
    n = values.shape[1]
    basis = np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(1, DRIFT_TERMS + 1)) / n) * np.sqrt(2.0 / n)
    moving = values - values.mean(axis=1, keepdims=True)
    power = np.sum(moving**2, axis=1)
    trend = np.sum((moving @ basis) ** 2, axis=1)
    return trend > DRIFT * np.where(power > 0.0, power, np.inf)


def _bursts_told(record: TimeSeries, values: Reals, dead: NDArray[np.bool_]) -> Iterator[Notice]:
    """Short loud pieces of records without a measured excitation, which would tell what they are."""
    if record.positions("input"):
        return
    names = []
    for i in np.flatnonzero(~dead):
        bursts, share = _bursts(values[i])
        if bursts:
            when = ", ".join(f"{record.time_s[a]:.4g} to {record.time_s[b - 1]:.4g} s" for a, b in bursts)
            names.append(f"{record.channels[i]} ({when}: {100.0 * share:.2g} % of its power)")
    if names:
        more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        yield Notice("record.bursts", channels=", ".join(names[:MOST_NAMED]) + more)


MOST_NAMED = 4
"""Channels with bursts that a notice lists."""


def _bursts(row: Reals) -> tuple[list[tuple[int, int]], float]:
    """First and last sample of each burst, and their part of the power; none where they are no fault.

    The powers of pieces are compared with a lognormal distribution, whose tail is longer than that of the powers of a
    stationary signal. Its median and spread follow from two quantiles that bursts hardly change, so that the spread
    includes slow changes of the level.
    """
    length = max(len(row) // BURST_PIECES, BURST_SAMPLES)
    count = len(row) // length
    if count < BURST_PIECES // 4:
        return [], 0.0
    pieces = row[: count * length].reshape(count, length)
    power = np.var(pieces, axis=1)
    middle, upper = np.quantile(power, [0.5, 0.75])
    if middle <= 0.0:
        return [], 0.0
    largest = middle * (upper / middle) ** (ndtri(1.0 - BURST_LEVEL / count) / ndtri(0.75))
    loud = power > largest
    # the flanks of a burst belong to it
    edge = power > upper + 2.0 * (upper - middle)
    labels = label(edge | loud)[0]
    spans = [(s[0].start, s[0].stop) for k, s in enumerate(find_objects(labels), 1) if loud[labels == k].any()]
    share = sum(float(power[a:b].sum()) for a, b in spans) / float(power.sum())
    lasting = sum(b - a for a, b in spans) / count
    if not 0 < len(spans) <= MOST_BURSTS or lasting > BURST_TIME or share < BURST_POWER:
        return [], 0.0
    return [(a * length, b * length) for a, b in spans], share


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
