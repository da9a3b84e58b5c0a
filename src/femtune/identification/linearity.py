"""Linearity from tests at several levels of force: modes and functions of each level beside those of the first.

Modes, frequency response functions and damping of a linear structure do not depend on the level of the force. A change
is evidence of nonlinearity if it is larger than a limit and than three standard deviations of its noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.identification.frf_checks import compare_levels
from femtune.modal import FrfSet, ModeSet, frac
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.shape_criteria import mac_where_defined

_LARGEST_SHIFT = 0.2
"""Relative distance of frequencies within which a mode is looked for at another level."""
_LEAST_MAC = 0.5
"""MAC from which it may be the same mode, as in the pairing of test and model."""
_SIGNIFICANT = 3.0
"""Standard deviations beyond which a change is significant (0.3 % by chance)."""
_SIGNIFICANT_LINES = 0.01
"""Fraction of the lines with a significant change from which a function has changed: above the 0.3 % by chance."""
_SAME_LINE = 1e-6
"""Relative difference of two frequency lines that is rounding of a written number."""


@dataclass(frozen=True)
class LinearityLimits:
    """Relative changes of frequency and damping, and FRAC, that are accepted between levels."""

    frequency: float = 0.005
    damping: float = 0.2
    frac: float = 0.9


@dataclass(frozen=True, eq=False)
class ForceLevel:
    """Modes and functions identified at one level.

    Parameters
    ----------
    name : shown in tables
    force : level of the force, above 0; only ratios matter
    modes : identified modes; those of the excitation left out
    frfs : measured functions, or None
    sd : (n, u, k) √E|error|² of the functions, or None
    """

    name: str
    force: float
    modes: ModeSet
    frfs: FrfSet | None = None
    sd: Reals | None = None


@dataclass(frozen=True)
class Trend:
    """Change of a quantity with the level of the force, relative to its value at the first level.

    Parameters
    ----------
    largest : change (value − first)/first of largest magnitude; NaN where the mode was found at one level only
    largest_sd : its standard deviation; NaN where none is known
    per_doubling : relative change for twice the force, by a least-squares line over the logarithm of the force
    per_doubling_sd : its standard deviation; NaN where none is known
    beyond : True where a change is above the limit, and above three standard deviations where these are known
    """

    largest: float
    largest_sd: float
    per_doubling: float
    per_doubling_sd: float
    beyond: bool


@dataclass(frozen=True, eq=False)
class ModeAtLevels:
    """A mode of the first level at all levels.

    Parameters
    ----------
    label : of the mode at the first level
    freq_hz, freq_sd_hz, damping_ratio, damping_sd, mac : (levels,) NaN where the mode was not found or no deviation is
        known; MAC with the first level
    frequency, damping : their trends
    linear : None if the mode was found at the first level only
    """

    label: str
    freq_hz: Reals
    freq_sd_hz: Reals
    damping_ratio: Reals
    damping_sd: Reals
    mac: Reals
    frequency: Trend
    damping: Trend
    linear: bool | None


@dataclass(frozen=True)
class FunctionsAtLevel:
    """Functions of one level beside those of the first.

    Parameters
    ----------
    functions, lines : that are compared
    frac : of all functions together
    lowest_frac : of the function that differs most
    lowest : its labels, "3Z+ / 1Z+"
    change : |H − H_first|/|H_first| of all functions together, norms over the lines
    noise : what noise alone would give on average; NaN where no deviations are known
    differing : number of functions whose FRAC is below the limit and that differ by more than noise; where the noise is
        not known 1 if the FRAC of all functions together is below the limit
    reason : why nothing was compared; "" where it was
    """

    functions: int = 0
    lines: int = 0
    frac: float = np.nan
    lowest_frac: float = np.nan
    lowest: str = ""
    change: float = np.nan
    noise: float = np.nan
    differing: int = 0
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Linearity:
    """The comparison of all levels with the first.

    Parameters
    ----------
    names, forces : of the levels, in their order
    modes : those of the first level
    functions : one a further level
    linear : None if neither modes nor functions could be compared
    limits : what was asked for
    """

    names: tuple[str, ...]
    forces: tuple[float, ...]
    modes: tuple[ModeAtLevels, ...]
    functions: tuple[FunctionsAtLevel, ...]
    linear: bool | None
    limits: LinearityLimits


def check_linearity(levels: Sequence[ForceLevel], limits: LinearityLimits | None = None) -> Linearity:
    """Compare modes and functions of several levels with those of the first.

    Parameters
    ----------
    levels : two or more; the first is the reference
    limits : accepted changes

    Examples
    --------
    >>> import numpy as np
    >>> from femtune import DofSet, ModeSet
    >>> from femtune.identification.linearity import ForceLevel, check_linearity
    >>> at = DofSet.parse(["1Z+", "2Z+"])
    >>> low = ModeSet(np.array([10.0]), np.array([[1.0], [2.0]]), at, damping_ratio=np.array([0.01]))
    >>> high = ModeSet(np.array([9.8]), np.array([[1.0], [2.0]]), at, damping_ratio=np.array([0.01]))
    >>> found = check_linearity([ForceLevel("1 N", 1.0, low), ForceLevel("4 N", 4.0, high)])
    >>> found.linear, round(100 * found.modes[0].frequency.per_doubling, 2)
    (False, -1.0)
    """
    limits = limits or LinearityLimits()
    first, *others = levels
    places = [_partners(first.modes, level.modes) for level in levels]
    modes = tuple(_mode(levels, places, i, limits) for i in range(len(first.modes)))
    functions = tuple(_functions(first, level, limits) for level in others)
    verdicts = [m.linear for m in modes if m.linear is not None]
    verdicts += [f.differing == 0 for f in functions if not f.reason]
    linear = all(verdicts) if verdicts else None
    return Linearity(tuple(v.name for v in levels), tuple(v.force for v in levels), modes, functions, linear, limits)


def _partners(first: ModeSet, other: ModeSet) -> dict[int, tuple[int, float]]:
    """Position and MAC of the partner of each mode of the first level, by shape and frequency."""
    common = first.dofs.common(other.dofs)
    if not len(common) or not len(first) or not len(other):
        return {}
    score = mac_where_defined(first.select_dofs(common).shapes, other.select_dofs(common).shapes)
    near = np.abs(other.freq_hz[None, :] / first.freq_hz[:, None] - 1.0)
    # the frequencies decide between modes whose shapes are alike at the sensors
    allowed = (near <= _LARGEST_SHIFT) & (np.nan_to_num(score) >= _LEAST_MAC)
    rows, columns = linear_sum_assignment(np.where(allowed, score - near, 0.0), maximize=True)
    return {int(i): (int(j), float(score[i, j])) for i, j in zip(rows, columns) if allowed[i, j]}


def _mode(
    levels: Sequence[ForceLevel], places: Sequence[dict[int, tuple[int, float]]], i: int, limits: LinearityLimits
) -> ModeAtLevels:
    at = [place.get(i) for place in places]

    def at_levels(values: Iterable[NDArray | None]) -> Reals:
        return np.array([np.nan if j is None else _value(v, j[0]) for v, j in zip(values, at)])

    freq = at_levels(v.modes.freq_hz for v in levels)
    freq_sd = at_levels(v.modes.freq_sd_hz for v in levels)
    damping = at_levels(v.modes.damping_ratio for v in levels)
    damping_sd = at_levels(v.modes.damping_sd for v in levels)
    doublings = np.log2(np.array([v.force for v in levels]) / levels[0].force)
    of_freq = _trend(freq, freq_sd, doublings, limits.frequency)
    of_damping = _trend(damping, damping_sd, doublings, limits.damping)
    macs = np.array([np.nan if j is None else j[1] for j in at])
    linear = None if np.isnan(of_freq.largest) else not (of_freq.beyond or of_damping.beyond)
    return ModeAtLevels(
        label=levels[0].modes.labels[i],
        freq_hz=freq,
        freq_sd_hz=freq_sd,
        damping_ratio=damping,
        damping_sd=damping_sd,
        mac=macs,
        frequency=of_freq,
        damping=of_damping,
        linear=linear,
    )


def _value(values: NDArray | None, j: int) -> float:
    return np.nan if values is None else float(values[j])


def _trend(values: Reals, sd: Reals, doublings: Reals, limit: float) -> Trend:
    known = np.isfinite(values)
    if known.sum() < 2 or not known[0] or values[0] == 0.0:
        return Trend(np.nan, np.nan, np.nan, np.nan, False)
    change = values / values[0] - 1.0
    spread = np.hypot(sd / values[0], values * sd[0] / values[0] ** 2)
    noise = np.where(np.isfinite(spread), _SIGNIFICANT * spread, 0.0)
    beyond = np.abs(change[known]) > np.maximum(limit, noise[known])
    worst = int(np.argmax(np.where(known, np.abs(change), -1.0)))
    slope, slope_sd = _slope(doublings[known], values[known] / values[0], sd[known] / values[0])
    return Trend(float(change[worst]), float(spread[worst]), slope, slope_sd, bool(beyond.any()))


def _slope(x: Reals, y: Reals, sd: Reals) -> tuple[float, float]:
    """Slope of the line y(x) and its standard deviation; NaN where all levels are equal, or no deviations are known."""
    if np.ptp(x) == 0.0:
        return np.nan, np.nan
    known = bool(np.isfinite(sd).all() and (sd > 0.0).all())
    weight = 1.0 / sd**2 if known else np.ones(len(x))
    centred = x - np.average(x, weights=weight)
    curvature = float(np.sum(weight * centred**2))
    return float(np.sum(weight * centred * y)) / curvature, curvature**-0.5 if known else np.nan


# ----------------------------------------------------------------------------------------------------
# Functions of a level beside those of the first.


def _functions(first: ForceLevel, other: ForceLevel, limits: LinearityLimits) -> FunctionsAtLevel:
    if first.frfs is None or other.frfs is None:
        return FunctionsAtLevel(reason="no functions were measured")
    if first.frfs.kind != other.frfs.kind:
        return FunctionsAtLevel(reason=f"the functions are of different kinds: {first.frfs.kind}, {other.frfs.kind}")
    rows, columns = (
        first.frfs.responses.common(other.frfs.responses),
        first.frfs.references.common(other.frfs.references),
    )
    lines = _common_lines(first.frfs.freq_hz, other.frfs.freq_hz)
    if not len(rows) or not len(columns) or len(lines[0]) < 2:
        return FunctionsAtLevel(reason="the levels have no functions, or fewer than two frequency lines, in common")
    (a, sd_a), (b, sd_b) = (_at(v, rows, columns, at) for v, at in zip((first, other), lines))
    b = replace(b, freq_hz=a.freq_hz)
    sds = None if sd_a is None or sd_b is None else (sd_a, sd_b)
    significant = compare_levels((a, b), sds).significant[1]
    known = np.isfinite(a.values) & np.isfinite(b.values)
    va, vb = (np.where(known, v.values, 0.0) for v in (a, b))
    fracs = np.array([[np.nan if (f := frac(x, y)) is None else f for x, y in zip(p, q)] for p, q in zip(va, vb)])
    whole = frac(va.ravel(), vb.ravel())
    if whole is None:
        return FunctionsAtLevel(reason="the functions are zero")
    size = float(np.linalg.norm(va))
    noise = np.nan if sds is None else float(np.sqrt(np.nansum(np.where(known, sds[0] ** 2 + sds[1] ** 2, 0.0)))) / size
    if sds is None:
        differing = int(whole < limits.frac)
    else:
        differing = int(np.sum((np.nan_to_num(fracs, nan=1.0) < limits.frac) & (significant >= _SIGNIFICANT_LINES)))
    i, j = np.unravel_index(int(np.nanargmin(fracs)), fracs.shape)
    return FunctionsAtLevel(
        functions=int(np.isfinite(fracs).sum()),
        lines=len(lines[0]),
        frac=whole,
        lowest_frac=float(fracs[i, j]),
        lowest=f"{rows[int(i)]} / {columns[int(j)]}",
        change=float(np.linalg.norm(vb - va)) / size,
        noise=noise,
        differing=differing,
    )


def _common_lines(a: Reals, b: Reals) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    if not len(b):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    right = np.clip(np.searchsorted(b, a), min(1, len(b) - 1), len(b) - 1)
    left = np.maximum(right - 1, 0)
    near = np.where(np.abs(b[left] - a) <= np.abs(b[right] - a), left, right)
    same = np.flatnonzero(np.abs(b[near] - a) <= _SAME_LINE * np.abs(a))
    return same, near[same]


def _at(level: ForceLevel, rows: DofSet, columns: DofSet, lines: NDArray[np.int64]) -> tuple[FrfSet, Reals | None]:
    """Functions and deviations at common DOFs, with the signs of the labels, and lines."""
    frfs = level.frfs
    assert frfs is not None
    i, sign = rows.align(frfs.responses)
    j, turn = columns.align(frfs.references)
    at = np.ix_(i, j, lines)
    values = frfs.values[at] * sign[:, None, None] * turn[None, :, None]
    some = FrfSet(frfs.freq_hz[lines], values, rows, columns, frfs.kind, source=frfs.source)
    return some, None if level.sd is None else level.sd[at]
