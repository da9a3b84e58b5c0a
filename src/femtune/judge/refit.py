"""The update continued with one further parameter, at the cost of a few solutions without derivatives.

Gauss-Newton steps with the Jacobian at the end of the update, which Broyden's rank-one formula corrects by the
residuals that each step finds: no derivatives are computed again. The residuals are those of the model itself, so that
the misfit at the end is one that the model has; a minimum that is missed makes it larger, never smaller.

Source: C. G. Broyden, A class of methods for solving nonlinear simultaneous equations, Mathematics of Computation 19,
1965; P. B. Stark, R. L. Parker, Bounded-variable least squares, Computational Statistics 10, 1995.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.residuals import Evaluation, UpdateProblem
from femtune.updating.regularisation import SideConstraint

_SAME = 1e-3
"""Predicted decrease of χ², relative to it, that does not matter: the order of the refitted fields needs no more."""
_MOST_HALVINGS = 3
"""Of a step that increases χ² or loses a mode."""


@dataclass(frozen=True, eq=False)
class Refit:
    """The end of a refit.

    Parameters
    ----------
    change : of the further parameter
    at_bound : whether it is at one of its bounds
    chi_square : at the end, side constraints included
    x : the parameters there, those of the update first
    evaluation : the residuals there, without derivatives
    converged : whether a further step would change nothing
    iterations, solutions : steps taken, and points that were solved for them
    """

    change: float
    at_bound: bool
    chi_square: float
    x: Reals
    evaluation: Evaluation
    converged: bool
    iterations: int
    solutions: int


def misfit(at: Evaluation, side: SideConstraint | None) -> Reals:
    """(n,) residuals and the rows of a side constraint on the first parameters, whose sum of squares is χ²."""
    values = np.zeros(0) if side is None else side.rows(at.x[: side.matrix.shape[1]])[0]
    return np.concatenate([at.residuals, values])


def refitted(
    problem: UpdateProblem,
    end: Evaluation,
    side: SideConstraint | None,
    moving: Integers,
    direction: Reals,
    within: tuple[float, float],
    most: int,
) -> Refit:
    """Continue an update from its end, with a combination of further parameters as one more.

    Parameters
    ----------
    end : the end of the update in the widened problem, with derivatives
    side : the side constraint of the update, on its own parameters; None without one
    moving : (k,) positions of the parameters that the update moves
    direction : (n,) change of all free parameters by a unit of the further one
    within : its least and largest change
    most : solutions, at most
    """
    parameters, x0 = problem.parameters, end.x
    turn = np.column_stack([np.eye(len(x0))[:, moving], direction])
    size = np.append(parameters.prior[1][moving], max(map(abs, within)))
    low, high = parameters.bounds
    lower, upper = np.append((low - x0)[moving], within[0]) / size, np.append((high - x0)[moving], within[1]) / size
    lower, upper = np.minimum(lower, 0.0), np.maximum(upper, 0.0)
    turn = turn * size
    fixed = np.zeros((0, turn.shape[1])) if side is None else side.rows(x0[: side.matrix.shape[1]])[1]
    fixed_rows = fixed if side is None else fixed @ turn[: side.matrix.shape[1]]
    at, y, J, r = end, np.zeros(turn.shape[1]), np.vstack([end.jacobian @ turn, fixed_rows]), misfit(end, side)
    converged, iterations, solutions = False, 0, 0
    while not converged and solutions < most:
        step = np.asarray(lsq_linear(J, -r, (lower - y, upper - y), method="bvls").x)
        converged = float(r @ r - np.sum((r + J @ step) ** 2)) <= _SAME * float(r @ r)
        trial = None
        for _ in range(0 if converged else _MOST_HALVINGS):
            if solutions >= most:
                break
            solutions += 1
            trial = _tried(problem, x0 + turn @ (y + step), at)
            if (
                trial is not None
                and len(trial.residuals) == len(at.residuals)
                and np.sum(misfit(trial, side) ** 2) < r @ r
            ):
                break
            step, trial = 0.5 * step, None
        if trial is None:
            break
        change = misfit(trial, side) - r
        J = J + np.outer(change - J @ step, step) / float(step @ step)
        at, y, r, iterations = trial, y + step, r + change, iterations + 1
    bound = bool(min(y[-1] - lower[-1], upper[-1] - y[-1]) <= _AT_BOUND)
    return Refit(float(y[-1] * size[-1]), bound, float(r @ r), at.x, at, converged, iterations, solutions)


_AT_BOUND = 1e-9
"""Distance from a bound, relative to the range, that is rounding."""


def _better(new: Reals, old: Reals) -> bool:
    """Whether as much is compared and the misfit is smaller."""
    return len(new) == len(old) and bool(new @ new < old @ old)


def _tried(problem: UpdateProblem, x: Reals, before: Evaluation) -> Evaluation | None:
    """The residuals at a point; None where the model cannot be solved."""
    try:
        return problem.follow(x, before, derivatives=False)
    except FemtuneError:
        return None
