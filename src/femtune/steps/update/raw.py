"""The update with the measured FRFs themselves that follows one with equal damping."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError, Notice
from femtune.model import EigenSolution, damping_by_mode
from femtune.residuals import CaseState, ComparedCase, Residual, UpdateProblem
from femtune.residuals.frf.asked import AskedFrfs
from femtune.residuals.frf.measured_damping import MeasuredDamping, measured_damping
from femtune.residuals.frf.on_reduced import ReducedFrfs
from femtune.residuals.frf.refined_damping import RefinedDamping, refined_on_reduced, with_refined_damping
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.state import reduced_case
from femtune.study.stages import reduction_rules
from femtune.updating import update, update_reduced

if TYPE_CHECKING:
    from collections.abc import Mapping

    from femtune.arrays import Reals
    from femtune.model.reduce import ReducedModel
    from femtune.study.study import Study
    from femtune.updating import Iteration, ReducedSearch, ReducedUpdate, SensitivityMethod, UpdateResult

_MORE_MODES = 3
"""Further ratios for each mode of the comparison with equal damping: the measured FRFs may need more modes."""
_LEAST_ROUNDS = 2
"""Updates on the full model at least."""
_MOST_ROUNDS = 3
"""Updates with measured FRFs: each begins with the pairs of modes where the one before has ended, until they stay."""


@dataclass(frozen=True, eq=False)
class RawUpdate:
    """The update with measured FRFs.

    Parameters
    ----------
    result : from the initial values to its end, with the iterations of the update with equal damping before its own
    study : the study that compares the measured FRFs
    equalised : the result with equal damping, where it began
    damping : measured damping on the modes of the model where it began, by configuration
    search : the reduced models at its end, where there are some
    reduced : the update on reduced models; None without them
    rounds : number of updates with measured FRFs, one after another
    """

    result: UpdateResult
    study: Study
    equalised: UpdateResult
    damping: Mapping[str, MeasuredDamping]
    search: ReducedSearch | None = None
    reduced: ReducedUpdate | None = None
    rounds: int = 1


def then_raw(
    study: Study,
    equalised: UpdateResult,
    method: SensitivityMethod,
    tell: Callable[[Iteration], None],
    search: ReducedSearch | None = None,
) -> tuple[RawUpdate | None, tuple[Notice, ...]]:
    """The update with the measured FRFs from the result of one with equal damping.

    Parameters
    ----------
    search : reduced models at this result, on which the iterations are made

    Returns
    -------
    None if the study compares no identified test or wants no such update, or if it cannot be made; what happened
    """
    table = study.file.equalise
    if table is None or table.then != "raw" or study.file.stage or study.source.needs_runs or not is_asked(study):
        return None, ()
    if not equalised.status.ok:
        return None, (Notice("update.no-raw/not-converged", ending=equalised.status.value),)
    raw: RawUpdate | None = None
    told: list[Notice] = []
    start = equalised
    try:
        for _ in range(_MOST_ROUNDS):
            now = another_round(study, equalised, start, method, tell, search, raw)
            if now is None:
                break
            raw, start = now, now.result
            if not raw.result.status.ok:
                break
        else:
            if raw is not None and not is_settled(study, raw):
                told.append(Notice("update.raw-open", rounds=_MOST_ROUNDS))
    except FemtuneError as error:
        if raw is None:
            return None, (Notice("update.no-raw", reason=error.what),)
        told.append(Notice("update.raw-open/failed", reason=error.what))
    if raw is not None and raw.reduced is not None and not raw.reduced.certified:
        told.append(Notice("update.not-certified", last_round=raw.reduced.rounds[-1]))
    return raw, tuple(told)


def is_asked(study: Study) -> bool:
    """Whether some FRFs of an identified test are compared."""
    return any(_identified(r) for case in study.cases if case.used is not None for r in case.used.residuals)


def _identified(residual: Residual) -> bool:
    settled = residual.settled if isinstance(residual, AskedFrfs) else None
    return isinstance(settled, FrfResidual) and settled.identified is not None


def another_round(
    study: Study,
    equalised: UpdateResult,
    start: UpdateResult,
    method: SensitivityMethod,
    tell: Callable[[Iteration], None],
    reduced: ReducedSearch | None,
    before: RawUpdate | None,
) -> RawUpdate | None:
    """One update from `start`; None if the modes have the same partners as in the one before.

    Parameters
    ----------
    reduced : reduced models of the comparison with equal damping
    """
    states = {s.case.name: s for s in start.after.states}
    damping = _damping_at(study, start)
    # ratios that were fitted where the comparison with equal damping ended are fitted once more, from a better point
    if before is not None and before.rounds >= _LEAST_ROUNDS and _same_partners(damping, before.damping):
        return None
    cases, raw = [], dict[int, FrfResidual]()
    served = _served(reduced, None if before is None else before.search)
    for case in study.cases:
        if case.compared is None or case.name not in damping:
            cases.append(case)
            continue
        refined = partial(_refined, states[case.name], served.get(case.name))
        new = _with_raw(case.compared.residuals, states[case.name], damping[case.name], raw, refined)
        cases.append(replace(case, compared=replace(case.compared, residuals=new)))
    on_raw = replace(study, cases=tuple(cases))
    problem = on_raw.problem()
    rules, first_x = reduction_rules(study), equalised.before.x
    search = None if before is None else before.search
    on_reduced: ReducedUpdate | None = None
    at_start, at_first = (_on_cases(problem, of.states) for of in (start.after, equalised.before))
    if rules is None or reduced is None:
        at = problem.assess(start.x, at_start)
        problem.check_compared(at)
        updated = update(problem, method, tell, at, equalised.active)
        first = problem.assess(first_x, at_first, derivatives=False)
    else:
        functions = [tuple(raw.get(id(r), r) for r in of) for of in reduced.functions]
        search = replace(search or reduced, problem=problem, functions=functions, history=[])
        at = search.assess(start.x, at_start, search.trained)
        problem.check_compared(at)
        on_reduced = update_reduced(problem, method, rules, tell, at, active=equalised.active, search=search)
        updated, search = on_reduced.result, on_reduced.search
        assert search is not None
        first = search.assess(first_x, at_first, search.trained)
    history = tuple(replace(i, functions=()) for i in updated.history)
    whole = tuple(replace(i, number=n) for n, i in enumerate((*start.history, *history)))
    result = replace(updated, before=first, history=whole, number=len(start.history) + updated.number)
    return RawUpdate(result, on_raw, equalised, damping, search, on_reduced, 1 if before is None else before.rounds + 1)


def is_settled(study: Study, raw: RawUpdate) -> bool:
    """Whether the modes have the same partners at the result as where it began."""
    return _same_partners(_damping_at(study, raw.result), raw.damping)


def _same_partners(one: Mapping[str, MeasuredDamping], other: Mapping[str, MeasuredDamping]) -> bool:
    return all(one[name].partners == other[name].partners for name in one)


def _damping_at(study: Study, result: UpdateResult) -> dict[str, MeasuredDamping]:
    """Measured damping on the modes at a result, by configuration."""
    return {s.case.name: damping for s in result.after.states if (damping := _damping(study, s)) is not None}


def _on_cases(problem: UpdateProblem, states: Sequence[CaseState]) -> list[CaseState]:
    """The same states of the same model, of other comparisons; what has been solved stays."""
    out = []
    for case, state in zip(problem.cases, states, strict=True):
        new = replace(state, case=case, known=state.solved)
        new.further.update(state.further)
        out.append(new)
    return out


def _damping(study: Study, state: CaseState) -> MeasuredDamping | None:
    """Measured damping on the modes of a configuration; None if it compares no identified test."""
    residuals = next((c.compared.residuals for c in study.cases if c.name == state.case.name and c.compared), ())
    for asked in residuals:
        if not isinstance(asked, AskedFrfs) or not _identified(asked):
            continue
        residual = asked.settled
        assert isinstance(residual, FrfResidual)
        assert residual.identified is not None
        modes = residual.way.model(state, residual.highest_hz)
        assert isinstance(modes, EigenSolution)
        return measured_damping(residual, residual.identified, modes, guided=True)
    return None


@dataclass(frozen=True, eq=False)
class _Served:
    """A configuration, its reduced model, and the residuals with equal damping that it serves."""

    case: ComparedCase
    model: ReducedModel
    functions: tuple[FrfResidual, ...]

    def residual(self, asked: FrfResidual, now: FrfResidual) -> ReducedFrfs | None:
        """The residual `now` that takes the place of `asked`, on the reduced model; None if it does not serve it."""
        places = [i for i, one in enumerate(self.functions) if one is asked]
        if not places:
            return None
        functions = tuple(now if one is asked else one for one in self.functions)
        reduced = reduced_case(replace(self.case, residuals=functions), self.model, functions).residuals[places[0]]
        assert isinstance(reduced, ReducedFrfs)
        return reduced


def _served(search: ReducedSearch | None, later: ReducedSearch | None) -> dict[str, _Served]:
    """Reduced models by configuration, those of a later search where there was one."""
    if search is None:
        return {}
    three = zip(search.cases, (later or search).trained, search.functions, strict=True)
    return {case.name: _Served(case, t.model, of) for case, t, of in three}


def _refined(
    state: CaseState, served: _Served | None, asked: FrfResidual, now: FrfResidual, ratios: Reals, paired: Sequence[int]
) -> RefinedDamping | None:
    """Ratios that the measured FRFs `now` refine, which take the place of `asked`; None where there are no modes."""
    reduced = None if served is None else served.residual(asked, now)
    if served is not None and reduced is not None:
        case = reduced_case(served.case, served.model, served.functions)
        return refined_on_reduced(reduced, CaseState(case, case.configured.at(state.point.x)), ratios, paired)
    modes = now.way.model(state, now.highest_hz)
    if not isinstance(modes, EigenSolution):
        return None
    return with_refined_damping(now, modes, ratios[: modes.wanted], paired)


def _with_raw(
    residuals: Sequence[Residual],
    state: CaseState,
    damping: MeasuredDamping,
    raw: dict[int, FrfResidual],
    refined: Callable[[FrfResidual, FrfResidual, Reals, Sequence[int]], RefinedDamping | None],
) -> tuple[Residual, ...]:
    """The residuals with measured FRFs in place of those of the identified test; `raw` gets each by the old one.

    Parameters
    ----------
    refined : residuals with equal damping and with measured FRFs, ratios and positions of paired modes -> ratios that
        the measured FRFs refine
    """
    out = list[Residual]()
    paired = [model for _, model in damping.partners]
    others = np.full(_MORE_MODES * len(damping.ratios), np.median(damping.ratios[paired]))
    ratios = np.append(damping.ratios, others)
    for asked in residuals:
        if isinstance(asked, AskedFrfs) and _identified(asked):
            assert asked.raw is not None
            residual = asked.settled
            assert isinstance(residual, FrfResidual)
            now = asked.raw(residual, damping.identified, state, damping_by_mode(ratios.tolist()))
            better = refined(residual, now, ratios, paired)
            if better is not None:
                ratios = np.append(better.ratios, others)
                way = replace(now.way, damping=damping_by_mode(ratios.tolist()))
                now = replace(now, way=way, common=better.common)
            raw[id(residual)] = now
            out.append(now)
        else:
            out.append(asked)
    return tuple(out)
