"""Multi-start update: initial points spread over the bounds; all results are kept and compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from scipy.special import chdtri, fdtri

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.parameters import ParameterSet
from femtune.residuals import Evaluation, UpdateProblem
from femtune.status import Status
from femtune.updating.regularisation import NoRegularisation, SideConstraint
from femtune.updating.result import UpdateResult
from femtune.updating.sensitivity_method import SensitivityMethod, linear_model, moving_parameters, update

# ----------------------------------------------------------------------------------------------------
# Ends of several starts: which are the same optimum, which are as good, and what that means.


SAME, SURE, EXACT = 1e-3, 0.95, 1e-16
_SPARE = 3


class StartOutcome(Enum):
    """Outcome of a start, compared with the others."""

    BEST = "reached the best optimum that was found"
    AS_GOOD = "reached another optimum that is equally good within the noise"
    WORSE = "reached an optimum with a higher objective"
    UNFINISHED = "did not converge"
    FAILED = "could not be solved"


@dataclass(frozen=True, eq=False)
class StartResult:
    """One start, kept whatever became of it.

    Parameters
    ----------
    start, end : (k,) normalised parameters; `end` is the start where it failed
    objective : ½ rᵀr at the end with the side constraint, NaN where it failed
    status : of the last update; None where it failed, for the reason in `problem`
    tries : how many times it set out: one, and one more for every hop from an end that was not good enough
    iterations : of all tries
    """

    number: int
    start: Reals
    end: Reals
    objective: float
    status: Status | None
    tries: int = 1
    iterations: int = 0
    problem: str = ""

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
    stated = 0.5 * float(chdtri(max(n_parameters, 1), 1.0 - SURE))
    spare = n_residuals - n_parameters
    if best < EXACT or spare < _SPARE:
        return 10.0 * EXACT if best < EXACT else stated
    shown = max(n_parameters, 1) * float(fdtri(max(n_parameters, 1), spare, SURE)) * best / spare
    return min(stated, shown)


def distinct_optima(starts: Sequence[StartResult], spread: Reals, noise: float) -> tuple[Optimum, ...]:
    """Converged results in clusters, the best first.

    Two results are the same if no parameter differs by more than a thousandth of its prior standard deviation.
    """
    left = sorted((s for s in starts if s.at_optimum), key=lambda s: (s.objective, s.number))
    best = left[0].objective if left else np.nan
    found = []
    while left:
        first = left[0]
        same = [s for s in left if np.abs((s.end - first.end) / spread).max(initial=0.0) <= SAME]
        numbers = tuple(sorted(s.number for s in same))
        found.append(Optimum(first.end, first.objective, numbers, first.objective - best <= noise))
        left = [s for s in left if s not in same]
    return tuple(found)


def outcomes(starts: Sequence[StartResult], optima: Sequence[Optimum]) -> dict[int, StartOutcome]:
    """Outcome of each start, by its number."""
    at = {number: i for i, optimum in enumerate(optima) for number in optimum.members}
    out = {}
    for s in starts:
        if s.number in at:
            i = at[s.number]
            good = StartOutcome.AS_GOOD if optima[i].as_good else StartOutcome.WORSE
            out[s.number] = StartOutcome.BEST if i == 0 else good
        else:
            out[s.number] = StartOutcome.FAILED if s.status is None else StartOutcome.UNFINISHED
    return out


def start_sentences(starts: Sequence[StartResult], optima: Sequence[Optimum]) -> tuple[str, ...]:
    """Whether the starts reached the same optimum, in sentences."""
    n, found = len(starts), outcomes(starts, optima)
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
    return (*out, *_lost(found))


def _lost(found: dict[int, StartOutcome]) -> list[str]:
    values = list(found.values())
    unfinished, failed = values.count(StartOutcome.UNFINISHED), values.count(StartOutcome.FAILED)
    out = [f"{unfinished} {'start' if unfinished == 1 else 'starts'} did not converge."] if unfinished else []
    return [*out, f"{failed} {'start' if failed == 1 else 'starts'} could not be solved."] if failed else out


@dataclass(frozen=True)
class StartRules:
    """How many starts, and how hard each tries.

    Parameters
    ----------
    count, seed : points of a Latin hypercube over the bounds
    hops : how many times a start whose end is worse than the best one sets out again: first from half way between its
        end and the middle of the bounds, then from points drawn at random
    """

    count: int = 20
    seed: int = 0
    hops: int = 0


DEFAULT_METHOD, DEFAULT_RULES = SensitivityMethod(), StartRules()


@dataclass(frozen=True, eq=False)
class MultiStart:
    """All starts and what they found.

    Parameters
    ----------
    starts : in the order of their numbers
    optima : distinct ends, the best first
    noise : by how much objectives may differ for the data not to tell their points apart
    best : the update at the best end, with residuals and covariance; its history is that of its start's last try
    """

    parameters: ParameterSet
    starts: tuple[StartResult, ...]
    optima: tuple[Optimum, ...]
    noise: float
    best: UpdateResult = field(repr=False)

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
    """(count, k) normalised points of a Latin hypercube over the bounds."""
    from scipy.stats import qmc  # noqa: PLC0415  half a second that an update from one start does not need

    lower, upper = parameters.bounds
    unit = qmc.LatinHypercube(len(lower), rng=np.random.default_rng(rules.seed)).random(rules.count)
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

    Raises
    ------
    FemtuneError : what the evaluation at the nominal values raises; later failures are kept as such
    """
    before = nominal or problem.start(np.zeros(len(problem.parameters.free)))
    moving = moving_parameters(problem, active)
    side = method.regularisation.settle(linear_model(problem, before, moving))
    given = starting_points(problem.parameters, rules) if points is None else np.asarray(points, dtype=float)
    search = _Search(
        problem, replace(method, regularisation=side), tuple(first), rules, active, known or {}, report or _tell_nobody
    )
    return search.go(np.where(moving, given, before.x), before)


