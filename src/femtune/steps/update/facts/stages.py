"""The stages of an update, as records."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.files.study_file.residual import TABLES
from femtune.files.study_file.stage import RESONANCES
from femtune.kinds import loaded
from femtune.residuals import pair_case, solve_case
from femtune.steps.update.facts.reduction import reduction_results
from femtune.steps.update.record.reduction import ReductionResults
from femtune.study.stages import stage_cases, used_in_stage

if TYPE_CHECKING:
    from femtune.files.study_file import StageEntry
    from femtune.study.study import Study
    from femtune.updating import StageResult, UpdateResult
from femtune.steps.update.record.stages import (
    StageByHand,
    StageErrorSum,
    StageFixed,
    StageLeftOut,
    StageMisfit,
    StageParameter,
    StageResults,
    StageRun,
)


def stage_results(study: Study, stages: Iterable[StageResult]) -> tuple[StageResults, ...]:
    """One record a stage."""
    return tuple(_stage(study, entry, result) for entry, result in zip(study.file.stage, stages))


def _stage(study: Study, entry: StageEntry, stage: StageResult) -> StageResults:
    return StageResults(
        name=entry.name,
        configurations=tuple(case.name for case in stage_cases(study, entry)),
        kinds=tuple(dict.fromkeys(stage.best.after.kinds)),
        ok=stage.best.status.ok,
        message=stage.best.status.value,
        comparisons=len(stage.best.after.residuals),
        band_hz=_band(entry),
        by_hand=tuple(_by_hand(stage)),
        fixed=tuple(
            StageFixed(name=p.name, value=stage.belief.values[p.name])
            for p in stage.belief.parameters.free
            if p.name not in stage.stage.parameters
        ),
        parameters=tuple(_parameter(stage, name) for name in stage.stage.parameters),
        runs=tuple(_runs(stage)),
        misfit=tuple(
            StageMisfit(kind=kind, size=m.size, larger_than_noise=m.large) for kind, m in stage.misfit.items()
        ),
        error_sums=tuple(
            StageErrorSum(configuration=s.configuration, label=s.label, kind=s.kind, before=s.before, after=s.after)
            for s in stage.error_sums
        ),
        left_out=tuple(_left_out(study, entry, stage.start.x)),
        reduction=_reduction(stage),
    )


def _reduction(stage: StageResult) -> ReductionResults | None:
    rules, reduced = stage.stage.reduction, stage.reduced
    return None if rules is None or reduced is None else reduction_results(reduced, rules)


def _band(entry: StageEntry) -> tuple[float, float | None] | None:
    return None if entry.band_hz is None else (entry.from_hz, entry.to_hz)


def _by_hand(stage: StageResult) -> Iterable[StageByHand]:
    for one in stage.stage.by_hand:
        yield StageByHand(
            parameter=one.parameter,
            before=stage.earlier.values[one.parameter],
            value=stage.start.values[one.parameter],
            sd=stage.start.sd[one.parameter],
            reason=one.reason,
        )


def _parameter(stage: StageResult, name: str) -> StageParameter:
    sd = stage.best.sd[name]
    return StageParameter(
        name=name,
        before=stage.start.values[name],
        value=stage.belief.values[name],
        sd=stage.belief.sd[name],
        sd_of_data=sd if np.isfinite(sd) else None,
    )


def _runs(stage: StageResult) -> Iterable[StageRun]:
    finished = iter(zip(stage.runs, stage.agreed))
    names = stage.stage.parameters
    for seed in range(len(stage.stage.seeds) + 1):
        if seed in stage.refused:
            yield _refused(stage, seed)
            continue
        run, agrees = next(finished)
        yield StageRun(
            seed=seed,
            start=_values(names, run, run.history[0].x),
            values=_values(names, run, run.x),
            objective=run.objective,
            iterations=len(run.history) - 1,
            status=run.status.name,
            message=run.status.value,
            agrees=agrees,
        )


def _refused(stage: StageResult, seed: int) -> StageRun:
    values = {**stage.start.values, **stage.stage.seeds[seed - 1]}
    start = tuple(values[name] for name in stage.stage.parameters)
    return StageRun(seed=seed, start=start, values=start, objective=None, iterations=0, status="",
                    message=f"the update could not start here: {stage.refused[seed]}", agrees=False)  # fmt: skip


def _values(names: Iterable[str], run: UpdateResult, x: NDArray[np.float64]) -> tuple[float, ...]:
    values = run.parameters.values(x)
    return tuple(values[name] for name in names)


def _left_out(study: Study, entry: StageEntry, x: NDArray[np.float64]) -> Iterable[StageLeftOut]:
    """Test modes without partner, or left out by the study, where the stage starts."""
    keys = study.file.residuals.kinds_of_stage(entry.residuals)
    if RESONANCES not in keys and not any(loaded(TABLES[key].made_by).of_modes for key in keys):
        return
    for case in stage_cases(study, entry):
        used = used_in_stage(case, entry)
        if used is not None and len(used.test):
            for mode in pair_case(used, solve_case(used, x)).unpaired_test:
                label = used.test.labels[mode.test]
                yield StageLeftOut(configuration=case.name, label=label, reason=mode.reason)
