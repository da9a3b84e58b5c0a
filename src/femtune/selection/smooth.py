"""Whether the residuals are smooth along each parameter within its bounds: slopes beside differences of the misfit.

The misfit δ = ½ rᵀr is computed with its slope rᵀJ along one parameter after the other, the others at the start. On an
interval h a smooth misfit changes by the mean of the slopes at its ends times h. Intervals on which it does not are
halved. The smallest interval that is needed says over which part of the range a slope is worth something; where
not even the smallest one is small enough, the misfit has a kink or a jump.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.residuals import Evaluation, UpdateProblem

Verdict = Literal["smooth", "rough", "several minima", "no solution"]


@dataclass(frozen=True)
class SmoothnessRules:
    """When a misfit is smooth.

    Parameters
    ----------
    intervals : of equal length at the beginning
    halvings : of an interval at most
    tolerance : error of the change that the slopes predict, relative to the range of the misfit
    smallest : part of the range of the parameter that slopes must hold over
    depth : height of a misfit between two minima above both, relative to the range of the misfit, that separates them
    """

    intervals: int = 8
    halvings: int = 4
    tolerance: float = 0.05
    smallest: float = 1.0 / 64.0
    depth: float = 0.1


DEFAULT_SMOOTHNESS = SmoothnessRules()


@dataclass(frozen=True, eq=False)
class Smoothness:
    """The misfit along one parameter.

    Parameters
    ----------
    verdict : "rough" where slopes hold over less than the smallest part of the range
    holds : part of the range between the bounds over which slopes hold in its worst place
    where : normalised value there
    minima : (n,) normalised values near which the misfit has separate minima
    x, misfit, slope : (n,) points, δ relative to that at the start, and its slope
    failed : number of points without a solution
    """

    name: str
    verdict: Verdict
    holds: float
    where: float
    minima: Reals
    x: Reals = field(repr=False)
    misfit: Reals = field(repr=False)
    slope: Reals = field(repr=False)
    failed: int = 0


def smoothness(
    problem: UpdateProblem,
    start: Evaluation,
    rules: SmoothnessRules = DEFAULT_SMOOTHNESS,
    report: Callable[[int, int], None] | None = None,
) -> tuple[Smoothness, ...]:
    """Smoothness along each free parameter within its bounds, the others at the start.

    Parameters
    ----------
    start : at which the pairing of modes is that of the others
    report : called with the number of parameters that are done, and of all
    """
    jumps = []
    scale = start.objective or 1.0
    names = [p.name for p in problem.parameters.free]
    for i, name in enumerate(names):
        if report is not None:
            report(i, len(names))
        lower, upper = (bound[i] for bound in problem.parameters.bounds)

        def along(x: float, i: int = i) -> tuple[float, float] | None:
            point = start.x.copy()
            point[i] = x
            try:
                there = problem.follow(point, start)
            except FemtuneError:
                return None
            return there.objective / scale, float(there.residuals @ there.jacobian[:, i]) / scale

        jumps.append(line_smoothness(name, along, float(lower), float(upper), rules))
    return tuple(jumps)


def line_smoothness(
    name: str,
    along: Callable[[float], tuple[float, float] | None],
    lower: float,
    upper: float,
    rules: SmoothnessRules = DEFAULT_SMOOTHNESS,
) -> Smoothness:
    """Smoothness of one misfit along a line.

    Parameters
    ----------
    along : x -> misfit and its slope; None if there is no solution

    Examples
    --------
    >>> from femtune.selection.smooth import line_smoothness
    >>> line_smoothness("E", lambda x: (x * x, 2.0 * x), -1.0, 1.0).verdict
    'smooth'
    >>> line_smoothness("E", lambda x: (abs(x - 0.3), 1.0 if x > 0.3 else -1.0), -1.0, 1.0).verdict
    'rough'
    """
    line = _Line(along, lower, upper, rules)
    line.refine()
    x, values = np.array(sorted(line.known)), [line.known[x] for x in sorted(line.known)]
    good = np.array([f is not None for f in values])
    pairs = np.array([f for f in values if f is not None]).reshape(-1, 2)
    x, failed = x[good], int((~good).sum())
    holds, where = line.worst()
    minima = _minima(x, pairs[:, 0], rules.depth)
    verdict: Verdict = "smooth"
    if len(x) < 2:
        verdict = "no solution"
    elif holds < rules.smallest * (1.0 - 1e-9):
        verdict = "rough"
    elif len(minima) > 1:
        verdict = "several minima"
    return Smoothness(
        name=name,
        verdict=verdict,
        holds=holds,
        where=where,
        minima=minima,
        x=x,
        misfit=pairs[:, 0],
        slope=pairs[:, 1],
        failed=failed,
    )


class _Line:
    """Points along a line, and the intervals between them."""

    def __init__(
        self,
        along: Callable[[float], tuple[float, float] | None],
        lower: float,
        upper: float,
        rules: SmoothnessRules,
    ) -> None:
        self._along, self._range, self._rules = along, upper - lower, rules
        self.known: dict[float, tuple[float, float] | None] = {}
        ends = np.linspace(lower, upper, rules.intervals + 1)
        self._open = [(float(a), float(b), 0) for a, b in pairwise(ends)]
        self._unresolved: list[tuple[float, float]] = []
        self._smallest: tuple[float, float] = (1.0 / rules.intervals, float(ends[0]))
        for x in ends:
            self._at(float(x))

    def _at(self, x: float) -> tuple[float, float] | None:
        if x not in self.known:
            self.known[x] = self._along(x)
        return self.known[x]

    @property
    def _height(self) -> float:
        values = [f[0] for f in self.known.values() if f is not None]
        return max(max(values, default=0.0) - min(values, default=0.0), 1e-12)

    def refine(self) -> None:
        """Halve intervals until the slopes at their ends explain the changes."""
        while self._open:
            a, b, halved = self._open.pop(0)
            if self._explained(a, b):
                continue
            if halved == self._rules.halvings:
                self._unresolved.append((a, b))
                continue
            middle = 0.5 * (a + b)
            part = 0.5 * (b - a) / self._range
            if part < self._smallest[0]:
                self._smallest = part, middle
            self._at(middle)
            self._open += [(a, middle, halved + 1), (middle, b, halved + 1)]

    def _explained(self, a: float, b: float) -> bool:
        return self._off(a, b) <= self._rules.tolerance * self._height

    def _off(self, a: float, b: float) -> float:
        """Change of the misfit that the slopes do not explain; 0 where it is not known."""
        one, other = self._at(a), self._at(b)
        if one is None or other is None:
            return 0.0
        return abs(other[0] - one[0] - 0.5 * (b - a) * (one[1] + other[1]))

    def worst(self) -> tuple[float, float]:
        """Part of the range over which slopes hold, 0 for a kink or jump, and where that is."""
        left = [(a, b) for a, b in self._unresolved if not self._explained(a, b)]
        if left:
            return 0.0, 0.5 * sum(max(left, key=lambda ends: self._off(*ends)))
        return self._smallest


def _minima(x: Reals, values: Reals, depth: float) -> Reals:
    """Values of x at minima that are separated by more than a part of the range of the values."""
    minima: list[int] = []
    if len(x) < 2:
        return x[:0]
    least = depth * float(np.ptp(values))
    lowest, highest = 0, 0
    falling = True
    for i, value in enumerate(values):
        if falling:
            lowest = i if value < values[lowest] else lowest
            if value > values[lowest] + least:
                minima.append(lowest)
                falling, highest = False, i
        else:
            highest = i if value > values[highest] else highest
            if value < values[highest] - least:
                falling, lowest = True, i
    if falling:
        minima.append(lowest)
    return np.asarray(x[minima])
