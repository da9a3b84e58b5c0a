"""The stages of an update, as records."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.files.study_file.stage import RESONANCES
from femtune.residuals import pair_case, solve_case
from femtune.residuals.kinds import RESIDUALS
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


def stage_results(study: Study, found: Iterable[StageResult]) -> tuple[StageResults, ...]:
    """One record a stage."""
    return tuple(_stage(study, entry, result) for entry, result in zip(study.file.stage, found))


def _stage(study: Study, entry: StageEntry, found: StageResult) -> StageResults:
    return StageResults(
        name=entry.name,
        configurations=tuple(case.name for case in stage_cases(study, entry)),
        kinds=tuple(dict.fromkeys(found.best.after.kinds)),
        ok=found.best.status.ok,
        message=found.best.status.value,
        comparisons=len(found.best.after.residuals),
        band_hz=_band(entry),
        by_hand=tuple(_by_hand(found)),
        fixed=tuple(
            StageFixed(name=p.name, value=found.belief.values[p.name])
            for p in found.belief.parameters.free
            if p.name not in found.stage.parameters
        ),
        parameters=tuple(_parameter(found, name) for name in found.stage.parameters),
        runs=tuple(_runs(found)),
        misfit=tuple(
            StageMisfit(kind=kind, size=m.size, larger_than_noise=m.large) for kind, m in found.misfit.items()
        ),
        error_sums=tuple(
            StageErrorSum(configuration=s.configuration, label=s.label, kind=s.kind, before=s.before, after=s.after)
            for s in found.error_sums
        ),
        left_out=tuple(_left_out(study, entry, found.start.x)),
        reduction=_reduction(found),
    )


def _reduction(found: StageResult) -> ReductionResults | None:
    rules, reduced = found.stage.reduction, found.reduced
    return None if rules is None or reduced is None else reduction_results(reduced, rules)


def _band(entry: StageEntry) -> tuple[float, float | None] | None:
    return None if entry.band_hz is None else (entry.from_hz, entry.to_hz)


def _by_hand(found: StageResult) -> Iterable[StageByHand]:
    for one in found.stage.by_hand:
        yield StageByHand(
            parameter=one.parameter,
            before=found.earlier.values[one.parameter],
            value=found.start.values[one.parameter],
            sd=found.start.sd[one.parameter],
            reason=one.reason,
        )


def _parameter(found: StageResult, name: str) -> StageParameter:
    own = found.best.sd[name]
    return StageParameter(
        name=name,
        before=found.start.values[name],
        value=found.belief.values[name],
        sd=found.belief.sd[name],
        sd_of_data=own if np.isfinite(own) else None,
    )


def _runs(found: StageResult) -> Iterable[StageRun]:
    finished = iter(zip(found.runs, found.agreed))
    names = found.stage.parameters
    for seed in range(len(found.stage.seeds) + 1):
        if seed in found.refused:
            yield _refused(found, seed)
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


def _refused(found: StageResult, seed: int) -> StageRun:
    values = {**found.start.values, **found.stage.seeds[seed - 1]}
    start = tuple(values[name] for name in found.stage.parameters)
    return StageRun(seed=seed, start=start, values=start, objective=None, iterations=0, status="",
                    message=f"the update could not start here: {found.refused[seed]}", agrees=False)  # fmt: skip


def _values(names: Iterable[str], run: UpdateResult, x: NDArray[np.float64]) -> tuple[float, ...]:
    values = run.parameters.values(x)
    return tuple(values[name] for name in names)


def _left_out(study: Study, entry: StageEntry, x: NDArray[np.float64]) -> Iterable[StageLeftOut]:
    """Test modes without partner, or left out by the study, where the stage starts."""
    keys = study.file.residuals.kinds_of_stage(entry.residuals)
    if RESONANCES not in keys and not any(RESIDUALS[key].load().of_modes for key in keys):
        return
    for case in stage_cases(study, entry):
        used = used_in_stage(case, entry)
        if used is not None and len(used.test):
            for mode in pair_case(used, solve_case(used, x)).unpaired_test:
                label = used.test.labels[mode.test]
                yield StageLeftOut(configuration=case.name, label=label, reason=mode.reason)
