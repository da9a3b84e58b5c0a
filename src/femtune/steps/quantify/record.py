"""Stochastic updating as records: mean and covariance of the parameters, from repeated tests."""

from __future__ import annotations

from femtune.study.record import CitationRecord, Record, VerdictWord

ORDER = "order of the tests"
OUTLIERS = "outliers"
HELD_OUT = "held-out repeats"


class QuantifiedParameter(Record):
    """Mean and standard deviation of one parameter from the repeated tests, in its unit."""

    parameter: str
    """Name of the parameter."""
    start: float
    """Initial value of the update of the means."""
    mean: float
    """Mean."""
    sd: float
    """Standard deviation of single structures or assemblies, not of the mean."""
    correlation: tuple[float, ...]
    """Correlation with each parameter of this list (no unit)."""
    cosine_distance: float | None
    """Distance 1 − cos of its scaled sensitivities from the leading space of the measured covariance: near 0 for a
    parameter that varies; None with fewer than four frequencies."""
    outside_bounds: bool
    """True if the mean is outside the bounds of the parameter; this step does not enforce them."""


class QuantifiedOutput(Record):
    """One frequency in the repeated tests and in the updated distribution."""

    label: str
    """Test mode."""
    repeats: int
    """Number of repeats with this mode."""
    measured_mean_hz: float
    """Mean of the repeats, in Hz."""
    measured_sd_hz: float
    """Standard deviation of the repeats, in Hz."""
    model_mean_hz: float
    """Mean of the samples of the forward check, in Hz."""
    model_sd_hz: float
    """Standard deviation of these samples, in Hz."""
    robust_sd_hz: float | None = None
    """Standard deviation to which outliers do not contribute, in Hz; None if there are too few repeats for it."""
    noise_sd_hz: float | None = None
    """Standard deviation of the measurement error of a single repeat, in Hz; None if it is neglected."""
    change_hz: float | None = None
    """Change from the first repeat to the last, or at a jump, in Hz; None if no dependence on order was found."""


class QuantifiedEntry(Record):
    """One entry of a mode shape in the repeated tests and in the updated distribution; each shape has unit norm."""

    label: str
    """Test mode and sensor."""
    repeats: int
    """Number of repeats with this entry."""
    measured_mean: float
    """Mean of the repeats."""
    measured_sd: float
    """Standard deviation of the repeats."""
    model_mean: float
    """Mean of the samples of the forward check."""
    model_sd: float
    """Standard deviation of these samples."""


class RepeatCheck(Record):
    """A test of the repeats, or of the predicted distribution, by its p-value."""

    check: str
    """"order of the tests", "outliers" or "held-out repeats"."""
    p_value: float | None
    """Probability of a result as extreme if there is no such effect; None if not tested."""
    limit: float
    """Smallest p-value that passes."""
    verdict: VerdictWord
    """Outcome."""
    sentence: str
    """Result of the test, or the reason why it was not tested."""


class ParameterInterval(Record):
    """Interval of one parameter, in its unit."""

    parameter: str
    """Name of the parameter."""
    lower: float
    """Lower end."""
    upper: float
    """Upper end."""


class OutputInterval(Record):
    """Smallest and largest value of one frequency, in the repeats and in the box of the parameters."""

    label: str
    """Test mode."""
    measured_lower_hz: float
    """Smallest value of the repeats, in Hz."""
    measured_upper_hz: float
    """Largest value of the repeats, in Hz."""
    model_lower_hz: float
    """Smallest value in the box, in Hz."""
    model_upper_hz: float
    """Largest value in the box, in Hz."""


class IntervalResults(Record):
    """Interval updating: the box of the parameters whose extreme frequencies are nearest to the measured ones."""

    ok: bool
    """True if the box converged and is determined by the frequencies."""
    proven: bool
    """True if the extrema over the box are proven by monotony."""
    sentence: str
    """The outcome."""
    solutions: int
    """Number of model solutions."""
    parameters: tuple[ParameterInterval, ...]
    """One record a free parameter; none if no box was found."""
    outputs: tuple[OutputInterval, ...]
    """One record a compared frequency; none if no box was found."""


class PopulationParameter(Record):
    """One parameter over the population, in its unit; 95 % intervals."""

    parameter: str
    """Name of the parameter."""
    mean: float
    """Mean of the population, median of the samples."""
    mean_interval_95: tuple[float, float]
    """Its interval."""
    sd: float
    """Standard deviation of single structures, median of the samples."""
    sd_interval_95: tuple[float, float]
    """Its interval."""
    new_interval_95: tuple[float, float]
    """Interval of the parameter of a further structure of this population."""


