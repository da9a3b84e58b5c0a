"""An update on reduced models that is checked on the full model: the bases are enriched until both agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

import numpy as np

from femtune.arrays import Reals
from femtune.model import EigenSolution, ModelPoint
from femtune.model.reduce import Trained, Trainer, TrainingRules, TrainingStatus, certified_error
from femtune.residuals import CaseState, ComparedCase, Evaluation, UpdateProblem
from femtune.residuals.state import reduced_case
from femtune.updating.equation_error import equation_error_phases
from femtune.updating.result import Iteration, UpdateResult
from femtune.updating.sensitivity_method import (
    SensitivityMethod,
    Walk,
    certificate,
    linear_model,
    moving_parameters,
    update,
)
from femtune.updating.starts import DEFAULT_RULES, MultiStart, StartResult, StartRules, follow_up, multi_start

SEARCH = 10.0
"""Ratio of the tolerance during the search to that at the final point."""
KEPT = 3
"""Full solutions reserved for the final points of searches."""


class Told(Protocol):
    """Receiver of the progress of an update on reduced models."""

    def trained(self, name: str, trained: Trained) -> None:
        """After every full solution of the training of a configuration."""
        ...

    def estimated(self, name: str, trained: Trained, count: int) -> None:
        """After every estimate: `count` candidates were estimated with this basis, of those in `trained.points`."""
        ...

    def searched(self, number: int) -> None:
        """Search `number` has ended; the full models are solved next."""
        ...


class _Nobody:
    """Ignores all progress."""

    def trained(self, name: str, trained: Trained) -> None:
        """Nothing."""

    def estimated(self, name: str, trained: Trained, count: int) -> None:
        """Nothing."""

    def searched(self, number: int) -> None:
        """Nothing."""


@dataclass(frozen=True)
class ReductionRules:
    """How far reduced models are trusted.

    Parameters
    ----------
    tolerance : relative frequency error, certified by a full solution where the search ends
    full_solutions : of each configuration at most, the first one and those that certify included
    order : of each reduced model at most
    """

    tolerance: float = 1e-4
    full_solutions: int = 20
    order: int = 600


@dataclass(frozen=True)
class ReducedCaseFacts:
    """The reduced model of one configuration at the end.

    Parameters
    ----------
    order : of the last model
    full_solutions : of the full model for its modes: those of the training and one where each search ended
    estimate : worst estimated relative frequency error at the candidates of the box, before the search
    certified_error : worst true one at the end point, of the model that the search used; NaN where none was made
    status : how the training before the search ended
    """

    configuration: str
    order: int
    full_solutions: int
    estimate: float
    certified_error: float
    status: TrainingStatus


@dataclass(frozen=True)
class ReducedUpdate:
    """An update on reduced models; `result` is of the full model at the end point.

    Parameters
    ----------
    cases : facts of each configuration
    rounds : what happened each time the search ended, a sentence each
    certified : True where full and reduced models agree within the tolerance at the end point
    """

    result: UpdateResult
    cases: tuple[ReducedCaseFacts, ...]
    rounds: tuple[str, ...]
    certified: bool


@dataclass(eq=False)
class ReducedSearch:
    """Reduced models of the cases that modes serve, and the history of the search on them; `reduced` are these cases'
    positions in the problem.
    """

    problem: UpdateProblem
    rules: ReductionRules
    reduced: list[int]
    trainers: list[Trainer]
    trained: list[Trained]
    estimates: list[Trained]
    history: list[Iteration]

    def reduced_problem(self) -> UpdateProblem:
        cases = list(self.problem.cases)
        for i, trained in zip(self.reduced, self.trained):
            cases[i] = reduced_case(cases[i], trained.model)
        return replace(self.problem, cases=tuple(cases))

    @property
    def cases(self) -> list[ComparedCase]:
        """The cases that are reduced."""
        return [self.problem.cases[i] for i in self.reduced]

    def solutions(self, states: list[CaseState]) -> list[EigenSolution]:
        """Full modes of the cases that are reduced."""
        return [states[i].solution for i in self.reduced]

    def errors(self, x: Reals, states: list[CaseState]) -> list[float]:
        """Worst relative frequency errors of the reduced models at a point where the full ones are solved."""
        pairs = zip(self.trained, self.solutions(states))
        return [float(certified_error(t.model, x, s.eigenvalues[: s.wanted]).max(initial=0.0)) for t, s in pairs]

    def enrich(self, x: Reals, states: list[CaseState]) -> bool:
        """Add the full modes at a point to the bases; False if they contain all of them already."""
        before = [t.model.order for t in self.trained]
        finer = [_finer(t, self.rules.tolerance) for t in self.trainers]
        triples = zip(finer, self.trained, self.solutions(states))
        self.trained = [t.enriched(m, x, s) for t, m, s in triples]
        return before != [t.model.order for t in self.trained]

    def facts(self, errors: list[float]) -> tuple[ReducedCaseFacts, ...]:
        """Facts of each reduced model, with its certified errors at the end."""
        four = zip(self.cases, self.trained, self.estimates, errors)
        return tuple(
            ReducedCaseFacts(c.name, t.model.order, len(t.certified) + 1, first.worst_estimate, error, first.status)
            for c, t, first, error in four
        )

    @property
    def used_up(self) -> bool:
        return any(len(t.certified) + 1 >= self.rules.full_solutions for t in self.trained)


NOBODY: Told = _Nobody()


NOTHING_REDUCED = "no model was reduced because no configuration compares modes; the search used the full model"


def update_reduced(
    problem: UpdateProblem,
    method: SensitivityMethod,
    rules: ReductionRules,
    report: Callable[[Iteration], None] = lambda i: None,
    start: Evaluation | None = None,
    told: Told = NOBODY,
    active: Sequence[str] | None = None,
) -> ReducedUpdate:
    """The update of `update`, its iterations on reduced models that are trained on the box of the parameters.

    Where the search ends the full models are solved. While they disagree by more than the tolerance their modes
    enrich the bases and the search goes on from there; the end is the full model's, with its residuals and covariance.

    Parameters
    ----------
    report, start, active : as for `update`
    told : receives the progress of training and searches

    Raises
    ------
    FemtuneError : ``correlate.no-pairs``, ``eigen.*``, ``reduce.too-many-terms``, and what `update` raises of `active`
        and priors
    """
    before = start or problem.start(np.zeros(len(problem.parameters.free)))
    if not any(case.on_modes for case in problem.cases):
        # there is nothing that a reduced model would serve
        return ReducedUpdate(update(problem, method, report, before, active), (), (NOTHING_REDUCED,), True)
    side = method.regularisation.settle(linear_model(problem, before, moving_parameters(problem, active)))
    method = replace(method, regularisation=side)
    search = train(problem, rules, before, told)
    x, rounds = before.x, list[str]()
    while True:
        found = _search(search, method, x, report, active)
        told.searched(len(rounds) + 1)
        x, states = found.x, problem.solved(found.x)
        errors = search.errors(x, states)
        agree = max(errors, default=0.0) <= rules.tolerance
        rounds.append(round_sentence(len(rounds) + 1, search, max(errors, default=0.0), agree))
        if agree or search.used_up or not search.enrich(x, states):
            break
    full = problem.assess(x, states)
    return ReducedUpdate(
        on_full_model(problem, method, before, full, found, search.history), search.facts(errors), tuple(rounds), agree
    )


def train(problem: UpdateProblem, rules: ReductionRules, before: Evaluation, told: Told) -> ReducedSearch:
    """Reduced models of all cases, trained on the box of the parameters."""
    trainers, trained = [], []
    which = [i for i, case in enumerate(problem.cases) if case.on_modes]
    for case, state in ((problem.cases[i], before.states[i]) for i in which):
        most = max(rules.full_solutions - KEPT, 1)
        asked = TrainingRules(state.solution.wanted, SEARCH * rules.tolerance, most, rules.order)
        hears = partial(told.trained, case.name), partial(told.estimated, case.name)
        trainers.append(Trainer(case.configured, asked, case.sensors, partial(_solve, case), *hears))
        trained.append(trainers[-1].train(trainers[-1].start()))
    return ReducedSearch(problem, rules, which, trainers, trained, trained, [])


def _finer(trainer: Trainer, tolerance: float) -> Trainer:
    """A trainer that keeps smaller parts of new modes: at an end shapes count, whose error is that of a root."""
    negligible = min(trainer.rules.negligible, 1e-2 * float(np.sqrt(tolerance)))
    return replace(trainer, rules=replace(trainer.rules, negligible=negligible))


def _solve(case: ComparedCase, point: ModelPoint, count: int, start: EigenSolution | None) -> EigenSolution:
    # whoever keeps solutions keeps them by the model alone, not by where they started
    return case.solver.modes(point, count, None)


def _search(
    search: ReducedSearch,
    method: SensitivityMethod,
    x: Reals,
    report: Callable[[Iteration], None],
    active: Sequence[str] | None,
) -> UpdateResult:
    """The update on the reduced models from x, its iterations numbered on."""
    reduced = search.reduced_problem()

    def number_on(iteration: Iteration) -> None:
        own = replace(iteration, number=len(search.history))
        # the first point of a further search is the last one of that before
        if iteration.number or not search.history:
            search.history.append(own)
            report(own)

    return update(reduced, method, number_on, reduced.start(x), active)


def round_sentence(number: int, search: ReducedSearch, error: float, agree: bool) -> str:
    order = " and ".join(str(t.model.order) for t in search.trained)
    verdict = "within the tolerance" if agree else "above the tolerance"
    return (
        f"search {number} with order {order}: at the final point the largest frequency difference from the full model "
        f"is {100.0 * error:.2g} %, {verdict} of {100.0 * search.rules.tolerance:.2g} %"
    )


def on_full_model(
    problem: UpdateProblem,
    method: SensitivityMethod,
    before: Evaluation,
    full: Evaluation,
    found: UpdateResult,
    history: Sequence[Iteration],
) -> UpdateResult:
    """The result at the final point with residuals, Jacobian and covariance of the full model."""
    there = update(problem, replace(method, max_iterations=0, smallest_change=0.0), start=full, active=found.active)
    walk = Walk(problem, moving_parameters(problem, found.active), there.side)
    return replace(
        there, status=found.status, before=before, history=tuple(history),
        number=len(history) - len(found.history) + found.number,
        certificate=certificate(walk, full, found.smallest_change), smallest_change=found.smallest_change,
    )  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# Many starts on reduced models: all ends follow the models while these are enriched where the best start ends.


Compared = Callable[[UpdateProblem], UpdateProblem]

NO_SIDE = SensitivityMethod(smallest_change=0.0)


@dataclass(frozen=True)
class ReducedStarts:
    """All starts, and the update at the best end as of `update_reduced`; results of the other starts are those of
    reduced models."""

    starts: MultiStart
    update: ReducedUpdate


def multi_start_reduced(
    problem: UpdateProblem,
    method: SensitivityMethod,
    reduction: ReductionRules,
    rules: StartRules = DEFAULT_RULES,
    *,
    equation_error: bool = True,
    nominal: Evaluation | None = None,
    points: Reals | None = None,
    active: Sequence[str] | None = None,
    known: Mapping[tuple[int, int], StartResult] | None = None,
    report: Callable[[StartResult], None] | None = None,
    told: Told = NOBODY,
) -> ReducedStarts:
    """`multi_start` on reduced models, which the full models certify at the best end.

    While they disagree there by more than the tolerance, the full modes enrich the bases and all ends go on from where
    they are, so that in the end they are as exact as the best one where they are the same optimum. With
    `equation_error` starts are first followed, and the best end certified, by that residual; the asked ones come after.

    Parameters
    ----------
    equation_error : whether starts first go through `equation_error_phases`; hops are judged by the equation error then
    nominal, points, active, known, report : as for `multi_start`
    told : as for `update_reduced`

    Raises
    ------
    FemtuneError : as `multi_start` and `update_reduced`
    """
    before = nominal or problem.start(np.zeros(len(problem.parameters.free)))
    side = method.regularisation.settle(linear_model(problem, before, moving_parameters(problem, active)))
    method = replace(method, regularisation=side)
    run = _Run(problem, method, reduction, train(problem, reduction, before, told), told, active, [])
    reduced = run.search.reduced_problem()
    if equation_error:
        *first, last = equation_error_phases(reduced)
        found = multi_start(last, NO_SIDE, rules, first=first, points=points, active=active, known=known, report=report)
        found = run.certify(found, lambda p: equation_error_phases(p)[-1], NO_SIDE)
        found = follow_up(found, run.search.reduced_problem(), method, side, active)
    else:
        found = multi_start(reduced, method, rules, points=points, active=active, known=known, report=report)
    found = run.certify(found, lambda p: p, method)
    best = on_full_model(
        problem, method, before, problem.assess(found.best.x, run.states), found.best, found.best.history
    )
    facts = run.search.facts(run.errors)
    return ReducedStarts(replace(found, best=best), ReducedUpdate(best, facts, tuple(run.rounds), run.agree))


@dataclass(eq=False)
class _Run:
    """Reduced models and their agreement with the full ones at the best result."""

    problem: UpdateProblem
    method: SensitivityMethod
    reduction: ReductionRules
    search: ReducedSearch
    told: Told
    active: Sequence[str] | None
    rounds: list[str]
    states: list[CaseState] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    agree: bool = False

    def certify(self, found: MultiStart, compared: Compared, method: SensitivityMethod) -> MultiStart:
        """The ends of starts once the full models agree at the best of them, or no more full solutions are allowed."""
        while not self._look(found.best.x) and not self.search.used_up:
            if not self.search.enrich(found.best.x, self.states):
                break
            reduced = compared(self.search.reduced_problem())
            found = follow_up(found, reduced, method, found.best.side, self.active)
        return found

    def _look(self, x: Reals) -> bool:
        self.told.searched(len(self.rounds) + 1)
        self.states = self.problem.solved(x)
        self.errors = self.search.errors(x, self.states)
        worst = max(self.errors, default=0.0)
        self.agree = worst <= self.reduction.tolerance
        self.rounds.append(round_sentence(len(self.rounds) + 1, self.search, worst, self.agree))
        return self.agree
