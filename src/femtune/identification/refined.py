"""Modes of a record of responses, refined by maximum likelihood from those that another method has found.

Each group of close modes is fitted to the lines around it (`whittle`), with the tails of all other modes. Where the
lines are not noise about the model, fewer lines are used, or a mode is divided into two; where that does not help
either, the group stays as it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from scipy.signal.windows import tukey
from scipy.special import chdtri

from femtune.arrays import Complexes, Flags, Integers, Reals
from femtune.errors import FemtuneError
from femtune.identification.choice import Candidate, choose
from femtune.identification.harmonics import Line, Removed, without_lines
from femtune.identification.in_place import allowed_distance
from femtune.identification.operational import Operational, OperationalModes, real_shape
from femtune.identification.quantities import DERIVATIVES
from femtune.identification.whittle import (
    ModalSpectrum,
    SpectrumFit,
    SpectrumLines,
    expected,
    fit,
    in_bins,
    misfit,
    score,
    spread,
)
from femtune.modal import ModeSet, TimeSeries

REACHES = (20.0, 10.0, 5.0)
"""Half bandwidths on each side of a mode whose lines are used, the first with which they are noise about the model.
Damping is in the far lines too: with 20 of them its standard deviation is 8 % above that with all, with 5, 40 %."""
TOGETHER = 3.0
"""Distance of modes of one group over the sum of their half bandwidths at most."""
MOST_DIVIDED = 3
"""Modes that are divided at most."""
TAPERED = 0.02
"""Part of the record in which it begins and ends smoothly. Ends that are cut have motions that channels of different
quantities have in different ratios, in all lines; where noise is 50 dB below the record, they are above it."""
LEAST_LINES = 40
"""Lines around a group at least."""
MOST_TOGETHER = 4
"""Modes of a group."""
MOST_CHANNELS = 8
"""Channels from which only their mixtures are used in which modes move; with more mixtures no mode is divided."""
LEAST_TAIL = 0.1
"""Power of the tail of another mode, over the noise of all channels, from which it is in the model."""
LARGEST_MISFIT = 4.0
"""`misfit` above which the lines are not noise about the model."""
COLOUR = 2
"""Coefficients of a load that is not white."""
BY_CHANCE = 0.01
"""Probability with which white forces are taken for coloured ones."""
CHANCE = 1e-9
"""Probability of the gain of the likelihood by which a mode is divided: its place is looked for."""
PARTS = 20
"""Parts of the record by which standard deviations are checked, where decays are short beside them."""
LEAST_PARTS = 8
DECAYS = 3.0
"""Decay times 1/(ζω) in a part at least."""
OUT_OF_CHANCE = 1.7
"""Variance over parts, relative to that of the likelihood, above which it counts: by chance 3 % of normal records have
as much."""
LEFT_BY_TWO = 0.05
"""Part of the misfit of one mode that two may leave before the modes beside them are refined; in the end they have to
leave no more than noise."""
KNOWN_DAMPING = 4.0
"""Standard deviations above zero of the damping ratios of both modes into which one is divided."""
LEAST_APART = 0.05
"""Their distance in half bandwidths, where they have one shape."""
CONTRADICTS = 2.6
"""Standard deviations of the difference to the method before, above which a mode stays as it was: 1 % by chance."""
LEAST_DIFFERENCE = 0.25
"""Variance of that difference over that of the method before, at least: both variances are estimates."""
DAMPING = 5.0
"""Ratio of the damping ratios of a mode before and after, beyond which it is another mode."""


@dataclass(frozen=True, eq=False)
class RefinedModes:
    """Modes after the refinement.

    Parameters
    ----------
    modes : the modes and candidates
    positions : modes whose frequencies and damping are those of the largest likelihood
    divided : frequencies in Hz of those that were one mode before
    """

    modes: OperationalModes
    positions: tuple[int, ...] = ()
    divided: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class _State:
    """Modes of the record, in the band and beside it.

    Parameters
    ----------
    model : (n, m) as they are now
    of : (m,) position of the mode that each of them was at first; from `inside` on those outside the band
    inside : modes in the band at first
    sd : (m, 2) relative standard deviations of frequencies and damping ratios, NaN where a mode was not refined
    shapes_sd : (n, m) of modes that were divided
    divided : (m,) those
    """

    model: ModalSpectrum
    of: Integers
    inside: int
    sd: Reals
    shapes_sd: Reals
    divided: Flags


@dataclass(frozen=True, eq=False)
class _Data:
    """The lines of a record: transform (n, k) per √Hz, its bins, and the duration."""

    transform: Complexes
    lines: SpectrumLines
    duration_s: float


def refined(
    found: OperationalModes,
    record: TimeSeries,
    lines: Sequence[Line],
    asked: Operational,
    gone: Sequence[Removed] = (),
) -> RefinedModes:
    """The modes of a method with poles, by maximum likelihood.

    Parameters
    ----------
    record : the responses as the method had them, without trend
    lines : of machines, which are subtracted and whose neighbourhood is not used
    asked : with the band
    gone : lines that were subtracted before, with what modes had beneath them
    """
    table, chosen = found.table, [c for c in found.candidates if c.chosen]
    if table is None or not chosen:
        return RefinedModes(found)
    rate, rule = record.even_hz, asked.rule
    wide = (0.3 * asked.band_hz[0], 0.47 * rate)
    outside = [
        c
        for c in choose(table, replace(asked.limits, band_hz=wide), rule)
        if c.chosen and not asked.band_hz[0] <= c.freq_hz <= asked.band_hz[1] and not _is_one(c, lines)
    ]
    at = [c.at for c in (*chosen, *outside)]
    ratio = table.damping_ratio[at]
    if not np.all(ratio > 0.0):
        return RefinedModes(found)
    rows = np.flatnonzero(record.values.std(axis=1) > 0.0)
    data = _data(record, rows, lines, gone, asked.band_hz, table.poles[at])
    if data is None:
        return RefinedModes(found)
    powers = np.array([DERIVATIVES.get(c.quantity, DERIVATIVES["acceleration"]) for c in record.channels], float)[rows]
    shapes = np.stack([real_shape(s) for s in table.shapes[rows][:, at].T], axis=1)
    unit = 2.0 * np.pi * float(np.exp(np.mean(np.log(table.freq_hz[at]))))
    shapes = shapes * unit ** (powers - powers.min())[:, None]
    model = expected(_start(data.lines, table.freq_hz[at], ratio, shapes, powers, unit), data.lines, 15)
    m = len(at)
    begun = _State(model, np.arange(m), len(chosen), np.full((m, 2), np.nan), np.zeros(shapes.shape), np.zeros(m, bool))
    return _as_modes(found, _swept(begun, data), rows, powers)


def _is_one(c: Candidate, lines: Sequence[Line]) -> bool:
    return any(abs(c.freq_hz - one.freq_hz) <= one.width_hz for one in lines)


def _data(
    record: TimeSeries,
    rows: Integers,
    lines: Sequence[Line],
    gone: Sequence[Removed],
    band_hz: tuple[float, float],
    poles: Complexes,
) -> _Data | None:
    rate, samples = record.even_hz, record.samples
    step_hz = rate / samples
    hz = step_hz * np.arange(samples // 2 + 1)
    usable = (hz >= band_hz[0]) & (hz <= min(band_hz[1], 0.48 * rate))
    values = record.values
    for one in gone:
        usable &= np.abs(hz - one.freq_hz) > (one.pieces + 3.0) * step_hz
    for line in lines:
        away = max(line.width_hz, 4.0 * step_hz)
        try:
            clean, (removed,) = without_lines(replace(record, values=values), [line.freq_hz])
            values, away = clean.values, (removed.pieces + 3.0) * step_hz
        except FemtuneError:
            pass
        usable &= np.abs(hz - line.freq_hz) > away
    if np.count_nonzero(usable) < 50:
        return None
    window = tukey(samples, TAPERED)
    transform = np.fft.rfft(values[rows] * window) / np.sqrt(rate * np.sum(window**2))
    return _Data(transform, in_bins(transform, step_hz, usable, poles), samples / rate)


def _start(lines: SpectrumLines, freq: Reals, ratio: Reals, shapes: Reals, powers: Reals, unit: float) -> ModalSpectrum:
    """Forces by the power at the resonances, noises by the least of the spectra."""
    own = 2.0 * np.pi * freq
    power = np.einsum("bii->bi", lines.power).real
    wide = lines.count >= min(8.0, float(np.median(lines.count)))
    noise = np.maximum(np.quantile(power[wide], 0.02, axis=0), 1e-12 * power.max(axis=0))
    forces = np.ones(len(freq))
    model = ModalSpectrum(freq, ratio, shapes, np.diag(forces), noise, powers, 2.0 * ratio * own**2, unit, np.zeros(0))
    columns = model.columns(lines.omega)
    for j in range(len(freq)):
        b = np.argsort(np.abs(lines.omega - own[j]))[:10]
        by = columns[b, :, j] / noise
        seen = np.einsum("bi,bij,bj->b", by.conj(), lines.power[b], by).real
        whole = np.einsum("bi,bi->b", by.conj(), columns[b, :, j]).real
        forces[j] = max(float(lines.count[b] @ seen) / max(float(lines.count[b] @ whole**2), 1e-300), 1e-300)
    return replace(model, forces=np.diag(forces))


def _swept(state: _State, data: _Data) -> _State:
    """All groups; again from the first one after a mode was divided, beside which its neighbours had been fitted."""
    most = len(state.of) + MOST_DIVIDED
    begun = None
    while begun is None or len(state.of) > len(begun.of):
        begun = replace(state, sd=np.full_like(state.sd, np.nan))
        state = _swept_once(begun, data, len(state.of) < most)
    return state


def _swept_once(state: _State, data: _Data, may_divide: bool) -> _State:
    """Until no more groups are refined, or a mode is divided; others first, since their tails are in all groups."""
    count, refined_before = len(state.of), -1
    tried: dict[tuple[int, ...], tuple[ModalSpectrum, _Tried | None]] = {}
    for last in (False, True):
        while np.isfinite(state.sd[:, 0]).sum() > refined_before:
            refined_before = int(np.isfinite(state.sd[:, 0]).sum())
            # the strongest modes first, which are least hidden by others
            groups = _groups(state.model, np.flatnonzero(state.of < state.inside))
            strong = np.diag(state.model.forces) * np.sum(state.model.shapes**2 / state.model.noise[:, None], axis=0)
            for group in sorted(groups, key=lambda g: -float(strong[g].max())):
                if np.isfinite(state.sd[group, 0]).all():
                    continue
                # a group that was tried beside the same modes would end in the same place
                key = tuple(group.tolist())
                if key not in tried or tried[key][0] is not state.model:
                    tried[key] = state.model, _tried(state.model, data, group)
                state = _with_group(state, data, group, tried[key][1], may_divide and last)
                if len(state.of) > count:
                    return state
        refined_before = -1 if may_divide else refined_before
    return state


def _groups(model: ModalSpectrum, inside: Integers) -> list[Integers]:
    half, freq = model.damping_ratio * model.freq_hz, model.freq_hz
    order = inside[np.argsort(freq[inside])].tolist()
    groups = [[order[0]]]
    for a, b in pairwise(order):
        if freq[b] - freq[a] < TOGETHER * (half[a] + half[b]) and len(groups[-1]) < MOST_TOGETHER:
            groups[-1].append(b)
        else:
            groups.append([b])
    return [np.array(g) for g in groups]


@dataclass(frozen=True, eq=False)
class _Window:
    """A group with the lines around it, in the mixtures of channels in which it moves.

    Parameters
    ----------
    model : those of the modes that are seen there
    free : of them the group
    mix : (r, n) of the channels
    back : (n, r) shapes of the channels from those of the mixtures
    """

    model: ModalSpectrum
    lines: SpectrumLines
    free: Integers
    mix: Reals
    back: Reals


def _window(model: ModalSpectrum, data: _Data, group: Integers, reach: float) -> _Window | None:
    hz, half = data.lines.omega / (2.0 * np.pi), model.damping_ratio * model.freq_hz
    keep = np.any(np.abs(hz[:, None] - model.freq_hz[group]) <= reach * half[group], axis=1)
    if data.lines.count[keep].sum() < LEAST_LINES:
        return None
    lines = data.lines.select(keep)
    power = np.abs(model.columns(lines.omega)) ** 2 * np.diag(model.forces) / model.noise[:, None]
    seen = power.sum(axis=1).max(axis=0) > LEAST_TAIL
    seen[group] = True
    modes = np.flatnonzero(seen)
    middle = 2.0 * np.pi * float(np.exp(np.mean(np.log(model.freq_hz[group]))))
    shapes = model.shapes[:, modes] * ((middle / model.unit) ** model.derivatives)[:, None]
    part = replace(
        model, freq_hz=model.freq_hz[modes], damping_ratio=model.damping_ratio[modes], shapes=shapes, unit=middle,
        forces=model.forces[np.ix_(modes, modes)], size=model.size[modes],
    )  # fmt: skip
    mix = back = np.eye(len(model.noise))
    if len(mix) > MOST_CHANNELS:
        mix, powers = _mixtures(part, np.sqrt(power[:, :, modes].max(axis=0)))
        part = replace(part, shapes=mix @ part.shapes, noise=np.ones(len(mix)), derivatives=powers)
        lines, back = lines.mixed(mix), model.noise[:, None] * mix.T
    return _Window(expected(part, lines, 6), lines, np.searchsorted(modes, group), mix, back)


def _mixtures(model: ModalSpectrum, largest: Reals) -> tuple[Reals, Reals]:
    """Mixtures (r, n) of channels of one quantity each, of unit noise, that have more than noise; derivatives (r,)."""
    root, mixes, powers = np.sqrt(model.noise), [], []
    signs = np.sign(model.shapes)
    for power in np.unique(model.derivatives):
        at = np.flatnonzero(model.derivatives == power)
        u, s, _ = np.linalg.svd(signs[at] * largest[at], full_matrices=False)
        rank = max(int(np.sum(s**2 > LEAST_TAIL)), 1)
        mix = np.zeros((rank, len(root)))
        mix[:, at] = u[:, :rank].T / root[at]
        mixes.append(mix)
        powers += [power] * rank
    return np.vstack(mixes), np.array(powers)


def _fitted(window: _Window, free: Integers) -> SpectrumFit | None:
    """By white forces, or by coloured ones where the likelihood grows with them by more than chance."""
    try:
        white = fit(window.model, window.lines, free)
        if score(white, window.lines, COLOUR) < chdtri(COLOUR, BY_CHANCE):
            return white
        return fit(replace(white.spectrum, colour=np.zeros(COLOUR)), window.lines, free)
    except np.linalg.LinAlgError:
        return None


@dataclass(frozen=True, eq=False)
class _Tried:
    """The fit of a group beside the modes of a model; `is_noise` where the lines are noise about it."""

    found: SpectrumFit
    window: _Window
    is_noise: bool


def _tried(model: ModalSpectrum, data: _Data, group: Integers) -> _Tried | None:
    """That of the most lines that are noise about it, or else of the second most lines."""
    worst: _Tried | None = None
    for reach in REACHES:
        window = _window(model, data, group, reach)
        found = None if window is None else _fitted(window, window.free)
        if window is None or found is None:
            continue
        one = _Tried(found, window, misfit(found, window.lines) <= LARGEST_MISFIT)
        if one.is_noise:
            return one
        if worst is None or reach == REACHES[1]:
            worst = one
    return worst


def _with_group(state: _State, data: _Data, group: Integers, tried: _Tried | None, may_divide: bool) -> _State:
    if tried is not None and tried.is_noise:
        return _accepted(state, data, group, tried.found, tried.window)
    if tried is None or not may_divide:
        return state
    return _divided(state, group, tried.found, tried.window)


def _accepted(state: _State, data: _Data, group: Integers, found: SpectrumFit, window: _Window) -> _State:
    """With the group where the fit has it, unless a mode has left its place."""
    s, f = found.spectrum, len(group)
    freq, ratio = s.freq_hz[found.free], s.damping_ratio[found.free]
    sd = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))[: 2 * f]
    before = state.model.damping_ratio[group]
    away = np.abs(freq / state.model.freq_hz[group] - 1.0)
    if np.any(away > np.maximum(before, 4.0 * sd[:f])) or np.any(np.abs(np.log(ratio / before)) > np.log(DAMPING)):
        return state
    if not np.all(np.isfinite(sd)):
        return state
    parts = int(np.clip(data.duration_s * 2.0 * np.pi * np.min(ratio * freq) / DECAYS, 0, PARTS))
    own = sd
    if parts >= LEAST_PARTS:
        by_time = spread(found, window.lines, window.mix @ data.transform, parts)
        own = np.where(by_time**2 > OUT_OF_CHANCE * own**2, by_time, own)
    model, all_sd, shapes_sd = state.model, state.sd.copy(), state.shapes_sd.copy()
    freqs, ratios, shapes = model.freq_hz.copy(), model.damping_ratio.copy(), model.shapes.copy()
    freqs[group], ratios[group] = freq, ratio
    all_sd[group, 0], all_sd[group, 1] = own[:f], own[f:]
    for k, j in enumerate(group.tolist()):
        shapes[:, j], shapes_sd[:, j] = _shape(found, k, window, model)
    model = replace(model, freq_hz=freqs, damping_ratio=ratios, shapes=shapes)
    return replace(state, model=model, sd=all_sd, shapes_sd=shapes_sd)


def _shape(found: SpectrumFit, k: int, window: _Window, model: ModalSpectrum) -> tuple[Reals, Reals]:
    """Shape of a free mode at all channels, as the model has them, and its standard deviations."""
    s, j, f = found.spectrum, int(found.free[k]), len(found.free)
    n = len(s.shapes)
    covariance = np.zeros((n, n))
    entries = np.delete(np.arange(n), np.argmax(np.abs(s.shapes[:, j])))
    at = 2 * f + k * (n - 1) + np.arange(n - 1)
    covariance[np.ix_(entries, entries)] = found.covariance[np.ix_(at, at)]
    turn = (model.unit / window.model.unit) ** model.derivatives
    shape = turn * (window.back @ s.shapes[:, j])
    sd = turn * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", window.back, covariance, window.back), 0.0))
    return shape, sd


def _divided(state: _State, group: Integers, found: SpectrumFit, window: _Window) -> _State:
    """With one mode of the group as two, where the lines are noise about the model then."""
    if len(window.mix) > MOST_CHANNELS:
        return state
    best: tuple[SpectrumFit, int] | None = None
    for k, j in enumerate(window.free.tolist()):
        trial = _fitted_as_two(found, window, j)
        if trial is not None and (best is None or trial.objective < best[0].objective):
            best = trial, k
    if best is None:
        return state
    trial, k = best
    s, first = trial.spectrum, int(group[k])
    pair = [int(window.free[k]), len(s.freq_hz) - 1]
    n, m = len(s.shapes), len(s.freq_hz)
    more = chdtri(2 + (n - 1) + m, CHANCE)
    allowed = max(LARGEST_MISFIT, LEFT_BY_TWO * misfit(found, window.lines))
    if 2.0 * (found.objective - trial.objective) < more or misfit(trial, window.lines) > allowed:
        return state
    sd = np.sqrt(np.maximum(np.diag(trial.covariance), 0.0))
    f, at = len(trial.free), [int(np.flatnonzero(trial.free == j)[0]) for j in pair]
    poles = s.freq_hz[pair] * (1j - s.damping_ratio[pair])
    apart = abs(poles[0] - poles[1]) / float(np.min(s.damping_ratio[pair] * s.freq_hz[pair]))
    before = state.model.damping_ratio[first]
    away = np.abs(s.freq_hz[pair] / state.model.freq_hz[first] - 1.0)
    if (
        apart < LEAST_APART
        or np.any(sd[[f + i for i in at]] * KNOWN_DAMPING > 1.0)
        or np.any(away > allowed_distance(np.array(before)))
        or np.any(np.abs(np.log(s.damping_ratio[pair] / before)) > np.log(DAMPING))
    ):
        return state
    model = state.model
    shapes = np.stack([_shape(trial, i, window, model)[0] for i in at], axis=1)
    every = np.column_stack([model.shapes, shapes[:, 1]])
    every[:, first] = shapes[:, 0]
    freq, ratio = np.append(model.freq_hz, s.freq_hz[pair[1]]), np.append(model.damping_ratio, s.damping_ratio[pair[1]])
    freq[first], ratio[first] = s.freq_hz[pair[0]], s.damping_ratio[pair[0]]
    forces = np.pad(model.forces, ((0, 1), (0, 1)))
    forces[-1, -1] = s.forces[-1, -1]
    forces[first, first] = s.forces[pair[0], pair[0]]
    model = replace(
        model, freq_hz=freq, damping_ratio=ratio, shapes=every, forces=forces, size=np.append(model.size, s.size[-1])
    )
    divided = np.append(state.divided, True)
    divided[first] = True
    return _State(
        model, np.append(state.of, state.of[first]), state.inside, np.pad(state.sd, ((0, 1), (0, 0))),
        np.pad(state.shapes_sd, ((0, 0), (0, 1))), divided,
    )  # fmt: skip


def _fitted_as_two(found: SpectrumFit, window: _Window, j: int) -> SpectrumFit | None:
    """The best fit with two modes in place of one, whose shapes begin as what the lines near it have most."""
    s, lines = replace(found.spectrum, colour=np.zeros(0)), window.lines
    half = 2.0 * np.pi * s.damping_ratio[j] * s.freq_hz[j]
    near = np.abs(lines.omega - 2.0 * np.pi * s.freq_hz[j]) <= 2.0 * half
    scale = (1j * lines.omega[near, None] / s.unit) ** s.derivatives
    unscaled = lines.power[near] / (scale[:, :, None] * scale[:, None, :].conj()) / np.sqrt(np.outer(s.noise, s.noise))
    _, vectors = np.linalg.eigh(np.tensordot(lines.count[near], unscaled, 1).real)
    most = vectors[:, ::-1][:, :2] * np.sqrt(s.noise)[:, None]
    starts = [(most[:, 0], most[:, 1]), (most[:, 0] + most[:, 1], most[:, 0] - most[:, 1])] if len(most) > 1 else []
    starts.append((s.shapes[:, j], s.shapes[:, j]))
    free, m = np.append(found.free, len(s.freq_hz)), len(s.freq_hz)
    best: SpectrumFit | None = None
    for (a, b), sign in product(starts, (1.0, -1.0)):
        freq, ratio = np.append(s.freq_hz, s.freq_hz[j]), np.append(s.damping_ratio, s.damping_ratio[j])
        freq[[j, m]] *= 1.0 + sign * 0.3 * s.damping_ratio[j] * np.array([-1.0, 1.0])
        shapes = np.column_stack([s.shapes, b / np.abs(b).max()])
        shapes[:, j] = a / np.abs(a).max()
        forces = np.pad(s.forces, ((0, 1), (0, 1)))
        level = 0.5 * s.forces[j, j] * float(np.abs(s.shapes[:, j]).max()) ** 2
        forces[j], forces[:, j] = 0.0, 0.0
        forces[j, j] = forces[m, m] = max(level, 1e-300)
        two = replace(
            s, freq_hz=freq, damping_ratio=ratio, shapes=shapes, forces=forces, size=np.append(s.size, s.size[j])
        )
        try:
            trial = fit(expected(two, lines, 10), lines, free)
        except np.linalg.LinAlgError:
            continue
        best = trial if best is None or trial.objective < best.objective else best
    return best


def _as_modes(found: OperationalModes, state: _State, rows: Integers, powers: Reals) -> RefinedModes:
    """The modes with those that were refined, and divided ones beside each other."""
    modes, known = found.modes, np.isfinite(state.sd[:, 0])
    inside = np.flatnonzero(state.of < state.inside)
    # one of which only a part was refined stays as it was
    parts = [np.flatnonzero(state.of == i) for i in range(state.inside)]
    if not known[inside].any():
        return RefinedModes(found)
    entries: list[tuple[int, int | None]] = []
    for i, members in enumerate(parts):
        if known[members].all() and not (len(members) == 1 and _contradicts(modes, i, state, int(members[0]))):
            entries += [(i, int(j)) for j in members[np.argsort(state.model.freq_hz[members])]]
        else:
            entries.append((i, None))
    entries.sort(key=lambda e: float(modes.freq_hz[e[0]] if e[1] is None else state.model.freq_hz[e[1]]))
    at = [i for i, _ in entries]
    m = len(entries)
    nothing = np.full(len(modes), np.nan)
    assert modes.damping_ratio is not None
    freq, ratio = modes.freq_hz[at], modes.damping_ratio[at]
    freq_sd = (nothing if modes.freq_sd_hz is None else modes.freq_sd_hz)[at]
    damping_sd = (nothing if modes.damping_sd is None else modes.damping_sd)[at]
    shapes, complex_shapes = modes.shapes[:, at], found.complex_shapes[:, at]
    shapes_sd = None if modes.shapes_sd is None else modes.shapes_sd[:, at]
    unit = state.model.unit ** (powers - powers.min())
    for k, (_, j) in enumerate(entries):
        if j is None:
            continue
        freq[k], ratio[k] = state.model.freq_hz[j], state.model.damping_ratio[j]
        freq_sd[k], damping_sd[k] = state.sd[j] * (freq[k], ratio[k])
        if state.divided[j]:
            shape = np.zeros(len(shapes))
            shape[rows] = state.model.shapes[:, j] / unit
            size = float(np.linalg.norm(shape))
            shapes[:, k] = real_shape(shape)
            complex_shapes[:, k] = shapes[:, k]
            if shapes_sd is not None:
                shapes_sd[rows, k] = state.shapes_sd[:, j] / unit / size
    candidates = _candidates(found.candidates, at)
    labels = tuple(c.name or str(i + 1) for i, c in enumerate(c for c in candidates if c.chosen))
    assert len(labels) == m
    new = replace(
        modes, freq_hz=freq, damping_ratio=ratio, freq_sd_hz=freq_sd, damping_sd=damping_sd, shapes=shapes,
        shapes_sd=shapes_sd, labels=labels,
    )  # fmt: skip
    positions = tuple(k for k, (_, j) in enumerate(entries) if j is not None)
    divided = tuple(float(modes.freq_hz[i]) for i in dict.fromkeys(at) if at.count(i) > 1)
    return RefinedModes(
        replace(found, modes=new, complex_shapes=complex_shapes, candidates=candidates), positions, divided
    )


def _contradicts(modes: ModeSet, i: int, state: _State, j: int) -> bool:
    """Whether the refinement moves a mode by more than errors of both methods explain (Hausman, 1978).

    The variance of the difference is that of the less accurate estimate less that of the more accurate one, if the
    model of the spectra is right. A load that changes within the band of the mode moves the refined one alone.
    """
    if modes.damping_ratio is None or modes.freq_sd_hz is None or modes.damping_sd is None:
        return False
    before = np.array([modes.freq_hz[i], modes.damping_ratio[i]])
    after = np.array([state.model.freq_hz[j], state.model.damping_ratio[j]])
    variance = np.array([modes.freq_sd_hz[i], modes.damping_sd[i]]) ** 2
    between = np.maximum(variance - (state.sd[j] * after) ** 2, LEAST_DIFFERENCE * variance)
    return bool(np.any((after - before) ** 2 > CONTRADICTS**2 * between))


def _candidates(candidates: tuple[Candidate, ...], at: Sequence[int]) -> tuple[Candidate, ...]:
    """With those of divided modes twice."""
    result: list[Candidate] = []
    mode = 0
    for c in candidates:
        copies = at.count(mode) if c.chosen else 1
        mode += c.chosen
        if copies > 1:
            reason = f"{c.reason}; the lines are noise only with two modes here"
            first = replace(c, reason=reason, divided=True)
            result += [first, *(replace(first, name="") for _ in range(copies - 1))]
        else:
            result.append(c)
    return tuple(result)
