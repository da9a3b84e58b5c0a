"""Validation as records: predictions on data that the update did not use, verdicts, and the goodness of fit."""

from __future__ import annotations

from femtune.steps.validate.record.frf_deviation import FrfDeviations
from femtune.steps.validate.record.frf_validation import PredictedCurves, PredictedFrf, PredictedResonance
from femtune.steps.vibration.record import VibrationResults
from femtune.study.record import LimitSense, Record, VerdictWord


class Prediction(Record):
    """A test mode that was not used in the update, and the prediction of the updated model."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency of the test in Hz."""
    model_number: int | None
    """Number of the model mode; None if no mode is similar."""
    model_freq_hz: float | None
    """Frequency of the updated model in Hz."""
    freq_error_percent: float | None
    """(model − test)/test in %."""
    mac: float | None
    """Modal assurance criterion, 0 to 1; None if the shape was measured at fewer than two DOFs."""
    before_freq_error_percent: float | None = None
    """The same error before the update in %."""
    remark: str = ""
    """The reason why the mode was not used."""
    data: str = ""
    """Kind of data: "held-out modes", "modified structure" …; "" if no criterion uses it."""
    paired: bool = True
    """False if the two modes are not a pair, and the model mode is the most similar one."""
    test_sd_percent: float | None = None
    """Standard deviation of the test's frequency, in % of it; None if not known."""
    parameter_sd_percent: float | None = None
    """That of the prediction, from the covariance of the parameters; None if not known."""
    z: float | None = None
    """The error in units of the standard deviation of test and prediction together (no unit)."""
    p_value: float | None = None
    """Probability of at least this error due to uncertainty alone, 0 to 1."""
    noise: str = ""
    """Whether uncertainty explains the error, in words."""


class ValidationVerdict(Record):
    """A criterion on data that the update did not use, with its limit and the measured value."""

    configuration: str
    """Name of the configuration."""
    data: str
    """Kind of data: "held-out modes", "beyond the frequencies used", "held-out sensors", "unused FRFs", "modified
    structure", "other boundary conditions", "another test", "same test, held out" or "vibration test"."""
    criterion: str
    """Quantity and standard: "frequency error, NASA-STD-5002"."""
    required: float
    """The limit, in `unit`."""
    sense: LimitSense
    """Which side of the limit passes."""
    measured: float | None
    """The worst measured value, in `unit`; None if not tested."""
    unit: str
    """"%", "dB" or "" (none)."""
    verdict: VerdictWord
    """Outcome."""
    remark: str
    """The decisive mode or FRF, or the reason why it was not tested."""
    noise: str
    """Whether noise explains a failure, in words; "" without a failure, or if it is not known."""
    sentence: str
    """The verdict in a sentence."""
    standard: str = ""
    """The standard alone: "NASA-STD-5002"; "" in older results."""
    before: float | None = None
    """The worst value of the model at the initial values, in `unit`; only for vibration tests."""
    before_verdict: VerdictWord | None = None
    """The verdict on it."""


class HeldOutShape(Record):
    """Shape error of a pair at the held-out sensors."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """The test mode, in words."""
    error_percent: float | None
    """Root mean square of test − model at these sensors, in % of that of the test's shape at all sensors; the scale of
    the model's shape is that of the sensors that were used. None if nothing was measured there."""
    noise_percent: float | None
    """Its expected value due to the noise of the shape; None if not known."""


class ValidationResults(Record):
    """Validation on data that the update did not use."""

    predictions: tuple[Prediction, ...]
    """Predictions of the modes that were not used."""
    not_tested: tuple[str, ...]
    """What was not tested, a sentence each."""
    profile: str = ""
    """Name of the profile of criteria."""
    verdicts: tuple[ValidationVerdict, ...] = ()
    """A verdict on each criterion, by configuration and kind of data."""
    held_out_sensors: tuple[str, ...] = ()
    """Held-out sensors, with their configuration."""
    shapes: tuple[HeldOutShape, ...] = ()
    """Shapes at these sensors."""
    frfs: tuple[PredictedFrf, ...] = ()
    """Measured FRFs that were not used, beside those of the updated model."""
    resonances: tuple[PredictedResonance, ...] = ()
    """Resonance peaks of these FRFs."""
    curves: tuple[PredictedCurves, ...] = ()
    """These FRFs line by line, by configuration."""
    vibrations: tuple[VibrationResults, ...] = ()
    """Sine sweeps and random vibration tests, beside the initial and the updated model."""
    deviations: FrfDeviations | None = None
    """Deviation δ of the FRFs before and after the update; None if the update uses no FRFs."""


class KindOfResiduals(Record):
    """The chi-square test of one kind of residual."""

    kind: str
    """"frequency", "shape" …"""
    chi_square: float
    """Sum of squares of the part that the parameters cannot change, or of all residuals if the update ended without an
    optimum, in units of the stated standard deviations."""
    degrees_of_freedom: int
    """Number of independent residuals."""
    p_value: float
    """Probability of at least this sum for noise of the stated size."""


class GoodnessResults(Record):
    """Whether the residuals at the end of the update are noise of the stated size."""

    chi_square: float | None
    """Sum of squares of the part of the residuals that the parameters cannot change, or of all of them if the update
    ended without an optimum; None where not tested."""
    degrees_of_freedom: int
    """Number of residuals minus the rank of the Jacobian, and minus those lost by scaling of the shapes."""
    p_value: float | None
    """Probability of at least this sum for noise of the stated size; None where not tested."""
    runs: int | None
    """Runs of one sign in the order of the comparisons; None for fewer than ten residuals."""
    runs_p_value: float | None
    """Probability of at most this number of runs; None where not tested."""
    largest: float | None
    """Largest residual, with its sign, in units of its own standard deviation."""
    largest_label: str
    """Its label."""
    by_kind: tuple[KindOfResiduals, ...]
    """The same by kind of residual."""
    verdict: VerdictWord
    """"fail" if the residuals are not noise (at the 1 % level)."""
    sentence: str
    """Outcome in words."""
    finding: str = ""
    """Name of the finding: "LARGE_SYSTEMATIC"; empty in older results."""
    values: int | None = None
    """Number of independent residuals, tested or not; None in older results."""
    rank: int | None = None
    """Number of combinations of parameters that are fitted to them; None in older results."""
    held: float | None = None
    """Chi-square that the parameters would remove from the residuals without their bounds, by the linear model; null
    where no bound is active, or the update has a regularisation or residuals that are not tested."""
    held_p_value: float | None = None
    """Probability of at least this value if the true parameters are within the bounds."""
