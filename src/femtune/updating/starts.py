"""Multi-start update: initial points spread over the bounds; all results are kept and compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np
from scipy.special import chdtri, fdtri

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.executor import Executor, Serial, finish
from femtune.executor.interface import nothing
from femtune.parameters import ParameterSet
from femtune.residuals import Evaluation, UpdateProblem
from femtune.status import Status
from femtune.updating.regularisation import NoRegularisation, SideConstraint
from femtune.updating.result import UpdateResult
from femtune.updating.sensitivity_method import SensitivityMethod, linear_model, moving_parameters, update

# ----------------------------------------------------------------------------------------------------
# Ends of several starts: which are the same optimum, which are as good, and what that means.


SAME_END = 1e-3
"""Distance of two ends, relative to the range of the starts, within which they are one solution. Convergence leaves far
less."""
CONFIDENCE = 0.95
"""Confidence level of the region in which solutions are as good as the best one."""
EXACT_OBJECTIVE = 1e-16
"""Objective of residuals of about 1e-8: the model reproduces the data to half of the digits."""
_LEAST_FREEDOM = 3
"""Degrees of freedom from which the residuals tell their own size: with fewer the F limit is wider than any use."""


class StartOutcome(Enum):
    """Outcome of a start, compared with the others."""

    BEST = "reached the best optimum that was found"
    AS_GOOD = "reached another optimum that is equally good within the noise"
    WORSE = "reached an optimum with a higher objective"
    FEWER_DATA = "ended where fewer residuals are compared, so that its objective cannot be judged beside the others"
    UNFINISHED = "did not converge"
    FAILED = "could not be solved"


@dataclass(frozen=True, eq=False)
class StartResult:
    """One start, whether it succeeded or not.

    Parameters
    ----------
    start, end : (k,) normalised parameters; `end` is the start where it failed
    objective : ½ rᵀr at the end with the side constraint, NaN where it failed
    status : of the last update; None if it failed, for the reason in `problem`
    tries : how many times it set out: one, and one more for every hop from an end that was not good enough
    iterations : of all tries
    residuals : number of independent residuals at the end; test modes without a partner have none
    tests : test modes of each case that have a partner at the end
    common : ½ rᵀr over the test modes that have a partner at the end of any start, see `UpdateProblem.over`; NaN where
        it is not known
    """

    number: int
    start: Reals
    end: Reals
    objective: float
    status: Status | None
    tries: int = 1
    iterations: int = 0
    problem: str = ""
    residuals: int = 0
    tests: tuple[frozenset[int], ...] = ()
    common: float = float("nan")

    @classmethod
    def of(cls, number: int, start: Reals, result: UpdateResult, tries: int = 1, iterations: int = 0) -> StartResult:
        """The end of an update."""
        return cls(
            number, start, result.x, result.objective, result.status, tries, iterations,
            residuals=result.after.independent, tests=result.after.tests,
        )  # fmt: skip

    @property
    def compared(self) -> float:
        """The objective by which it is compared with other starts."""
        return self.objective if np.isnan(self.common) else self.common

    @property
    def at_optimum(self) -> bool:
        """True if the iteration converged, at any optimum."""
        return self.status is not None and self.status.ok


@dataclass(frozen=True, eq=False)
class Optimum:
    """Starts that reached the same point.

    Parameters
    ----------
    x, objective : of the best of them
    members : numbers of the starts that ended there
    as_good : True if it is equally good as the best within the noise
    """

    x: Reals
    objective: float
    members: tuple[int, ...]
    as_good: bool


def noise_level(best: float, n_residuals: int, n_parameters: int) -> float:
    """By how much the objective ½rᵀr may differ from the best for the data not to tell two points apart.

    Half the 95 % quantile of χ² of as many degrees of freedom as parameters; if the residuals have a smaller variance
    than stated, half that of F with the variance of the residuals: weights that are no standard deviations must not
    make every valley as good as the best one. An exact fit has no noise, and only exact fits are as good.
    """
    stated = 0.5 * float(chdtri(max(n_parameters, 1), 1.0 - CONFIDENCE))
    spare = n_residuals - n_parameters
    if best < EXACT_OBJECTIVE or spare < _LEAST_FREEDOM:
        return 10.0 * EXACT_OBJECTIVE if best < EXACT_OBJECTIVE else stated
    shown = max(n_parameters, 1) * float(fdtri(max(n_parameters, 1), spare, CONFIDENCE)) * best / spare
    return min(stated, shown)


def comparable(starts: Sequence[StartResult]) -> list[StartResult]:
    """The starts whose objectives can be compared: all whose objective over the same test modes is known.

    Otherwise those with as many residuals as any: a start from which fewer modes find their partners ends with smaller
    residuals for this reason alone. Starts that converged count before those that did not.
    """
    ends = [s for s in starts if s.status is not None]
    if not any(np.isnan(s.common) for s in ends):
        return ends
    most = max((s.residuals for s in [s for s in ends if s.at_optimum] or ends), default=0)
    return [s for s in ends if s.residuals == most]


def best_of(problem: UpdateProblem, results: Sequence[UpdateResult]) -> int:
    """Position of the update of a problem with the smallest objective over the same test modes; of an optimum if there
    is any."""
    tests = united([end.after.tests for end in results])
    ends = [
        replace(StartResult.of(i, end.x, end), common=objective_over(problem, end, tests))
        for i, end in enumerate(results)
    ]
    return min(ends, key=height).number


def objective_over(problem: UpdateProblem, result: UpdateResult, tests: Sequence[frozenset[int]]) -> float:
    """½ rᵀr of a result, side constraint included, over some test modes of each case, see `UpdateProblem.over`."""
    return result.objective - result.after.objective + problem.over(result.after, tests)


def united(several: Sequence[tuple[frozenset[int], ...]]) -> tuple[frozenset[int], ...]:
    """Test modes of each case that have a partner at any of several ends."""
    return tuple(frozenset().union(*of_case) for of_case in zip(*several, strict=True))


def height(start: StartResult) -> tuple[bool, float]:
    """Sort key of comparable starts: optima first, then by their objectives."""
    return not start.at_optimum, start.compared


def distinct_optima(starts: Sequence[StartResult], spread: Reals, noise: float) -> tuple[Optimum, ...]:
    """Converged results that can be compared in clusters, the best first.

    Two results are the same if no parameter differs by more than a thousandth of its prior standard deviation.
    """
    left = sorted((s for s in comparable(starts) if s.at_optimum), key=lambda s: (s.compared, s.number))
    best = left[0].compared if left else np.nan
    optimum_groups = []
    while left:
        first = left[0]
        same = [s for s in left if np.abs((s.end - first.end) / spread).max(initial=0.0) <= SAME_END]
        numbers = tuple(sorted(s.number for s in same))
        optimum_groups.append(Optimum(first.end, first.objective, numbers, first.compared - best <= noise))
        left = [s for s in left if s not in same]
    return tuple(optimum_groups)


def outcomes(starts: Sequence[StartResult], optima: Sequence[Optimum]) -> dict[int, StartOutcome]:
    """Outcome of each start, by its number."""
    at = {number: i for i, optimum in enumerate(optima) for number in optimum.members}
    out = {}
    for s in starts:
        if s.number in at:
            i = at[s.number]
            good = StartOutcome.AS_GOOD if optima[i].as_good else StartOutcome.WORSE
            out[s.number] = StartOutcome.BEST if i == 0 else good
        elif s.at_optimum:
            out[s.number] = StartOutcome.FEWER_DATA
        else:
            out[s.number] = StartOutcome.FAILED if s.status is None else StartOutcome.UNFINISHED
    return out


def start_sentences(starts: Sequence[StartResult], optima: Sequence[Optimum]) -> tuple[str, ...]:
    """Whether the starts reached the same optimum, in sentences."""
    n, outcome_counts = len(starts), outcomes(starts, optima)
    if not optima:
        return (f"None of {n} starts converged. The best point is kept; it is not an optimum.",)
    others = [o for o in optima[1:] if o.as_good]
    count = len(optima[0].members)
    out = [f"{count} of {n} starts reached the {'same' if count > 1 else 'best'} optimum."]
    if others:
        count = sum(len(o.members) for o in others)
        out.append(
            f"{count} {'start' if count == 1 else 'starts'} reached {len(others)} other "
            f"{'optimum that is' if len(others) == 1 else 'optima that are'} equally good within the noise; "
            "the result is not unique."
        )
    elif len(optima[0].members) == 1 and n > 1:
        out.append("No other start confirms it; more starts may find a better optimum.")
    worse = [o for o in optima if not o.as_good]
    if worse:
        count = sum(len(o.members) for o in worse)
        ends = "an optimum" if len(worse) == 1 else f"{len(worse)} optima"
        out.append(f"{count} {'start' if count == 1 else 'starts'} reached {ends} with a higher objective.")
    return (*out, *_nearest(starts), *_lost(outcome_counts))


def _nearest(starts: Sequence[StartResult]) -> list[str]:
    """Starts at whose end test modes without a partner are compared with the nearest model mode."""
    ends = [s for s in starts if s.at_optimum and not np.isnan(s.common)]
    every = united([s.tests for s in ends])
    fewer = sum(s.tests != every for s in ends)
    if not fewer:
        return []
    return [
        f"{fewer} {'start' if fewer == 1 else 'starts'} ended where fewer test modes find a partner; to compare the "
        "objectives, the others are compared there with the nearest model mode."
    ]


def _lost(found: dict[int, StartOutcome]) -> list[str]:
    values = list(found.values())
    unfinished, failed = values.count(StartOutcome.UNFINISHED), values.count(StartOutcome.FAILED)
    fewer = values.count(StartOutcome.FEWER_DATA)
    out = []
    if fewer:
        out.append(
            f"{fewer} {'start' if fewer == 1 else 'starts'} ended where fewer test modes are paired; "
            f"{'its objective is' if fewer == 1 else 'their objectives are'} not compared with the others."
        )
    if unfinished:
        out.append(f"{unfinished} {'start' if unfinished == 1 else 'starts'} did not converge.")
    return [*out, f"{failed} {'start' if failed == 1 else 'starts'} could not be solved."] if failed else out


@dataclass(frozen=True, eq=False)
class Sample:
    """A point at which the objective was evaluated before the starts were chosen.

    Parameters
    ----------
    number : position in the Latin hypercube, from 1
    objective : ½ rᵀr; NaN where the model could not be solved
    residuals : number of independent residuals
    """

    number: int
    x: Reals
    objective: float
    residuals: int = 0


@dataclass(frozen=True)
class StartRules:
    """Number of starts, and effort of each.

    Parameters
    ----------
    count, seed : the nominal values, and points of a Latin hypercube over the bounds
    samples : if it is not zero, the objective is evaluated at a Latin hypercube of so many points, and the starts are
        the nominal values and the best points, those with more residuals first
    hops : how many times a start whose end is worse than the best one sets out again: first from half way between its
        end and the middle of the bounds, then from points drawn at random
    """

    count: int = 20
    seed: int = 0
    hops: int = 0
    samples: int = 0


DEFAULT_METHOD = SensitivityMethod()
DEFAULT_RULES = StartRules()


@dataclass(frozen=True, eq=False)
class MultiStart:
    """All starts and what they found.

    Parameters
    ----------
    starts : in the order of their numbers
    optima : distinct ends, the best first
    noise : by how much objectives may differ for the data not to tell their points apart
    best : the update at the best end, with residuals and covariance; its history is that of its start's last try
    samples : where the objective was evaluated before; none where the starts are the points of the hypercube
    """

    parameters: ParameterSet
    starts: tuple[StartResult, ...]
    optima: tuple[Optimum, ...]
    noise: float
    best: UpdateResult = field(repr=False)
    samples: tuple[Sample, ...] = field(default=(), repr=False)

    @property
    def outcomes(self) -> dict[int, StartOutcome]:
        """Outcome of each start, by its number."""
        return outcomes(self.starts, self.optima)

    @property
    def unique(self) -> bool:
        """False if another optimum is equally good within the noise."""
        return sum(o.as_good for o in self.optima) <= 1

    @property
    def sentences(self) -> tuple[str, ...]:
        """Whether the starts reached the same optimum, in sentences."""
        return start_sentences(self.starts, self.optima)


def starting_points(parameters: ParameterSet, rules: StartRules) -> Reals:
    """(n, k) normalised points of a Latin hypercube over the bounds: of the samples if there are any, or the starts."""
    from scipy.stats import qmc  # noqa: PLC0415  half a second that an update from one start does not need

    lower, upper = parameters.bounds
    unit = qmc.LatinHypercube(len(lower), rng=np.random.default_rng(rules.seed)).random(rules.samples or rules.count)
    return np.asarray(lower + unit * (upper - lower))


def multi_start(
    problem: UpdateProblem,
    method: SensitivityMethod = DEFAULT_METHOD,
    rules: StartRules = DEFAULT_RULES,
    *,
    first: Sequence[UpdateProblem] = (),
    nominal: Evaluation | None = None,
    points: Reals | None = None,
    active: Sequence[str] | None = None,
    known: Mapping[tuple[int, int], StartResult] | None = None,
    report: Callable[[StartResult], None] | None = None,
    executor: Executor | None = None,
    sampled: Mapping[int, Sample] | None = None,
    report_sample: Callable[[Sample], None] | None = None,
) -> MultiStart:
    """Update from many initial points, keep every result, and state whether the result is unique.

    Parameters
    ----------
    first : problems of the same parameters that every start goes through before, each from where the former ended:
        reduced models, easier residuals, fewer modes; see `equation_error_phases`
    nominal : the problem at x = 0 where it is evaluated already; side constraints are settled there, once for all
    points : (n, k) normalised starting points in place of those of `rules`
    active : names of the parameters that move; the others stay at their nominal values
    known : ends of an earlier run of the same by (number, tries), which are not repeated
    report : is called with every end as soon as it is known
    executor : makes the runs; one after another where it is None
    sampled, report_sample : the same of the samples, by their number

    Raises
    ------
    FemtuneError : what the evaluation at the nominal values raises; later failures are kept as such
    """
    before = nominal or problem.start(np.zeros(len(problem.parameters.free)))
    moving = moving_parameters(problem, active)
    side = method.regularisation.settle(linear_model(problem, before, moving))
    executor = executor or Serial()
    given = starting_points(problem.parameters, rules) if points is None else np.asarray(points, dtype=float)
    given = np.where(moving, given, before.x)
    samples: tuple[Sample, ...] = ()
    if rules.samples and points is None:
        work = _Sampled(first[0] if first else problem)
        samples = tuple(_samples(work, given, executor, sampled or {}, report_sample or nothing))
        given = _best_points(samples, before.x, rules.count)
    elif points is None and len(given) > 1:
        given[0] = before.x
    tries = _Tries(problem, replace(method, regularisation=side), tuple(first), active)
    search = _Search(tries, rules, known or {}, report or nothing, executor)
    return replace(search.go(given, before), samples=samples)


@dataclass(frozen=True, eq=False)
class _Sampled:
    """½ rᵀr of a problem, and the number of residuals; called with a point. NaN where it cannot be solved."""

    problem: UpdateProblem

    def __getstate__(self) -> dict[str, Any]:
        return {"problem": self.problem.to_send()}

    def __call__(self, x: Reals) -> tuple[float, int]:
        try:
            states = self.problem.solved(x)
            evaluation = self.problem.assess(x, states, derivatives=False)
            self.problem.check_compared(evaluation)
        except FemtuneError:
            return float("nan"), 0
        return evaluation.objective, evaluation.independent


def _samples(
    work: _Sampled, points: Reals, executor: Executor, known: Mapping[int, Sample], report: Callable[[Sample], None]
) -> list[Sample]:
    """The objective at all points."""
    evaluations = finish(
        executor, work, list(points), {n - 1: (s.objective, s.residuals) for n, s in known.items()}, name="sample",
        finished=lambda i, value: report(Sample(i + 1, points[i], *value)),
    )  # fmt: skip
    return [Sample(i + 1, x, *value) for i, (x, value) in enumerate(zip(points, evaluations))]


def _best_points(samples: Sequence[Sample], nominal: Reals, count: int) -> Reals:
    """(count, k) the nominal point and the best samples."""
    # a point with fewer pairs has a smaller objective for this reason alone
    order = sorted(
        (s for s in samples if np.isfinite(s.objective)), key=lambda s: (-s.residuals, s.objective, s.number)
    )
    return np.array([nominal, *(s.x for s in order[: count - 1])])


def follow_up(
    starts: MultiStart,
    problem: UpdateProblem,
    method: SensitivityMethod,
    side: SideConstraint,
    active: Sequence[str] | None = None,
    unfinished: bool = False,
) -> MultiStart:
    """The results continued on another problem: a reduced model that has become better, other residuals.

    Of starts that ended at one optimum the best is continued, and the others end where it ends. Starts that did not
    converge stay where they are, but for the best of all where none converged. A start that cannot be continued has
    failed at its old result.

    Parameters
    ----------
    unfinished : continue the starts that did not converge too, each by itself: the other problem is no better model of
        the same, but asks for something else
    """
    tries = _Tries(problem, replace(method, regularisation=side), (), active)
    search = _Search(tries, DEFAULT_RULES, {}, nothing, Serial())
    return search.further(starts, problem.start(starts.best.before.x), unfinished)


def _followed(starts: MultiStart, unfinished: bool) -> dict[int, int]:
    """For each start that is continued by or ends with another one: the number of the other one."""
    by_number = {s.number: s for s in starts.starts}
    out = {}
    for optimum in starts.optima:
        leader = min(optimum.members, key=lambda n: (by_number[n].compared, n))
        out.update(dict.fromkeys(optimum.members, leader))
    open_ = [s for s in starts.starts if s.status is not None and s.number not in out]
    if not unfinished:
        open_ = sorted(open_, key=lambda s: (s.compared, s.number))[:1] if not out else []
    return {**out, **{s.number: s.number for s in open_}}


_Task = tuple[StartResult, Reals]
"""A start so far, and from where it sets out now."""
_Try = tuple[StartResult, UpdateResult | None]
"""Outcome of a start, and its update if it was made in this run."""


@dataclass(frozen=True, eq=False)
class _Tries:
    """One more run of a start; called with its task."""

    problem: UpdateProblem
    method: SensitivityMethod
    first: tuple[UpdateProblem, ...]
    active: Sequence[str] | None

    def __getstate__(self) -> dict[str, Any]:
        first = tuple(problem.to_send() for problem in self.first)
        return {**self.__dict__, "problem": self.problem.to_send(), "first": first}

    def __call__(self, task: _Task) -> _Try:
        so_far, x = task
        tries, iterations = so_far.tries + 1, so_far.iterations
        for phase in self.first:
            x, more = self._phase(phase, x)
            iterations += more
        try:
            result = update(self.problem, self.method, start=self.problem.start(x), active=self.active)
        except FemtuneError as error:
            return StartResult(so_far.number, so_far.start, x, np.nan, None, tries, iterations, error.what), None
        iterations += len(result.history) - 1
        return StartResult.of(so_far.number, so_far.start, result, tries, iterations), result

    def _phase(self, phase: UpdateProblem, x: Reals) -> tuple[Reals, int]:
        """Final point and iterations of a first phase; none if it cannot be solved."""
        try:
            method = replace(self.method, regularisation=NoRegularisation(), smallest_change=0.0)
            result = update(phase, method, start=phase.start(x), active=self.active)
        except FemtuneError:
            return x, 0
        return result.x, len(result.history) - 1

    def here(self, result: UpdateResult) -> UpdateResult:
        """A result with its end on the problem of this process, which may have been found in another one."""
        if all(state.case is case for state, case in zip(result.after.states, self.problem.cases)):
            return result
        return replace(result, after=self.problem.unsolved(result.after))


@dataclass(eq=False)
class _Search:
    tries: _Tries
    rules: StartRules
    known: Mapping[tuple[int, int], StartResult]
    report: Callable[[StartResult], None]
    executor: Executor
    best: UpdateResult | None = None

    @property
    def problem(self) -> UpdateProblem:
        return self.tries.problem

    def go(self, points: Reals, before: Evaluation) -> MultiStart:
        """All starts, then restarts of those with a higher objective."""
        starts = self._set_out([(StartResult(i, x, x, np.nan, None, 0), x) for i, x in enumerate(points, start=1)])
        for hop in range(self.rules.hops):
            starts = self._compared(starts)
            noise = self._noise(starts, before)
            least = _least(starts)
            best = {s.number for s in comparable(starts) if s.at_optimum and s.compared - least <= noise}
            lost = [i for i, s in enumerate(starts) if s.number not in best]
            again = self._set_out([(starts[i], self._hop(starts[i], hop)) for i in lost])
            for i, result in zip(lost, again):
                starts[i] = result
        return self._result(tuple(starts), before)

    def further(self, starts: MultiStart, before: Evaluation, unfinished: bool) -> MultiStart:
        """The ends from where they are, see `follow_up`."""
        leaders, ends = _followed(starts, unfinished), dict[int, StartResult]()
        for s in starts.starts:
            if leaders.get(s.number) == s.number:
                ends[s.number] = self._remembered(self.tries((s, s.end)))
        return self._result(tuple(_ended(s, ends.get(leaders.get(s.number, 0))) for s in starts.starts), before)

    def _set_out(self, tasks: Sequence[_Task]) -> list[StartResult]:
        """One more run of some starts; of each the better result is kept."""
        keys = [(so_far.number, so_far.tries + 1) for so_far, _ in tasks]
        known: dict[int, _Try] = {i: (self.known[key], None) for i, key in enumerate(keys) if key in self.known}

        def tell(i: int, trial: _Try) -> None:
            self.report(self._better(tasks[i][0], trial[0]))

        every = finish(self.executor, self.tries, tasks, known, name="start", finished=tell)
        return [
            self._better(tasks[i][0], found[0] if i in known else self._remembered(found))
            for i, found in enumerate(every)
        ]

    def _better(self, so_far: StartResult, result: StartResult) -> StartResult:
        """The start that is kept after one more run."""
        if so_far.status is None:
            return result
        if result.status is not None:
            tests = united([so_far.tests, result.tests])
            if self._over(result, tests) < self._over(so_far, tests):
                return result
        return replace(so_far, tries=result.tries, iterations=result.iterations)

    def _remembered(self, trial: _Try) -> StartResult:
        """The start; its update is kept where it is the best so far."""
        start, result = trial
        if result is not None and (self.best is None or best_of(self.problem, [self.best, result]) == 1):
            self.best = result
        return start

    def _hop(self, start: StartResult, hop: int) -> Reals:
        lower, upper = self.problem.parameters.bounds
        rng = np.random.default_rng([self.rules.seed, start.number, hop])
        middle, drawn = 0.5 * (start.end + 0.5 * (lower + upper)), rng.uniform(lower, upper)
        moving = moving_parameters(self.problem, self.tries.active)
        return np.where(moving, middle if hop == 0 else drawn, start.end)

    def _noise(self, starts: Sequence[StartResult], before: Evaluation) -> float:
        moving = moving_parameters(self.problem, self.tries.active)
        n = (before if self.best is None else self.best.after).independent
        return noise_level(_least(starts), n, int(moving.sum()))

    def _compared(self, starts: Sequence[StartResult]) -> list[StartResult]:
        """The starts with their objectives over the test modes that have a partner at the end of any of them."""
        ends = [s for s in starts if s.status is not None and len(s.tests)]
        every = united([s.tests for s in ends if s.at_optimum] or [s.tests for s in ends])
        return [replace(s, common=self._over(s, every)) if s in ends else s for s in starts]

    def _over(self, start: StartResult, tests: Sequence[frozenset[int]]) -> float:
        """½ rᵀr of the end of a start, side constraint included, over some test modes of each case."""
        if all(of_test >= wanted for of_test, wanted in zip(start.tests, tests, strict=True)):
            return start.objective
        try:
            at = self.problem.assess(start.end, self.problem.solved(start.end), derivatives=False)
        except FemtuneError:
            return np.inf
        paired = self.problem.over(at, start.tests)
        return start.objective - paired + self.problem.over(at, united([start.tests, tuple(tests)]))

    def _result(self, starts: tuple[StartResult, ...], before: Evaluation) -> MultiStart:
        starts = tuple(self._compared(starts))
        noise, spread = self._noise(starts, before), self.problem.parameters.prior[1]
        return MultiStart(
            self.problem.parameters, starts, distinct_optima(starts, spread, noise), noise, self._best(starts, before)
        )

    def _best(self, starts: Sequence[StartResult], before: Evaluation) -> UpdateResult:
        """The update at the best result; repeated there if it belongs to an earlier run."""
        least = min(comparable(starts), key=height, default=None)
        if least is None:
            none = replace(self.tries.method, max_iterations=0)
            return update(self.problem, none, start=before, active=self.tries.active)
        if self.best is not None and np.array_equal(self.best.x, least.end):
            return replace(self.tries.here(self.best), before=before)
        start = self.problem.start(least.end)
        result = update(self.problem, self.tries.method, start=start, active=self.tries.active)
        return replace(result, before=before)


def _ended(start: StartResult, leader: StartResult | None) -> StartResult:
    """A start that ends where another one, or it itself, has ended; as it is without."""
    if leader is None:
        return start
    end = start.end if leader.status is None else leader.end
    iterations = leader.iterations if leader.number == start.number else start.iterations
    return replace(
        start, end=end, objective=leader.objective, status=leader.status, problem=leader.problem, iterations=iterations,
        residuals=leader.residuals, tests=leader.tests,
    )  # fmt: skip


def _least(starts: Sequence[StartResult]) -> float:
    return min((s.compared for s in comparable(starts) if s.at_optimum), default=np.inf)
