"""The stages of a bottom-up study: components, then joints; mass, stiffness, then damping."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.files.study_file.stage import RESONANCES
from femtune.residuals import UpdateProblem, case_without_modes
from femtune.status import Status
from femtune.study.resonances import resonance_case
from femtune.study.update_method import method_of
from femtune.updating import (
    NOBODY,
    Iteration,
    ParameterCovariance,
    ReductionRules,
    SetByHand,
    SideConstraint,
    Stage,
    UpdateResult,
    first_belief,
    posterior_of_covariance,
    run_stages,
)

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.files.study_file import StageEntry
    from femtune.residuals import ComparedCase, Evaluation
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study
    from femtune.updating import (
        Belief,
        StageResult,
        Told,
    )

Tell = Callable[[str, int, Iteration], None]


def bottom_up(
    study: Study, at: Evaluation, tell: Tell, told: Told = NOBODY
) -> tuple[UpdateResult, tuple[StageResult, ...]]:
    """Run the stages of a study. Returns them as one update, and each stage. `at` is the whole study at the initial
    values.

    Raises
    ------
    FemtuneError : ``study.stage``, ``correlate.no-pairs``, and what the residuals raise
    """
    plan = [_stage(study, i) for i, entry in enumerate(study.file.stage) if stage_parameters(study, entry)]
    results = run_stages(plan, first_belief(study.parameters), tell, told)
    return _as_one(study, at, results), results


def _stage(study: Study, i: int) -> Stage:
    entry, table = study.file.stage[i], study.file.update
    method = replace(
        method_of(table, study.parameters),
        max_iterations=entry.max_iterations or table.max_iterations,
        tolerance=entry.tolerance or table.tolerance,
    )
    parameters = stage_parameters(study, entry)
    seeds = tuple(
        {name: v for key, v in seed.items() for name in study.expand((key,)) if name in parameters}
        for seed in entry.seeds
    )
    by_hand = tuple(
        SetByHand(name, one.value, one.add, one.sd, one.reason)
        for one in entry.by_hand
        for name in study.expand((one.parameter,))
    )
    return Stage(entry.name, parameters, partial(_problem, study, i), method, entry.prior, seeds,
                 reduction_rules(study), by_hand)  # fmt: skip


def stage_parameters(study: Study, entry: StageEntry) -> tuple[str, ...]:
    """The parameters that a stage updates; none if it compares nothing of the specimen that the study is limited to."""
    if study.specimen is None:
        return study.expand(entry.parameters)
    some = any(case.used is not None for case in stage_cases(study, entry))
    return tuple(n for n in study.expand(entry.parameters) if some and n not in study.model.foreign)


def _problem(study: Study, i: int, x: Reals) -> UpdateProblem:
    """The update problem of a stage, made at the parameters where it starts."""
    entry = study.file.stage[i]
    cases = tuple(c for case in stage_cases(study, entry) for c in _compared(study, case, i, x))
    if not cases:
        raise _nothing(study, i)
    stated = study.file.residuals
    return UpdateProblem(cases, study.parameters, scatter=stated.scatter, common_sd=stated.common_frequency_sd)


def _nothing(study: Study, i: int) -> FemtuneError:
    entry = study.file.stage[i]
    return FemtuneError(
        "study.stage/nothing",
        where=study.file.where("stage", i, "residuals"),
        values={"residuals": ", ".join(entry.residuals)},
        stage=entry.name,
    )


def stage_cases(study: Study, entry: StageEntry) -> tuple[StudyCase, ...]:
    """The configurations of a stage; by default all that the update uses."""
    return tuple(
        case
        for case in study.cases
        if case.entry.use == "update" and (entry.configurations is None or case.name in entry.configurations)
    )


def _compared(study: Study, case: StudyCase, i: int, x: Reals) -> Iterable[ComparedCase]:
    """The configuration with the residuals of the stage; resonances are a case of their own."""
    entry = study.file.stage[i]
    used = used_in_stage(case, entry)
    keys = study.file.residuals.kinds_of_stage(entry.residuals)
    made = () if case.compared is None else case.compared.residuals
    residuals = tuple(some for r in made if (some := r.of_kinds(keys)) is not None)
    if entry.band_hz is not None:
        residuals = tuple(r.in_band(*entry.band_hz) for r in residuals)
    if used is not None and any(r.on_modes for r in residuals):
        yield replace(used, residuals=residuals)
    elif residuals:
        yield case_without_modes(case.configured, residuals, count=study.file.modes.count, solver=study.solver)
    if RESONANCES in entry.residuals:
        yield resonance_case(case, used, entry, x, study.file.where("stage", i, "residuals"))


OUTSIDE_BAND = "outside the band of the stage"
"""Reason for which a stage leaves out a test mode."""


def used_in_stage(case: StudyCase, entry: StageEntry) -> ComparedCase | None:
    """What the update uses of a configuration, without the test modes beyond the band of a stage."""
    used = case.used
    if used is None or entry.band_hz is None:
        return used
    low, high = entry.band_hz
    beyond = {i: OUTSIDE_BAND for i, hz in enumerate(used.test.freq_hz) if not low <= hz <= high}
    return replace(used, left_out={**beyond, **used.left_out})


def _as_one(study: Study, at: Evaluation, stages: tuple[StageResult, ...]) -> UpdateResult:
    """All stages as one update: from the initial values to the result of the last stage, with all iterations."""
    belief = stages[-1].belief
    after = study.problem().start(belief.x)
    failed = [s.best.status for s in stages if not s.best.status.ok]
    ends = [s.best.status for s in stages]
    best = Status.CONVERGED_AT_BOUNDS if Status.CONVERGED_AT_BOUNDS in ends else Status.CONVERGED
    best = Status.UNDETERMINED if Status.UNDETERMINED in ends else best
    active = tuple(p.name for p, determined in zip(study.parameters.free, belief.found) if determined)
    cited = tuple(dict.fromkeys(key for s in stages for key in s.best.citations))
    none, history = SideConstraint("none", np.zeros((0, len(belief.x)))), _history(stages)
    return UpdateResult(
        parameters=study.parameters,
        status=failed[0] if failed else best,
        x=belief.x,
        before=at,
        after=after,
        history=history,
        covariance=covariance_of_stages(belief, after),
        citations=cited,
        active=active,
        side=none,
        number=len(history) - 1,
    )


def _history(stages: tuple[StageResult, ...]) -> tuple[Iteration, ...]:
    """The iterations of the best run of every stage, numbered consecutively."""
    iterations = [iteration for stage in stages for iteration in stage.best.history]
    return tuple(replace(iteration, number=i) for i, iteration in enumerate(iterations))


def covariance_of_stages(belief: Belief, after: Evaluation) -> ParameterCovariance:
    """The covariance after all stages, with the reason for each parameter that has no standard deviation."""
    matrix = np.where(np.outer(belief.found, belief.found), belief.covariance, np.nan)
    by_hand = np.zeros(len(belief.x), bool) if belief.given is None else belief.given & ~belief.found
    reasons = {int(i): "not updated in any stage, σ not given" for i in np.flatnonzero(~belief.found)}
    reasons |= {int(i): "set by hand and not updated after that, σ not given" for i in np.flatnonzero(by_hand)}
    kinds = np.asarray(after.kinds)
    squares: Mapping[str, Reals] = {kind: after.residuals[kinds == kind] ** 2 for kind in dict.fromkeys(after.kinds)}
    misfit = {kind: float(np.sqrt(np.mean(values))) for kind, values in squares.items()}
    freedom = {kind: float(len(values) - after.lost[kind]) for kind, values in squares.items()}
    posterior = None
    if belief.found.any():
        posterior = posterior_of_covariance(belief.x, belief.covariance, belief.found, belief.parameters.limits)
    return ParameterCovariance(matrix, reasons, misfit, freedom=freedom, posterior=posterior)


def reduction_rules(study: Study) -> ReductionRules | None:
    """The rules of [reduction] with the components of the study; None without the table."""
    table = study.file.reduction
    if table is None:
        return None
    return ReductionRules(table.tolerance, table.full_solutions, table.order, study.components, table.frf_tolerance)
