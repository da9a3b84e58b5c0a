"""Selection, update and write-back as records: identifiability, updated values, written deck."""

from __future__ import annotations

from typing import Literal

from femtune.steps.select.record.fisher import FisherResults
from femtune.steps.update.record.iterations import IterationFrfs
from femtune.steps.update.record.left_out import ModeLeftOutOfFrfs
from femtune.steps.update.record.raw import RawResults
from femtune.steps.update.record.reduction import ReductionResults
from femtune.steps.update.record.search import (
    CertificateResults,
    MinimumResults,
    SmallestChangeResults,
    StartsResults,
    WeightChoiceResults,
)
from femtune.steps.update.record.stages import StageResults
from femtune.steps.update.record.truncation import FrfTruncation
from femtune.steps.validate.record.validation import GoodnessResults
from femtune.study.record import CitationRecord, Record
from femtune.updating.kinds import IntervalKind

BoundState = Literal["", "lower", "upper"]


class ParameterFacts(Record):
    """A parameter of the study."""

    name: str
    """Name."""
    fields: tuple[str, ...]
    """Fields of the deck that it sets, "PBAR 1 I1"; empty if there is none."""
    unit: str
    """Unit of its values; "" for a factor."""
    nominal: float
    """Initial value, in `unit`."""
    lower: float | None
    """Lower bound, in `unit`; None for a tied parameter."""
    upper: float | None
    """Upper bound, in `unit`; None for a tied parameter."""
    prior_mean: float | None
    """Mean of the prior, in `unit`; None for a tied parameter."""
    prior_sd: float | None
    """Standard deviation of the prior, in `unit`; None for a tied parameter."""
    tie: str = ""
    """Expression of other parameters; "" for a free parameter."""
    elements: int | None = None
    """Number of elements in its region; None if it affects all that use its fields."""


class PairingEvent(Record):
    """A change of pairing between two iterations."""

    iteration: int
    """Iteration after which it happened."""
    configuration: str
    """Name of the configuration."""
    sentence: str
    """The change, in words."""
    merged: bool = False
    """True where test modes whose partners alternated are compared as one subspace from there on."""


class IterationModeRecord(Record):
    """A paired mode at one point of the history."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency of the test in Hz."""
    freq_hz: float
    """Frequency of the model in Hz."""
    mac: float | None
    """MAC of the pair, of close modes with the model's motion nearest to the test's; None without a measured shape."""


class IterationRecord(Record):
    """One point of the update's history."""

    iteration: int
    """Number, 0 at the start."""
    objective_percent: float
    """Weighted mean error √(Σr²/Σw²) in %."""
    step_length: float | None
    """Norm of the step in normalised parameters (no unit); None at the start."""
    damping: float | None
    """Levenberg-Marquardt damping of the step (no unit); None without damping."""
    parameters: tuple[float, ...]
    """Values of the free parameters, each in its unit, in the order of UpdateResults.history_parameters."""
    active_bounds: tuple[str, ...] = ()
    """Names of parameters at a bound."""
    events: tuple[str, ...] = ()
    """Changes of pairing that followed, in words."""
    to_smallest_change: bool = False
    """True on the way from the minimum within the bounds to the smallest change."""
    long_step: bool = False
    """True for a long step, taken since no short one reduced the objective function."""
    modes: tuple[IterationModeRecord, ...] = ()
    """Paired modes; empty if no modes are compared, and in older results without this field."""


class WrittenValue(Record):
    """A parameter's value in one field of the deck."""

    field: str
    """The field: "PBAR 1 I1"."""
    value: float
    """The value of the written text, in units of the deck."""


class PhysicalValue(Record):
    """A field that a factor multiplies."""

    field: str
    """The field: "PBAR 1 I1"."""
    unit: str
    """Unit of its values in the units of the study; "" if it has none, or if the card does not tell."""
    nominal: float
    """Initial value, in `unit`."""
    value: float
    """Updated value, in `unit`."""
    interval_95: tuple[float, float] | None
    """95 % interval, in `unit`; None if the parameter has none."""


