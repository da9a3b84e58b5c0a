"""Records of the stages of a bottom-up study."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from femtune.files.study_file import StageEntry
from femtune.residuals import pair_case, solve_case
from femtune.study.bottom_up import stage_cases
from femtune.study.load import Study
from femtune.study.results_stages import (
    StageErrorSum,
    StageLeftOut,
    StageMisfit,
    StageParameter,
    StageResults,
    StageRun,
)
from femtune.update import StageResult, UpdateResult

_OF_MODES = frozenset({"frequency", "shape", "resonances", "mac", "strain", "flexibility", "dynamic"})


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
        parameters=tuple(_parameter(found, name) for name in entry.parameters),
        runs=tuple(_runs(entry, found)),
        misfit=tuple(
            StageMisfit(kind=kind, size=m.size, larger_than_noise=m.large) for kind, m in found.misfit.items()
        ),
        error_sums=tuple(
            StageErrorSum(configuration=s.configuration, label=s.label, kind=s.kind, before=s.before, after=s.after)
            for s in found.error_sums
        ),
        left_out=tuple(_left_out(study, entry, found.start.x)),
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


def _runs(entry: StageEntry, found: StageResult) -> Iterable[StageRun]:
    finished = iter(zip(found.runs, found.agreed))
    for seed in range(len(entry.seeds) + 1):
        if seed in found.refused:
            yield _refused(entry, found, seed)
            continue
        run, agrees = next(finished)
        yield StageRun(
            seed=seed,
            start=_values(entry, run, run.history[0].x),
            values=_values(entry, run, run.x),
            objective=run.history[-1].objective,
            iterations=len(run.history) - 1,
            status=run.status.name,
            message=run.status.value,
            agrees=agrees,
        )


def _refused(entry: StageEntry, found: StageResult, seed: int) -> StageRun:
    values = {**found.start.values, **entry.seeds[seed - 1]}
    start = tuple(values[name] for name in entry.parameters)
    return StageRun(seed=seed, start=start, values=start, objective=None, iterations=0, status="",
                    message=f"no update could start here: {found.refused[seed]}", agrees=False)  # fmt: skip


def _values(entry: StageEntry, run: UpdateResult, x: NDArray[np.float64]) -> tuple[float, ...]:
    values = run.parameters.values(x)
    return tuple(values[name] for name in entry.parameters)


def _left_out(study: Study, entry: StageEntry, x: NDArray[np.float64]) -> Iterable[StageLeftOut]:
    """Test modes without partner, or left out by the study, where the stage starts."""
    if not _OF_MODES.intersection(entry.residuals):
        return
    for case in stage_cases(study, entry):
        used = case.used
        if used is not None and len(used.test):
            for mode in pair_case(used, solve_case(used, x)).unpaired_test:
                label = used.test.labels[mode.test]
                yield StageLeftOut(configuration=case.name, label=label, reason=mode.reason)
