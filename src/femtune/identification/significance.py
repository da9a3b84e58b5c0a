"""Does a pole stand out of the noise near it, or does it follow the noise?

Noise that is larger at the resonances has a narrow band, as noise in proportion to the functions has, and rounding.
Subspace identification then finds poles beside the resonances, stable from order to order, which are those of the
noise. They explain of the functions near them as much as any column would: about one variance of the noise a function.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import qr
from scipy.special import fdtri

from femtune.arrays import Complexes, Flags
from femtune.identification.choice import Candidate
from femtune.identification.pole_table import PoleTable
from femtune.modal import FrfSet

LEAST_GAIN = 8.0
"""What a pole explains, in variances of the noise a function, below which it is taken for one of the noise: the poles
of noise had 7 at most."""
CHANCE = 1e-6
"""Probability of a larger gain by chance; it decides for few functions, where chance reaches more."""
_LEAST_LINES = 16
"""Lines on each side of a pole at least."""
_HALF_BANDS = 8.0
"""Half bandwidths on each side within which lines are used."""
_MOST_LINES = 400
"""Lines that are used at most, evenly spaced among these: the cost is proportional to their number."""
_SMOOTH = 5
"""Terms of the polynomial for everything that is not near."""
_ROUNDING = 1e-6
"""Noise relative to the functions that is assumed at least: what the polynomial leaves, and what text files round."""
_DEPENDENT = 1e-10
"""Columns of the other poles that are no further from those before are left out."""
_DISTINCT = 0.1
"""A pole whose column is no further from the others cannot be told from them by its size at the lines, as one of two
modes that are much closer than their bandwidth: their shapes tell."""


NO_MORE_THAN_NOISE = "it explains no more than the noise near it"
"""Reason of a candidate that is dropped."""


def without_poles_of_noise(
    candidates: Sequence[Candidate], table: PoleTable, frfs: FrfSet, share: float
) -> tuple[Candidate, ...]:
    """The candidates, with those dropped that one method alone has and that do not stand out of the noise near them.

    Parameters
    ----------
    table : the poles that the candidates were chosen from
    frfs : (n, u, k) complete, as they were identified
    share : part of a method's orders from which on it is taken to have a pole
    """
    checked, there = list(candidates), np.ones(len(table), bool)
    for i in sorted(range(len(checked)), key=lambda i: max(checked[i].share.values())):
        one = checked[i]
        alone = sum(part >= share for part in one.share.values()) < 2
        # what is dropped does not stand in for the next one: of two poles that share a mode, one stays
        if one.chosen and alone and not stands_out(frfs, *_of_one_order(table, one.at, there)):
            checked[i] = replace(one, chosen=False, reason=NO_MORE_THAN_NOISE)
            there[one.members] = False
    return tuple(checked)


def _of_one_order(table: PoleTable, at: int, there: Flags) -> tuple[complex, Complexes]:
    """A pole, and the others that its method found at its order."""
    same_order = there & (np.array(table.method) == table.method[at]) & (table.order == table.order[at])
    same_order[at] = False
    return complex(table.poles[at]), np.asarray(table.poles[same_order])


def stands_out(frfs: FrfSet, pole: complex, others: Complexes) -> bool:
    """Whether a pole explains more of the functions near it than a pole of the noise does.

    At the lines near the pole each function is the sum of the other poles there and of a polynomial, with the pole and
    without it; lines are weighted by the inverse of the size that the functions have there. The squared errors that the
    pole takes away are compared with the variance of those that it leaves, function by function.

    Parameters
    ----------
    frfs : (n, u, k) complete
    pole, others : rad/s, of one model

    Returns
    -------
    true also where the lines near the pole do not tell
    """
    near = _near(frfs.freq_hz, pole)
    values = frfs.values[:, :, near].reshape(-1, len(near))
    size = np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True))
    moving = size[:, 0] > 0.0
    if not moving.any():
        return True
    values = (values[moving] / size[moving]).T
    weights = np.maximum(np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True)), _ROUNDING)
    omega = 2.0 * np.pi * frfs.freq_hz[near]
    basis = np.hstack([_smooth(omega), 1.0 / (1j * omega[:, None] - _beside(omega, pole, others))])
    span = _span(basis / weights)
    freedom = len(near) - span.shape[1] - 1
    if freedom < 2:
        return True
    whole = 1.0 / (1j * omega - pole)[:, None] / weights
    column = _across(whole, span)
    if np.linalg.norm(column) < _DISTINCT * np.linalg.norm(whole):
        return True
    errors = _across(values / weights, span)
    taken = column.conj().T @ errors / np.linalg.norm(column)
    left = np.sum(np.abs(errors - column * (taken / np.linalg.norm(column))) ** 2, axis=0)
    gain = np.abs(taken[0]) ** 2 / np.maximum(left / freedom, _ROUNDING**2)
    count = len(gain)
    by_chance = float(fdtri(2 * count, 2 * count * freedom, 1.0 - CHANCE))
    return bool(np.mean(gain) > max(LEAST_GAIN, by_chance))


def _near(freq_hz: np.ndarray, pole: complex) -> np.ndarray:
    """Positions of the lines near a pole; at an end of the band as many on its other side."""
    away = np.abs(freq_hz - abs(pole) / (2.0 * np.pi))
    inside = int(np.sum(away <= _HALF_BANDS * abs(pole.real) / (2.0 * np.pi)))
    near = np.sort(np.argsort(away, kind="stable")[: max(2 * _LEAST_LINES + 1, inside)])
    return near[np.linspace(0, len(near) - 1, min(len(near), _MOST_LINES)).astype(int)]


def _smooth(omega: np.ndarray) -> np.ndarray:
    return np.vander((omega - omega.mean()) / (0.5 * np.ptp(omega)), _SMOOTH)


def _beside(omega: np.ndarray, pole: complex, others: Complexes) -> Complexes:
    """The poles nearest to a pole, as many as leave half of the lines to the noise."""
    order = np.argsort(np.abs(others - pole))
    return np.asarray(others[order[: max(len(omega) // 2 - _SMOOTH, 0)]])


def _span(basis: np.ndarray) -> np.ndarray:
    """Orthonormal columns of what the basis spans."""
    Q, R, _ = qr(basis / np.linalg.norm(basis, axis=0), mode="economic", pivoting=True, check_finite=False)
    size = np.abs(np.diag(R))
    return np.asarray(Q[:, size > _DEPENDENT * size[0]])


def _across(columns: np.ndarray, span: np.ndarray) -> np.ndarray:
    """What is left outside of a span; twice, since the first leaves rounding of it."""
    for _ in range(2):
        columns = columns - span @ (span.conj().T @ columns)
    return np.asarray(columns)
