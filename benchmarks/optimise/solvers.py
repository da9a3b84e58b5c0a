"""femtune's search and general solvers on the same residuals, from the same points."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from objective import BestPairing, Residuals
from scipy.optimize import least_squares, minimize

from femtune.arrays import Reals
from femtune.updating import SensitivityMethod, update

TIGHT = 1e-12
"""Tolerances of the rivals; smaller ones are below the rounding of the objective."""
MOST, MOST_AGAIN = 250, 80
"""Solutions at most for a rival from a start, and from the end of femtune."""
OURS = "femtune"
METHOD = SensitivityMethod(smallest_change=0.0)
"""The minimum inside the bounds."""


@dataclass(frozen=True, eq=False)
class Ended:
    """One run.

    Parameters
    ----------
    x, objective : the best point that the run solved, with ½ rᵀr; NaN where it solved none
    trace : (n,) objective of each solution in turn
    status : how the solver says it ended
    """

    x: Reals
    objective: float
    trace: Reals
    status: str
    seconds: float


class Solver(Protocol):
    """A solver with its settings."""

    def __call__(self, problem: BestPairing, x: Reals, most: int = MOST) -> Ended:
        """One run from x."""
        ...


def femtune(problem: BestPairing, x: Reals, most: int = MOST) -> Ended:
    """The search that is compared; it has no limit of solutions."""
    del most
    begun, counted = time.process_time(), problem.counted()
    found = update(counted, METHOD, start=counted.start(x))
    seconds = time.process_time() - begun
    return Ended(found.x, found.objective, np.array(counted.trace.objectives), found.status.name, seconds)


def _least_squares(method: str, scale: float | str) -> Solver:
    def run(problem: BestPairing, x: Reals, most: int = MOST) -> Ended:
        def solve(functions: Residuals) -> str:
            found = least_squares(
                functions.values, x, functions.jacobian, problem.parameters.bounds, method=method, ftol=TIGHT,
                xtol=TIGHT, gtol=TIGHT, x_scale=scale, max_nfev=most,
            )  # fmt: skip
            return str(found.status)

        return _rival(problem, x, solve, most)

    return run


def slsqp(problem: BestPairing, x: Reals, most: int = MOST) -> Ended:
    """Sequential quadratic programming on the objective over that of the start, which its tolerance asks for."""

    def solve(functions: Residuals) -> str:
        size = max(0.5 * float(np.sum(functions.values(x) ** 2)), 1e-12)

        def value(y: Reals) -> float:
            return 0.5 * float(np.sum(functions.values(y) ** 2)) / size

        def slope(y: Reals) -> Reals:
            return np.asarray(functions.jacobian(y).T @ functions.values(y) / size)

        bounds = list(zip(*problem.parameters.bounds))
        found = minimize(
            value, x, jac=slope, method="SLSQP", bounds=bounds, options={"ftol": TIGHT * 1e-3, "maxiter": most}
        )
        return str(found.status)

    return _rival(problem, x, solve, most)


class _LimitError(Exception):
    """The limit of solutions, for solvers that only limit iterations."""


@dataclass(eq=False)
class _Limited(Residuals):
    most: int = MOST

    def values(self, x: Reals) -> Reals:
        if len(self.problem.trace.objectives) >= self.most:
            raise _LimitError
        return super().values(x)


def _rival(problem: BestPairing, x: Reals, solve: Callable[[Residuals], str], most: int) -> Ended:
    begun, counted = time.process_time(), problem.counted()
    functions = _Limited(counted, counted.size, most=most)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            status = solve(functions)
        except _LimitError:
            status = "limit"
        except (ValueError, np.linalg.LinAlgError) as error:
            status = f"failed: {error}"
    seconds = time.process_time() - begun
    objective, end = functions.best or (float("nan"), x)
    return Ended(end, objective, np.array(counted.trace.objectives), status, seconds)


RIVALS: dict[str, Solver] = {
    # the parameters are normalised by their nominal values already; x_scale="jac" takes as many solutions
    "trf": _least_squares("trf", 1.0),
    "dogbox": _least_squares("dogbox", "jac"),
    "SLSQP": slsqp,
}
SOLVERS: dict[str, Solver] = {OURS: femtune, **RIVALS}
