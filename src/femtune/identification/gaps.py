"""Records in which samples are missing: cut at the gaps, so that each part is a record of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.identification.kinds import GapWay
from femtune.modal import TimeSeries
from femtune.modal.time_series import LONG_STEP

LEAST_SHARE = 0.25
"""Length of a part relative to the longest one, below which it is left out: its lines are four times as far apart."""
LEAST_PART = 32
"""Samples of a part at least; shorter ones hold no motion, and are left out whatever the others are."""
UNEVEN = 0.05
"""Deviation of the times of a part from even steps, relative to the step, that rounding explains."""
_MOST_LISTED = 5
"""Parts that a notice lists."""


def cut_at_gaps(record: TimeSeries, way: GapWay) -> tuple[list[TimeSeries], tuple[Notice, ...]]:
    """The parts of a record between its gaps, in their order, and what was done; a record without gaps as it is.

    A gap is a run of samples that a channel lacks, or a step between two times of more than one and a half usual ones.

    Parameters
    ----------
    way : "parts" for all parts that are not much shorter than the longest one, "longest" for this one alone

    Returns
    -------
    The parts, evenly sampled, with their own times; ``identify.gaps``, or () without a gap

    Raises
    ------
    FemtuneError : ``record.lost-samples/no-part`` where no part is long enough, ``record.uneven`` where the samples of
        a part are not evenly spaced
    """
    spans = _spans(record)
    if len(spans) == 1 and spans[0] == (0, record.samples):
        return [record], ()
    longest = max((b - a for a, b in spans), default=0)
    if longest < LEAST_PART:
        lost = np.isnan(record.values).mean(axis=1)
        names = ", ".join(f"{record.channels[i]}: {100.0 * lost[i]:.3g} %" for i in np.argsort(-lost)[:5] if lost[i])
        values = {"longest part": f"{longest} samples", "samples lost": names or "none"}
        raise FemtuneError("record.lost-samples/no-part", values=values, least=LEAST_PART)
    first = next(i for i, (a, b) in enumerate(spans) if b - a == longest)
    used = [first] if way == "longest" else [
        i for i, (a, b) in enumerate(spans) if b - a >= max(LEAST_SHARE * longest, LEAST_PART)
    ]  # fmt: skip
    rate = _part(record, spans[first], None).even_hz
    parts = [_part(record, spans[i], rate) for i in used]
    return parts, (_told(record, spans, used, rate),)


def _spans(record: TimeSeries) -> list[tuple[int, int]]:
    """First sample and end of each part in which every channel has all samples, at the usual step."""
    there = np.asarray(~np.isnan(record.values).any(axis=0), dtype=bool)
    cut = np.zeros(record.samples, bool)
    if record.times_s is not None and record.samples > 1:
        steps = np.diff(record.times_s)
        cut[1:] = steps > LONG_STEP * np.median(steps)
    spans: list[tuple[int, int]] = []
    for begin, end in _runs(there):
        inner = begin + np.flatnonzero(cut[begin:end])
        edges = [begin, *inner[inner > begin].tolist(), end]
        spans += list(pairwise(edges))
    return spans


def _runs(there: NDArray[np.bool_]) -> list[tuple[int, int]]:
    steps = np.diff(np.concatenate([[False], there, [False]]).astype(int))
    return list(zip(np.flatnonzero(steps == 1).tolist(), np.flatnonzero(steps == -1).tolist()))


def _part(record: TimeSeries, span: tuple[int, int], rate: float | None) -> TimeSeries:
    """The samples of a span; with the rate of the longest part where its own times agree with that."""
    part = record.select_samples(*span)
    if record.times_s is None or rate is None:
        return part
    times = record.times_s[slice(*span)]
    if np.abs(times - times[0] - np.arange(len(times)) / rate).max() * rate > UNEVEN:
        return part
    return replace(part, sampling_hz=rate, t0_s=float(times[0]), times_s=None)


def _told(record: TimeSeries, spans: Sequence[tuple[int, int]], used: Sequence[int], rate: float) -> Notice:
    """The parts that are used with their times, and what was left out."""
    listed = _places(record, [spans[i] for i in used], rate)
    others = [spans[i] for i in range(len(spans)) if i not in used]
    seconds = sum(b - a for a, b in others) / rate
    left = f"; {seconds:.4g} s are left out" if others else ""
    kept = sum(spans[i][1] - spans[i][0] for i in used) / rate
    return Notice(
        "identify.gaps", level="info", count=len(spans), parts=len(used), seconds=kept, listed=listed, left=left
    )


def _places(record: TimeSeries, spans: Sequence[tuple[int, int]], rate: float) -> str:
    times = record.time_s
    shown = [f"{times[a]:.6g} to {times[b - 1] + 1.0 / rate:.6g} s" for a, b in spans[:_MOST_LISTED]]
    more = len(spans) - _MOST_LISTED
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")
