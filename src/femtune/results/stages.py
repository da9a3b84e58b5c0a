"""The stages of a bottom-up study as records."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.assembly.stages import stage_cases, used_in_stage
from femtune.files.study_file.stage import RESONANCES
from femtune.residuals import pair_case, solve_case
from femtune.residuals.kinds import RESIDUALS
from femtune.results.base import Record
from femtune.results.reduction import ReductionResults, reduction_results

if TYPE_CHECKING:
    from femtune.assembly.study import Study
    from femtune.files.study_file import StageEntry
    from femtune.updating import StageResult, UpdateResult


class StageRun(Record):
    """One run of a stage, from the results of earlier stages or from a seed."""

    seed: int
    """0: started from the results of earlier stages; otherwise the number of the seed, from 1."""
    start: tuple[float, ...]
    """Initial values of the stage's parameters, in their units."""
    values: tuple[float, ...]
    """Final values."""
    objective: float | None
    """½ rᵀr with the prior, at the end (no unit); None if it could not start."""
    iterations: int
    """Accepted steps."""
    status: str
    """Name of the status; "" if it could not start."""
    message: str
    """The outcome, in a sentence."""
    agrees: bool
    """True if it reached an optimum within a tenth of a standard deviation of the best run's."""


class StageParameter(Record):
    """A parameter that a stage updated."""

    name: str
    """Name."""
    before: float
    """Value before the stage, in the unit of the parameter."""
    value: float
    """Value after it."""
    sd: float
    """Standard deviation, including the uncertainty of the fixed parameters."""
    sd_of_data: float | None
    """The same without this uncertainty; None if the update gives none."""


class StageErrorSum(Record):
    """Misfit of a test mode, or of a function, by one kind of residual."""

    configuration: str
    """Name."""
    label: str
    """The mode or function."""
    kind: str
    """Kind of residual."""
    before: float
    """|r|·σ before the stage, relative to what is compared (of FRFs the logarithm of the ratio; no unit)."""
    after: float
    """The same after it."""


class StageMisfit(Record):
    """Residuals of one kind relative to what noise and uncertain parameters explain."""

    kind: str
    """Kind of residual."""
    size: float
    """Root of the sum of squares over its expectation (no unit): about 1."""
    larger_than_noise: bool
    """True if it exceeds the 1 % point for a correct model; the standard deviations are then increased."""


class StageLeftOut(Record):
    """A test mode that a stage did not compare."""

    configuration: str
    """Name."""
    label: str
    """The mode."""
    reason: str
    """The reason."""


class StageFixed(Record):
    """A free parameter of the study that a stage did not update."""

    name: str
    """Name."""
    value: float
    """Its value during the stage."""


class StageByHand(Record):
    """A value that the study sets by hand before a stage."""

    parameter: str
    """Name."""
    before: float
    """Value at the end of earlier stages, in the unit of the parameter."""
    value: float
    """Value that was set."""
    sd: float
    """Its standard deviation."""
    reason: str
    """The reason stated in the study."""


class StageResults(Record):
    """One stage of a bottom-up study."""

    name: str
    """Name."""
    configurations: tuple[str, ...]
    """Configurations that it compared."""
    kinds: tuple[str, ...]
    """Kinds of residual that it compared."""
    ok: bool
    """True if the best run reached an optimum."""
    message: str
    """The outcome of the best run, in a sentence."""
    comparisons: int
    """Number of values that were compared."""
    band_hz: tuple[float, float | None] | None = None
    """Lowest and highest frequency that it compared, Hz, the second None without limit; None for all frequencies."""
    by_hand: tuple[StageByHand, ...] = ()
    """Values that were set by hand before it."""
    fixed: tuple[StageFixed, ...] = ()
    """Free parameters of the study that it did not update, with the values that they had."""
    parameters: tuple[StageParameter, ...]
    """Its parameters."""
    runs: tuple[StageRun, ...]
    """The runs from the results of earlier stages and from every seed."""
    misfit: tuple[StageMisfit, ...]
    """By kind."""
    error_sums: tuple[StageErrorSum, ...]
    """Misfits before and after."""
    left_out: tuple[StageLeftOut, ...] = ()
    """Modes that were not compared."""
    reduction: ReductionResults | None = None
    """The reduced models of the best run; None if it used the full models."""


# ----------------------------------------------------------------------------------------------------
# How the records are made.


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
