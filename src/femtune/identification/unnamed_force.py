"""A channel that is taken as a response and looks like the force of a hammer.

A hammer pushes: its pulses have one sign, they are short, and the structure moves after each of them. A response swings
to both sides, and after a spike of a cable nothing else moves.
"""

from __future__ import annotations

import numpy as np

from femtune.arrays import Flags, Reals
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
