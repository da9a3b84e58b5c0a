"""The stages of a bottom-up study as records."""

from __future__ import annotations

from femtune.steps.update.record.reduction import ReductionResults
from femtune.study.record import Record


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
