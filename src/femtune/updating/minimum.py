"""Is there a better minimum? After an update, other pairings that the MACs leave open are tried, and a few starts.

An update descends from its start, with pairs that follow from the MACs on its way. Where modes are close, or far from
the test's, it may end at a minimum at which some modes have the wrong partners, or in another valley.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy.special import chdtrc

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal.shape_criteria import mac_where_defined
from femtune.residuals import CaseState, Evaluation, PairedMode, UpdateProblem
from femtune.residuals.pairing import LOW_MAC, OtherPairing, crossed, in_order, other_pairings
from femtune.status import Status
from femtune.updating.kinds import TrialKind
from femtune.updating.result import Iteration, MinimumSearch, Trial, UpdateResult
from femtune.updating.search import GaussNewton
from femtune.updating.sensitivity_method import Point, SensitivityMethod, Walk, moving_parameters, update
from femtune.updating.starts import StartRules, objective_over, starting_points, united

BETTER = 1e-3
"""Part of χ² by which another minimum has to be lower: less is the tolerance of the iterations."""
_SUSPECT = 0.05
"""Probability of χ² by chance below which the residuals are reason enough to look for another minimum."""
_LEAST_EFFORT = 10
"""Iterations that trials may take at least, where the update itself took few."""
_FIRST_STEPS = 10
"""Iterations after which a start is given up if the linear model does not expect a better minimum: most starts that
find one are near it by then."""
_CURVED_GAIN = 3.0
"""Decrease of the objective that may be left, relative to that which the linear model expects, where it is curved."""
_LEADS_BACK = 0.5
"""Distance from a known minimum, in the size that its residuals have, to which a single step of the linear model leads
from points that lie in its valley; and part of the distance that may be left."""

_MOST_RANKED = 40
"""Other pairings that are assessed by the linear model: each costs the derivatives of one or two pairs."""
_WORSE = 0.01
"""Frequency error from which it matters that it has grown."""


@dataclass(frozen=True)
class MinimumRules:
    """How much is tried beyond an update.

    Parameters
    ----------
    swaps : other pairings at most
    samples : points over the bounds at which χ² is evaluated, where a model is cheap
    starts : of these points, those with the least χ² from which the update is repeated
    effort : iterations with other pairings, and once more with other starts, as a multiple of those of the update
    small_effort : the same where the model is small
    small_dofs : free DOFs of all full models together up to which a model is small. There and on reduced models starts
        are tried, and on larger ones a single pairing; the others are named
    """

    swaps: int = 4
    samples: int = 40
    starts: int = 4
    effort: float = 1.0
    small_effort: float = 4.0
    small_dofs: int = 1_000


def look_further(
    problem: UpdateProblem,
    method: SensitivityMethod,
    result: UpdateResult,
    rules: MinimumRules = MinimumRules(),
    report: Callable[[Iteration], None] = lambda i: None,
) -> UpdateResult:
    """The better minimum of an update, with what was tried for it in `UpdateResult.minimum`.

    With another pairing the update goes on from its end, the pairs held; from where this ends it goes on with pairs by
    their MACs again. Where pairs cross that agree badly, it is repeated from the initial values with all pairs in the
    order of their frequencies. A trial becomes the result if it ends at an optimum whose χ² is lower over the same
    comparisons: test modes without a partner at one of the two ends are compared with the nearest model mode there.

    Parameters
    ----------
    result : the update of the problem
    report : is called with every iteration that becomes a part of the history
    """
    search = _Search(problem, replace(method, regularisation=result.side), rules, result, report)
    return search.go()


@dataclass(eq=False)
class _Search:
    problem: UpdateProblem
    method: SensitivityMethod
    rules: MinimumRules
    best: UpdateResult
    report: Callable[[Iteration], None]
    trials: list[Trial] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.used = len(self.best.history) - 1
        dofs = [case.configured.n_free for case in self.problem.cases if case.full is None]
        self._small = bool(dofs) and sum(dofs) <= self.rules.small_dofs
        self._reduced = not dofs

    def go(self) -> UpdateResult:
        """The better minimum."""
        first, reasons = self.best, self._reasons() if self._applies else []
        left: list[str] = []
        if reasons:
            if self._compares_modes:
                self._untangle()
                left = self._pairings()
            if self._small or self._reduced:
                before_starts = self.best
                self._starts()
                if self._compares_modes and self.best is not before_starts:
                    left = self._pairings()
        before = now = 2.0 * first.objective
        if self.best is not first:
            tests = united([first.after.tests, self.best.after.tests])
            before, now = (2.0 * objective_over(self.problem, r, tests) for r in (first, self.best))
        made = MinimumSearch(tuple(reasons), before, now, tuple(self.trials), tuple(left), self.used)
        return replace(self.best, minimum=made)

    @property
    def _compares_modes(self) -> bool:
        return any(block.of_mode for block in self.best.after.blocks)

    @property
    def _applies(self) -> bool:
        """False where the way belongs to the answer: full steps of a textbook, constraints of single steps."""
        method, side = self.method, self.best.side
        own_way = isinstance(method.search, GaussNewton) or method.adapt or side.renewed is not None
        return method.max_iterations > 0 and not own_way

    def _reasons(self) -> list[str]:
        """What suggests another minimum; an exact fit and a good one with clear pairs need none."""
        at, out = self.best.after, []
        if self.best.status == Status.EXACT or not at.blocks:
            return []
        if not self.best.status.ok:
            out.append("the update did not end at an optimum")
        if self._compares_modes:
            lowest = min(macs_of_pairs(at), default=1.0)
            out += [f"the lowest MAC of a pair is {lowest:.2f}"] if lowest < LOW_MAC else []
            out += ["the pairing of modes changed during the update"] if self.best.events else []
        free = at.independent - len(self.best.x)
        if self.problem.scatter == "stated" and free > 0 and chdtrc(free, 2.0 * at.objective) < _SUSPECT:
            out.append("the residuals are larger than noise of the stated size")
        if self._compares_modes and _grown_error(self.best):
            out.append("a frequency is worse than at the start")
        return out

    def _spare(self, kind: TrialKind) -> int:
        """Iterations that are left for trials of a kind."""
        effort = self.rules.small_effort if self._small else self.rules.effort
        allowed = max(int(effort * self.used), _LEAST_EFFORT)
        return allowed - sum(trial.iterations for trial in self.trials if trial.kind == kind)

    def _untangle(self) -> None:
        """The update from the initial values with all pairs held in the order of their frequencies.

        It is tried where pairs cross that do not agree well. Where modes of two families lie close together, such as
        bending in two directions, a wrong order of the families at the initial values crosses many pairs at once, and
        no exchange of a few of them leads out.
        """
        end, first = self.best.after.states, self.best.before.states
        wrong = any(crossed(s.case, s.groups) for s in end if not s.case.fixed)
        if not wrong or min(macs_of_pairs(self.best.after), default=1.0) >= LOW_MAC:
            return
        ordered = [s.with_groups(in_order(s.case, s.groups)) if s.groups else s for s in first]
        self._judge("pairing", "all pairs in the order of their frequencies", partial(self._ordered, ordered))

    def _ordered(self, states: list[CaseState]) -> _Way:
        held = replace(self.problem, pairing_held=True)
        start, spare = held.assess(self.best.before.x, states), self._spare("pairing")
        way = self._update("pairing", held, start, smallest=False, most=max(spare // 2, _LEAST_EFFORT))
        left = max(spare - len(way.history) + 1, _LEAST_EFFORT)
        result = self._update("pairing", self.problem, self.problem.start(way.x), most=left)
        return _Way(result, (*way.history, *result.history[1:]))

    def _pairings(self) -> list[str]:
        """Other pairings from the best end, again from every better one; those that are left, in words."""
        known = sum(trial.kind == "pairing" for trial in self.trials)
        most, tried = self.rules.swaps if self._small or self._reduced else 1 - known, set[str]()
        while True:
            open_ = [one for one in self._ranked() if one.sentence not in tried]
            if not open_ or len(tried) >= most or self._spare("pairing") <= 0:
                return [one.sentence for one in open_]
            tried.add(open_[0].sentence)
            self._judge("pairing", open_[0].sentence, partial(self._swapped, open_[0]))

    def _ranked(self) -> list[OtherPairing]:
        """Other pairings by the objective that the linear model expects after a step with them."""
        at = self.best.after
        alternatives = [
            one
            for i, state in enumerate(at.states)
            if state.groups
            for one in other_pairings(i, state.case, state.groups, state.solution)
        ]
        if len(alternatives) < 2 or not (self._small or self._reduced):
            return alternatives
        walk = self._walk()
        worth = {}
        for one in alternatives[:_MOST_RANKED]:
            point = walk.point(self.problem.assess(at.x, self._states(one)))
            worth[one.sentence] = point.objective - walk.best_gain(point)
        return sorted(alternatives[:_MOST_RANKED], key=lambda one: worth[one.sentence])

    def _walk(self) -> Walk:
        return Walk(self.problem, moving_parameters(self.problem, self.best.active), self.best.side)

    def _states(self, one: OtherPairing) -> list[CaseState]:
        states = list(self.best.after.states)
        states[one.case] = states[one.case].with_groups(one.groups)
        return states

    def _swapped(self, one: OtherPairing) -> _Way:
        """The update with other pairs that are held, and from its end with pairs by their MACs."""
        held = replace(self.problem, pairing_held=True)
        way = self._update("pairing", held, held.assess(self.best.x, self._states(one)), smallest=False)
        tests = united([self.best.after.tests, way.after.tests])
        reached, before = (2.0 * objective_over(self.problem, r, tests) for r in (way, self.best))
        if not _lower(reached, before):
            return _Way(way, way.history, ends_held=True)
        result = self._update("pairing", self.problem, self.problem.start(way.x))
        return _Way(result, (*way.history, *result.history[1:]), held=reached)

    def _update(
        self,
        kind: TrialKind,
        problem: UpdateProblem,
        start: Evaluation,
        smallest: bool = True,
        most: int = 0,
        leads_back: Callable[[Evaluation], bool] = lambda at: False,
    ) -> UpdateResult:
        most = min(self.method.max_iterations, most or max(self._spare(kind), _LEAST_EFFORT))
        change = self.method.smallest_change if smallest else 0.0
        method = replace(self.method, max_iterations=most, smallest_change=change)
        return update(problem, method, start=start, active=self.best.active, leads_back=leads_back)

    def _starts(self) -> None:
        """Those points with the least χ² of many that are spread over the bounds."""
        if not self.rules.starts:
            return
        moving = moving_parameters(self.problem, self.best.active)
        points = starting_points(self.problem.parameters, StartRules(self.rules.starts, samples=self.rules.samples))
        points = np.where(moving, points, self.best.before.x)
        heights = np.array([self._height(x) for x in points])
        order = [int(i) for i in np.argsort(heights, kind="stable") if np.isfinite(heights[i])][: self.rules.starts]
        for i, at in enumerate(order, start=1):
            if self._spare("start") <= 0:
                return
            sentence = f"start {i} of {len(order)}, chosen from {len(points)} points"
            self._judge("start", sentence, partial(self._from, points[at]))

    def _height(self, x: Reals) -> float:
        """½ rᵀr of a point over the test modes that the best end compares; infinite where it is not solved."""
        try:
            at = self.problem.assess(x, self.problem.solved(x), derivatives=False)
            values, _ = self.best.side.rows(x)
            return self.problem.over(at, united([self.best.after.tests, at.tests])) + 0.5 * float(values @ values)
        except FemtuneError:
            return np.inf

    def _from(self, x: Reals) -> _Way:
        """The update from a point, given up where its steps lead back to the best end, and after some steps where the
        linear model expects no better minimum."""
        valley = Valley.of(self._walk(), self.best)
        first = self._update(
            "start", self.problem, self.problem.start(x), smallest=False, most=_FIRST_STEPS, leads_back=valley.holds
        )  # fmt: skip
        if first.status is Status.KNOWN_MINIMUM:
            return _Way(first, first.history, leads_back=True)
        if not first.status.ok:
            tests, walk = united([self.best.after.tests, first.after.tests]), self._walk()
            new, old = (objective_over(self.problem, r, tests) for r in (first, self.best))
            if new - _CURVED_GAIN * walk.best_gain(walk.point(first.after)) > old:
                return _Way(first, first.history)
        result = self._update("start", self.problem, first.after)
        return _Way(result, (*first.history, *result.history[1:]))

    def _judge(self, kind: TrialKind, sentence: str, trial: Callable[[], _Way]) -> None:
        """Make a trial, and keep the better end."""
        try:
            way = trial()
        except FemtuneError:
            self.trials.append(Trial(kind, sentence, np.inf, 2.0 * self.best.objective, 1, False))
            return
        tests = united([self.best.after.tests, way.end.after.tests])
        old, new = (2.0 * objective_over(self.problem, r, tests) for r in (self.best, way.end))
        fit = way.end.status.ok or not self.best.status.ok
        better = not way.ends_held and fit and _lower(new, old)
        iterations = max(len(way.history) - 1, 1)
        self.trials.append(Trial(kind, sentence, new, old, iterations, better, way.held, way.leads_back))
        if better:
            self._take(way, sentence, old, new)

    def _take(self, way: _Way, sentence: str, old: float, new: float) -> None:
        """The result with the way to it behind the history so far."""
        history, offset = list(self.best.history), len(self.best.history)
        told = f"a better minimum was found ({sentence}): χ² {old:.5g} before, {new:.5g} now"
        for i, iteration in enumerate(way.history, start=1):
            last = told if i == len(way.history) else ""
            history.append(replace(iteration, number=offset + i - 1, better_minimum=last))
            self.report(history[-1])
        number = len(history) - len(way.end.history) + way.end.number
        self.best = replace(way.end, before=self.best.before, history=tuple(history), number=number)


def _lower(new: float, old: float) -> bool:
    return new < (1.0 - BETTER) * old


@dataclass(frozen=True)
class _Way:
    """Where a trial ended, all points on its way, and χ² where its pairs were held; `ends_held`: it ended there;
    `leads_back`: it was given up, since its steps led back to the best end."""

    end: UpdateResult
    history: tuple[Iteration, ...]
    held: float | None = None
    ends_held: bool = False
    leads_back: bool = False


@dataclass(frozen=True, eq=False)
class Valley:
    """The points from which steps lead to a known minimum: they have its pairs, and a step of their own linear model
    leads next to it, nearer than they are.

    Parameters
    ----------
    walk, end : the problem and the minimum
    size : root mean square of the residuals there that no parameter changes
    """

    walk: Walk
    end: Point
    size: float

    @classmethod
    def of(cls, walk: Walk, result: UpdateResult) -> Valley:
        """Of the end of an update."""
        free = max(result.after.independent - int(walk.moving.sum()), 1)
        return cls(walk, walk.point(result.after), float(np.sqrt(2.0 * result.after.objective / free)))

    def holds(self, at: Evaluation) -> bool:
        """Whether a point with derivatives lies in it."""
        if any(a.groups != b.groups for a, b in zip(at.states, self.end.evaluation.states, strict=True)):
            return False
        point = self.walk.point(at)
        away, left = (self._distance(x) for x in (at.x, at.x + self.walk.local(point).step()))
        return left <= _LEADS_BACK * min(self.size, away) or away <= _LEADS_BACK * self.size

    def _distance(self, x: Reals) -> float:
        """Change of the residuals from the minimum, by its linear model."""
        return float(np.linalg.norm(self.end.jacobian @ (x - self.end.x)))


def _pairs(at: Evaluation) -> dict[tuple[str, int], PairedMode]:
    """Paired modes by configuration and position of the test mode."""
    pairs = (p for state in at.states if state.groups for p in state.pairs(derivatives=False))
    return {(p.case.name, p.position): p for p in pairs}


def macs_of_pairs(at: Evaluation) -> list[float]:
    """MAC of each pair that has one."""
    every = (mac_where_defined(p.test_shape[:, None], p.shape[:, None])[0, 0] for p in _pairs(at).values())
    return [float(mac) for mac in every if np.isfinite(mac)]


def _grown_error(result: UpdateResult) -> bool:
    """True if a frequency that is paired before and after has a larger error after, and one that matters."""
    before, after = _pairs(result.before), _pairs(result.after)
    errors = [(_error(before[key]), _error(after[key])) for key in before.keys() & after.keys()]
    return any(now > max(then, _WORSE) for then, now in errors)


def _error(pair: PairedMode) -> float:
    freq_hz = float(np.sqrt(max(pair.eigenvalue, 0.0)) / (2.0 * np.pi))
    return abs(freq_hz / pair.test_hz - 1.0) if pair.test_hz > 0.0 else 0.0
