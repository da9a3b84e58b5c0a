"""Records of the stages of a bottom-up study."""

from __future__ import annotations

from femtune.study.results_base import Record


class StageRun(Record):
    """One update of a stage, from what was believed or from a seed."""

    seed: int
    """0: started from what was believed; else the number of the seed, from 1."""
    start: tuple[float, ...]
    """Start values of the stage's parameters, in their units."""
    values: tuple[float, ...]
    """Where it ended."""
    objective: float | None
    """½ rᵀr with the prior, at the end (no unit); None where it could not start."""
    iterations: int
    """Accepted steps."""
    status: str
    """Name of the status; "" where it could not start."""
    message: str
    """What happened, in a sentence."""
    agrees: bool
    """True where it ended at an optimum within a tenth of a standard deviation of the best run's."""


class StageParameter(Record):
    """A parameter that a stage moved."""

    name: str
    """Name."""
    before: float
    """Value before the stage, in the unit of the parameter."""
    value: float
    """Value after it."""
    sd: float
    """Standard deviation, with the share of uncertain parameters that rested."""
    sd_of_data: float | None
    """The same if all that rested were known exactly; None where the update gives none."""


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
    """Residuals of one kind beside what noise and uncertain parameters explain."""

    kind: str
    """Kind of residual."""
    size: float
    """Root of the sum of squares over its expectation (no unit): about 1."""
    larger_than_noise: bool
    """True where chance exceeds it once in a hundred tests of a right model; the standard deviations are then wider."""


class StageLeftOut(Record):
    """A test mode that a stage did not compare."""

    configuration: str
    """Name."""
    label: str
    """The mode."""
    reason: str
    """Why."""


class StageResults(Record):
    """One stage of a bottom-up study."""

    name: str
    """Name."""
    configurations: tuple[str, ...]
    """States that it compared."""
    kinds: tuple[str, ...]
    """Kinds of residual that it compared."""
    ok: bool
    """True where the best run ended at an optimum."""
    message: str
    """How the best run ended, in a sentence."""
    comparisons: int
    """Number of values that were compared."""
    parameters: tuple[StageParameter, ...]
    """What it moved."""
    runs: tuple[StageRun, ...]
    """The updates from the belief and from every seed."""
    misfit: tuple[StageMisfit, ...]
    """By kind."""
    error_sums: tuple[StageErrorSum, ...]
    """Misfits before and after."""
    left_out: tuple[StageLeftOut, ...] = ()
    """Modes that were not compared."""
