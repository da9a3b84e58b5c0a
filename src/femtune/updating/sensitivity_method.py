"""The sensitivity method with bounds inside the step: Gauss-Newton on residuals, a search and a side constraint.

Source: Mottershead, Link and Friswell (2011); damping after Levenberg and Marquardt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError
from femtune.modal.shape_criteria import mac_where_defined
from femtune.parameters import ParameterSet
from femtune.residuals import Evaluation, UpdateProblem, describe_change
from femtune.residuals.frf.fitted import fitted_frfs
from femtune.residuals.kinds import Scatter
from femtune.residuals.pairing import Joined, alternating, describe_joined
from femtune.selection.combinations import determined_combinations
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
from femtune.updating.result import Certificate, Iteration, IterationMode, UpdateResult
from femtune.updating.search import LevenbergMarquardt, LocalModel, Search, without
from femtune.updating.smallest_change import ALLOWED, SmallestChange, change_rows, weight_for

# ----------------------------------------------------------------------------------------------------
# The facts that stay the same while an update goes on, and what they make of a point.


_RELATIVE_ROUNDING = 1e-7
"""Residual, relative to its change by a whole length of step, that is rounding: half of the digits of a double."""
_CROSSING_RATIO = 1e4
"""Sensitivity of a residual relative to the lower quartile of all, above which its modes cross; four decades, so that
residuals of very different standard deviations do not count."""
_TINY_PART = 1e-10
"""Objective relative to its first value, below which residuals have lost five digits and may be rounding."""
_AT_BOUND = 1e-9
"""Distance from a bound, relative to the smaller of the width of the box and 1 + |bound|, within which a parameter is
at it."""
_ZERO_RESIDUAL = 1e-6
"""Residual, in standard deviations, that counts as zero."""
_ROUNDING_OF_ONE = 1e-5
"""The same as a part of its change by a whole length of step. A single residual scatters more than their norm, see
`_RELATIVE_ROUNDING`."""
_ORTHOGONAL = 1e-6
"""Cosine of the angle between the residuals and their change by a parameter, below which it is zero. Where the
objective is stationary to all digits of a double it is 1.5e-8, their square root, times the root of the ratio of true
and linear curvature, which may be some thousands. Along a combination with a thousandth of the largest effect, the
least that counts as determined, such a cosine stands for a decrease of the objective by 1e-6, see `_NEARLY_SAME`."""


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
    """A problem, the parameters that move, the side constraint, and the rows of the smallest change where it is sought.

    `first` is the objective of the problem where the update starts. `within` are lower and upper limits (k,) of the
    steps, closer than the bounds where the model holds in a part of them only; the bounds where it is None.

    The sum of squares of residuals and side constraint is χ²; the objective is half of it, with the rows of the
    smallest change added.
    """

    problem: UpdateProblem
    moving: Flags
    side: SideConstraint
    change: SideConstraint | None = None
    first: float = 0.0
    within: tuple[Reals, Reals] | None = None

    @property
    def limits(self) -> tuple[Reals, Reals]:
        """(k,) each, between which steps end."""
        return self.within or self.problem.parameters.bounds

    def point(self, evaluation: Evaluation) -> Point:
        """The evaluation with the side constraints."""
        rows = [side.rows(evaluation.x) for side in (self.side, self.change) if side is not None]
        residuals = np.concatenate([evaluation.residuals, *(values for values, _ in rows)])
        return Point(evaluation, residuals, np.vstack([evaluation.jacobian, *(matrix for _, matrix in rows)]))

    def objective(self, evaluation: Evaluation) -> float:
        """½ rᵀr of an evaluation that may lack derivatives, side constraints included."""
        sides = [side for side in (self.side, self.change) if side is not None]
        return evaluation.objective + sum(_half_square(side.rows(evaluation.x)[0]) for side in sides)

    def chi_square(self, evaluation: Evaluation) -> float:
        """Sum of squares of residuals and side constraint, unless this acts on the change of one iteration only."""
        whole = 0.0 if self.side.renewed else _half_square(self.side.rows(evaluation.x)[0])
        return 2.0 * (evaluation.objective + whole)

    def local(self, point: Point) -> LocalModel:
        """The linear model there, with the distances to the limits; zero for fixed parameters."""
        lower, upper = self.limits
        room = np.where(self.moving, lower - point.x, 0.0), np.where(self.moving, upper - point.x, 0.0)
        return LocalModel(point.residuals, point.jacobian, *room, self.scale(point.x), self.side.held)

    def scale(self, x: Reals) -> Reals:
        """(k,) lengths in which steps are measured: a parameter's size, or its prior standard deviation if smaller.

        Bounds that are wide beside the nominal value must not make steps long.
        """
        parameters = self.problem.parameters
        size = np.maximum(np.abs(parameters.denormalise(x)), np.abs(parameters.nominal)) / parameters.scale
        sd = parameters.prior[1]
        return np.asarray(np.where(size > 0.0, np.minimum(size, sd), sd))

    def moved(self, x: Reals, d: Reals) -> Reals:
        """x + d, kept inside the limits against rounding."""
        lower, upper = self.limits
        return np.where(self.moving, np.clip(x + d, lower, upper), x)

    def bounds_touched(self, x: Reals) -> tuple[Flags, Flags]:
        """Moving parameters that touch the lower and the upper bound."""
        lower, upper = self.problem.parameters.bounds
        width = upper - lower
        low = x - lower <= _AT_BOUND * np.minimum(width, 1.0 + np.abs(lower))
        high = upper - x <= _AT_BOUND * np.minimum(width, 1.0 + np.abs(upper))
        return low & self.moving, high & self.moving

    def at_bound(self, x: Reals) -> Flags:
        """Moving parameters that touch a bound."""
        low, high = self.bounds_touched(x)
        return np.asarray(low | high)

    def certificate(self, point: Point) -> Certificate:
        """How far a point is from the first-order conditions of a minimum inside the bounds."""
        lower, upper = self.problem.parameters.bounds
        scale = self.scale(point.x)
        slope = np.where(self.moving, scale * (point.jacobian.T @ point.residuals), 0.0)
        step = np.clip(point.x - scale * slope, lower, upper) - point.x
        names = [p.name for p in self.problem.parameters.free]
        low, high = self.bounds_touched(point.x)
        multipliers = {n: float(g) for n, g, at in zip(names, slope, low) if at}
        multipliers |= {n: float(-g) for n, g, at in zip(names, slope, high) if at}
        left = max(self.best_gain(point), 0.0) / point.objective if point.objective > 0.0 else 0.0
        return Certificate(float(np.abs(step / scale).max(initial=0.0)), left, multipliers)

    def optimum(self, point: Point) -> Status:
        """Status of a stationary point."""
        bound = self.at_bound(point.x)
        known = replace(self, change=None).of_result(point.evaluation)
        if not self.determined(known, self.moving & ~bound):
            return Status.UNDETERMINED
        if bound.any():
            return Status.CONVERGED_AT_BOUNDS
        exact = 0.5 * self.chi_square(point.evaluation) < max(1e-16, self.rounding(point))
        return Status.EXACT if exact and self.all_zero(point) else Status.CONVERGED

    def of_result(self, evaluation: Evaluation) -> Point:
        """The evaluation with what determines the result: a side constraint of single steps does not."""
        side = NoRegularisation().side(len(evaluation.x)) if self.side.renewed else self.side
        return replace(self, side=side).point(evaluation)

    def best_gain(self, point: Point) -> float:
        """Predicted decrease of the objective of the result within the bounds."""
        local = self.local(self.of_result(point.evaluation))
        return local.gain(local.step())

    def rounding(self, point: Point) -> float:
        """Objective below which residuals are rounding: 1e-7 of their change by a whole length of step.

        Where modes cross, the derivatives of their shapes are far above all others and are no measure of rounding,
        unless the objective has fallen to a tiny part of its first value.
        """
        changes, most = self._changes(point)
        whole, without = (_half_square(_RELATIVE_ROUNDING * c) for c in (changes, np.minimum(changes, most)))
        return min(whole, max(without, _TINY_PART * self.first))

    def all_zero(self, point: Point) -> bool:
        """True if each residual by itself is rounding: a tiny standard deviation of one does not concern others."""
        changes, _ = self._changes(point)
        known = self.of_result(point.evaluation).residuals
        return bool((np.abs(known) <= np.maximum(_ZERO_RESIDUAL, _ROUNDING_OF_ONE * changes)).all())

    def stationary(self, point: Point) -> bool:
        """True if the residuals are orthogonal to their change by each parameter, to rounding.

        Rounding of the objective hides smaller slopes: no step reduces it. The linear model can still predict a
        decrease, because at a minimum with as many residuals as parameters the Jacobian of non-zero residuals loses
        rank. Rows of modes that cross count no more than in `rounding`. Source: Moré, Garbow and Hillstrom (1980).
        """
        known, scale = self.of_result(point.evaluation), self.scale(point.x)
        changes, most = self._changes(point)
        scaled = without(self._scaled(point), self.side.held * scale)
        slope = scaled.T @ known.residuals
        low, high = self.bounds_touched(point.x)
        blocked = (low & (slope > 0.0)) | (high & (slope < 0.0))
        rows = scaled * np.minimum(1.0, most / np.where(changes > 0.0, changes, 1.0))[:, None]
        sizes = np.linalg.norm(rows, axis=0) * np.linalg.norm(known.residuals)
        return bool((np.abs(slope) <= _ORTHOGONAL * sizes)[~blocked].all())

    def modes_cross(self, point: Point) -> bool:
        """True if some residuals and one combination of parameters are far more sensitive than all others.

        The shapes of two modes that nearly cross turn into each other by a tiny change of this combination.
        """
        changes, most = self._changes(point)
        if not (changes > most).any() or point.objective < _TINY_PART * self.first:
            return False
        s = np.linalg.svd(self._scaled(point), compute_uv=False)
        return len(s) > 1 and bool(s[0] > _CROSSING_RATIO * s[1])

    def _scaled(self, point: Point) -> Reals:
        """(n, k) changes of the residuals of the result by a whole length of step of each parameter that moves."""
        return np.asarray(self.of_result(point.evaluation).jacobian * self.scale(point.x) * self.moving)

    def _changes(self, point: Point) -> tuple[Reals, float]:
        """(n,) changes of the residuals by a whole length of step, and the largest one of modes that do not cross."""
        changes = np.linalg.norm(self._scaled(point), axis=1)
        return changes, _CROSSING_RATIO * float(np.quantile(changes[changes > 0.0], 0.25)) if changes.any() else 0.0

    def determined(self, point: Point, which: Flags) -> bool:
        """True if the data determine all combinations of some parameters."""
        scaled = (point.jacobian * self.problem.parameters.prior[1])[:, which]
        return determined_combinations(scaled) == scaled.shape[1]


def _half_square(values: Reals) -> float:
    return 0.5 * float(values @ values)


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

_SAME_OBJECTIVE = 1e-10
"""Predicted relative decrease of the objective that the rounding of sums of squares hides."""
_NEARLY_SAME = 1e-6
"""Relative decrease of the objective that no result shows: χ² is reported with fewer digits."""
_ZERO_OBJECTIVE = 1e-24
"""Objective of residuals of about 1e-12: an exact fit."""
MANY_PAIRING_CHANGES = 6
"""Iterations with a change of pairing, beyond which the search is taken to cycle between pairings. A search may pass
several crossings on its way."""
_WORTH_A_JUMP = 1e-7
"""Relative decrease that the linear model must predict beyond a crossing of modes for a jump across it."""
_MOST_JUMPS = 8
"""Jumps in one update; each is followed by a search of its own."""
_MOST_FAILED_JUMPS = 3
"""Jumps in a row without a lower objective, after which no more are tried."""
_DAMPING_OF_JUMP = 1e-2
"""Damping of the step that crosses: it hardly shortens well determined directions and keeps the others small."""
_STALL_ITERATIONS = 20
"""Iterations over which progress is judged: enough that a slow turn of a curved valley is not taken for the end."""
_LITTLE_PROGRESS = 1e-4
"""Relative decrease of the objective over these iterations that is no progress."""
_MUCH_PREDICTED = 1e-3
"""Relative decrease predicted for a single step, above which little progress means that steps fail."""
_MOST_WEIGHTS = 12
"""Weights tried for the smallest change; each is a search from the last end."""
_MARGIN_AIM = 0.9
"""Part of the allowed increase of χ² that is aimed at: below 1, because the linear model misses it and more than all of
it is refused."""
_MARGIN_REACHED = 0.75
"""Part of the allowed increase from which no further weight is tried."""
_MARGIN_TOLERANCE = 0.05
"""Part of the allowed increase that does not matter."""


@dataclass(frozen=True)
class SensitivityMethod:
    """Settings of the iteration, put together from parts.

    Parameters
    ----------
    max_iterations : accepted steps at most
    tolerance : largest change that counts as none, relative to a parameter's size or prior standard deviation
    regularisation : side constraints, settled at the first iteration and kept
    search : how the length of a step is found
    adapt : whether a weight that a rule finds is found again at every iteration, instead of being kept from the first
    smallest_change : where the data leave combinations undetermined, the result is the smallest change whose χ² exceeds
        the minimum inside the bounds by at most this, see `SmallestChange`; zero for that minimum itself. It counts in
        units of the variance that the residuals show where that is smaller than stated, or where none is stated
    """

    max_iterations: int = 250
    tolerance: float = 1e-8
    regularisation: Regularisation = field(default_factory=NoRegularisation)
    search: Search = field(default_factory=LevenbergMarquardt)
    adapt: bool = False
    smallest_change: float = ALLOWED


def update(
    problem: UpdateProblem,
    method: SensitivityMethod = SensitivityMethod(),
    report: Report = lambda i: None,
    start: Evaluation | None = None,
    active: Sequence[str] | None = None,
    within: tuple[Reals, Reals] | None = None,
    leads_back: Callable[[Evaluation], bool] = lambda at: False,
) -> UpdateResult:
    """Move the parameters inside their bounds until model and test agree as well as they can.

    Parameters
    ----------
    report : is called with every iteration
    start : the problem where the update starts, with derivatives; at x = 0 where it is None
    active : names of the parameters that move, all where it is None; the others stay where `start` has them
    within : (k,) each, lower and upper limits of the normalised parameters inside the bounds, with the start between
        them. Bounds, priors and uncertainty stay those of the problem
    leads_back : whether the steps from a point lead to a minimum that is known, so that the update ends there

    Raises
    ------
    FemtuneError : ``correlate.no-pairs``, ``update.unknown-parameter``, ``update.nothing-moves``, ``prior.*``, and what
        the first eigen-solution raises; later failures end in a status
    """
    before = start or problem.start(np.zeros(len(problem.parameters.free)))
    moving = moving_parameters(problem, active)
    side = method.regularisation.settle(linear_model(problem, before, moving))
    walk = Walk(problem, moving, side, first=before.objective, within=within)
    return _Update(walk, method, report, leads_back).go(before)


@dataclass(frozen=True)
class _End:
    """Where an iteration ended, and the number of the point in the history."""

    point: Point
    status: Status
    number: int


@dataclass(eq=False)
class _Update:
    walk: Walk
    method: SensitivityMethod
    report: Report
    leads_back: Callable[[Evaluation], bool]
    history: list[Iteration] = field(default_factory=list)
    best: tuple[int, Evaluation] | None = None
    changes: list[tuple[Evaluation, Evaluation]] = field(default_factory=list)
    joined: tuple[Joined, ...] = ()

    def go(self, before: Evaluation) -> UpdateResult:
        """The minimum inside the bounds, and the smallest change near it where it is asked for."""
        self._record(self.walk.point(before), 0.0, 0.0)
        end = self._minimum(before)
        small = None
        if end.status.ok and self._needs_smallest_change(end.point):
            end, small = self._smallest_change(end)
        if not end.status.ok and self.best is not None:
            number, evaluation = self.best
            end = _End(self.walk.point(evaluation), end.status, number)
        return _result(self.walk, before, end, self.history, small)

    def _minimum(self, at: Evaluation) -> _End:
        """Where the iterations from a point end, and from beyond the places that block them.

        Where two modes of the model nearly cross, their shapes turn into each other within a tiny change of the
        parameters. The objective has a wall or a narrow canyon there, in which only tiny steps reduce it. One long step
        without the directions that turn the shapes leads out. The best end is taken.
        """
        end, failed = self._iterate(at), 0
        if end.status == Status.PAIRING_CYCLES:
            end = self._with_joined(end)
        for _ in range(_MOST_JUMPS):
            if failed == _MOST_FAILED_JUMPS or not self._blocked(end):
                break
            failed += 1
            beyond = self._beyond(end.point, failed)
            if beyond is not None:
                moved = float(np.abs(beyond.x - end.point.x).max())
                self._record(beyond, moved, self.method.search.start, long_step=True)
                other = self._iterate(beyond.evaluation)
                if self._better(other.point.evaluation, end.point.evaluation):
                    out = other.point.objective < (1.0 - _LITTLE_PROGRESS) * end.point.objective
                    end, failed = other, 0 if out else failed
        return end

    def _with_joined(self, end: _End) -> _End:
        """The iteration from its best point on, with test modes whose pairing alternates compared as one subspace.

        Two modes of the model that are sometimes close enough for one subspace and sometimes not are different
        comparisons, so that the objective jumps; as a subspace they can be compared anywhere.
        """
        changed = [[(a.groups, b.groups) for a, b in zip(one.states, other.states)] for one, other in self.changes]
        joined = tuple(alternating(of_case) for of_case in zip(*changed))
        if self.best is None or not any(joined):
            return end
        point = self.walk.point(self.walk.problem.pair_again(self.best[1], joined))
        sentences = [describe_joined(s.case, j) for s, j in zip(point.evaluation.states, joined)]
        self.joined, self.best = joined, None
        moved = float(np.abs(point.x - end.point.x).max(initial=0.0))
        self._record(point, moved, self.method.search.start, tuple(s for of_case in sentences for s in of_case))
        self.history[-1] = replace(self.history[-1], merged=True)
        return self._iterate(point.evaluation)

    def _blocked(self, end: _End) -> bool:
        """True if no step was found where the linear model predicts a decrease, or the end lies where modes cross."""
        if self.walk.side.renewed or not (end.status.ok or end.status == Status.STALLED):
            return False
        point = end.point
        enough = max(_WORTH_A_JUMP * point.objective, self._negligible(point), self.walk.rounding(point))
        if point.objective < _ZERO_OBJECTIVE:
            return False
        return self.walk.best_gain(point) > enough or self.walk.modes_cross(point)

    def _beyond(self, point: Point, left_out: int) -> Point | None:
        """A point beyond the place that blocks the steps, with any objective; None if it cannot be solved."""
        d = self.walk.local(point).without_leading(left_out).step(_DAMPING_OF_JUMP)
        trial = self._try(point, d)
        return None if trial is None else self._paired(trial)

    def _iterate(self, at: Evaluation) -> _End:
        """All iterations from a point, and how they end."""
        point, first = self.walk.point(at), len(self.history) - 1
        state, status = self.method.search.start, self._finished(point, first)
        while status is None:
            taken, state, status = self._step(point, state)
            if taken is not None:
                trial, paired = taken
                moved = float(np.abs(trial.x - point.x).max(initial=0.0))
                events = _events(trial, paired.evaluation)
                self.changes += [(trial, paired.evaluation)] if events else []
                self._record(paired, moved, state, events)
                point = self._adapted(paired)
                status = self._finished(point, first)
        return _End(point, status, len(self.history) - 1)

    def _record(
        self, point: Point, moved: float, state: float, events: tuple[str, ...] = (), long_step: bool = False
    ) -> None:
        """Add a point to the history; it is the best if χ² is lower over what the best one compares."""
        made = _iteration(self.walk, len(self.history), point, moved, state, events)
        self.history.append(replace(made, long_step=long_step))
        self.report(self.history[-1])
        if self.best is None or self._better(point.evaluation, self.best[1]):
            self.best = len(self.history) - 1, point.evaluation

    def _better(self, new: Evaluation, old: Evaluation) -> bool:
        ours, theirs = new.squares, old.squares
        if not theirs.keys() <= ours.keys():
            return False
        gained = sum(value for key, value in ours.items() if key not in theirs)
        return self.walk.chi_square(new) - gained < self.walk.chi_square(old)

    def _needs_smallest_change(self, point: Point) -> bool:
        """Whether combinations are undetermined, those of parameters at bounds among them: noise drives them there.

        Combinations that a side constraint fixes need no other rule, nor do steps that are constrained.
        """
        side = self.walk.side
        asked = self.method.smallest_change > 0.0 and not len(side.held) and side.renewed is None
        return asked and not self.walk.determined(point, self.walk.moving)

    def _smallest_change(self, optimum: _End) -> tuple[_End, SmallestChange | None]:
        """The smallest change near a minimum; the minimum itself where none is found."""
        walk, at, smallest = self.walk, optimum, None
        change, weight = change_rows(walk.problem.parameters, walk.moving), 0.0
        for _ in range(_MOST_WEIGHTS):
            least, allowed = walk.chi_square(optimum.point.evaluation), self._allowed(optimum.point)
            point = walk.point(at.point.evaluation)
            reached = walk.chi_square(point.evaluation) - least
            last, weight = weight, weight_for(walk.local(point), change, point.x, _MARGIN_AIM * allowed - reached)
            if weight == last:
                break
            self.walk = replace(walk, change=replace(change, weight=weight))
            at, self.walk = self._iterate(point.evaluation), walk
            increase = walk.chi_square(at.point.evaluation) - least
            if not at.status.ok or at.point.evaluation.squares.keys() != point.evaluation.squares.keys():
                break
            if increase < -allowed:
                # the way led into a better minimum
                optimum = at = self._iterate(at.point.evaluation)
                smallest, weight = None, 0.0
                if not optimum.status.ok:
                    break
            elif increase <= (1.0 - _MARGIN_TOLERANCE) * allowed:
                sizes = (float(np.linalg.norm(change.rows(x)[0])) for x in (optimum.point.x, at.point.x))
                bounds = self.history[optimum.number].at_bound
                small = SmallestChange(optimum.point.x, bounds, least, allowed, increase, weight, *sizes)
                smallest = at, small
                if increase >= _MARGIN_REACHED * allowed:
                    break
        return smallest or (optimum, None)

    def _allowed(self, point: Point) -> float:
        """By how much the smallest change may increase χ².

        Residuals smaller than stated show weights, or deviations that are stated too large: the noise is theirs.
        """
        problem = self.walk.problem
        free = self.walk.moving & ~self.walk.at_bound(point.x)
        rank = determined_combinations((point.jacobian * problem.parameters.prior[1])[:, free])
        shown = self.walk.chi_square(point.evaluation) / max(len(point.residuals) - rank, 1)
        variance = shown if problem.scatter == "estimated" else min(shown, 1.0)
        return max(self.method.smallest_change * variance, 2.0 * self.walk.rounding(point))

    def _adapted(self, point: Point) -> Point:
        """The point with the side constraint that holds from there on: of the change from there, where it is of the
        change of each iteration, and with the weight that the rule finds there, where the weight is adapted."""
        if not self.method.adapt and self.walk.side.renewed is None:
            return point
        at = linear_model(self.walk.problem, point.evaluation, self.walk.moving)
        side = self.walk.side.settle(at)
        self.walk = replace(self.walk, side=reweighed(side, at) if self.method.adapt else side)
        return self.walk.point(point.evaluation)

    def _finished(self, point: Point, first: int) -> Status | None:
        """Status if the iteration that began with a point of the history ends at this one, otherwise None."""
        gain, changes = self._best_step(point)
        if gain <= _SAME_OBJECTIVE * point.objective or gain <= self._negligible(point):
            return self._optimum(point)
        if not changes:
            return self._end(point, failed=False)
        steps = self.history[first + 1 :]
        if sum(bool(i.events) for i in steps) > MANY_PAIRING_CHANGES:
            return Status.PAIRING_CYCLES
        if self._crawls(steps, gain):
            return Status.STALLED
        if self._settled(point, steps, gain):
            return self._optimum(point)
        if self.leads_back(point.evaluation):
            return Status.KNOWN_MINIMUM
        return Status.MAX_ITERATIONS if len(steps) >= self.method.max_iterations else None

    def _crawls(self, steps: list[Iteration], gain: float) -> bool:
        """True if many steps have hardly reduced the objective, far less than the linear model predicts for one."""
        if self.walk.change is not None or len(steps) < _STALL_ITERATIONS:
            return False
        before, now = steps[-_STALL_ITERATIONS].objective, steps[-1].objective
        return before - now < _LITTLE_PROGRESS * now and gain > _MUCH_PREDICTED * now

    def _settled(self, point: Point, steps: list[Iteration], gain: float) -> bool:
        """True if many steps and the linear model agree that no more than a tiny part of the objective is left.

        Along a flat, curved valley the steps would go on for hundreds of iterations.
        """
        if self.walk.change is not None or len(steps) < _STALL_ITERATIONS:
            return False
        enough = _NEARLY_SAME * point.objective
        return gain < enough and steps[-_STALL_ITERATIONS].objective - steps[-1].objective < 0.1 * enough

    def _negligible(self, point: Point) -> float:
        """A decrease of the objective that does not matter: before the smallest change, a small part of its margin.

        The valley of what the data do not determine is flat, long and curved, and its lowest point has no meaning.
        """
        if self.walk.change is not None or not self._needs_smallest_change(point):
            return 0.0
        return 0.5 * _MARGIN_TOLERANCE * self._allowed(point)

    def _best_step(self, point: Point) -> tuple[float, bool]:
        """Predicted decrease of the objective within the bounds, and whether the step for it changes anything."""
        if point.objective < _ZERO_OBJECTIVE:
            return 0.0, False
        local = self.walk.local(point)
        d = local.step()
        return local.gain(d), not self._none(local, d)

    def _optimum(self, point: Point) -> Status:
        """The status where steps end: those that a side constraint shortens may end before the optimum."""
        limit = max(_NEARLY_SAME * point.objective, self.walk.rounding(point))
        if self.walk.side.renewed and point.objective >= _ZERO_OBJECTIVE and self.walk.best_gain(point) > limit:
            return Status.SHORT_STEPS
        return self.walk.optimum(point)

    def _none(self, local: LocalModel, d: Reals) -> bool:
        """True if a step changes nothing."""
        return bool(np.abs(d / local.scale).max(initial=0.0) <= self.method.tolerance)

    def _step(self, point: Point, state: float) -> tuple[tuple[Evaluation, Point] | None, float, Status | None]:
        """The next accepted point, before and after pairing is repeated, and the state; or the status that ends it."""
        search, local, failed, rejected = self.method.search, self.walk.local(point), False, 0
        trying: float | None = state
        while trying is not None:
            state = trying
            d = search.step(local, state)
            if self._none(local, d):
                break
            trial = self._try(point, d)
            gain = -np.inf if trial is None else self._gain(local, d, point, trial)
            if trial is not None and not search.accepts(gain):
                trial, gain = self._corrected(local, d, state, point, trial) or (trial, gain)
            elif trial is not None:
                trial = self._lengthened(d, gain, point, trial)
            paired = None if trial is None or not search.accepts(gain) else self._paired(trial)
            if trial is not None and paired is not None:
                return (trial, paired), search.longer(state, gain), None
            if trial is None or search.accepts(gain):
                failed, gain = True, -np.inf
            trying = search.shorter(state, gain, rejected)
            rejected += 1
        return None, state, self._end(point, failed)

    def _lengthened(self, d: Reals, gain: float, point: Point, trial: Evaluation) -> Evaluation:
        """The trial of a longer step in the same direction where that is better, otherwise the trial."""
        factor = self.method.search.further(gain)
        longer = self._try(point, factor * d) if factor > 1.0 else None
        if longer is None or longer.squares.keys() != trial.squares.keys():
            return trial
        return longer if self.walk.objective(longer) < self.walk.objective(trial) else trial

    def _corrected(
        self, local: LocalModel, d: Reals, state: float, point: Point, rejected: Evaluation
    ) -> tuple[Evaluation, float] | None:
        """The trial of the corrected step after a rejected one, and its gain; None if there is none."""
        before = point.evaluation
        if rejected.squares.keys() != before.squares.keys():
            return None
        # side constraints are linear and have no error
        error = np.zeros(len(point.residuals))
        error[: len(before.residuals)] = rejected.residuals - before.residuals - before.jacobian @ d
        turned = self.method.search.corrected(local, d, state, error)
        trial = None if turned is None else self._try(point, turned)
        return None if trial is None else (trial, self._gain(local, d, point, trial))

    def _end(self, point: Point, failed: bool) -> Status:
        """The status if no step was accepted: rounding at an optimum, trial points that cannot be solved, or
        stalled."""
        small = max(_NEARLY_SAME * point.objective, self.walk.rounding(point))
        if self._best_step(point)[0] <= small or self.walk.stationary(point):
            return self._optimum(point)
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
            return self.walk.point(self.walk.problem.pair_again(trial, self.joined))
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
    half = 0.5 * walk.chi_square(point.evaluation)
    mean, small = point.evaluation.mean_error, walk.change is not None
    modes = tuple(_modes(point.evaluation))
    functions = tuple(fitted_frfs(point.evaluation))
    return Iteration(
        number=number,
        objective=half,
        mean_error=mean,
        x=point.x,
        step=moved,
        damping=state,
        at_bound=names,
        events=events,
        to_smallest_change=small,
        modes=modes,
        functions=functions,
    )


def _modes(evaluation: Evaluation) -> Iterator[IterationMode]:
    """Modes of the states whose pairs residuals have formed: the record costs no further solution."""
    for state in evaluation.states:
        if state.solved is None or not any(r.on_modes for r in state.case.residuals):
            continue
        for pair in state.pairs(derivatives=False):
            freq_hz = float(np.sqrt(max(pair.eigenvalue, 0.0)) / (2.0 * np.pi))
            agreement = mac_where_defined(pair.test_shape[:, None], pair.shape[:, None])[0, 0]
            yield IterationMode(state.case.name, pair.label, pair.test_hz, freq_hz, float(agreement))


def _result(
    walk: Walk, before: Evaluation, end: _End, history: list[Iteration], small: SmallestChange | None
) -> UpdateResult:
    parameters, at = walk.problem.parameters, end.point.evaluation
    active = tuple(p.name for p, moves in zip(parameters.free, walk.moving) if moves)
    cited = ("mottershead2011", "friswell1995", "fox1968", "dailey1989")
    return UpdateResult(
        parameters=parameters,
        status=end.status,
        x=at.x,
        before=before,
        after=at,
        history=tuple(history),
        covariance=_covariance(walk, at),
        citations=cited,
        active=active,
        side=walk.side,
        number=end.number,
        certificate=certificate(walk, at, small),
        smallest_change=small,
    )


def certificate(walk: Walk, at: Evaluation, small: SmallestChange | None) -> Certificate:
    """The certificate of a result, as the minimum of χ² or as the smallest change."""
    change = None if small is None else change_rows(walk.problem.parameters, walk.moving, small.weight)
    walk = replace(walk, change=change)
    return walk.certificate(walk.point(at))


def _covariance(walk: Walk, at: Evaluation) -> ParameterCovariance:
    spread = walk.problem.parameters.prior[1]
    jacobian = without(at.jacobian * spread, walk.side.held * spread) / spread
    return parameter_covariance(
        r=at.residuals,
        J=jacobian,
        kinds=at.kinds,
        extra=walk.side.prior_rows,
        at_bound=walk.at_bound(at.x),
        prior_sd=spread,
        moving=walk.moving,
        scatter=walk.problem.scatter,
        lost=at.lost,
        box=_box(walk.problem.parameters, walk.side, at),
    )


def with_noise(result: UpdateResult, noise: Reals) -> UpdateResult:
    """The result with the covariance that follows from errors of the data that are not independent.

    Parameters
    ----------
    noise : (k, k) covariance of Jᵀe in units of the prior standard deviations, see `parameter_covariance`
    """
    return replace(result, covariance=_covariance_at_end(result, "stated", noise))


def not_narrowed(result: UpdateResult) -> UpdateResult:
    """The result with intervals for which estimated errors are at least as large as the stated standard deviations.

    Parameters
    ----------
    result : of a problem whose scatter is "estimated"
    """
    return replace(result, covariance=_covariance_at_end(result, "estimated", None))


def _covariance_at_end(result: UpdateResult, scatter: Scatter, noise: Reals | None) -> ParameterCovariance:
    """The covariance at the end of an update, of errors that are not below the stated ones."""
    parameters, side, at = result.parameters, result.side, result.after
    spread, names = parameters.prior[1], np.array([p.name for p in parameters.free])
    turn = without(np.eye(len(spread)), side.held * spread)
    return parameter_covariance(
        r=at.residuals,
        J=at.jacobian * spread @ turn / spread,
        kinds=at.kinds,
        extra=side.prior_rows,
        at_bound=np.isin(names, result.at_bound),
        prior_sd=spread,
        moving=np.isin(names, result.active),
        scatter=scatter,
        lost=at.lost,
        box=_box(parameters, side, at),
        noise=None if noise is None else turn.T @ noise @ turn,
        may_narrow=False,
    )


def _box(parameters: ParameterSet, side: SideConstraint, at: Evaluation) -> Box:
    """The bounds, and how the side constraint acts there: as a prior, or as an opinion that only moves the estimate."""
    values, rows = side.rows(at.x)
    prior = np.broadcast_to(side.informative, len(values))
    lower, upper = parameters.limits
    return Box(at.x, lower, upper, values[prior], rows[~prior].T @ values[~prior])
