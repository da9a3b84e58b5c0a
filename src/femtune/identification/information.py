"""Modes that too few orders show, and that the data need: chosen by what they explain, not by stability alone.

A weak or heavily damped mode is stable in few orders. The modal fit tells whether it is one: with its pole the errors
near it are noise from line to line, and without it they are larger by more than chance. Where the errors near it are
no noise with the pole either, as for functions of a structure that is not linear, nothing is added.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from femtune.arrays import Complexes, Integers, Reals
from femtune.errors import FemtuneError
from femtune.identification.choice import Candidate
from femtune.identification.in_place import allowed_distance, distance_from
from femtune.identification.modal_fit import ModalFit
from femtune.identification.near_band import gain
from femtune.identification.pole_table import PoleTable
from femtune.identification.significance import stands_out

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
KNOWN_DAMPING = 4.0
"""Standard deviations of the damping ratio above zero."""
_LEAST_LINES = 16
"""Lines on each side of a pole at least, from which the noise near it is estimated to a sixth."""
_HALF_BANDS = 4.0
"""Half bandwidths on each side of a pole: the response of its mode is a quarter of the peak there."""
_APART = 0.2
"""Distance from the other poles in half bandwidths at least."""

Refit = Callable[[Complexes, Complexes], ModalFit]
"""The fit that starts from poles of modes and poles outside the band."""
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
    kept, now_fit, added = list(candidates), fit, []
    for i in _tried(candidates):
        chosen = [j for j, c in enumerate(kept) if c.chosen]
        inside = np.flatnonzero(~now_fit.outside)
        now = dict(zip((chosen[b] for b in now_fit.begun_at[inside]), now_fit.poles[inside]))
        now[i] = complex(table.poles[kept[i].at])
        try:
            trial = refit(np.array([now[j] for j in sorted(now)]), now_fit.poles[now_fit.outside])
        except (FemtuneError, np.linalg.LinAlgError):
            continue
        place = sorted(now).index(i)
        end = complex(trial.poles[trial.begun_at == place][0])
        away = distance_from(end, table.poles[kept[i].members])
        # one that ends elsewhere says nothing about its cluster
        if away <= allowed_distance(np.array(kept[i].damping_ratio)) and _explains(trial, now_fit, place):
            now_fit = trial
            added.append(i)
            kept[i] = replace(kept[i], chosen=True, reason=f"{kept[i].reason}; the functions are noise only with it")
    if not added and search is not None:
        kept, now_fit, added = _with_divided(kept, now_fit, refit, search, line)
    elif added and search is not None:
        # the modes outside of the band were looked for beside fewer modes, for which they may stand
        again = search(now_fit.poles[~now_fit.outside][np.argsort(now_fit.begun_at[~now_fit.outside])])
        now_fit = again if again.deviance < now_fit.deviance else now_fit
    chosen = [j for j, c in enumerate(kept) if c.chosen]
    ends = [now_fit.poles[now_fit.begun_at == chosen.index(i)][0] for i in added]
    # one that hides others is no noise near it before these are there too
    if not added or not all(_is_white(now_fit, _near(now_fit.measured.freq_hz, end), line) for end in ends):
        return fit, tuple(candidates)
    return now_fit, tuple(kept)


def _with_divided(
    kept: list[Candidate], fit: ModalFit, refit: Refit, search: Search, line: Reals | None
) -> tuple[list[Candidate], ModalFit, list[int]]:
    """With the mode of a cluster divided into two, where the errors near it are no noise and become noise.

    Two modes closer than their bandwidth, with one response or with shapes that are alike, are one cluster of poles.
    """
    chosen = [j for j, c in enumerate(kept) if c.chosen]
    inside = np.flatnonzero(~fit.outside)
    near = {r: _near(fit.measured.freq_hz, fit.poles[r]) for r in inside.tolist()}
    rough = sorted((r for r in near if not _is_white(fit, near[r], line)), key=lambda r: -_excess(fit, near[r], line))
    best: tuple[ModalFit, int] | None = None
    for r in rough[:MOST_DIVIDED]:
        i = int(fit.begun_at[r])
        start = fit.poles[~fit.outside][np.argsort(fit.begun_at[~fit.outside])]
        for part in PARTS:
            step = part * 1j * abs(fit.poles[r].real)
            poles = np.concatenate([start[:i], [start[i] - step, start[i] + step], start[i + 1 :]])
            try:
                trial = refit(poles, fit.poles[fit.outside])
            except (FemtuneError, np.linalg.LinAlgError):
                continue
            if _explains(trial, fit, i) and _explains(trial, fit, i + 1):
                best = (trial, i) if best is None or trial.deviance < best[0].deviance else best
                break
    if best is None:
        return kept, fit, []
    trial, j = best[0], chosen[best[1]]
    # modes outside the band may have stood for what is one more mode
    fit = search(trial.poles[~trial.outside][np.argsort(trial.begun_at[~trial.outside])])
    reason = f"{kept[j].reason}; the functions are noise only with two modes here"
    first = replace(kept[j], reason=reason, divided=True)
    return [*kept[:j], first, replace(first, name=""), *kept[j + 1 :]], fit, [j, j + 1]


def _tried(candidates: Sequence[Candidate]) -> list[int]:
    left = [
        i
        for i, c in enumerate(candidates)
        if not c.chosen and c.reason.startswith("stable in") and max(c.share.values()) >= LEAST_SHARE
    ]
    return sorted(left, key=lambda i: -max(candidates[i].share.values()))[:MOST_TRIALS]


def _explains(trial: ModalFit, fit: ModalFit, begun_at: int) -> bool:
    """Whether a further pole in the band, with a known damping, explains more than chance."""
    n, u, _ = trial.measured.values.shape
    if not trial.converged or gain(trial, fit) <= float(chdtri(2 + 2 * n * u, CHANCE)):
        return False
    r = int(np.flatnonzero(trial.begun_at == begun_at)[0])
    pole, others, lines = trial.poles[r], np.delete(trial.poles, r), trial.measured.freq_hz
    inside = bool(lines[0] <= abs(pole) / (2.0 * np.pi) <= lines[-1])
    apart = bool(np.all(np.abs(others - pole) >= _APART * abs(pole.real)))
    if not (inside and apart and _damping_is_known(trial, r)):
        return False
    # noise that is larger at the resonances makes poles of its own beside them
    values = trial.measured.values - (0.0 if trial.ends is None else trial.ends[:, None])
    return stands_out(replace(trial.measured, values=values), complex(pole), others)


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
    return bool(np.mean(_noise_power(left)) >= LEAST_WHITE * np.mean(np.abs(left) ** 2))


def _excess(fit: ModalFit, near: Integers, line: Reals | None) -> float:
    """What the fit leaves near a pole above the noise, over the noise of each function, summed over the functions."""
    left = _left(fit, line)
    noise = np.maximum(_noise_power(left), np.finfo(float).tiny)
    return float(np.sum(np.sum(np.abs(left[:, :, near]) ** 2, axis=2) / noise) - noise.size * len(near))
