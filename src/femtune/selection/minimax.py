"""The point of a set of parameters whose largest residual is smallest.

Error-domain falsification rejects a model only if no values of its parameters keep all residuals within their limits.
The least-squares point is not the one to ask: it accepts one large residual for many small ones.

Source: sequential linear programming with a trust region, K. Madsen, H. Schjaer-Jacobsen, Linearly constrained minimax
optimization, Mathematical Programming 14, 1978.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import linprog

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError
from femtune.residuals import Evaluation

_MOST_STEPS = 15
"""Linear programs at most; each costs an evaluation with derivatives."""
_FIRST_RADIUS = 0.25
"""First trust region, relative to the width of the bounds."""
_SMALLEST_RADIUS = 1e-6
"""Trust region, relative to the width of the bounds, at which the search ends: a smaller change has no effect."""
_LEAST_GAIN = 1e-3
"""Predicted decrease, relative to the largest residual, that is not worth another evaluation."""
_GOOD = 0.1
"""Share of the predicted decrease that an accepted step must reach."""


def smallest_largest(
    at: Evaluation,
    move: Callable[[Reals, Evaluation], Evaluation],
    moving: Flags,
    bounds: tuple[Reals, Reals],
    enough: float,
) -> Evaluation:
    """The evaluation with the smallest largest residual that a descent from `at` finds.

    Parameters
    ----------
    at : where the search starts, with derivatives
    move : the evaluation, with derivatives, at a point (k,), from one nearby
    moving : (k,) parameters that move
    bounds : (k,) each, lower and upper
    enough : largest residual at which the search ends
    """
    best, least = at, _largest(at)
    lower, upper = (np.asarray(end, float)[moving] for end in bounds)
    width = np.where(np.isfinite(upper - lower), upper - lower, 1.0)
    radius = _FIRST_RADIUS
    for _ in range(_MOST_STEPS):
        if least <= enough or radius < _SMALLEST_RADIUS:
            break
        x, box = best.x[moving], radius * width
        step = _step(best.residuals, best.jacobian[:, moving], np.maximum(lower - x, -box), np.minimum(upper - x, box))
        if step is None or least - step[1] < _LEAST_GAIN * least:
            break
        d, predicted = step
        point = best.x.copy()
        point[moving] += d
        try:
            there = move(point, best)
        except FemtuneError:
            # no model there, or another pairing: nearer points may have one
            radius *= 0.25
            continue
        if len(there.residuals) == len(best.residuals) and least - _largest(there) >= _GOOD * (least - predicted):
            best, least = there, _largest(there)
            radius = min(2.0 * radius, 1.0)
        else:
            radius *= 0.25
    return best


def _step(r: Reals, J: Reals, low: Reals, high: Reals) -> tuple[Reals, float] | None:
    """The step d, and t = max |r + Jd|, of the linear program min t, |r + Jd| <= t, low <= d <= high."""
    k, one = J.shape[1], np.ones((len(r), 1))
    solution = linprog(
        np.append(np.zeros(k), 1.0),
        A_ub=np.block([[J, -one], [-J, -one]]),
        b_ub=np.concatenate([-r, r]),
        bounds=[*zip(low, np.maximum(low, high)), (0.0, None)],
        method="highs",
    )
    return (solution.x[:k], float(solution.x[k])) if solution.success else None


def _largest(at: Evaluation) -> float:
    return float(np.abs(at.residuals).max(initial=0.0))
