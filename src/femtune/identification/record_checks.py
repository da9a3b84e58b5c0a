"""Channels of a record that measured nothing, too much, or something else: found and named."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.modal import TimeSeries

DEAD = 1e-3
"""A channel whose rms is below this part of the median of its quantity is dead."""
CLIPPED_RUNS = 3
"""Runs of equal extreme samples that are more than chance."""
CLIPPED, PILED, NEXT = 10, 4, 5
"""Samples at an extreme that are more than chance: this many, and this many times those of any of the next values."""
DRIFT = 0.5
"""Part of a channel's power in its trend (a polynomial of third degree) above which it drifts."""
CUT = 0.02
"""Part of a record at its end in which nothing changes on any channel, above which it was cut short."""


def check_record(record: TimeSeries) -> tuple[Notice, ...]:
    """Notices of lost samples, of dead, clipped, drifting and doubled channels, and of a record that ends early.

    Returns
    -------
    ``record.lost-samples``, ``record.dead``, ``record.clipped``, ``record.drifting``, ``record.same-signal``,
    ``record.cut-short``; each names its channels
    """
    return tuple(_checks(record))


def dead_channels(record: TimeSeries) -> NDArray[np.bool_]:
    """(channels,) True where a channel hardly moves; lost samples count as zero."""
    return _dead(record, np.where(np.isnan(record.values), 0.0, record.values))


def _checks(record: TimeSeries) -> Iterator[Notice]:
    values = record.values
    lost = np.isnan(values).sum(axis=1)
    yield from _told(record, "record.lost-samples/channels", lost > 0)
    filled = np.where(np.isnan(values), 0.0, values)
    dead = _dead(record, filled)
    yield from _told(record, "record.dead", dead)
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
    found = []
    for row in values:
        levels, counts = np.unique(row, return_counts=True)
        ends = [(levels[-1], counts[-1], counts[-1 - NEXT : -1]), (levels[0], counts[0], counts[1 : 1 + NEXT])]
        found.append(
            len(levels) > 16
            and any(
                _runs(row == extreme) >= CLIPPED_RUNS or (count >= CLIPPED and count > PILED * beside.max())
                for extreme, count, beside in ends
                if extreme != 0.0
            )
        )
    return np.array(found)


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
