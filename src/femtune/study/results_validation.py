"""Records about data that the update did not use: predictions, verdicts, and whether its residuals are noise."""

from __future__ import annotations

from typing import Literal

from femtune.study.results_base import Record, VerdictWord


class Prediction(Record):
    """A test mode that was not used in the update, beside what the updated model predicts."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency of the test in Hz."""
    model_number: int | None
    """Number of the model mode; None where none answers."""
    model_freq_hz: float | None
    """Frequency of the updated model in Hz."""
    freq_error_percent: float | None
    """(model − test)/test in %."""
    mac: float | None
    """Modal assurance criterion, 0 to 1."""
    before_freq_error_percent: float | None = None
    """The same error before the update in %."""
    remark: str = ""
    """Why the mode was not used, or what to think of it."""
    data: str = ""
    """What kind of data it is: "held-out modes", "modified structure" …; "" where nothing is judged by it."""
    paired: bool = True
    """False where the two modes are not a pair, and the model mode is only the most alike."""
    test_sd_percent: float | None = None
    """Standard deviation of the test's frequency, in % of it; None where it is not known."""
    parameter_sd_percent: float | None = None
    """That of the prediction, from the covariance of the parameters; None where it is not known."""
    z: float | None = None
    """The error in units of the standard deviation of test and prediction together (no unit)."""
    p_value: float | None = None
    """Chance of an error as large by scatter alone, 0 to 1."""
    noise: str = ""
    """What part of the error scatter explains, in words."""


class ValidationVerdict(Record):
    """A criterion on data that the update did not use, with the measured number beside its own."""

    configuration: str
    """Name of the configuration."""
    data: str
    """What kind of data it is: "held-out modes", "beyond the frequencies used", "held-out sensors", "modified
    structure", "other boundary conditions" or "another test"."""
    criterion: str
    """What is asked: "frequency error, NASA-STD-5002"."""
    required: float
    """The criterion's number, in `unit`."""
    sense: Literal["at most", "at least"]
    """Which side of it passes."""
    measured: float | None
    """The worst measured number, in `unit`; None where not tested."""
    unit: str
    """"%" or "" (none)."""
    verdict: VerdictWord
    """Outcome."""
    remark: str
    """The mode that decided, or why it was not tested."""
    noise: str
    """What part of a miss noise explains, in words; "" where nothing missed or nothing is known."""
    sentence: str
    """All of it in words."""


class HeldOutShape(Record):
    """The shape of a pair at the sensors that were held out."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """The test mode, in words."""
    error_percent: float | None
    """Root mean square of test − model at these sensors, in % of that of the test's shape at all sensors; the scale of
    the model's shape is that of the sensors that were used. None where nothing was measured there."""
    noise_percent: float | None
    """What the scatter of the shape gives on average, likewise; None where it is not known."""


class ValidationResults(Record):
    """On data that were not used."""

    predictions: tuple[Prediction, ...]
    """Modes that were held out."""
    not_tested: tuple[str, ...]
    """What was not tested, a sentence each."""
    profile: str = ""
    """Name of the profile of criteria."""
    verdicts: tuple[ValidationVerdict, ...] = ()
    """A verdict on each criterion, by configuration and kind of data."""
    held_out_sensors: tuple[str, ...] = ()
    """Sensors that the update did not see, with their configuration."""
    shapes: tuple[HeldOutShape, ...] = ()
    """Shapes at these sensors."""


class KindOfResiduals(Record):
    """The chi-square test of one kind of residual by itself."""

    kind: str
    """"frequency", "shape" …"""
    chi_square: float
    """Sum of squares of what no parameters could remove, in units of the stated standard deviations."""
    degrees_of_freedom: int
    """How many independent residuals that are."""
    p_value: float
    """Chance of a sum as large or larger by noise of the stated size."""


class GoodnessResults(Record):
    """Whether the residuals at the end of the update are noise of the stated size."""

    chi_square: float | None
    """Sum of squares of the part of the residuals that no parameters could remove; None where not tested."""
    degrees_of_freedom: int
    """Residuals less the rank of the Jacobian, and less what normalising shapes takes."""
    p_value: float | None
    """Chance of a sum as large or larger by noise of the stated size; None where not tested."""
    runs: int | None
    """Runs of one sign in the order of the comparisons; None for fewer than ten residuals."""
    runs_p_value: float | None
    """Chance of as few runs; None likewise."""
    largest: float | None
    """Largest residual, with its sign, in units of its own standard deviation."""
    largest_label: str
    """What it compares."""
    by_kind: tuple[KindOfResiduals, ...]
    """The same by kind of residual."""
    verdict: VerdictWord
    """"fail" where the residuals are not noise (at 1 %)."""
    sentence: str
    """Outcome in words."""