class ParameterResult(Record):
    """A parameter after the update."""

    name: str
    """Name."""
    value: float
    """Final value, in the unit of the parameter."""
    sd: float | None
    """Its standard deviation, in the unit of the parameter; None if `sd_reason` gives a reason."""
    sd_reason: str
    """The reason why there is no sd: "at bound, σ not given"; "" where there is one."""
    interval_95: tuple[float, float] | None = None
    """Equal-tailed 95 % interval in the unit of the parameter, within its bounds; None if none is given."""
    interval_kind: IntervalKind = ""
    """Distribution of the interval: "normal" for stated standard deviations, "Student's t" if the variance was
    estimated from the residuals; "truncated" if a bound cuts off a part of that distribution; "bounds" if the data
    hardly narrow what the bounds leave open; "" without interval."""
    mean: float | None = None
    """Mean of this distribution, in the unit of the parameter."""
    median: float | None = None
    """Its median."""
    change_percent: float | None
    """(final − nominal)/|nominal| in %; None if the nominal value is zero."""
    at_bound: BoundState
    """"lower", "upper" or "" (inside)."""
    written: tuple[WrittenValue, ...] = ()
    """Values in the updated deck."""
    physical: tuple[PhysicalValue, ...] = ()
    """Fields that a factor multiplies, with their values; empty for a parameter that is no factor of fields."""


class DerivedResult(Record):
    """A quantity that follows from the parameters."""

    name: str
    """Name."""
    expression: str
    """Expression of parameters."""
    unit: str
    """Unit; "" where none is given."""
    nominal: float | None
    """Its initial value, in `unit`; None if the expression is not finite."""
    value: float | None
    """Its value after the update, in `unit`; None if the expression is not finite."""
    sd: float | None
    """Standard deviation by linear propagation, in `unit`; None where not given."""
    sd_reason: str = ""
    """The reason why none is given: "stiffness: at bound, σ not given"."""
    interval_95: tuple[float, float] | None = None
    """Equal-tailed 95 % interval, in `unit`; None if none is given."""
    interval_kind: IntervalKind = ""
    """Distribution of the interval, as for a parameter."""
    mean: float | None = None
    """Mean of this distribution, in `unit`."""
    median: float | None = None
    """Its median."""


class ResidualCount(Record):
    """Residuals of one kind."""

    kind: str
    """"frequency", "shape", "mass", …"""
    sd_of_test: bool = False
    """True if their standard deviations are those that the test has, in place of values of the study."""
    count: int
    """Their number."""
    misfit: float | None
    """Their root mean square at the end in units of the stated standard deviations (no unit), corrected for the
    fitted parameters: about 1 if the stated standard deviations are correct; None: not known (an earlier femtune)."""
    freedom: float = 0.0
    """Degrees of freedom of these residuals after the fit (no unit)."""
    widened: bool = False
    """True if they are larger than the stated standard deviations easily explain (20 % point of χ²), so that they widen
    the intervals of the parameters."""
    error_factor: float = 1.0
    """Factor on the stated standard deviations with which errors of this kind count in the intervals: the size that the
    residuals show where they widen the intervals, or with scatter = "estimated"; 1 otherwise."""
    rms_before: float | None = None
    """Their root mean square at the start, in units of the stated standard deviations (no unit); None: not known."""
    rms_after: float | None = None
    """The same at the end (no unit)."""
    error_before_percent: float | None = None
    """Weighted mean error √(Σr²/Σw²) of this kind at the start, in % of the measured values; None: not known."""
    error_after_percent: float | None = None
    """The same at the end, in %."""


class ComparisonResults(Record):
    """One comparison: a mode's frequency or shape, a load case, the mass …; before and after the update."""

    configuration: str
    """Name of the configuration."""
    kind: str
    """"frequency", "shape", "static displacement" …"""
    label: str
    """Label of the test mode, or of what else was measured."""
    count: int
    """Number of residuals."""
    error_before_percent: float | None
    """Size of the misfit at the start, in % of the measured values; None if it was not compared."""
    error_after_percent: float
    """The same at the end, in %."""
    rms_after: float
    """Root mean square of its residuals at the end, in units of the stated standard deviation (no unit)."""


