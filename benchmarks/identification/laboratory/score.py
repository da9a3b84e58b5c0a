"""What a way found of a test: modes that are true, false ones, errors beside bounds and intervals."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from simulated import Structure

Reals = NDArray[np.float64]
HELD = 0.25
"""Least standard deviation of a damping ratio relative to it, below which the data hold a mode: 4 σ above zero."""
NORMAL_95 = 1.96
_NONE = 1e6
"""Cost of a mode that is not near, above that of all that are: as many as can be are matched."""


def score(one: Structure, bound: tuple[Reals, Reals], found: list[dict[str, Any]]) -> dict[str, Any]:
    """Rows of the true modes and of those that are none of them."""
    pairs = matches(one, bound, found)
    modes = []
    for j in range(one.inside):
        row: dict[str, Any] = {
            "freq_hz": one.freq_hz[j],
            "damping_ratio": one.damping_ratio[j],
            "bound": [_or_none(bound[0][j]), _or_none(bound[1][j])],
            "held": held(one, bound, j),
            "close": one.close is not None and j in one.close,
            "found": found[pairs[j]] if j in pairs else None,
        }
        modes.append(row)
    others = [mode for i, mode in enumerate(found) if i not in pairs.values()]
    return {"modes": modes, "false": others}


def held(one: Structure, bound: tuple[Reals, Reals], j: int) -> bool | None:
    """Whether the data hold a mode; None where its bound was not computed."""
    return bool(bound[1][j] <= HELD * one.damping_ratio[j]) if np.isfinite(bound[1][j]) else None


def matches(one: Structure, bound: tuple[Reals, Reals], found: list[dict[str, Any]]) -> dict[int, int]:
    """Of true modes the positions of those found, one to one and nearest first as a whole.

    Frequencies differ by half the bandwidth or 0.3 %, damping ratios by their size or 0.5 % of critical damping, and
    both by four times the bound where this is more. How near a mode is does not depend on its bound: a mode that the
    data do not hold would else take one that was found at its neighbour.
    """
    if not found:
        return {}
    own, ratio = one.freq_hz[: one.inside, None], one.damping_ratio[: one.inside, None]
    least = [4.0 * np.nan_to_num(b)[:, None] for b in bound]
    freq = np.array([mode["freq_hz"] for mode in found])
    damping = np.array([np.nan if mode["damping_ratio"] is None else mode["damping_ratio"] for mode in found])
    width, size = np.maximum(ratio, 0.003) * own, np.maximum(ratio, 0.005)
    away, other = np.abs(freq - own), np.abs(damping - ratio)
    near = (away <= np.maximum(width, least[0])) & (other <= np.maximum(size, least[1]))
    cost = np.where(near, away / width + 0.1 * np.nan_to_num(other / size, nan=1.0), _NONE)
    rows, columns = linear_sum_assignment(cost)
    return {int(j): int(i) for j, i in zip(rows, columns) if near[j, i]}


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
