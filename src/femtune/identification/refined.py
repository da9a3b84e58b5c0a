"""Modes of a record of responses, refined by maximum likelihood from those that another method has found.

All modes are fitted together to all lines of the band (`whittle`), if need be with a mode outside the band that the
method has not found, or with a mode that is divided into two. Where the lines are not noise about this model, each
group of close modes is fitted to the lines around it, with the tails of all other modes, and to fewer lines where these
are not noise either; where that does not help, the group stays as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from scipy.signal import fftconvolve
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
    ROUNDS,
    ModalSpectrum,
    SpectrumFit,
    SpectrumLines,
    expected,
    fit,
    in_bins,
    misfit,
    objective,
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
DEAD = 1e-10
"""Level of a channel beside the largest one, up to which it has rounding errors alone: what is left of a constant."""
TAPERED = 0.02
"""Part of the record in which it begins and ends smoothly."""
HALF_FILTER = 16
"""Samples on each side of the filter that differentiates channels. Its response is divided out of the lines."""
FILTER_BETA = 6.0
"""Parameter of its Kaiser window."""
LEAST_LINES = 40
"""Lines around a group at least."""
MOST_TOGETHER = 4
"""Modes of a group."""
MOST_CHANNELS = 8
"""Channels from which only their mixtures are used in which modes move, around a group; with more mixtures no mode of
it is divided."""
MOST_VALUES = 1e7
"""Derivatives of the spectra of all lines up to which all modes are fitted together; these have 0.1 GB."""
BESIDE = (1.15, 0.85)
"""Where a mode outside the band is looked for, over the last and the first line."""
BESIDE_RATIO = 0.05
"""Its damping ratio at first."""
MOST_MORE = 3
"""Modes that are added for this at most, outside the band and by division."""
MOST_ROUNDS = 40
"""Steps of scoring of all modes together."""
LEFT_BY_MORE = 0.5
"""Part of the misfit that a further mode may leave, so that others are tried."""
STARTS = 2
"""Fits by which a mode is divided there."""
NEAR_END = 0.1
"""Part of the lines at an end of the band that show its shape."""
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
TURNS = 4
"""Pairs of shapes from which the division of a mode starts."""
KNOWN_DAMPING = 4.0
"""Standard deviations above zero of the damping ratios of both modes into which one is divided."""
LEAST_APART = 0.05
"""Their distance in half bandwidths, where they have one shape."""
CONTRADICTS = 2.6
"""Standard deviations of the difference to the method before, above which a mode stays as it was: 1 % by chance."""
LEAST_DIFFERENCE = 0.5
"""Variance of that difference over that of the method before, at least: both variances are estimates."""
DAMPING = 5.0
"""Ratio of the damping ratios of a mode before and after, beyond which it is another mode."""


_Pair = tuple[int, int]
"""Positions of two modes in a fit."""


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
    level = record.values.std(axis=1)
    rows = np.flatnonzero(level > DEAD * level.max())
    powers = np.array([DERIVATIVES.get(c.quantity, DERIVATIVES["acceleration"]) for c in record.channels], float)[rows]
    data = _data(record, rows, lines, gone, asked.band_hz, table.poles[at], powers)
    if data is None:
        return RefinedModes(found)
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
    powers: Reals,
) -> _Data | None:
    values, beside = record.values, [(one.freq_hz, one.pieces + 3.0) for one in gone]
    rate, step_hz = record.even_hz, record.even_hz / record.samples
    for line in lines:
        steps = max(line.width_hz / step_hz, 4.0)
        try:
            clean, (removed,) = without_lines(replace(record, values=values), [line.freq_hz])
            values, steps = clean.values, removed.pieces + 3.0
        except FemtuneError:
            pass
        beside.append((line.freq_hz, steps))
    values, response = _as_one_quantity(values[rows], powers, rate)
    samples = values.shape[1]
    hz = rate / samples * np.arange(samples // 2 + 1)
    usable = (hz >= band_hz[0]) & (hz <= min(band_hz[1], 0.48 * rate))
    for freq, steps in beside:
        usable &= np.abs(hz - freq) > steps * step_hz
    if np.count_nonzero(usable) < 50:
        return None
    window = tukey(samples, TAPERED)
    transform = np.fft.rfft(values * window) / np.sqrt(rate * np.sum(window**2))
    transform[:, usable] /= response(hz[usable])
    bins = in_bins(transform, rate / samples, usable, poles, powers)
    return _Data(transform, bins, samples / rate)


def _as_one_quantity(values: Reals, powers: Reals, rate: float) -> tuple[Reals, Callable[[Reals], Complexes]]:
    """Channels differentiated to the quantity with the most derivatives, and what their lines are multiplied by then.

    A window of the record multiplies what a displacement and an acceleration have at its ends, so that their lines are
    not those of one motion: in each line there is 50 dB below the record what no mode has. Channels that are
    differentiated in time before have the same ends. Differentiating in time, and dividing the lines by the response of
    the filter, leaves the spectra of displacements as they were.
    """
    times = np.round(powers.max() - powers).astype(int)
    steps = np.arange(1, HALF_FILTER + 1)
    window = np.kaiser(2 * HALF_FILTER + 1, FILTER_BETA)[HALF_FILTER + 1 :]
    half = rate * window * np.where(steps % 2, 1.0, -1.0) / steps
    taps = np.concatenate([-half[::-1], [0.0], half])
    cut = HALF_FILTER * int(times.max())
    rows = []
    for channel, count in zip(values, times):
        row = channel
        for _ in range(count):
            row = fftconvolve(row, taps, "same")
        rows.append(row[cut : len(row) - cut])

    def response(hz: Reals) -> Complexes:
        once = -2j * np.sin(2.0 * np.pi / rate * hz[:, None] * steps) @ half
        return np.asarray(once ** times[:, None])

    return np.array(rows), response


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
    """All modes; again from the first one after a mode was divided, beside which its neighbours had been fitted."""
    most = len(state.of) + MOST_DIVIDED
    begun = None
    while begun is None or len(state.of) > len(begun.of):
        begun = replace(state, sd=np.full_like(state.sd, np.nan))
        may_divide = len(state.of) < most
        state = _together(begun, data, may_divide)
        if len(state.of) == len(begun.of):
            state = _swept_once(state, data, may_divide)
    return state


def _together(state: _State, data: _Data, may_divide: bool) -> _State:
    """All modes by one fit to all lines, or one of them divided; as before where the lines are not noise about it."""
    inside = np.flatnonzero(state.of < state.inside)
    window = _window(state.model, data, inside, np.inf, np.inf)
    if window is None or _values(window) > MOST_VALUES:
        return state
    found, two = _of_all(window, may_divide)
    if found is None:
        return state
    if two:
        first = inside[int(np.flatnonzero(window.free == two[0])[0])]
        return _with_two(state, int(first), found, two, window)
    for group in _groups(state.model, inside):
        state = _accepted(state, data, group, found, window.of(group))
    return state


def _of_all(window: _Window, may_divide: bool) -> tuple[SpectrumFit | None, _Pair | None]:
    """The fit of all modes, if the lines are noise about it, and the positions of modes that were one before."""
    lines = window.lines
    found = _fitted(window, np.arange(len(window.modes)), MOST_ROUNDS)
    if found is None:
        return None, None
    # a fit without a mode that the lines have is further from the right one than the modes of the method
    start, two = replace(found, spectrum=window.model), None
    for _ in range(MOST_MORE):
        left = misfit(found, lines)
        if left <= LARGEST_MISFIT:
            break
        found, pair = _with_one_more(found, start, window, may_divide)
        if misfit(found, lines) > LEFT_BY_MORE * left:
            break
        start, two = found, two or pair
    return (found, two) if misfit(found, lines) <= LARGEST_MISFIT else (None, None)


def _with_one_more(
    found: SpectrumFit, start: SpectrumFit, window: _Window, may_divide: bool
) -> tuple[SpectrumFit, _Pair | None]:
    """With a mode outside the band or one mode as two, and the positions of these two.

    It is the first with which the lines are noise, or else that of the largest likelihood.
    """
    lines = window.lines
    best: tuple[SpectrumFit, _Pair | None] = found, None
    for over in (*BESIDE, None) if may_divide else BESIDE:
        if over is None:
            worst = max(window.free.tolist(), key=lambda j: _misfit_at(found, lines, j))
            trial, pair = _fitted_as_two(start, window, worst, STARTS), (worst, len(start.spectrum.freq_hz))
        else:
            trial, pair = _with_one_beside(start, lines, over), None
        if trial is None or trial.objective >= best[0].objective:
            continue
        best = trial, pair
        if misfit(trial, lines) <= LARGEST_MISFIT:
            break
    trial, pair = best
    if trial is not found and not trial.converged:
        trial = fit(trial.spectrum, lines, trial.free, MOST_ROUNDS)
    return (trial, pair) if 2.0 * (found.objective - trial.objective) > _by_chance(found) else (found, None)


def _by_chance(found: SpectrumFit) -> float:
    """Twice the gain of the likelihood that a further mode has by chance at most."""
    n, m = found.spectrum.shapes.shape
    return float(chdtri(2 + n + m, CHANCE))


def _values(window: _Window) -> float:
    n, m = len(window.mix), len(window.modes)
    return float(len(window.lines.omega)) * n**2 * (2 * m + n * m + m * (m + 1) / 2 + n)


def _misfit_at(found: SpectrumFit, lines: SpectrumLines, j: int) -> float:
    """That of the lines within the bandwidth of a mode."""
    near = _near(lines, found.spectrum, np.array([j]), 1.0)
    return misfit(found, lines.select(near)) if near.any() else 0.0


def _with_one_beside(found: SpectrumFit, lines: SpectrumLines, over: float) -> SpectrumFit | None:
    """With a mode outside the band."""
    s, last = found.spectrum, over > 1.0
    hz = over * float(lines.omega.max() if last else lines.omega.min()) / (2.0 * np.pi)
    near = np.argsort(lines.omega)[:: -1 if last else 1][: max(round(NEAR_END * len(lines.omega)), 1)]
    omega, count = lines.omega[near], lines.count[near]
    scale = (1j * omega[:, None] / s.unit) ** s.derivatives
    left = (lines.power[near] - s.at(omega)) / (scale[:, :, None] * scale[:, None, :].conj())
    root, m = np.sqrt(s.noise), len(s.freq_hz)
    value, vectors = np.linalg.eigh(np.tensordot(count / count.sum(), left / np.outer(root, root), 1).real)
    shape = root * vectors[:, -1]
    largest = float(np.abs(shape).max())
    size = 2.0 * BESIDE_RATIO * (2.0 * np.pi * hz) ** 2
    forces = np.pad(s.forces, ((0, 1), (0, 1)))
    more = replace(
        s, freq_hz=np.append(s.freq_hz, hz), damping_ratio=np.append(s.damping_ratio, BESIDE_RATIO),
        shapes=np.column_stack([s.shapes, shape / largest]), size=np.append(s.size, size), forces=forces,
        colour=np.zeros(0),
    )  # fmt: skip
    seen = np.average(np.abs(more.responses(omega)[:, -1]) ** 2, weights=count)
    forces[-1, -1] = max(value[-1], 1.0) * largest**2 / seen
    try:
        trial = fit(more, lines, np.arange(m + 1))
    except np.linalg.LinAlgError:
        return None
    # one that has come into the band is for the division of modes
    return trial if (trial.spectrum.freq_hz[-1] > hz / over) == last else None


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
    modes : positions of these among all modes
    free : of them the group
    mix : (r, n) of the channels
    back : (n, r) shapes of the channels from those of the mixtures
    """

    model: ModalSpectrum
    lines: SpectrumLines
    modes: Integers
    free: Integers
    mix: Reals
    back: Reals

    def of(self, group: Integers) -> _Window:
        """For another group."""
        return replace(self, free=np.searchsorted(self.modes, group))


