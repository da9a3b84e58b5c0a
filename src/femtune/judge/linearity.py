"""Is the sum of squares a parabola over the distribution of the parameters? True χ² beside the linear one.

The covariance of an update is that of the residuals linearised at the result. Along each of its principal axes the true
χ² is evaluated at a distance of some standard deviations to both sides, and compared with that of the linear residuals,
which grows by the square of the distance. Where the valley is curved, the true one grows more: the point of the linear
distribution contradicts the data, and its standard deviations do not apply.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError
from femtune.selection import determined

STEP = 1.5
"""Distance in standard deviations at which the true χ² is evaluated: inside the 95 % interval, and far enough for its
curvature to show."""
CURVED = 3.84
"""Excess of the true over the linear χ² from which the data refute a point that the linear distribution allows: the
95 % quantile of χ² with one degree of freedom."""
FLAT = 0.25
"""True over linear increase of χ², below which the true distribution is at least twice as wide."""
_LEAST_STEP = 0.2
"""Distance in standard deviations below which bounds leave nothing to compare."""


@dataclass(frozen=True)
class AxisPoint:
    """One side of a principal axis.

    Parameters
    ----------
    axis : number of the axis, from 1, the widest first
    step : distance in standard deviations, negative to the other side; shorter than asked for where a bound is nearer
    linear, true : increase of χ² by the linear residuals and by the model; `true` is infinite where it is not solved
    """

    axis: int
    step: float
    linear: float
    true: float

    @property
    def curved(self) -> bool:
        """True if the model contradicts the linear residuals: the point is refuted, or the valley goes on."""
        return self.true - self.linear > CURVED or self.true < FLAT * self.linear


def principal_axes(rows: Reals, spread: Reals, moving: Flags) -> Reals:
    """(a, k) changes of x by one standard deviation along the principal axes of the covariance, the widest first.

    Parameters
    ----------
    rows : (n, k) Jacobian with the rows of the prior
    spread : (k,) prior standard deviations, the lengths in which axes are perpendicular
    moving : (k,) parameters that are free at the result; those at a bound are not

    Combinations that the data do not determine have no standard deviation and are left out.
    """
    used = np.flatnonzero(moving)
    _, s, vt = np.linalg.svd(rows[:, used] * spread[used], full_matrices=False)
    known = np.asarray(determined(s))
    out = np.zeros((int(known.sum()), len(spread)))
    out[:, used] = (vt[known] / s[known, None]) * spread[used]
    return out[::-1]


def compare(
    x: Reals,
    residuals: Reals,
    jacobian: Reals,
    axes: Reals,
    box: tuple[Reals, Reals],
    chi_square: Callable[[Reals], float],
    most: int,
) -> tuple[tuple[AxisPoint, ...], int]:
    """True and linear increase of χ² at ± `STEP` standard deviations along axes; and the number of axes left out.

    Parameters
    ----------
    x : (k,) the result
    residuals, jacobian : (n,), (n, k) there, those of the prior included
    axes : (a, k) as of `principal_axes`
    box : (k,) each, bounds of x
    chi_square : of the model at another point, over the same comparisons; it may fail with a `FemtuneError`
    most : points at most

    Examples
    --------
    >>> import numpy as np
    >>> valley = lambda x: float((10.0 * (x[1] - x[0] ** 2)) ** 2 + x[0] ** 2)
    >>> J, box = np.array([[0.0, 10.0], [1.0, 0.0]]), (np.full(2, -5.0), np.full(2, 5.0))
    >>> axes = principal_axes(J, np.ones(2), np.ones(2, bool))
    >>> points, left = compare(np.zeros(2), np.zeros(2), J, axes, box, valley, 10)
    >>> [(p.axis, round(p.linear, 2), round(p.true, 2), p.curved) for p in points]
    [(1, 2.25, 508.5, True), (1, 2.25, 508.5, True), (2, 2.25, 2.25, False), (2, 2.25, 2.25, False)]
    """
    least, points = float(residuals @ residuals), list[AxisPoint]()
    for number, axis in enumerate(axes, start=1):
        if len(points) + 2 > most:
            return tuple(points), len(axes) - number + 1
        for side in (1.0, -1.0):
            step = min(STEP, _room(x, side * axis, box))
            if step < _LEAST_STEP:
                continue
            d = side * step * axis
            linear = float(np.sum((residuals + jacobian @ d) ** 2)) - least
            try:
                true = chi_square(x + d) - least
            except FemtuneError:
                true = np.inf
            points.append(AxisPoint(number, side * step, linear, true))
    return tuple(points), 0


def _room(x: Reals, direction: Reals, box: tuple[Reals, Reals]) -> float:
    """Length of the line from x inside the box, relative to the direction."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.where(direction > 0.0, (box[1] - x) / direction, (box[0] - x) / direction)
    return float(np.min(np.where(direction != 0.0, ends, np.inf), initial=np.inf))
