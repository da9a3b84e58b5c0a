"""Modes that too few orders show, and that the data need: chosen by what they explain, not by stability alone.

A weak or heavily damped mode is stable in few orders. The modal fit tells whether it is one: with its pole the errors
near it are noise from line to line, and without it they are larger by more than chance. Where the errors near it are
no noise with the pole either, as for functions of a structure that is not linear, nothing is added.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.special import chdtri

from femtune.arrays import Complexes, Integers, Reals
from femtune.errors import FemtuneError
from femtune.identification.choice import CHOSEN_BY_USER, DROPPED_BY_USER, Candidate
from femtune.identification.in_place import allowed_distance, distance_from
from femtune.identification.modal_fit import NO_POLES, ModalFit
from femtune.identification.near_band import APART, by_chance, gain
from femtune.identification.pole_table import PoleTable
from femtune.identification.significance import NO_MORE_THAN_NOISE, stands_out

CHANCE = 1e-9
"""Probability of what a pole of noise would explain: there are many places where one could be."""
LEAST_SHARE = 0.1
"""Part of the orders of a method that have the pole at least."""
MOST_DIVIDED = 3
"""Modes that are tried as two, those first beside which the fit leaves most above the noise."""
PARTS = (0.5, 0.15)
"""Distances from a mode of the two that are tried in its place, in half bandwidths."""
MOST_TRIALS = 8
"""Clusters that are tried, those of the largest share first."""
LEAST_WHITE = 0.7
"""Mean square of the fourth differences of the errors over 70 times their own, which is 1 for white noise. Errors of a
model that does not hold change slowly from line to line: with 0.25 they were taken for modes."""
WHITE_BY_CHANCE = 2.7
"""By how much this ratio is below 1 in one of a hundred cases of white noise, times the root of the number of
errors."""
LARGE = 1.5
"""Mean square of the errors near a mode, over the noise of all lines, above which they are looked at: what two modes
leave that are fitted as one is as narrow as they are. Over a few lines it cannot be told from noise by how it changes
from line to line."""
ROUNDING = 1e-6
"""Errors over the functions below which a fit is exact: no measurement has 120 dB."""
MOST_IN_PAIRS = 4
"""Clusters that are tried two at once."""
MOST_ROUNDS = 4
"""Rounds of clusters that are tried, each beside the modes outside the band that are found beside those before."""
KNOWN_DAMPING = 4.0
"""Standard deviations of the damping ratio above zero."""
_LEAST_LINES = 16
"""Lines on each side of a pole at least, from which the noise near it is estimated to a sixth."""
_HALF_BANDS = 4.0
"""Half bandwidths on each side of a pole: the response of its mode is a quarter of the peak there."""
_APART = 0.2
"""Distance from the other poles in half bandwidths at least; of the two parts of a cluster, `APART`."""

Refit = Callable[[Complexes, Complexes, float], ModalFit]
"""The fit that starts from poles of modes and poles outside the band, and is of use below a deviance only."""
Search = Callable[[Complexes], ModalFit]
"""The fit that starts from poles of modes and looks for those outside the band."""


def with_needed_modes(
    fit: ModalFit,
    candidates: Sequence[Candidate],
    table: PoleTable,
    refit: Refit,
    line: Reals | None = None,
    search: Search | None = None,
) -> tuple[ModalFit, tuple[Candidate, ...]]:
    """The fit with the clusters that the data need, which are chosen then.

    Parameters
    ----------
    fit : of the candidates that are chosen, in their order
    line : (k,) weights of the lines, where they are not equal
    search : where it is given, a cluster may be two modes, and modes outside the band are looked for again beside modes
        that are added
    """
    if _is_exact(fit):
        return fit, tuple(candidates)
    result = _with_needed(fit, candidates, table, refit, line, search, len(fit.poles))
    if search is None:
        return result
    if fit.outside.any() and not _is_noise(result[0], line):
        # poles outside the band may stand for modes in it, and explain so much that these are not wanted beside them
        try:
            alone = refit(np.array([table.poles[c.at] for c in candidates if c.chosen]), NO_POLES, np.inf)
        except (FemtuneError, np.linalg.LinAlgError):
            return result
        other = _with_needed(alone, candidates, table, refit, line, search, len(fit.poles))
        result = other if other[0] is not alone and _is_better(other[0], result[0]) else result
    return _mixtures_marked(*_tied_again(*result, table, refit, line))


def _with_needed(
    fit: ModalFit,
    candidates: Sequence[Candidate],
    table: PoleTable,
    refit: Refit,
    line: Reals | None,
    search: Search | None,
    poles: int,
) -> tuple[ModalFit, tuple[Candidate, ...]]:
    """`with_needed_modes` from one fit; `poles` is the number of those that explain less."""
    kept, now_fit, every = list(candidates), fit, list[int]()
    firm: tuple[list[Candidate], ModalFit, list[int]] | None = None
    for _ in range(MOST_ROUNDS):
        after, trial, added, are_firm = _with_clusters(kept, now_fit, table, refit, line)
        if not added:
            break
        if not are_firm and firm is None:
            firm = kept, now_fit, every
        kept, now_fit, every = after, trial, [*every, *added]
        if search is None:
            break
        # the modes outside of the band were looked for beside fewer modes, for which they may stand
        again = search(_inside(now_fit))
        now_fit = again if _is_better(again, now_fit) else now_fit
    if firm is not None:
        # with no more poles than before, which leave noise only, they are not there to explain noise
        if len(now_fit.poles) <= poles and _is_noise(now_fit, line):
            return now_fit, tuple(kept)
        if not all(_stands_out(now_fit, _place(kept, i)) for i in every):
            kept, now_fit, every = firm
    if not every and search is not None:
        kept, now_fit, every = _with_divided(kept, now_fit, refit, search, line)
    ends = [now_fit.poles[now_fit.begun_at == _place(kept, i)][0] for i in every]
    # one that hides others is no noise near it before these are there too
    if not every or not all(_is_white(now_fit, _near(now_fit.measured.freq_hz, end), line) for end in ends):
        return fit, tuple(candidates)
    return now_fit, tuple(kept)


def _place(candidates: Sequence[Candidate], i: int) -> int:
    """Position of a chosen candidate among those that are chosen."""
    return sum(c.chosen for c in candidates[:i])


def _with_clusters(
    candidates: list[Candidate], fit: ModalFit, table: PoleTable, refit: Refit, line: Reals | None
) -> tuple[list[Candidate], ModalFit, list[int], bool]:
    """With the clusters that explain more than chance and stand out of the noise, one after the other: these are firm.

    If there are none and the fit leaves more than noise, with the one or two that explain most: beside what is missing
    none may stand out, and of two that are both missing each alone moves to where it stands for both.
    """
    kept, now_fit, added = candidates, fit, list[int]()
    tried = _tried(candidates)
    trials = list[tuple[ModalFit, tuple[int, ...]]]()
    for i in tried:
        trial = _with_these(kept, now_fit, (i,), table, refit)
        if trial is not None and _stands_out(trial, _place(kept, i)):
            kept, now_fit, added = _taken(kept, (i,)), trial, [*added, i]
        elif trial is not None:
            trials.append((trial, (i,)))
    if added or _is_noise(fit, line):
        return kept, now_fit, added, True
    pairs = combinations(tried[:MOST_IN_PAIRS], 2)
    trials += [(trial, g) for g in pairs if (trial := _with_these(kept, fit, g, table, refit)) is not None]
    if not trials:
        return kept, fit, [], True
    best, group = min(trials, key=lambda one: one[0].deviance)
    return _taken(kept, group), best, list(group), False


_NEEDED = "; the functions are noise only with it"
"""End of the reason of a cluster that the fit needs."""


def _taken(candidates: Sequence[Candidate], these: tuple[int, ...]) -> list[Candidate]:
    kept = list(candidates)
    for i in these:
        kept[i] = replace(kept[i], chosen=True, reason=kept[i].reason + _NEEDED)
    return kept


def _tied_again(
    fit: ModalFit, candidates: tuple[Candidate, ...], table: PoleTable, refit: Refit, line: Reals | None
) -> tuple[ModalFit, tuple[Candidate, ...]]:
    """With modes that ended far from where their poles began, tied to the cluster at their end.

    A pole that was looked for outside the band may end at a mode in it, and one that began at a cluster of the noise at
    a mode beside another. Such a pole is a mode if the errors near it are noise with it and larger by more than chance
    without it.
    """
    lines = fit.measured.freq_hz
    for end in fit.poles[
        (np.abs(fit.poles) >= 2.0 * np.pi * lines[0]) & (np.abs(fit.poles) <= 2.0 * np.pi * lines[-1])
    ]:
        r = int(np.argmin(np.abs(fit.poles - end)))
        chosen = [j for j, c in enumerate(candidates) if c.chosen]
        own = -1 if fit.outside[r] else chosen[fit.begun_at[r]]
        if own >= 0 and (candidates[own].reason == CHOSEN_BY_USER or _is_near(end, candidates[own], table)):
            continue
        near = [i for i in _free(candidates) if _is_near(end, candidates[i], table)]
        if not near:
            continue
        i = min(near, key=lambda i: distance_from(end, table.poles[candidates[i].members]))
        moved = _taken(candidates, (i,))
        if own >= 0:
            moved[own] = replace(moved[own], chosen=False, reason=moved[own].reason.removesuffix(_NEEDED))
        inside = np.flatnonzero(~fit.outside)
        starts = dict(zip((chosen[b] for b in fit.begun_at[inside]), fit.poles[inside]))
        starts = {j: pole for j, pole in starts.items() if j != own}
        outside = fit.poles[fit.outside & (np.arange(len(fit.poles)) != r)]
        try:
            without = refit(np.array([starts[j] for j in sorted(starts)]), outside, np.inf)
            starts[i] = end
            trial = refit(np.array([starts[j] for j in sorted(starts)]), outside, np.inf)
        except (FemtuneError, np.linalg.LinAlgError):
            continue
        place = sorted(starts).index(i)
        at = complex(trial.poles[trial.begun_at == place][0])
        is_mode = _is_near(at, candidates[i], table) and _explains(trial, without, place, APART)
        if is_mode and _stands_out(trial, place) and _is_white(trial, _near(lines, at), line):
            fit, candidates = trial, tuple(moved)
    return fit, candidates


def _free(candidates: Sequence[Candidate]) -> list[int]:
    """Clusters that are no modes, unless a person dropped them."""
    return [i for i, c in enumerate(candidates) if not c.chosen and c.reason != DROPPED_BY_USER]


def _is_near(end: complex, one: Candidate, table: PoleTable) -> bool:
    """Whether a pole is in the place of a cluster."""
    return distance_from(end, table.poles[one.members]) <= float(allowed_distance(np.array(one.damping_ratio)))


def _mixtures_marked(fit: ModalFit, candidates: tuple[Candidate, ...]) -> tuple[ModalFit, tuple[Candidate, ...]]:
    """With the mark of clusters whose shapes are mixtures: of two modes within their bandwidth that few orders part."""
    kept = list(candidates)
    chosen = [j for j, c in enumerate(kept) if c.chosen]
    ends = {chosen[b]: fit.poles[r] for r, b in enumerate(fit.begun_at.tolist()) if b >= 0}
    for j in chosen:
        if kept[j].reason.endswith(_NEEDED):
            for i in chosen:
                if i != j and abs(ends[i] - ends[j]) <= 2.0 * abs(ends[j].real):
                    kept[i], kept[j] = replace(kept[i], divided=True), replace(kept[j], divided=True)
    return fit, tuple(kept)


def _with_these(
    candidates: Sequence[Candidate], fit: ModalFit, these: tuple[int, ...], table: PoleTable, refit: Refit
) -> ModalFit | None:
    """The fit with further clusters; None if one of them ends elsewhere, or explains no more than chance."""
    chosen = [j for j, c in enumerate(candidates) if c.chosen]
    inside = np.flatnonzero(~fit.outside)
    now = dict(zip((chosen[b] for b in fit.begun_at[inside]), fit.poles[inside]))
    now |= {i: complex(table.poles[candidates[i].at]) for i in these}
    try:
        below = fit.deviance - by_chance(fit, len(these), CHANCE)
        trial = refit(np.array([now[j] for j in sorted(now)]), fit.poles[fit.outside], below)
    except (FemtuneError, np.linalg.LinAlgError):
        return None
    for i in these:
        place = sorted(now).index(i)
        end = complex(trial.poles[trial.begun_at == place][0])
        # one that ends elsewhere says nothing about its cluster
        if not _is_near(end, candidates[i], table) or not _explains(trial, fit, place):
            return None
    return trial


def _inside(fit: ModalFit) -> Complexes:
    """Poles of the modes in the order in which they began."""
    return np.asarray(fit.poles[~fit.outside][np.argsort(fit.begun_at[~fit.outside])])


def _is_better(trial: ModalFit, fit: ModalFit) -> bool:
    """Whether a fit explains more than another, beyond what chance explains with the poles that it has more."""
    if not trial.converged:
        return False
    if len(trial.poles) < len(fit.poles):
        return not _is_better(fit, trial)
    more = len(trial.poles) - len(fit.poles)
    return gain(trial, fit) > (by_chance(fit, more, CHANCE) if more else 0.0)


def _with_divided(
    kept: list[Candidate], fit: ModalFit, refit: Refit, search: Search, line: Reals | None
) -> tuple[list[Candidate], ModalFit, list[int]]:
    """With the mode of a cluster divided into two, where the errors near it are no noise and become noise.

    Two modes closer than their bandwidth, with one response or with shapes that are alike, are one cluster of poles.
    """
    chosen = [j for j, c in enumerate(kept) if c.chosen]
    inside = np.flatnonzero(~fit.outside)
    near = {r: _near(fit.measured.freq_hz, fit.poles[r]) for r in inside.tolist()}
    large = {r: _excess(fit, near[r], line) for r in near}
    rough = [r for r in near if not _is_white(fit, near[r], line) or large[r] > _most_excess(fit, near[r])]
    rough.sort(key=lambda r: -large[r])
    best: tuple[ModalFit, int] | None = None
    for r in rough[:MOST_DIVIDED]:
        i = int(fit.begun_at[r])
        start = _inside(fit)
        for part in PARTS:
            step = part * 1j * abs(fit.poles[r].real)
            poles = np.concatenate([start[:i], [start[i] - step, start[i] + step], start[i + 1 :]])
            try:
                trial = refit(poles, fit.poles[fit.outside], fit.deviance - by_chance(fit, 1, CHANCE))
            except (FemtuneError, np.linalg.LinAlgError):
                continue
            parts = (i, i + 1)
            if all(_explains(trial, fit, p, APART) and _stands_out(trial, p) for p in parts):
                best = (trial, i) if best is None or trial.deviance < best[0].deviance else best
                break
    if best is None:
        return kept, fit, []
    trial, j = best[0], chosen[best[1]]
    r = int(np.flatnonzero(fit.begun_at == best[1])[0])
    was_white = _is_white(fit, near[r], line)
    # modes outside the band may have stood for what is one more mode
    again = search(_inside(trial))
    # errors that are large near a mode for another reason, as noise in proportion to the motion, are no second mode
    large_still = _excess(again, near[r], line) > _most_excess(again, near[r])
    if not again.converged or (was_white and large_still):
        return kept, fit, []
    fit = again
    reason = f"{kept[j].reason}; the functions are noise only with two modes here"
    first = replace(kept[j], reason=reason, divided=True)
    return [*kept[:j], first, replace(first, name=""), *kept[j + 1 :]], fit, [j, j + 1]


def _tried(candidates: Sequence[Candidate]) -> list[int]:
    left = [
        i
        for i, c in enumerate(candidates)
        if not c.chosen
        and c.reason.startswith(("stable in", NO_MORE_THAN_NOISE))
        and max(c.share.values()) >= LEAST_SHARE
    ]
    return sorted(left, key=lambda i: -max(candidates[i].share.values()))[:MOST_TRIALS]


def _explains(trial: ModalFit, fit: ModalFit, begun_at: int, least_apart: float = _APART) -> bool:
    """Whether a further pole in the band, with a known damping, explains more than chance."""
    more = max(len(trial.poles) - len(fit.poles), 1)
    if not trial.converged or gain(trial, fit) <= by_chance(fit, more, CHANCE):
        return False
    r = int(np.flatnonzero(trial.begun_at == begun_at)[0])
    pole, others, lines = trial.poles[r], np.delete(trial.poles, r), trial.measured.freq_hz
    inside = bool(lines[0] <= abs(pole) / (2.0 * np.pi) <= lines[-1])
    apart = bool(np.all(np.abs(others - pole) >= least_apart * abs(pole.real)))
    return inside and apart and _damping_is_known(trial, r)


def _stands_out(fit: ModalFit, begun_at: int) -> bool:
    """Whether a mode is none of the poles that noise, where it is larger at the resonances, makes beside them."""
    r = int(np.flatnonzero(fit.begun_at == begun_at)[0])
    values = fit.measured.values - (0.0 if fit.ends is None else fit.ends[:, None])
    return stands_out(replace(fit.measured, values=values), complex(fit.poles[r]), np.delete(fit.poles, r))


def _damping_is_known(fit: ModalFit, r: int) -> bool:
    # the relative error of a damping ratio is nearly that of Re λ
    return bool(KNOWN_DAMPING * np.sqrt(fit.pole_covariance[r, r]) < -fit.poles[r].real)


def _near(freq_hz: Reals, pole: complex) -> Integers:
    away = np.abs(freq_hz - abs(pole) / (2.0 * np.pi))
    inside = int(np.sum(away <= _HALF_BANDS * abs(pole.real) / (2.0 * np.pi)))
    return np.sort(np.argsort(away, kind="stable")[: max(2 * _LEAST_LINES + 1, inside)])


def _left(fit: ModalFit, line: Reals | None) -> Complexes:
    """(n, u, k) what the fit leaves, by the weights of the lines."""
    values = fit.measured.values - fit.synthesised.values
    if fit.ends is not None:
        values = values - fit.ends[:, None]
    return np.asarray(values * (1.0 if line is None else line))


def _noise_power(left: Complexes) -> Reals:
    """(n, u) mean square of the part of the errors that changes from line to line."""
    return np.asarray(np.mean(np.abs(np.diff(left, 4, axis=2)) ** 2, axis=2) / 70.0)


def _is_white(fit: ModalFit, near: Integers, line: Reals | None) -> bool:
    """Whether what the fit leaves near a pole is noise, in the functions of which it leaves most."""
    left = _left(fit, line)[:, :, near]
    size = np.mean(np.abs(left) ** 2, axis=2)
    share = size / max(float(size.max()), np.finfo(float).tiny)
    # errors of functions of which the fit leaves little do not count
    count = max(len(near) * float(np.sum(share)) ** 2 / max(float(np.sum(share**2)), 1.0), 1.0)
    return bool(np.mean(_noise_power(left)) >= min(LEAST_WHITE, 1.0 - WHITE_BY_CHANCE / np.sqrt(count)) * np.mean(size))


def leaves_noise(fit: ModalFit, line: Reals) -> list[bool]:
    """Of each pole from which the fit of a record started, whether noise only is left near its end."""
    inside = np.flatnonzero(~fit.outside)
    near = {int(fit.begun_at[r]): _near(fit.measured.freq_hz, fit.poles[r]) for r in inside}
    return [
        _is_white(fit, near[b], line) and _excess(fit, near[b], line) <= _most_excess(fit, near[b])
        for b in sorted(near)
    ]


def _excess(fit: ModalFit, near: Integers, line: Reals | None) -> float:
    """What the fit leaves near a pole above the noise, over the noise of each function, summed over the functions."""
    left = _left(fit, line)
    noise = np.maximum(_noise_power(left), np.finfo(float).tiny)
    return float(np.sum(np.sum(np.abs(left[:, :, near]) ** 2, axis=2) / noise) - noise.size * len(near))


def _most_excess(fit: ModalFit, near: Integers) -> float:
    """The excess above which the errors near a pole are larger than noise: by chance, and by `LARGE`."""
    n, u, _ = fit.measured.values.shape
    count = n * u * len(near)
    return max((LARGE - 1.0) * count, 0.5 * float(chdtri(2 * count, CHANCE)) - count)


def _is_exact(fit: ModalFit) -> bool:
    """Whether a fit leaves rounding only, in which poles can be found too."""
    size = np.sqrt(np.mean(np.abs(fit.measured.values) ** 2, axis=2))
    return bool(np.median(fit.sd) <= ROUNDING * np.median(size))


def _is_noise(fit: ModalFit, line: Reals | None) -> bool:
    """Whether what the fit leaves is as large everywhere as the noise in most places."""
    left = _left(fit, line)
    n, u, k = left.shape
    width = 2 * _LEAST_LINES + 1
    parts = [left[:, :, i : i + width] for i in range(0, max(k - width, 0) + 1, width)]
    noise = np.maximum(np.median([_noise_power(part) for part in parts], axis=0), np.finfo(float).tiny)
    limit = max(LARGE, 0.5 * float(chdtri(2 * n * u * width, CHANCE)) / (n * u * width))
    return all(float(np.mean(np.mean(np.abs(part) ** 2, axis=2) / noise)) <= limit for part in parts)
