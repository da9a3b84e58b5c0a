"""The sensitivity method with bounds inside the step: Gauss-Newton on residuals, a search and a side constraint.

Source: Mottershead, Link and Friswell (2011); damping after Levenberg and Marquardt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError
from femtune.residuals import Evaluation, UpdateProblem, describe_change
from femtune.selection import identifiability
from femtune.status import Status
from femtune.updating.covariance import Box, ParameterCovariance, parameter_covariance
from femtune.updating.regularisation import (
    LinearModel,
    NoRegularisation,
    Regularisation,
    SideConstraint,
    position,
    reweighed,
)
from femtune.updating.result import Iteration, UpdateResult
from femtune.updating.search import LevenbergMarquardt, LocalModel, Search, without

# ----------------------------------------------------------------------------------------------------
# The facts that stay the same while an update goes on, and what they make of a point.


_ROUNDING = 1e-7


@dataclass(frozen=True)
class Point:
    """An evaluation with the rows of the side constraint."""

    evaluation: Evaluation
    residuals: Reals
    jacobian: Reals

    @property
    def objective(self) -> float:
        """½ rᵀr, side constraint included."""
        return 0.5 * float(self.residuals @ self.residuals)

    @property
    def x(self) -> Reals:
        """Normalised parameters."""
        return self.evaluation.x


@dataclass(frozen=True)
class Walk:
    """A problem, the parameters that move and the side constraint."""

    problem: UpdateProblem
    moving: Flags
    side: SideConstraint

    def point(self, evaluation: Evaluation) -> Point:
        """The evaluation with the side constraint."""
        extra, rows = self.side.rows(evaluation.x)
        residuals = np.concatenate([evaluation.residuals, extra])
        return Point(evaluation, residuals, np.vstack([evaluation.jacobian, rows]))

    def objective(self, evaluation: Evaluation) -> float:
        """½ rᵀr of an evaluation that may lack derivatives, side constraint included."""
        extra, _ = self.side.rows(evaluation.x)
        return evaluation.objective + 0.5 * float(extra @ extra)

    def local(self, point: Point) -> LocalModel:
        """The linear model there, with the distances to the bounds; zero for fixed parameters."""
        lower, upper = self.problem.parameters.bounds
        room = np.where(self.moving, lower - point.x, 0.0), np.where(self.moving, upper - point.x, 0.0)
        return LocalModel(point.residuals, point.jacobian, *room, self.problem.parameters.prior[1], self.side.held)

    def moved(self, x: Reals, d: Reals) -> Reals:
        """x + d, limited to the bounds against rounding."""
        lower, upper = self.problem.parameters.bounds
        return np.where(self.moving, np.clip(x + d, lower, upper), x)

    def at_bound(self, x: Reals) -> Flags:
        """Moving parameters that touch a bound."""
        lower, upper = self.problem.parameters.bounds
        near = 1e-9 * (upper - lower)
        return np.asarray(((x <= lower + near) | (x >= upper - near)) & self.moving)

    def optimum(self, point: Point) -> Status:
        """Status of a stationary point."""
        bound = self.at_bound(point.x)
        free = self.moving & ~bound
        _, sd = self.problem.parameters.prior
        names = tuple(p.name for p in self.problem.parameters.free)
        known = identifiability(point.jacobian[:, free], sd[free], tuple(n for n, f in zip(names, free) if f))
        if known.undetermined:
            return Status.UNDETERMINED
        if bound.any():
            return Status.CONVERGED_AT_BOUNDS
        return Status.EXACT if point.objective < max(1e-16, self.rounding(point)) else Status.CONVERGED

    def rounding(self, point: Point) -> float:
        """Objective below which residuals are rounding: 1e-7 of their change by a prior standard deviation."""
        spread = self.problem.parameters.prior[1] * self.moving
        return 0.5 * float(np.sum((_ROUNDING * point.jacobian * spread) ** 2))


def moving_parameters(problem: UpdateProblem, active: Sequence[str] | None) -> Flags:
    """(k,) which free parameters move: all of them where `active` is None.

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``, ``update.nothing-moves``
    """
    moving = np.full(len(problem.parameters.free), active is None)
    for name in active or ():
        moving[position(problem.parameters, name)] = True
    if active is not None and not moving.any():
        raise FemtuneError(
            "update.nothing-moves", values={"free parameters": ", ".join(p.name for p in problem.parameters.free)}
        )
    return moving


def linear_model(problem: UpdateProblem, at: Evaluation, moving: Flags) -> LinearModel:
    """The data from which a regularisation is determined."""
    return LinearModel(problem.parameters, at.x, at.residuals, at.jacobian, moving)


Report = Callable[[Iteration], None]

_SAME_OBJECTIVE, _NEARLY_SAME, _ZERO_OBJECTIVE = 1e-10, 1e-6, 1e-24
_MANY_PAIRING_CHANGES = 6


@dataclass(frozen=True)
class SensitivityMethod:
    """Settings of the iteration, put together from parts.

    Parameters
    ----------
    max_iterations : accepted steps at most
    tolerance : largest change of a normalised parameter that counts as none
    regularisation : side constraints, settled at the first iteration and kept
    search : how the length of a step is found
    adapt : whether a weight that a rule finds is found again at every iteration, in place of kept from the first
    """

    max_iterations: int = 50
    tolerance: float = 1e-8
    regularisation: Regularisation = field(default_factory=NoRegularisation)
    search: Search = field(default_factory=LevenbergMarquardt)
    adapt: bool = False


def update(
    problem: UpdateProblem,
    method: SensitivityMethod = SensitivityMethod(),
    report: Report = lambda i: None,
    start: Evaluation | None = None,
    active: Sequence[str] | None = None,
) -> UpdateResult:
    """Move the parameters inside their bounds until model and test agree as well as they can.

    Parameters
    ----------
    report : is called with every iteration
    start : the problem where the update starts, with derivatives; at x = 0 where it is None
    active : names of the parameters that move, all where it is None; the others stay where `start` has them

    Raises
    ------
    FemtuneError : ``correlate.no-pairs``, ``update.unknown-parameter``, ``update.nothing-moves``, ``prior.*``, and what
        the first eigen-solution raises; later failures end in a status
    """
    before = start or problem.start(np.zeros(len(problem.parameters.free)))
    moving = moving_parameters(problem, active)
    side = method.regularisation.settle(linear_model(problem, before, moving))
    return _Update(Walk(problem, moving, side), method, report).go(before)


@dataclass(eq=False)
class _Update:
    walk: Walk
    method: SensitivityMethod
    report: Report

    def go(self, before: Evaluation) -> UpdateResult:
        """All iterations."""
        point = self.walk.point(before)
        history = [_iteration(self.walk, 0, point, 0.0, 0.0, ())]
        self.report(history[0])
        state, status = self.method.search.start, self._finished(point, history)
        while status is None:
            taken, state, status = self._step(point, state)
            if taken is not None:
                trial, paired = taken
                moved = float(np.abs(trial.x - point.x).max(initial=0.0))
                events = _events(trial, paired.evaluation)
                history.append(_iteration(self.walk, len(history), paired, moved, state, events))
                self.report(history[-1])
                point = self._adapted(paired)
                status = self._finished(point, history)
        return _result(self.walk, before, point, status, history)

    def _adapted(self, point: Point) -> Point:
        """The point with the weight that the rule finds there, where the weight is adapted."""
        if not self.method.adapt:
            return point
        at = linear_model(self.walk.problem, point.evaluation, self.walk.moving)
        self.walk = replace(self.walk, side=reweighed(self.walk.side, at))
        return self.walk.point(point.evaluation)

    def _finished(self, point: Point, history: list[Iteration]) -> Status | None:
        """Status if the iteration ends at this point, otherwise None."""
        if self._best_gain(point) <= _SAME_OBJECTIVE * point.objective:
            return self.walk.optimum(point)
        if sum(bool(i.events) for i in history) > _MANY_PAIRING_CHANGES:
            return Status.PAIRING_CYCLES
        return Status.MAX_ITERATIONS if len(history) > self.method.max_iterations else None

    def _best_gain(self, point: Point) -> float:
        """Predicted decrease of the objective within the bounds; zero without a step."""
        if point.objective < _ZERO_OBJECTIVE:
            return 0.0
        local = self.walk.local(point)
        d = local.step()
        return 0.0 if np.abs(d).max(initial=0.0) <= self.method.tolerance else local.gain(d)

    def _step(self, point: Point, state: float) -> tuple[tuple[Evaluation, Point] | None, float, Status | None]:
        """The next accepted point, before and after pairing is repeated, and the state; or the status that ends it."""
        search, local, failed = self.method.search, self.walk.local(point), False
        trying: float | None = state
        while trying is not None:
            state = trying
            d = search.step(local, state)
            if np.abs(d).max(initial=0.0) <= self.method.tolerance:
                break
            trial = self._try(point, d)
            gain = -1.0 if trial is None else self._gain(local, d, point, trial)
            paired = None if trial is None or not search.accepts(gain) else self._paired(trial)
            if trial is not None and paired is not None:
                return (trial, paired), search.longer(state, gain), None
            failed = failed or trial is None or search.accepts(gain)
            trying = search.shorter(state)
        return None, state, self._end(point, failed)

    def _end(self, point: Point, failed: bool) -> Status:
        """The status if no step was accepted: rounding at an optimum, trial points that cannot be solved, or
        stalled."""
        if self._best_gain(point) <= max(_NEARLY_SAME * point.objective, self.walk.rounding(point)):
            return self.walk.optimum(point)
        return Status.SOLVE_FAILED if failed else Status.STALLED

    def _try(self, point: Point, d: Reals) -> Evaluation | None:
        """A trial point without derivatives, which cost more than its modes and are not needed if it is rejected."""
        try:
            return self.walk.problem.follow(self.walk.moved(point.x, d), point.evaluation, derivatives=False)
        except FemtuneError:
            # A trial point may be unsolvable (a mechanism at an extreme value); a shorter step is tried instead.
            return None

    def _paired(self, trial: Evaluation) -> Point | None:
        """An accepted point with its derivatives and new pairing; None if they cannot be computed."""
        try:
            return self.walk.point(self.walk.problem.pair_again(trial))
        except FemtuneError:
            return None

    def _gain(self, local: LocalModel, d: Reals, point: Point, trial: Evaluation) -> float:
        """Actual over predicted decrease of the objective."""
        predicted, actual = local.gain(d), point.objective - self.walk.objective(trial)
        if predicted <= 1e-14 * point.objective:
            return 1.0 if actual >= 0.0 else -1.0
        return actual / predicted


def _events(before: Evaluation, after: Evaluation) -> tuple[str, ...]:
    return tuple(
        text for a, b in zip(before.states, after.states) for text in describe_change(a.case, a.groups, b.groups)
    )


def _iteration(walk: Walk, number: int, point: Point, moved: float, state: float, events: tuple[str, ...]) -> Iteration:
    names = tuple(p.name for p, at in zip(walk.problem.parameters.free, walk.at_bound(point.x)) if at)
    return Iteration(number, point.objective, point.evaluation.mean_error, point.x, moved, state, names, events)


def _result(walk: Walk, before: Evaluation, point: Point, status: Status, history: list[Iteration]) -> UpdateResult:
    parameters = walk.problem.parameters
    active = tuple(p.name for p, moves in zip(parameters.free, walk.moving) if moves)
    cited = ("mottershead2011", "friswell1995", "fox1968", "dailey1989")
    covariance = _covariance(walk, point.evaluation)
    return UpdateResult(
        parameters, status, point.x, before, point.evaluation, tuple(history), covariance, cited, active, walk.side
    )


def _covariance(walk: Walk, at: Evaluation) -> ParameterCovariance:
    spread = walk.problem.parameters.prior[1]
    jacobian = without(at.jacobian * spread, walk.side.held * spread) / spread
    return parameter_covariance(
        at.residuals, jacobian, at.kinds, walk.side.prior_rows, walk.at_bound(at.x), spread, walk.moving,
        walk.problem.scatter, at.lost, _box(walk, at),
    )  # fmt: skip


def _box(walk: Walk, at: Evaluation) -> Box:
    """The bounds, and how the side constraint acts there: as a prior, or as an opinion that only moves the estimate."""
    values, rows = walk.side.rows(at.x)
    prior = np.broadcast_to(walk.side.informative, len(values))
    lower, upper = walk.problem.parameters.limits
    return Box(at.x, lower, upper, values[prior], rows[~prior].T @ values[~prior])
