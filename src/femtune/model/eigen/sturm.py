"""Sturm counts: how many eigenvalues lie below a value, and where among the modes found to count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.model.eigen.pencil import Pencil
from femtune.model.solvers.interface import Factor, SingularMatrixError

_REPEATED = 1e-6
"""Neighbouring modes whose λ − σ differ by less than this fraction are one repeated mode."""
_NUDGES = (1.0, 1.0 + 1e-7, 1.0 + 1e-5)
"""Factors of a value that are tried in turn if K − λM is singular there."""

Cut = tuple[float, int]


@dataclass(frozen=True, eq=False)
class Count:
    """Number of eigenvalues below a value (None if the pivots do not show it), and the factors used."""

    value: float
    below: int | None
    factor: Factor | None = None


def count_below(pencil: Pencil, value: float) -> Count:
    """Negative pivots of K − λM."""
    for nudge in _NUDGES:
        try:
            factor = pencil.factorise(nudge * value)
        except SingularMatrixError:
            continue
        if factor.negative_pivots is not None:
            return Count(nudge * value, factor.negative_pivots, factor)
        del factor
    return Count(value, None)


def with_repeats(values: NDArray, wanted: int, shift: float) -> int:
    """The number of modes that keeps a repeated mode at the end whole."""
    while wanted < len(values) and values[wanted] - values[wanted - 1] <= _REPEATED * (values[wanted] - shift):
        wanted += 1
    return wanted


def cut_above(values: NDArray, wanted: int, known: int, shift: float, complete: bool) -> Cut | None:
    """A shift in the widest relative gap above the wanted modes and the number of modes below it; None without one.

    Gaps are relative to λ − σ: among rigid-body modes, whose λ are rounding, there is none. `complete` says that
    there are no modes above the values.
    """
    ends = values[wanted - 1 : min(known + 1, len(values))]
    if wanted > known:
        return None
    if len(ends) < 2:
        return (float(values[-1] + 0.01 * (values[-1] - shift)), len(values)) if complete else None
    gaps = np.diff(ends) / (ends[1:] - shift)
    i = int(np.argmax(gaps))
    return (0.5 * float(ends[i] + ends[i + 1]), wanted + i) if gaps[i] > _REPEATED else None


def separates(values: NDArray, wanted: int, known: int, shift: float, count: Count) -> bool:
    """True where a count that was made before lies between the wanted modes and the others."""
    if count.below != wanted or known < wanted:
        return False
    gap = _REPEATED * (count.value - shift)
    above = values[wanted] if wanted < len(values) else np.inf
    return bool(values[wanted - 1] + gap < count.value < above - gap)


def missed(cut: Cut | None, below: int | None) -> FemtuneError:
    """The error that the count and the modes differ."""
    if cut is None:
        return FemtuneError("eigen.missed-modes/no-gap")
    return FemtuneError("eigen.missed-modes", below=below, eigenvalue=cut[0], found=cut[1])


def not_counted() -> Notice:
    """The notice that modes come without a count."""
    return Notice("eigen.not-counted")