def _window(model: ModalSpectrum, data: _Data, group: Integers, reach: float, channels: float) -> _Window | None:
    """Of the lines within `reach` half bandwidths; by mixtures where there are more than `channels`."""
    keep = _near(data.lines, model, group, reach)
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
    if len(mix) > channels:
        mix, powers = _mixtures(part, np.sqrt(power[:, :, modes].max(axis=0)))
        part = replace(part, shapes=mix @ part.shapes, noise=np.ones(len(mix)), derivatives=powers)
        lines, back = lines.mixed(mix), model.noise[:, None] * mix.T
    return _Window(expected(part, lines, 6), lines, modes, np.searchsorted(modes, group), mix, back)


def _near(lines: SpectrumLines, model: ModalSpectrum, group: Integers, reach: float) -> Flags:
    hz, half = lines.omega / (2.0 * np.pi), model.damping_ratio * model.freq_hz
    return np.asarray(np.any(np.abs(hz[:, None] - model.freq_hz[group]) <= reach * half[group], axis=1))


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


def _fitted(window: _Window, free: Integers, rounds: int = ROUNDS) -> SpectrumFit | None:
    """By white forces, or by coloured ones where the likelihood grows with them by more than chance."""
    try:
        white = fit(window.model, window.lines, free, rounds)
        if score(white, window.lines, COLOUR) < chdtri(COLOUR, BY_CHANCE):
            return white
        return fit(replace(white.spectrum, colour=np.zeros(COLOUR)), window.lines, free, rounds)
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
        window = _window(model, data, group, reach, MOST_CHANNELS)
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
    freq, ratio = s.freq_hz[window.free], s.damping_ratio[window.free]
    at = [int(np.flatnonzero(found.free == j)[0]) for j in window.free]
    both = [*at, *(len(found.free) + k for k in at)]
    sd = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))[both]
    before = state.model.damping_ratio[group]
    away = np.abs(freq / state.model.freq_hz[group] - 1.0)
    if np.any(away > np.maximum(before, 4.0 * sd[:f])) or np.any(np.abs(np.log(ratio / before)) > np.log(DAMPING)):
        return state
    if not np.all(np.isfinite(sd)):
        return state
    parts = int(np.clip(data.duration_s * 2.0 * np.pi * np.min(ratio * freq) / DECAYS, 0, PARTS))
    own = sd
    if parts >= LEAST_PARTS:
        near = _near(window.lines, s, window.free, REACHES[0])
        part = replace(found, slopes=found.slopes[near])
        by_time = spread(part, window.lines.select(near), window.mix @ data.transform, parts, both)
        own = np.where(by_time**2 > OUT_OF_CHANCE * own**2, by_time, own)
    model, all_sd, shapes_sd = state.model, state.sd.copy(), state.shapes_sd.copy()
    freqs, ratios, shapes = model.freq_hz.copy(), model.damping_ratio.copy(), model.shapes.copy()
    freqs[group], ratios[group] = freq, ratio
    all_sd[group, 0], all_sd[group, 1] = own[:f], own[f:]
    for k, j in zip(at, group.tolist()):
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
    trials = [(_fitted_as_two(found, window, j), k) for k, j in enumerate(window.free.tolist())]
    allowed = max(LARGEST_MISFIT, LEFT_BY_TWO * misfit(found, window.lines))
    better = [
        (trial, k)
        for trial, k in trials
        if trial is not None
        and 2.0 * (found.objective - trial.objective) > _by_chance(found)
        and misfit(trial, window.lines) <= allowed
    ]
    for trial, k in sorted(better, key=lambda one: one[0].objective):
        pair = (int(window.free[k]), int(trial.free[-1]))
        divided = _with_two(state, int(group[k]), trial, pair, window)
        if divided is not state:
            return divided
    return state


