"""Is there a better minimum? After an update, other pairings that the MACs leave open are tried, and a few starts.

An update descends from its start, with pairs that follow from the MACs on its way. Where modes are close, or far from the
test's, it may end at a minimum at which some modes are paired with the wrong partners, or simply in another valley.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import chdtrc

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.residuals import Evaluation, UpdateProblem
from femtune.residuals.pairing import LOW_MAC, OtherPairing, other_pairings
from femtune.status import Status
from femtune.updating.result import Iteration, UpdateResult
from femtune.updating.sensitivity_method import SensitivityMethod, Walk, moving_parameters, update
from femtune.updating.starts import StartRules, objective_over, starting_points, united

TrialKind = Literal["pairing", "start"]

BETTER = 1e-3
"""Part of χ² by which another minimum has to be lower: less is the tolerance of the iterations."""
_SUSPECT = 0.05
"""Probability of χ² by chance below which the residuals are reason enough to look for another minimum."""
_LEAST_EFFORT = 10
"""Iterations that trials may take at least, where the update itself took few."""


@dataclass(frozen=True)
class MinimumRules:
    """How much is tried beyond an update.

    Parameters
    ----------
    swaps : other pairings at most
    starts : other initial values at most, where a model is cheap
    effort : iterations of all trials, as a multiple of those of the update
    cheap_dofs : free DOFs of all full models together up to which a model is cheap; reduced models always are
    large_dofs : the same above which a single pairing is tried, and the others are named
    """

    swaps: int = 4
    starts: int = 6
    effort: float = 4.0
    cheap_dofs: int = 1_000
    large_dofs: int = 20_000


@dataclass(frozen=True)
class Trial:
    """Another pairing or start, and where it ended.

    Parameters
    ----------
    sentence : what was tried
    chi_square : at its end, over the comparisons of both ends; infinite where it was not solved
    before : χ² over the same comparisons of the best end until then
    iterations : that it took
    better : whether it became the result
    """

    kind: TrialKind
    sentence: str
    chi_square: float
    before: float
    iterations: int
    better: bool


@dataclass(frozen=True)
class MinimumSearch:
    """What was tried beyond an update.

    Parameters
    ----------
    reasons : why; none where nothing suggests another minimum, and nothing was tried
    first_chi_square : of the update as it had ended
    chi_square : over the same comparisons, of the result
    trials : in their order
    left : other pairings that were not tried, in words
    update_iterations : of the update itself
    """

    reasons: tuple[str, ...]
    first_chi_square: float
    chi_square: float
    trials: tuple[Trial, ...] = ()
    left: tuple[str, ...] = ()
    update_iterations: int = 0

    @property
    def improved(self) -> bool:
        """True if the result is a better minimum than that where the update had ended."""
        return any(trial.better for trial in self.trials)

    @property
    def iterations(self) -> int:
        """Of all trials."""
        return sum(trial.iterations for trial in self.trials)


def look_further(
    problem: UpdateProblem,
    method: SensitivityMethod,
    found: UpdateResult,
    rules: MinimumRules = MinimumRules(),
    report: Callable[[Iteration], None] = lambda i: None,
) -> tuple[UpdateResult, MinimumSearch]:
    """The better minimum of an update, and what was tried for it.

    With another pairing the update goes on from its end, the pairs held; from where this ends it goes on with pairs by
    their MACs again. A trial becomes the result if it ends at an optimum whose χ² is lower over the same comparisons:
    test modes without a partner at one of the two ends are compared with the nearest model mode there.

    Parameters
    ----------
    found : the update of the problem
    report : is called with every iteration that becomes a part of the history
    """
    search = _Search(problem, replace(method, regularisation=found.side), rules, found, report)
    return search.go()


@dataclass(eq=False)
class _Search:
    problem: UpdateProblem
    method: SensitivityMethod
    rules: MinimumRules
    best: UpdateResult
    report: Callable[[Iteration], None]

    def go(self) -> tuple[UpdateResult, MinimumSearch]:
        first, reasons = self.best, self._reasons()
        self.trials: list[Trial] = []
        self.used = len(first.history) - 1
        left: list[str] = []
        if reasons and self.method.max_iterations:
            left = self._pairings()
            if self._dofs() <= self.rules.cheap_dofs:
                self._starts()
        tests = united([first.after.tests, self.best.after.tests])
        before, now = (2.0 * objective_over(self.problem, r, tests) for r in (first, self.best))
        made = MinimumSearch(tuple(reasons), before, now, tuple(self.trials), tuple(left), self.used)
        return self.best, made

    def _reasons(self) -> list[str]:
        """What suggests another minimum; an exact fit and a good one with clear pairs need none."""
        at, out = self.best.after, []
        if self.best.status == Status.EXACT or not at.blocks:
            return []
        if not self.best.status.ok:
            out.append("the update did not end at an optimum")
        low = [p for p in _pairs(at) if p[1] < LOW_MAC]
        if low:
            out.append(f"the lowest MAC of a pair is {min(mac for _, mac in low):.2f}")
        if self.best.events:
            out.append("the pairing of modes changed during the update")
        free = at.independent - len(self.best.x)
        if self.problem.scatter == "stated" and free > 0 and chdtrc(free, 2.0 * at.objective) < _SUSPECT:
            out.append("the residuals are larger than noise of the stated size")
        if any(abs(after) > abs(before) and abs(after) > _WORSE for before, after in _frequency_errors(self.best)):
            out.append("a frequency is worse than at the start")
        return out

    def _dofs(self) -> int:
        """Free DOFs of the models on which it searches, those of reduced models aside."""
        return sum(case.configured.n_free for case in self.problem.cases if case.full is None)

    @property
    def _spare(self) -> int:
        """Iterations that are left for trials."""
        allowed = max(int(self.rules.effort * self.used), _LEAST_EFFORT)
        return allowed - sum(trial.iterations for trial in self.trials)

    def _pairings(self) -> list[str]:
        """Other pairings from the best end, again from every better one; those that are left, in words."""
        most = self.rules.swaps if self._dofs() <= self.rules.large_dofs else 1
        tried: set[str] = set()
        while True:
            open_ = [one for one in self._ranked() if one.sentence not in tried]
            if not open_ or len(tried) == most or self._spare <= 0:
                return [one.sentence for one in open_]
            tried.add(open_[0].sentence)
            self._judge("pairing", open_[0].sentence, lambda: self._swapped(open_[0]))

    def _ranked(self) -> list[OtherPairing]:
        """Other pairings by the objective that the linear model expects after a step with them."""
        at = self.best.after
        found = [
            one
            for i, state in enumerate(at.states)
            if state.groups
            for one in other_pairings(i, state.case, state.groups, state.solution)
        ]
        if len(found) < 2 or self._dofs() > self.rules.large_dofs:
            return found
        walk = self._walk()
        worth = {}
        for one in found[:_MOST_RANKED]:
            point = walk.point(self.problem.assess(at.x, self._states(one)))
            worth[one.sentence] = point.objective - walk.best_gain(point)
        return sorted(found[:_MOST_RANKED], key=lambda one: worth[one.sentence])

    def _walk(self) -> Walk:
        return Walk(self.problem, moving_parameters(self.problem, self.best.active), self.best.side)

    def _states(self, one: OtherPairing):  # type: ignore[no-untyped-def]
        states = list(self.best.after.states)
        states[one.case] = states[one.case].with_groups(one.groups)
        return states

    def _swapped(self, one: OtherPairing) -> tuple[UpdateResult | None, list[Iteration]]:
        """The update with other pairs that are held, and from its end with pairs by their MACs."""
        held = replace(self.problem, pairing_held=True)
        start = held.assess(self.best.x, self._states(one))
        way = self._update(held, start, smallest=False)
        tests = united([self.best.after.tests, way.after.tests])
        if not self._lower(2.0 * objective_over(held, way, tests), 2.0 * objective_over(self.problem, self.best, tests)):
            return None, list(way.history)
        found = self._update(self.problem, self.problem.start(way.x))
        return found, [*way.history, *found.history[1:]]

    def _update(self, problem: UpdateProblem, start: Evaluation, smallest: bool = True) -> UpdateResult:
        most = min(self.method.max_iterations, max(self._spare, _LEAST_EFFORT))
        change = self.method.smallest_change if smallest else 0.0
        method = replace(self.method, max_iterations=most, smallest_change=change)
        return update(problem, method, start=start, active=self.best.active)

    def _starts(self) -> None:
        """A few initial values spread over the bounds."""
        moving = moving_parameters(self.problem, self.best.active)
        points = starting_points(self.problem.parameters, StartRules(self.rules.starts))
        nominal = self.best.before.x
        for i, point in enumerate(points, start=1):
            if self._spare <= 0:
                return
            x = np.where(moving, point, nominal)
            self._judge("start", f"start {i} of {len(points)}", lambda x=x: self._from(x))  # type: ignore[misc]

    def _from(self, x: Reals) -> tuple[UpdateResult | None, list[Iteration]]:
        found = self._update(self.problem, self.problem.start(x))
        return found, list(found.history)

    def _judge(
        self, kind: TrialKind, sentence: str, trial: Callable[[], tuple[UpdateResult | None, list[Iteration]]]
    ) -> None:
        """Make a trial, and keep the better end."""
        try:
            found, way = trial()
        except FemtuneError:
            self.trials.append(Trial(kind, sentence, np.inf, 2.0 * self.best.objective, 1, False))
            return
        if found is None:
            self.trials.append(Trial(kind, sentence, 2.0 * way[-1].objective, 2.0 * self.best.objective, len(way) - 1, False))
            return
        tests = united([self.best.after.tests, found.after.tests])
        old, new = (2.0 * objective_over(self.problem, r, tests) for r in (self.best, found))
        better = self._lower(new, old) and (found.status.ok or not self.best.status.ok)
        self.trials.append(Trial(kind, sentence, new, old, max(len(way) - 1, 1), better))
        if better:
            self._take(found, way, sentence, old, new)

    def _take(self, found: UpdateResult, way: list[Iteration], sentence: str, old: float, new: float) -> None:
        """The result with the way to it behind the history so far."""
        history = list(self.best.history)
        event = f"a better minimum was found ({sentence}): χ² {old:.5g} before, {new:.5g} now"
        offset = len(history)
        for i, iteration in enumerate(way):
            events = (event, *iteration.events) if i == len(way) - 1 else iteration.events
            history.append(replace(iteration, number=offset + i, events=events, long_step=False))
            self.report(history[-1])
        number = offset + len(way) - len(found.history) + found.number
        self.best = replace(found, before=self.best.before, history=tuple(history), number=number)

    @staticmethod
    def _lower(new: float, old: float) -> bool:
        return new < (1.0 - BETTER) * old


_MOST_RANKED = 40
"""Other pairings that are assessed by the linear model: each costs the derivatives of one or two pairs."""
_WORSE = 0.01
"""Frequency error from which it matters that it has grown."""


def _pairs(at: Evaluation) -> list[tuple[str, float]]:
    from femtune.modal.shape_criteria import mac_where_defined

    out = []
    for state in at.states:
        for pair in state.pairs(derivatives=False) if state.groups else ():
            mac = float(mac_where_defined(pair.test_shape[:, None], pair.shape[:, None])[0, 0])
            if np.isfinite(mac):
                out.append((pair.label, mac))
    return out


def _frequency_errors(result: UpdateResult) -> list[tuple[float, float]]:
    """Relative errors of the test modes that are paired before and after."""
    before, after = ({(s.case.name, p.position): p for s in at.states if s.groups for p in s.pairs(derivatives=False)}
                     for at in (result.before, result.after))
    return [(_error(before[key]), _error(after[key])) for key in before.keys() & after.keys() if after[key].test_hz]


def _error(pair) -> float:  # type: ignore[no-untyped-def]
    return float(np.sqrt(max(pair.eigenvalue, 0.0)) / (2.0 * np.pi)) / pair.test_hz - 1.0