class PoleResults(Record):
    """A measured pole λ = ω(−ζ + i√(1 − ζ²)) and that of the damped model, before and after the update."""

    configuration: str
    """Name of the configuration."""
    label: str
    """Label of the test mode; of close modes whose mean poles are compared, all labels."""
    measured_hz: float
    """Measured natural frequency, the modulus of λ over 2π, in Hz."""
    before_hz: float | None
    """That of the model at the start, in Hz; None if the mode was not paired."""
    after_hz: float
    """The same at the end, in Hz."""
    measured_ratio: float
    """Measured damping ratio (no unit)."""
    before_ratio: float | None
    """That of the model at the start (no unit); None if the mode was not paired."""
    after_ratio: float
    """The same at the end (no unit)."""


class UpdateResults(Record):
    """The update."""

    status: str
    """Name of the status: "CONVERGED_AT_BOUNDS"."""
    message: str
    """The outcome, in a sentence."""
    ok: bool
    """True if the result is an optimum."""
    method: str
    """Name of the solver, in words."""
    objective_before_percent: float
    """Weighted mean error √(Σr²/Σw²) at the start, in %."""
    objective_after_percent: float
    """The same at the end, in %."""
    objective_as_written_percent: float | None
    """The same for the values written to the deck, in %; None if nothing was written."""
    history_parameters: tuple[str, ...]
    """Names of the columns of IterationRecord.parameters."""
    history: tuple[IterationRecord, ...]
    """One record per iteration, beginning with the initial point."""
    raw: RawResults | None = None
    """The update with measured FRFs after that with equal damping; None if there was none."""
    frfs: tuple[IterationFrfs, ...] = ()
    """Compared FRFs at each iteration; empty without FRF residuals, and in older results."""
    parameters: tuple[ParameterResult, ...]
    """Free and tied parameters after the update."""
    derived: tuple[DerivedResult, ...] = ()
    """Quantities that follow from the parameters, as the study defines them."""
    pairing_events: tuple[PairingEvent, ...]
    """Changes of pairing; empty if there were none."""
    regularisation: str
    """Name of the regularisation; "none" without regularisation."""
    regularisation_weight: float | None
    """Its weight (no unit)."""
    interval_samples: float | None = None
    """Effective number of samples of the distribution within the bounds, of the parameter with the fewest; 0 if the
    samples did not become stationary; None if no samples were needed."""
    residual_counts: tuple[ResidualCount, ...]
    """Residuals by kind."""
    comparisons: tuple[ComparisonResults, ...] = ()
    """Every comparison by itself."""
    poles: tuple[PoleResults, ...] = ()
    """Poles of residuals of kind complex-eigenvalue and damping."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications on the methods of the update."""
    goodness: GoodnessResults | None = None
    """Goodness of fit: whether the residuals are noise; None in older results without this field."""
    stages: tuple[StageResults, ...] = ()
    """Stages of a bottom-up study, in their order; the history has the best run of each, one after another."""
    weight_choice: WeightChoiceResults | None = None
    """Choice of the regularisation weight; None if it was given or there is none."""
    starts: StartsResults | None = None
    """The starts of a multi-start update; None for a single start."""
    reduction: ReductionResults | None = None
    """Reduced models of the update; None if it used the full model."""
    fisher: FisherResults | None = None
    """Fisher information of the FRFs at the result; None without residuals of measured FRFs."""
    frf_truncation: tuple[FrfTruncation, ...] = ()
    """Error of the FRFs of residuals by truncation of the modes, at start and end; empty without FRF residuals."""
    left_out_modes: tuple[ModeLeftOutOfFrfs, ...] = ()
    """Modes of the model that are left out of the compared FRFs; empty where none is."""
    iteration: int | None = None
    """The iteration whose point is the result; None in older results, where it is the last one."""
    chi_square: float | None = None
    """Sum of squares at the result, side constraint included (no unit); None in older results."""
    certificate: CertificateResults | None = None
    """First-order conditions at the result; None of a bottom-up study, and in older results."""
    smallest_change: SmallestChangeResults | None = None
    """The smallest change within a margin of the minimum; None where the result is a minimum within the bounds."""
    minimum: MinimumResults | None = None
    """What was tried for a better minimum at the end; None of several starts, of stages, of an external solver, with
    `look_further = false`, and in older results."""
    looked_further: bool = True
    """False with `look_further = false`: no better minimum was looked for, no missing field was made a parameter."""
