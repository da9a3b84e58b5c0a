"""The interval problem: extrema of outputs where each parameter lies anywhere between two values.

Where every parameter's matrix is definite, every ordered eigenvalue is monotone in it (Courant and Fischer) and two
corners of the box are proof enough. Otherwise corners are tried, all of them where they are few, else those to which
the derivatives lead, and a bounded search goes on from the best of them into the box.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.uncertainty.outputs import Counted, Outputs
from femtune.uncertainty.stochastic import StochasticStatus

_ALL_CORNERS = 8
"""Parameters of unknown sign up to which all 2^8 = 256 corners are solved."""
_RANDOM_STARTS = 8
"""Points beside the centre from which extreme corners are sought; each costs a chain of solutions."""
_SAME_EXTREME = 1e-9
"""Relative difference of two extremes that is rounding of an eigenvalue solution."""


@dataclass(frozen=True)
class Bounds:
    """Extrema of m outputs over a box of k parameters.

    Parameters
    ----------
    lower, upper : (m,)
    at_lower, at_upper : (m, k) where they are
    lower_slopes, upper_slopes : (m, k) sensitivities there
    box : (k,) ends of the parameters
    proven : True where monotony makes the two corners the extrema for certain
    solutions : model solutions
    """

    lower: Reals
    upper: Reals
    at_lower: Reals
    at_upper: Reals
    lower_slopes: Reals
    upper_slopes: Reals
    box: tuple[Reals, Reals]
    proven: bool
    solutions: int

    @property
    def inside(self) -> NDArray[np.bool_]:
        """(m, 2) True where a lowest or highest value is not at a corner of the box."""
        ends = np.stack([self.at_lower, self.at_upper], axis=1)
        return np.asarray(~(np.isclose(ends, self.box[0]) | np.isclose(ends, self.box[1])).all(axis=2))


@dataclass(frozen=True)
class _Point:
    theta: Reals
    z: Reals
    slopes: Reals


def interval_bounds(outputs: Outputs, lower: Reals, upper: Reals, signs: Reals | None = None) -> Bounds:
    """Lowest and highest value of every output in the box.

    Parameters
    ----------
    lower, upper : (k,) of the parameters
    signs : (k,) +1 or −1 where all outputs are known to grow or to fall with a parameter (see `definite_signs`),
        0 where nothing is known

    Raises
    ------
    FemtuneError : ``quantify.interval``, ``quantify.not-finite``, and what the model raises
    """
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    _check_box(lower, upper)
    counted = Counted(outputs)
    known = np.zeros(len(lower)) if signs is None else np.asarray(signs, float)
    proven = bool((known != 0.0).all())
    points = _corners(counted, lower, upper, known)
    ends = [_best(points, j, side) for side in (1.0, -1.0) for j in range(len(points[0].z))]
    if not proven:
        ends = [_polished(counted, lower, upper, p, j, side) for p, j, side in ends]
    m = len(points[0].z)
    low, high = ends[:m], ends[m:]
    return Bounds(
        lower=np.array([p.z[j] for p, j, _ in low]),
        upper=np.array([p.z[j] for p, j, _ in high]),
        at_lower=np.array([p.theta for p, *_ in low]),
        at_upper=np.array([p.theta for p, *_ in high]),
        lower_slopes=np.array([p.slopes[j] for p, j, _ in low]),
        upper_slopes=np.array([p.slopes[j] for p, j, _ in high]),
        box=(lower, upper),
        proven=proven,
        solutions=counted.solutions,
    )


def _corners(counted: Counted, lower: Reals, upper: Reals, signs: Reals) -> list[_Point]:
    """Corners worth trying: with known signs two of each, else all of them or those that derivatives lead to."""
    open_ = np.flatnonzero(signs == 0.0)
    if len(open_) > _ALL_CORNERS:
        return _led(counted, lower, upper, signs)
    points = []
    for grows in (0.0, 1.0):
        share = np.where(signs > 0.0, grows, 1.0 - grows)
        for corner in product((0.0, 1.0), repeat=len(open_)):
            share[open_] = corner
            points.append(_at(counted, lower + share * (upper - lower)))
        if len(open_) == len(lower):
            break
    return points


def _led(counted: Counted, lower: Reals, upper: Reals, signs: Reals) -> list[_Point]:
    """Corners to which the slopes point, repeatedly, from the centre and random points, for every output and side."""
    rng, points = np.random.default_rng(0), [_at(counted, 0.5 * (lower + upper))]
    points += [_at(counted, rng.uniform(lower, upper)) for _ in range(_RANDOM_STARTS)]
    tried: set[tuple[bool, ...]] = set()
    for side, j in product((1.0, -1.0), range(len(points[0].z))):
        for start in list(points[: 1 + _RANDOM_STARTS]):
            points += _chain(counted, lower, upper, start, j, side, signs, tried)
    return points


def _chain(
    counted: Counted, lower: Reals, upper: Reals, start: _Point, j: int, side: float, signs: Reals,
    tried: set[tuple[bool, ...]],
) -> list[_Point]:  # fmt: skip
    chain: list[_Point] = []
    for _ in range(len(lower)):
        slopes = np.where(signs != 0.0, signs, (chain[-1] if chain else start).slopes[j])
        up = side * slopes < 0.0
        if tuple(up.tolist()) in tried:
            break
        tried.add(tuple(up.tolist()))
        chain.append(_at(counted, np.where(up, upper, lower)))
    return chain


def _best(points: list[_Point], j: int, side: float) -> tuple[_Point, int, float]:
    return min(points, key=lambda p: side * p.z[j]), j, side


def _polished(
    counted: Counted, lower: Reals, upper: Reals, start: _Point, j: int, side: float
) -> tuple[_Point, int, float]:
    """A bounded search from the best corner, where its slopes do not already hold it there, and from the middle."""
    best = start
    starts = [0.5 * (lower + upper)] if _held(lower, upper, start, j, side) else [start.theta, 0.5 * (lower + upper)]
    for theta in starts:
        minimum = minimize(
            _goal, (theta - lower) / (upper - lower), (counted, lower, upper, j, side), jac=True, method="L-BFGS-B",
            bounds=[(0.0, 1.0)] * len(lower), options={"maxiter": 100},
        )  # fmt: skip
        point = _at(counted, lower + np.clip(minimum.x, 0.0, 1.0) * (upper - lower))
        if side * point.z[j] < side * best.z[j] - _SAME_EXTREME * abs(best.z[j]):
            best = point
    return best, j, side


def _held(lower: Reals, upper: Reals, p: _Point, j: int, side: float) -> bool:
    uphill = side * p.slopes[j]
    return bool((np.where(p.theta <= lower, uphill >= 0.0, np.where(p.theta >= upper, uphill <= 0.0, False))).all())


def _goal(share: Reals, counted: Counted, lower: Reals, upper: Reals, j: int, side: float) -> tuple[float, Reals]:
    point = _at(counted, lower + share * (upper - lower))
    return side * float(point.z[j]), side * point.slopes[j] * (upper - lower)


def _at(counted: Counted, theta: Reals) -> _Point:
    return _Point(theta, *counted.linearised(theta))


def _check_box(lower: Reals, upper: Reals) -> None:
    if lower.shape != upper.shape or not (np.isfinite(lower) & np.isfinite(upper)).all() or (upper <= lower).any():
        raise FemtuneError("quantify.interval", values={"lower": lower.tolist(), "upper": upper.tolist()})


# ----------------------------------------------------------------------------------------------------
# Intervals of parameters from intervals of outputs: the interval problem, turned round.


_MOST_ITERATIONS = 40
"""Gauss-Newton iterations for the bounds at most."""
_TOLERANCE = 1e-8
"""Change of the bounds, in units of the parameters, that is convergence: half of the digits of a double."""
_SAME_EXTREMES = 1e-8
"""Relative difference of measured and computed extremes that is convergence as well."""
_SLOPELESS = 1e-6
"""Singular value of the slopes relative to the largest, below which a combination of ends has no effect."""
_NARROWEST = 1e-9
"""Width of an interval relative to its upper bound, below which rounding decides its sign."""


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
    for _ in range(_MOST_ITERATIONS):
        J = _slopes(bounds, ends, k)
        # relative outputs, parameters in widths of the first box
        rows = J * np.tile(scale, 2) / np.abs(target)[:, None]
        error = (target - _extrema(bounds)) / np.abs(target)
        d = np.tile(scale, 2) * np.linalg.lstsq(rows, error, rcond=1e-8)[0]
        # where two frequencies are equal at an end, its derivatives change from step to step
        if np.abs(d / np.tile(scale, 2)).max() <= _TOLERANCE or np.abs(error).max() <= _SAME_EXTREMES:
            determined = np.linalg.matrix_rank(rows, _SLOPELESS) == 2 * k
            status = StochasticStatus.CONVERGED if determined else StochasticStatus.UNDETERMINED
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
        raise FemtuneError("quantify.interval/apart", values={"lower": ends[:k].tolist(), "upper": ends[k:].tolist()})
    return ends
