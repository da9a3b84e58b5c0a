"""Intervals of parameters from intervals of outputs: the interval problem, turned round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.quantify.intervals import Bounds, interval_bounds
from femtune.quantify.outputs import Outputs
from femtune.quantify.status import StochasticStatus

Reals = NDArray[np.float64]

_MOST, _TOLERANCE, _NARROWEST = 40, 1e-8, 1e-9


@dataclass(frozen=True)
class IntervalResult:
    """Box (k,) to (k,) of the parameters whose extrema are the measured ones, and the extrema of that box."""

    lower: Reals
    upper: Reals
    bounds: Bounds
    status: StochasticStatus
    solutions: int


def interval_update(
    outputs: Outputs, measured: tuple[Reals, Reals], start: tuple[Reals, Reals], signs: Reals | None = None
) -> IntervalResult:
    """The box whose extrema come nearest to measured lowest and highest outputs, by Gauss-Newton on its ends.

    An extremum moves with the end of the box at which it lies, with the slope that it has there.

    Parameters
    ----------
    measured : (m,) lowest and highest outputs
    start : (k,) ends of a first box

    Raises
    ------
    FemtuneError : ``quantify.interval`` and what the model raises

    Source: interval updating after Khodaparast, Mottershead and Badcock (2011), with corners in place of a surrogate.
    """
    target = np.concatenate([np.asarray(end, float) for end in measured])
    ends = np.concatenate([np.asarray(end, float) for end in start])
    k, cost, status = len(ends) // 2, 0, StochasticStatus.MEANS_LIMIT
    bounds, scale = interval_bounds(outputs, ends[:k], ends[k:], signs), ends[k:] - ends[:k]
    cost += bounds.solutions
    for _ in range(_MOST):
        J = _slopes(bounds, ends, k)
        # relative outputs, parameters in widths of the first box
        rows = J * np.tile(scale, 2) / np.abs(target)[:, None]
        d = np.tile(scale, 2) * np.linalg.lstsq(rows, (target - _extrema(bounds)) / np.abs(target), rcond=1e-8)[0]
        if np.abs(d / np.tile(scale, 2)).max() <= _TOLERANCE:
            status = StochasticStatus.CONVERGED if np.linalg.matrix_rank(rows, 1e-6) == 2 * k else (
                StochasticStatus.UNDETERMINED
            )  # fmt: skip
            break
        ends = _apart(ends + d, k)
        bounds = interval_bounds(outputs, ends[:k], ends[k:], signs)
        cost += bounds.solutions
    return IntervalResult(ends[:k], ends[k:], bounds, status, cost)


def _extrema(bounds: Bounds) -> Reals:
    return np.concatenate([bounds.lower, bounds.upper])


def _slopes(bounds: Bounds, ends: Reals, k: int) -> Reals:
    """(2m, 2k) derivatives of the extrema by the lower and upper ends of the box."""
    at = np.vstack([bounds.at_lower, bounds.at_upper])
    slopes = np.vstack([bounds.lower_slopes, bounds.upper_slopes])
    return np.hstack([slopes * np.isclose(at, ends[:k]), slopes * np.isclose(at, ends[k:])])


def _apart(ends: Reals, k: int) -> Reals:
    if (ends[k:] - ends[:k] <= _NARROWEST * np.abs(ends[k:])).any():
        raise FemtuneError(
            "quantify.interval",
            "the measured intervals leave no room for a parameter: its upper end falls below the lower one",
            values={"lower": ends[:k].tolist(), "upper": ends[k:].tolist()},
            hint="the outputs are not those of one box of these parameters; leave out a parameter, or an output",
        )
    return ends
