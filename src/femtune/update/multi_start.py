"""Many starts: spread over the bounds, each followed to its end and kept, the ends compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from femtune.errors import FemtuneError
from femtune.parameters import ParameterSet
from femtune.residuals import Evaluation, UpdateProblem
from femtune.update.optima import (
    Optimum,
    StartOutcome,
    StartResult,
    distinct_optima,
    noise_level,
    outcomes,
    start_sentences,
)
from femtune.update.regularise import NoRegularisation, SideConstraint
from femtune.update.result import UpdateResult
from femtune.update.sensitivity_method import SensitivityMethod, update
from femtune.update.walk import linear_model, moving_parameters

Reals = NDArray[np.float64]


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
        """What became of each start, by its number."""
        return outcomes(self.starts, self.optima)

    @property
    def unique(self) -> bool:
        """False where another optimum is as good within the noise."""
        return sum(o.as_good for o in self.optima) <= 1

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the starts tell of the answer."""
        return start_sentences(self.starts, self.optima)


def starting_points(parameters: ParameterSet, rules: StartRules) -> Reals:
    """(count, k) normalised points of a Latin hypercube over the bounds."""
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
    """Update from many points, keep every end, and say whether the answer is one.

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
    """Every end followed further on another problem: a reduced model that has become better, other residuals.

    A start that cannot go on there has failed at its old end.
    """
    search = _Search(problem, replace(method, regularisation=side), (), DEFAULT_RULES, active, {}, _tell_nobody)
    return search.further(found.starts, problem.start(found.best.before.x))


def _tell_nobody(start: StartResult) -> None:
    """Listens to nothing."""


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
        """All starts, then the hops of those that are not good enough."""
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
        """One more try of a start from x; the better end is kept."""
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
        objective = result.history[-1].objective
        if self.best is None or objective < self.best.history[-1].objective:
            self.best = result
        iterations += len(result.history) - 1
        return StartResult(so_far.number, so_far.start, result.x, objective, result.status, tries, iterations)

    def _phase(self, phase: UpdateProblem, x: Reals) -> tuple[Reals, int]:
        """Where a first phase leads, and its iterations; a phase that cannot be solved leads nowhere."""
        try:
            result = update(phase, replace(self.method, regularisation=NoRegularisation()), start=phase.start(x),
                            active=self.active)  # fmt: skip
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
        """The update at the best end; made again there where it belongs to an earlier run."""
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