def follow_up(
    found: MultiStart,
    problem: UpdateProblem,
    method: SensitivityMethod,
    side: SideConstraint,
    active: Sequence[str] | None = None,
) -> MultiStart:
    """Every result continued on another problem: a reduced model that has become better, other residuals.

    A start that cannot be continued has failed at its old result.
    """
    search = _Search(problem, replace(method, regularisation=side), (), DEFAULT_RULES, active, {}, _tell_nobody)
    return search.further(found.starts, problem.start(found.best.before.x))


def _tell_nobody(start: StartResult) -> None:
    """Ignores all progress."""


@dataclass(eq=False)
class _Search:
    problem: UpdateProblem
    method: SensitivityMethod
    first: tuple[UpdateProblem, ...]
    rules: StartRules
    active: Sequence[str] | None
    known: Mapping[tuple[int, int], StartResult]
    report: Callable[[StartResult], None]
    best: UpdateResult | None = None

    def go(self, points: Reals, before: Evaluation) -> MultiStart:
        """All starts, then restarts of those with a higher objective."""
        starts = [self._set_out(StartResult(i, x, x, np.nan, None, 0), x) for i, x in enumerate(points, start=1)]
        for hop in range(self.rules.hops):
            noise = self._noise(starts, before)
            least = _least(starts)
            lost = [i for i, s in enumerate(starts) if not (s.at_optimum and s.objective - least <= noise)]
            for i in lost:
                starts[i] = self._set_out(starts[i], self._hop(starts[i], hop))
        return self._result(tuple(starts), before)

    def further(self, starts: Sequence[StartResult], before: Evaluation) -> MultiStart:
        """All ends from where they are."""
        again = []
        for s in starts:
            found = self._try(s, s.end) if s.status is not None else s
            again.append(replace(found, tries=s.tries, end=s.end if found.status is None else found.end))
        return self._result(tuple(again), before)

    def _set_out(self, so_far: StartResult, x: Reals) -> StartResult:
        """One more run of a start from x; the better result is kept."""
        key = (so_far.number, so_far.tries + 1)
        if key in self.known:
            return self.known[key]
        found = self._try(so_far, x)
        better = not found.objective >= so_far.objective if found.status is not None else False
        kept = (
            found
            if better or so_far.status is None
            else replace(so_far, tries=found.tries, iterations=found.iterations)
        )
        self.report(kept)
        return kept

    def _try(self, so_far: StartResult, x: Reals) -> StartResult:
        tries, iterations = so_far.tries + 1, so_far.iterations
        for phase in self.first:
            x, more = self._phase(phase, x)
            iterations += more
        try:
            result = update(self.problem, self.method, start=self.problem.start(x), active=self.active)
        except FemtuneError as error:
            return StartResult(so_far.number, so_far.start, x, np.nan, None, tries, iterations, error.what)
        objective = result.objective
        if self.best is None or objective < self.best.objective:
            self.best = result
        iterations += len(result.history) - 1
        return StartResult(so_far.number, so_far.start, result.x, objective, result.status, tries, iterations)

    def _phase(self, phase: UpdateProblem, x: Reals) -> tuple[Reals, int]:
        """Final point and iterations of a first phase; none if it cannot be solved."""
        try:
            method = replace(self.method, regularisation=NoRegularisation(), smallest_change=0.0)
            result = update(phase, method, start=phase.start(x), active=self.active)
        except FemtuneError:
            return x, 0
        return result.x, len(result.history) - 1

    def _hop(self, start: StartResult, hop: int) -> Reals:
        lower, upper = self.problem.parameters.bounds
        rng = np.random.default_rng([self.rules.seed, start.number, hop])
        middle, drawn = 0.5 * (start.end + 0.5 * (lower + upper)), rng.uniform(lower, upper)
        moving = moving_parameters(self.problem, self.active)
        return np.where(moving, middle if hop == 0 else drawn, start.end)

    def _noise(self, starts: Sequence[StartResult], before: Evaluation) -> float:
        moving = moving_parameters(self.problem, self.active)
        n = len(before.residuals if self.best is None else self.best.after.residuals)
        return noise_level(_least(starts), n, int(moving.sum()))

    def _result(self, starts: tuple[StartResult, ...], before: Evaluation) -> MultiStart:
        noise, spread = self._noise(starts, before), self.problem.parameters.prior[1]
        return MultiStart(
            self.problem.parameters, starts, distinct_optima(starts, spread, noise), noise, self._best(starts, before)
        )

    def _best(self, starts: Sequence[StartResult], before: Evaluation) -> UpdateResult:
        """The update at the best result; repeated there if it belongs to an earlier run."""
        ends = [s for s in starts if s.status is not None]
        least = min(ends, key=lambda s: (not s.at_optimum, s.objective), default=None)
        if least is None:
            return update(self.problem, replace(self.method, max_iterations=0), start=before, active=self.active)
        if self.best is not None and np.array_equal(self.best.x, least.end):
            return replace(self.best, before=before)
        found = update(self.problem, self.method, start=self.problem.start(least.end), active=self.active)
        return replace(found, before=before)


def _least(starts: Sequence[StartResult]) -> float:
    return min((s.objective for s in starts if s.at_optimum), default=np.inf)
