"""Hits of a hammer in a record: found by the force, cut into blocks of one length, double hits and overloads left out.

A hit is short beside the response, which decays after it. Segments of a random signal, each with a window that begins
and ends at zero, would cut the response from its force; a block from each hit to the next one needs no window.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_dilation

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError, Notice
from femtune.modal import TimeSeries

LEVEL = 0.1
"""Part of the largest force beyond which a sample belongs to a hit."""
MOST_SAMPLES = 0.02
"""Part of the samples beyond that level up to which a force is that of a hammer: random forces have 60 %, sweeps 90 %,
and bursts as much as they last."""
LEAST_ENERGY = 0.3
"""Part of the energy of the force above its noise that these samples have at least."""
MOST_ELSEWHERE = 0.5
"""Samples beyond half of that level that are not beside a hit, relative to those beyond it. Around a hit a steep
anti-aliasing filter rings, more often beyond the level after a hard hit than after a soft one. Heavy-tailed random
forces have them everywhere, and a random force with spikes has all those beyond its 3 σ."""
DOUBLE = 0.2
"""Part of the longest time from one hit to the next; hits that follow sooner are bounces of the hammer."""
FLAT = 3
"""Equal samples in a row at the largest value of a channel, from which the channel was overloaded in a hit."""
LEAST_HITS = 3
"""Hits from which their scatter gives the noise of the functions."""
FINE = 1e-4
"""Steps of a channel by its largest value, up to which three hits have the same peak by a limit only."""
VERY_FINE = 1e-5
"""The same for two hits."""
LEAST_LIMIT = 0.3
"""Distance of a limit of a channel from its value at rest, relative to its largest distance from it."""
QUIET = 2e-6
"""Part of the energy of the force that comes before a hit."""
_EXTREME = 0.98
"""Part of the largest value of a channel over the record above which a hit may have overloaded it."""
_BEFORE = 8
"""Samples before a hit that its block begins with at most."""
_MEDIAN_OF_NORMAL = 0.6745
"""Median of the magnitude of Gaussian noise with a standard deviation of 1."""
DECAYED = 0.05
"""Part of its largest value that the response may still have at the end of a block without a remark."""
LARGE_REST = 0.5
"""Part of its size from which what is left of the response is no noise, even where it does not fall."""
LEAST_FALL = 1.3
"""The ratio of `FALLS` with noise from which the response falls: steady noise has 1 with some scatter."""
LEAST_BEFORE = 24
"""Samples before the first hits from which the noise is known."""
FALLS = 1.8
"""Mean square of the eighth tenth of a block over that of the last one, of the response alone, where the noise before
the hits is not known: that of a mode that falls by e^-3 over the block is 3.3, of one that falls by e^-1.5 1.8."""


@dataclass(frozen=True, eq=False)
class Hits:
    """Blocks of the same length, each with one hit; notices say what was left out and why.

    Parameters
    ----------
    left_out : begin and end of each hit that is left out, in samples of its record
    doubtful : whether hits that are not sound are among the blocks
    """

    blocks: tuple[TimeSeries, ...]
    notices: tuple[Notice, ...]
    left_out: tuple[tuple[int, int], ...] = ()
    doubtful: bool = False


def is_impulsive(record: TimeSeries) -> bool:
    """Whether the force of a record is that of a hammer: a few samples with most of its energy."""
    force = _force(record)
    at = _beyond(force)
    elsewhere = _beyond(force, 0.5 * LEVEL) & ~binary_dilation(at, iterations=_BEFORE)
    few = 0 < at.sum() <= MOST_SAMPLES * len(force) and elsewhere.sum() <= MOST_ELSEWHERE * at.sum()
    # in a long record with one hit the noise of the force has more energy than the hit
    noise = np.median(np.abs(force)) / _MEDIAN_OF_NORMAL
    energy = float(np.sum(force**2)) - len(force) * float(noise) ** 2
    return bool(few and np.sum(force[at] ** 2) >= LEAST_ENERGY * energy)


def hits_of(records: Sequence[TimeSeries], longest: int | None = None, force_window: int | None = None) -> Hits:
    """The hits of records that have one or more each.

    Parameters
    ----------
    records : with one input, the force
    longest : samples of a block; as long as the hits allow where None
    force_window : samples from the beginning of a hit on after which the force is set to zero, or None

    Raises
    ------
    FemtuneError : ``identify.resolution/hits`` where no block is as long as that; ``record.lost-samples``
    """
    found = [(record, *hit) for record in records for hit in hit_spans(record)]
    if len({len(record.channels) for record in records}) == 1:
        overloads = _overloads([one[:3] for one in found])
    else:
        overloads = [why for record in records for why in _overloads([o[:3] for o in found if o[0] is record])]
    hits = [(*one[:3], "double hit" if one[3] else why) for one, (why, _) in zip(found, overloads)]
    brief = ["" if reason else why for (*_, reason), (_, why) in zip(hits, overloads)]
    points = [tuple(record.dofs("input").labels()) for record, *_ in hits]
    sound = Counter(point for point, hit, why in zip(points, hits, brief) if not (hit[3] or why))
    good, left = [], []
    spans: list[tuple[int, int]] = []
    for hit, why, point in zip(hits, brief, points):
        time_s, enough = float(hit[0].time_s[hit[1]]), sound[point] >= LEAST_HITS
        if hit[3] or (why and enough):
            left.append(Notice("identify.hit-left-out", time_s=time_s, reason=hit[3] or why))
            spans.append((hit[1], hit[2]))
        else:
            good.append(hit)
            if why:
                left.append(Notice("identify.hit-overloaded", time_s=time_s, reason=why, count=LEAST_HITS))
    if not good:
        # there is nothing better, and the reader is told
        spans = []
        good, left = hits, [Notice("identify.hits-doubtful", reasons=", ".join(sorted({one[3] for one in hits})))]
    lengths = np.array([end - begin for _, begin, end, _ in good])
    usual = float(np.median(lengths))
    kept = [one for one, length in zip(good, lengths) if length >= (longest or 0.5 * usual)]
    if not kept:
        values = {"block": f"{longest} samples", "longest hit": f"{lengths.max()} samples"}
        raise FemtuneError("identify.resolution/hits", values=values)
    block = longest or int(min(end - begin for _, begin, end, _ in kept))
    before = min(_BEFORE, *(begin for _, begin, _, _ in kept))
    pieces = [record.select_samples(begin - before, begin - before + block) for record, begin, _, _ in kept]
    cut = (
        (Notice("identify.hits-cut", level="info", count=len(good) - len(kept), seconds=block / records[0].even_hz),)
        if len(good) > len(kept)
        else ()
    )
    if force_window is not None:
        pieces = [_with_force_window(piece, before + force_window) for piece in pieces]
    doubtful = any(notice.code == "identify.hits-doubtful" for notice in left)
    return Hits(tuple(pieces), (*left, *cut), tuple(spans), doubtful)


def without_hits(record: TimeSeries, spans: Sequence[tuple[int, int]]) -> tuple[TimeSeries, tuple[int, ...]]:
    """A record without some of its hits, each until the next one, and the first sample of each piece that is left.

    Parameters
    ----------
    spans : begin and end of the hits in samples, in their order
    """
    first = hit_spans(record)[0][0]
    kept = np.ones(record.samples, bool)
    for begin, end in spans:
        kept[0 if begin == first else max(begin - _BEFORE, 0) : end] = False
    at = np.flatnonzero(kept)
    begins = np.append(0, np.flatnonzero(np.diff(at) > 1) + 1)
    return replace(record.select_samples(0, len(at)), values=record.values[:, at]), tuple(begins.tolist())


def samples_before(record: TimeSeries) -> int:
    """Samples before the first hit and before the ringing of a filter ahead of it."""
    energy = np.cumsum(_force(record) ** 2)
    return int(np.searchsorted(energy, QUIET * energy[-1]))


def still_moving(blocks: Sequence[TimeSeries], records: Sequence[TimeSeries]) -> float:
    """Median over the hits of the part of its size that the response has in the last tenth of a block, without noise.

    The mean square of the noise is that before the first hits of the records. What is left is not above the noise
    where the mean square at the end is less than twice as large. Where the records begin too late for that, only what
    falls over the last tenths of the block is no noise.

    Parameters
    ----------
    blocks : of the hits
    records : from which they were cut
    """
    noise = _noise_before(records)
    parts = []
    for block in blocks:
        y = block.values[[i for i, c in enumerate(block.channels) if c.role != "input"]]
        y = y - np.median(y, axis=1, keepdims=True)
        tenth, mean = max(y.shape[1] // 10, 1), max(float(np.mean(y**2)), np.finfo(float).tiny)
        tail = float(np.mean(y[:, -tenth:] ** 2))
        if noise is not None:
            left = tail - noise if tail > 2.0 * noise else 0.0
        else:
            earlier = float(np.mean(y[:, -3 * tenth : -2 * tenth] ** 2))
            if tail > LARGE_REST**2 * mean:
                left = tail
            else:
                left = min((earlier - tail) / (FALLS - 1.0), tail) if earlier > LEAST_FALL * tail else 0.0
        parts.append(float(np.sqrt(left / mean)))
    return float(np.median(parts))


def _noise_before(records: Sequence[TimeSeries]) -> float | None:
    """Mean square of the responses before the first hits; None where there are less than `LEAST_BEFORE` samples."""
    pieces = []
    for record in records:
        begin = max(hit_spans(record)[0][0] - _BEFORE, 0)
        y = record.values[[i for i, c in enumerate(record.channels) if c.role != "input"], :begin]
        if begin > 1:
            pieces.append((y - y.mean(axis=1, keepdims=True)) * np.sqrt(begin / (begin - 1)))
    known = sum(piece.shape[1] for piece in pieces) >= LEAST_BEFORE
    return float(np.mean(np.concatenate([piece.ravel() for piece in pieces]) ** 2)) if known else None


def _force(record: TimeSeries) -> Reals:
    row = record.values[record.positions("input")[0]]
    return np.asarray(row - np.nanmedian(row), float)


def _beyond(force: Reals, level: float = LEVEL) -> Flags:
    return np.asarray(np.abs(force) > level * np.nanmax(np.abs(force), initial=0.0))


def hit_spans(record: TimeSeries) -> list[tuple[int, int, bool]]:
    """Begin and end of each hit, and whether it is a double hit."""
    at = np.flatnonzero(_beyond(_force(record)))
    apart = np.append(np.diff(at), record.samples - at[-1])
    # pulses that follow much sooner than the others do are one hit with its bounces
    least = DOUBLE * apart.max()
    last = np.flatnonzero(np.append(apart[:-1] >= least, True))
    first = np.append(0, last[:-1] + 1)
    begins = at[first]
    ends = np.append(begins[1:] - _BEFORE, record.samples)
    hits = []
    for i, (begin, end) in enumerate(zip(begins.tolist(), ends.tolist())):
        contact = at[first[i] : last[i] + 1]
        # within one pulse the force falls below the level only where it crosses zero
        bounce = np.diff(contact).max(initial=1) > max(2 * _first_pulse(contact), 4)
        hits.append((begin, end, bool(bounce)))
    return hits


def _first_pulse(own: np.ndarray) -> int:
    """Samples of the first run beyond the level."""
    gaps = np.flatnonzero(np.diff(own) > 1)
    return int(gaps[0] + 1 if len(gaps) else len(own))


def _overloads(hits: Sequence[tuple[TimeSeries, int, int]]) -> list[tuple[str, str]]:
    """Of each hit of records with the same channels, which are overloaded for long and which briefly ("" if none is).

    A channel is for long if it is flat at the largest values that it has in the record, briefly if it stops for a
    sample or two where it stops in other hits.
    """
    names: list[tuple[list[str], list[str]]] = [([], []) for _ in hits]
    for i in range(len(hits[0][0].channels)):
        rows = {id(record): record.values[i] for record, _, _ in hits}
        if any(_coarse(row) for row in rows.values()):
            continue
        largest = {key: float(np.nanmax(np.abs(row))) for key, row in rows.items()}
        step = max(_step(row) / largest[key] for key, row in rows.items())
        pieces = [rows[id(record)][begin:end] for record, begin, end in hits]
        for own, (record, _, _), piece, stops in zip(names, hits, pieces, _share_an_extreme(pieces, step)):
            high = np.abs(piece) >= _EXTREME * largest[id(record)]
            equal = high[1:] & high[:-1] & (piece[1:] == piece[:-1])
            runs = np.convolve(equal, np.ones(FLAT - 1), "valid") if len(equal) >= FLAT - 1 else np.zeros(0)
            if (runs >= FLAT - 1).any():
                own[0].append(str(record.channels[i]))
            elif stops:
                own[1].append(str(record.channels[i]))
    return [(_overload_of(long), _overload_of(brief)) for long, brief in names]


def _overload_of(channels: Sequence[str]) -> str:
    return f"overload of {', '.join(channels)}" if channels else ""


def _share_an_extreme(pieces: Sequence[Reals], step: float) -> Flags:
    """Of each hit, whether a channel stops at its largest or smallest value, at which another hit stops too.

    One sample of each hit says so where the steps of the channel are fine; else a hit has two equal neighbours there.
    """
    out = np.zeros(len(pieces), bool)
    together = np.concatenate(pieces)
    top, bottom, rest = float(together.max()), float(together.min()), float(np.median(together))
    # a converter with symmetric limits stops at both
    far = [v for v in (top, bottom) if abs(v - rest) > LEAST_LIMIT * max(top - rest, rest - bottom)]
    for values in (far,) if top == -bottom else [[v] for v in far]:
        at = [np.isin(piece, values) for piece in pieces]
        single = np.array([one.any() for one in at])
        double = np.array([bool((p[1:][a[1:] & a[:-1]] == p[:-1][a[1:] & a[:-1]]).any()) for p, a in zip(pieces, at)])
        if single.sum() > 1:
            sure = step <= VERY_FINE or (step <= FINE and (single.sum() > 2 or double.any()))
            out |= single if sure else double
    return out


def _coarse(row: Reals) -> bool:
    """Whether the steps of a converter are so coarse that equal samples say nothing."""
    step = _step(row)
    return bool(step == 0.0 or step > 2e-3 * np.nanmax(np.abs(row)))


def _step(row: Reals) -> float:
    """The smallest difference between two samples in a row that is not zero; 0 where there is none."""
    steps = np.abs(np.diff(row))
    moving = steps[steps > 0.0]
    return float(moving.min()) if len(moving) else 0.0


def _with_force_window(piece: TimeSeries, samples: int) -> TimeSeries:
    values = piece.values.copy()
    for i in piece.positions("input"):
        values[i] -= np.median(values[i])
        values[i, samples:] = 0.0
    return replace(piece, values=values)
