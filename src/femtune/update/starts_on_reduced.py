"""Many starts on reduced models: all ends follow the models while these are enriched where the best start ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from femtune.residuals import CaseState, Evaluation, UpdateProblem
from femtune.update.equation_error import equation_error_phases
from femtune.update.multi_start import DEFAULT_RULES, MultiStart, Reals, StartRules, follow_up, multi_start
from femtune.update.on_reduced_model import (
    NOBODY,
    ReducedSearch,
    ReducedUpdate,
    ReductionRules,
    Told,
    on_full_model,
    round_sentence,
    train,
)
from femtune.update.optima import StartResult
from femtune.update.sensitivity_method import SensitivityMethod
from femtune.update.walk import linear_model, moving_parameters

Compared = Callable[[UpdateProblem], UpdateProblem]

NO_SIDE = SensitivityMethod()


@dataclass(frozen=True)
class ReducedStarts:
    """All starts, and the update at the best end as of `update_reduced`; ends beside the best are of reduced models."""

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
    """Reduced models and how far they agree with the full ones where the best start ends."""

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