class PopulationCorrelation(Record):
    """Correlation of two parameters over the population."""

    first: str
    """Name of a parameter."""
    second: str
    """Name of the other one."""
    correlation: float
    """Median of the samples."""
    interval_95: tuple[float, float]
    """Its interval."""


class PopulationResults(Record):
    """The distribution of the parameters over nominally identical structures, with its uncertainty."""

    parameters: tuple[PopulationParameter, ...]
    """One record a free parameter."""
    correlations: tuple[PopulationCorrelation, ...]
    """One record a pair of parameters."""
    repeats: int
    """Number of repeats that it is made of."""
    r_hat: float
    """R-hat of the slowest of means and standard deviations; below 1.05 the chains have forgotten where they began."""
    misfit: float
    """Sum of squares of the errors in their standard deviations, at the parameters of each repeat."""
    degrees: float
    """Its expected value, if the parameters explain the repeats within the measurement errors."""
    ok: bool
    """True if R-hat is below its limit, and the repeats fit within the measurement errors."""
    sentences: tuple[str, ...]
    """The result in sentences."""
    individual_key: str
    """Key of the parameters of each repeat: median and standard deviation, shape (2, repeats, parameters)."""
    samples_key: str
    """Key of samples of mean, standard deviation and a further structure, shape (3, samples, parameters)."""


class QuantifyResults(Record):
    """Stochastic updating and its forward check."""

    configuration: str
    """Configuration whose tests were repeated."""
    method: str
    """Formulation: "second-order", "perturbation", "cross-covariance" or "output-difference"."""
    status: str
    """Name of the status."""
    message: str
    """The outcome, in a sentence."""
    ok: bool
    """True if mean and covariance may be used."""
    estimate: str
    """How mean and covariance of the repeats were estimated."""
    repeats: int
    """Number of repeats."""
    solutions: int
    """Number of model solutions, including the update of the means, without the forward check."""
    samples: int
    """Samples of the forward check."""
    covariance_error_percent: float
    """Relative difference between the covariances of samples and repeats, in measured standard deviations, in %."""
    chance_error_percent: float
    """Expected sampling error of the covariance for this number of repeats, in %."""
    unexplained_percent: float
    """Part of the measured variance that variations of these parameters cannot explain, to first order, in %."""
    agrees: bool
    """True if the samples reproduce the measured means and covariance."""
    parameters: tuple[QuantifiedParameter, ...]
    """One record a free parameter."""
    outputs: tuple[QuantifiedOutput, ...]
    """One record a compared frequency."""
    sentences: tuple[str, ...]
    """Sentences of the step, the verdict first."""
    repeats_key: str | None
    """Key of the measured frequencies, shape (repeats, outputs), Hz; NaN where not measured."""
    covariance_key: str | None
    """Key of their estimated covariance, shape (outputs, outputs), Hz²."""
    cloud_key: str | None
    """Key of the frequencies of the samples, shape (samples, outputs), Hz."""
    parameter_covariance_key: str | None
    """Key of the covariance of the parameters, shape (parameters, parameters), in their units."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications on the method."""
    checks: tuple[RepeatCheck, ...] = ()
    """Tests of the repeats, and of the prediction for repeats that were held out."""
    noise_percent: float | None = None
    """Part of the measured variance that is due to measurement errors, in %; None if these are neglected."""
    entries: tuple[QuantifiedEntry, ...] = ()
    """One record for each entry of a mode shape, if the study requests shapes."""
    output_covariance_key: str | None = None
    """Key of the estimated covariance of frequencies (Hz), then entries of shapes, in the order of `outputs` and
    `entries`; None without shapes."""
    intervals: IntervalResults | None = None
    """Intervals of the parameters; None if the study does not request them."""
    population: PopulationResults | None = None
    """The population with its uncertainty; None if the study does not request it."""
    outliers: tuple[int, ...] = ()
    """Numbers of the outlying repeats, from 1 in the order of the tests."""
    held_out: tuple[int, ...] = ()
    """Numbers of the repeats that the update did not use."""
    robust_distance_key: str | None = None
    """Key of the robust distances of the repeats from their mean, shape (repeats), NaN for repeats with missing values;
    None if there are too few repeats."""
