"""The sensitivity method with bounds inside the step: damped Gauss-Newton on modal residuals.

Source: Mottershead, Link and Friswell (2011); damping after Levenberg and Marquardt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.residuals import Evaluation, UpdateProblem, describe_change
from femtune.select import identifiability
from femtune.status import Status
from femtune.update.covariance import parameter_covariance
from femtune.update.regularise import Regularisation
from femtune.update.result import Iteration, UpdateResult
from femtune.update.trust import bounded_step

Reals = NDArray[np.float64]
Report = Callable[[Iteration], None]

_DAMPING_START, _DAMPING_LEAST, _DAMPING_MOST = 1e-3, 1e-12, 1e12
_SAME_OBJECTIVE, _NEARLY_SAME, _ZERO_OBJECTIVE = 1e-10, 1e-6, 1e-24
_MANY_PAIRING_CHANGES = 6


@dataclass(frozen=True)
class SensitivityMethod:
    """Settings of the iteration.

    Parameters
    ----------
    max_iterations : accepted steps at most
    tolerance : largest change of a normalised parameter that counts as none
    regularisation : side constraints
    """

    max_iterations: int = 50
    tolerance: float = 1e-8
    regularisation: Regularisation = field(default_factory=Regularisation)


@dataclass(frozen=True)
class _Point:
    evaluation: Evaluation
    residuals: Reals
    jacobian: Reals

    @property
    def objective(self) -> float:
        return 0.5 * float(self.residuals @ self.residuals)

    @property
    def x(self) -> Reals:
        return self.evaluation.x


def update(
    problem: UpdateProblem,
    method: SensitivityMethod = SensitivityMethod(),
    report: Report = lambda i: None,
    start: Evaluation | None = None,
) -> UpdateResult:
    """Move the parameters inside their bounds until model and test agree as well as they can.

    `report` is called with every iteration; `start` is the problem at x = 0 where it has been evaluated already.

    Raises
    ------
    FemtuneError : ``correlate.no-pairs``, and what the first eigen-solution raises; later failures end in a status
    """
    before = start or problem.start(np.zeros(len(problem.parameters.free)))
    point = _point(problem, method, before)
    history = [_iteration(problem, 0, point, 0.0, 0.0, ())]
    report(history[0])
    damping, status = _DAMPING_START, _finished(problem, method, point, history)
    while status is None:
        taken, damping, status = _step(problem, method, point, damping)
        if taken is not None:
            trial, paired = taken
            moved = float(np.abs(trial.x - point.x).max(initial=0.0))
            events = _events(trial, paired.evaluation)
            history.append(_iteration(problem, len(history), paired, moved, damping, events))
            report(history[-1])
            point = paired
            status = _finished(problem, method, point, history)
    return _result(problem, method, before, point, status, history)


def _point(problem: UpdateProblem, method: SensitivityMethod, evaluation: Evaluation) -> _Point:
    extra, rows = method.regularisation.rows(problem.parameters, evaluation.x)
    return _Point(
        evaluation,
        np.concatenate([evaluation.residuals, extra]),
        np.vstack([evaluation.jacobian, rows]),
    )


def _finished(
    problem: UpdateProblem, method: SensitivityMethod, point: _Point, history: list[Iteration]
) -> Status | None:
    """How the iteration ends at this point, or None where it goes on."""
    if _gauss_newton_gain(problem, method, point) <= _SAME_OBJECTIVE * point.objective:
        return _optimum(problem, point)
    if sum(bool(i.events) for i in history) > _MANY_PAIRING_CHANGES:
        return Status.PAIRING_CYCLES
    return Status.MAX_ITERATIONS if len(history) > method.max_iterations else None


def _gauss_newton_gain(problem: UpdateProblem, method: SensitivityMethod, point: _Point) -> float:
    """By how much the linear model lowers the objective inside the bounds; zero where its step is none."""
    if point.objective < _ZERO_OBJECTIVE:
        return 0.0
    d = bounded_step(
        point.residuals, point.jacobian, _DAMPING_LEAST, *_room(problem, point), problem.parameters.prior[1]
    )
    return 0.0 if np.abs(d).max(initial=0.0) <= method.tolerance else _predicted(point, d)


def _room(problem: UpdateProblem, point: _Point) -> tuple[Reals, Reals]:
    lower, upper = problem.parameters.bounds
    return lower - point.x, upper - point.x


def _step(
    problem: UpdateProblem, method: SensitivityMethod, point: _Point, damping: float
) -> tuple[tuple[Evaluation, _Point] | None, float, Status | None]:
    """The next accepted point, before and after it is paired afresh, and its damping; or the status that ends it."""
    failed = False
    while damping <= _DAMPING_MOST:
        d = bounded_step(point.residuals, point.jacobian, damping, *_room(problem, point), problem.parameters.prior[1])
        if np.abs(d).max(initial=0.0) <= method.tolerance:
            break
        trial = _try(problem, point, d)
        gain = _gain(problem, method, point, d, trial)
        paired = None if trial is None or gain <= 1e-4 else _paired(problem, method, trial)
        if trial is not None and paired is not None:
            return (trial, paired), _relaxed(damping, gain), None
        failed = failed or trial is None or gain > 1e-4
        damping = max(10.0 * damping, 1e-6)
    return None, damping, _end(problem, method, point, failed)


def _end(problem: UpdateProblem, method: SensitivityMethod, point: _Point, failed: bool) -> Status:
    """Why no step was accepted: rounding at an optimum, unsolvable trial points, or a wall."""
    if _gauss_newton_gain(problem, method, point) <= _NEARLY_SAME * point.objective:
        return _optimum(problem, point)
    return Status.SOLVE_FAILED if failed else Status.STALLED


def _try(problem: UpdateProblem, point: _Point, d: Reals) -> Evaluation | None:
    """A trial point without derivatives, which cost more than its modes and are of no use where it is refused."""
    lower, upper = problem.parameters.bounds
    try:
        return problem.follow(np.clip(point.x + d, lower, upper), point.evaluation, derivatives=False)
    except FemtuneError:
        # A trial point may be unsolvable (a mechanism at an extreme value); a shorter step is tried instead.
        return None


def _paired(problem: UpdateProblem, method: SensitivityMethod, trial: Evaluation) -> _Point | None:
    """An accepted point with its derivatives, paired afresh; None where they cannot be had."""
    try:
        return _point(problem, method, problem.pair_again(trial))
    except FemtuneError:
        return None


def _gain(
    problem: UpdateProblem, method: SensitivityMethod, point: _Point, d: Reals, trial: Evaluation | None
) -> float:
    """Actual over predicted decrease of the objective."""
    if trial is None:
        return -1.0
    predicted = _predicted(point, d)
    extra, _ = method.regularisation.rows(problem.parameters, trial.x)
    actual = point.objective - trial.objective - 0.5 * float(extra @ extra)
    if predicted <= 1e-14 * point.objective:
        return 1.0 if actual >= 0.0 else -1.0
    return actual / predicted


def _predicted(point: _Point, d: Reals) -> float:
    linear = point.residuals + point.jacobian @ d
    return point.objective - 0.5 * float(linear @ linear)


def _relaxed(damping: float, gain: float) -> float:
    if gain > 0.75:
        return max(0.1 * damping, _DAMPING_LEAST)
    return damping if gain > 0.25 else 4.0 * damping


def _optimum(problem: UpdateProblem, point: _Point) -> Status:
    bound = _at_bound(problem, point.x)
    free = ~bound
    _, sd = problem.parameters.prior
    names = tuple(p.name for p in problem.parameters.free)
    known = identifiability(point.jacobian[:, free], sd[free], tuple(n for n, f in zip(names, free) if f))
    if known.undetermined:
        return Status.UNDETERMINED
    if bound.any():
        return Status.CONVERGED_AT_BOUNDS
    return Status.EXACT if point.objective < 1e-16 else Status.CONVERGED


def _at_bound(problem: UpdateProblem, x: Reals) -> NDArray[np.bool_]:
    lower, upper = problem.parameters.bounds
    near = 1e-9 * (upper - lower)
    return np.asarray((x <= lower + near) | (x >= upper - near))


def _events(before: Evaluation, after: Evaluation) -> tuple[str, ...]:
    return tuple(
        text for a, b in zip(before.states, after.states) for text in describe_change(a.case, a.groups, b.groups)
    )


def _iteration(
    problem: UpdateProblem, number: int, point: _Point, moved: float, damping: float, events: tuple[str, ...]
) -> Iteration:
    bound = _at_bound(problem, point.x)
    names = tuple(p.name for p, at in zip(problem.parameters.free, bound) if at)
    return Iteration(number, point.objective, point.evaluation.mean_error, point.x, moved, damping, names, events)


def _result(
    problem: UpdateProblem,
    method: SensitivityMethod,
    before: Evaluation,
    point: _Point,
    status: Status,
    history: list[Iteration],
) -> UpdateResult:
    at = point.evaluation
    _, rows = method.regularisation.rows(problem.parameters, at.x)
    prior = rows if method.regularisation.kind == "prior" else rows[:0]
    bound = _at_bound(problem, at.x)
    covariance = parameter_covariance(at.residuals, at.jacobian, at.kinds, prior, bound, problem.parameters.prior[1])
    cited = ("mottershead2011", "friswell1995", "fox1968", "dailey1989")
    return UpdateResult(problem.parameters, status, at.x, before, at, tuple(history), covariance, cited)