def _with_two(state: _State, first: int, trial: SpectrumFit, two: _Pair, window: _Window) -> _State:
    """With the modes `two` of a fit in place of one, unless they are not known well or are at another place."""
    s, pair = trial.spectrum, list(two)
    sd = np.sqrt(np.maximum(np.diag(trial.covariance), 0.0))
    f, at = len(trial.free), [int(np.flatnonzero(trial.free == j)[0]) for j in pair]
    poles = s.freq_hz[pair] * (1j - s.damping_ratio[pair])
    apart = abs(poles[0] - poles[1]) / float(np.min(s.damping_ratio[pair] * s.freq_hz[pair]))
    before = state.model.damping_ratio[first]
    away = np.abs(s.freq_hz[pair] / state.model.freq_hz[first] - 1.0)
    near = np.maximum(allowed_distance(np.array(before)), TOGETHER * before)
    if (
        apart < LEAST_APART
        or np.any(sd[[f + i for i in at]] * KNOWN_DAMPING > 1.0)
        or np.any(away > near)
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


def _fitted_as_two(found: SpectrumFit, window: _Window, j: int, most: int | None = None) -> SpectrumFit | None:
    """The best fit with two modes in place of one, whose shapes begin as what the lines near it have most.

    With `most`, only as many starts are used, those with the largest likelihood.
    """
    s, lines = replace(found.spectrum, colour=np.zeros(0)), window.lines
    half = 2.0 * np.pi * s.damping_ratio[j] * s.freq_hz[j]
    near = np.abs(lines.omega - 2.0 * np.pi * s.freq_hz[j]) <= 2.0 * half
    scale = (1j * lines.omega[near, None] / s.unit) ** s.derivatives
    unscaled = lines.power[near] / (scale[:, :, None] * scale[:, None, :].conj()) / np.sqrt(np.outer(s.noise, s.noise))
    value, vectors = np.linalg.eigh(np.tensordot(lines.count[near], unscaled, 1).real)
    factor = (vectors * np.sqrt(np.maximum(value, 0.0)))[:, ::-1] * np.sqrt(s.noise)[:, None]
    a, b = factor[:, 0], factor[:, min(1, len(factor) - 1)]
    # a aᵀ + b bᵀ is that of two independent modes whose shapes are a and b after some rotation
    turns = np.pi * np.arange(TURNS) / (2 * TURNS) if len(factor) > 1 else np.zeros(0)
    starts = [(np.cos(t) * a + np.sin(t) * b, np.cos(t) * b - np.sin(t) * a) for t in turns]
    starts.append((s.shapes[:, j], s.shapes[:, j]))
    free, m = np.append(found.free, len(s.freq_hz)), len(s.freq_hz)
    models: list[tuple[float, ModalSpectrum]] = []
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
            model = expected(two, lines, 10)
        except np.linalg.LinAlgError:
            continue
        models.append((objective(model, lines), model))
    best: SpectrumFit | None = None
    for _, model in sorted(models, key=lambda one: one[0])[:most]:
        try:
            trial = fit(model, lines, free)
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
