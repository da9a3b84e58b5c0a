"""The posterior distribution of the parameters as a record."""

from __future__ import annotations

from femtune.modal.kinds import FrfKind
from femtune.sampling.kinds import Discrepancy, NoiseRule, Route
from femtune.study.record import Alert, CitationRecord, Record


class PosteriorParameter(Record):
    """One parameter, in its unit."""

    parameter: str
    """Name of the parameter."""
    value: float
    """Result of the update."""
    mean: float
    """Mean of the samples."""
    median: float
    """Median of the samples."""
    sd: float
    """Standard deviation of the samples."""
    interval_95: tuple[float, float]
    """Interval between the 2.5 % and the 97.5 % quantile."""
    linear_median: float
    """Median with linearised residuals, the same prior and the same rule for the errors."""
    linear_sd: float
    """Standard deviation with linearised residuals."""
    linear_interval_95: tuple[float, float]
    """The interval with linearised residuals."""
    update_interval_95: tuple[float, float] | None
    """The interval of the update; None where it gives none."""
    of_data_sd: float | None = None
    """Standard deviation with errors of the data alone; None where no errors of the model are taken."""
    of_data_interval_95: tuple[float, float] | None = None
    """The interval with errors of the data alone; None where no errors of the model are taken."""
    prior_sd: float | None
    """Standard deviation before the test: that of a uniform distribution between the bounds, or of the prior of the
    update; None for tied parameters."""
    of_bounds: bool
    """True if the data tell nothing of it: it is as wide as before."""


class PosteriorNoise(Record):
    """Size of the errors of some residuals."""

    residuals: str
    """Kind of residual."""
    count: float
    """Number of independent residuals."""
    factor: float
    """Actual over stated standard deviation, median; 1 where it is not estimated."""
    interval_95: tuple[float, float] | None
    """Interval of the factor; None where it is not estimated."""


class ModelErrorClass(Record):
    """Unknown changes of one kind of property, mass or support, which have one standard deviation."""

    what: str
    """What they are changes of."""
    count: int
    """Number of unknown changes."""
    sd_percent: float
    """Their standard deviation, median, in % of the usual change of each field: 20 % of a stiffness, 10 % of a mass. Of
    masses and supports that the deck does not have it is relative to the largest plausible one."""
    interval_95: tuple[float, float]
    """Its interval, in %."""


class WantedChange(Record):
    """A change of something that no parameter represents."""

    what: str
    """Field of the deck, mass or support."""
    of: str
    """Its class."""
    change_percent: float
    """Most probable change in % of the value of the deck; of a mass that the deck does not have, of 5 % of the mass of
    the model, and of a support of the largest plausible compliance."""


class BentPair(Record):
    """Two parameters whose joint distribution is bent."""

    first: str
    """Name of a parameter."""
    second: str
    """Name of the other one."""
    share_percent: float
    """Part of the variance of the second one that a parabola in the first explains beyond a line, in %."""


class OtherRegion(Record):
    """An optimum outside the sampled region."""

    values: tuple[float, ...]
    """Values of the free parameters there, each in its unit."""
    log_likelihood_difference: float
    """Logarithm of the likelihood there over the largest one of the samples, at the same size of the errors."""
    starts: int
    """Number of starts that ended there."""


class FurtherParameter(Record):
    """What a further test is expected to leave of the standard deviation of a parameter, in its unit."""

    parameter: str
    """Name of the parameter."""
    sd: float
    """Standard deviation of the samples."""
    sd_after: float
    """Expected standard deviation with the further test."""


class FurtherTest(Record):
    """A configuration without a test, and what a test of its frequencies is expected to teach."""

    configuration: str
    """Name of the configuration."""
    modes: tuple[int, ...]
    """Numbers of the modes whose frequencies would be measured."""
    bits: float
    """Expected information about the parameters, bits."""
    parameters: tuple[FurtherParameter, ...]
    """The sampled parameters."""


class PosteriorFrequency(Record):
    """A natural frequency of the model over the samples."""

    configuration: str
    """Name of the configuration."""
    mode: int
    """Number of the mode at the result of the update, from 1; rigid-body modes are counted."""
    value_hz: float
    """Frequency at the result of the update, Hz."""
    median_hz: float
    """Median, Hz."""
    interval_95: tuple[float, float]
    """Interval between the 2.5 % and the 97.5 % quantile, Hz."""
    test_mode: str | None = None
    """Label of the test mode that is paired with it at the result of the update."""
    measured_hz: float | None = None
    """Its frequency, Hz."""
    used: bool = False
    """Whether the update used it."""
    measured_inside: bool | None = None
    """Whether the measured frequency is in the 95 % interval of a measurement, with errors of the test as stated; None
    where nothing was measured."""


class PosteriorFunctions(Record):
    """FRFs of a configuration over the samples; arrays have the positions of `outputs` and `inputs`."""

    configuration: str
    """Name of the configuration."""
    kind: FrfKind
    """Receptance, mobility or accelerance."""
    outputs: tuple[str, ...]
    """Response DOFs."""
    inputs: tuple[str, ...]
    """Reference DOFs."""
    freq_key: str
    """Key of the lines (f,), Hz."""
    band_key: str
    """Key of the 2.5 %, 50 % and 97.5 % quantiles of the magnitude (3, outputs, inputs, f)."""
    test_freq_key: str | None = None
    """Key of the measured lines (g,) between the first and the last one, Hz; None without a test."""
    test_values_key: str | None = None
    """Key of the measured values (outputs, inputs, g), NaN where there are none."""
    width_db: float
    """Median width of the 95 % band over all lines, dB."""
    measured_inside_percent: float | None = None
    """Part of the measured values in the band, in %, at the lines that the test has too; None where it has less than
    half of them."""


class PosteriorResults(Record):
    """Samples of the distribution of the parameters after the test."""

    noise: NoiseRule
    """Rule for the size of the errors of the data."""
    discrepancy: Discrepancy = "none"
    """Errors of the model that were asked for."""
    no_model_errors: str = ""
    """Why no errors of the model are taken although they were asked for."""
    fields_left_out: int = 0
    """Fields of the deck that are not among the unknown changes, since there are too many."""
    changes_not_settled: str = ""
    """Why the unknown changes are not linearised about the most probable ones, where the data want large ones."""
    model_errors: tuple[ModelErrorClass, ...] = ()
    """Sizes of the errors of the model, by class."""
    wanted: tuple[WantedChange, ...] = ()
    """Changes that the data want most, the largest first."""
    seed: int
    """Seed of the random numbers."""
    draws: int
    """Number of weighted samples."""
    effective: float
    """Effective number of independent samples, 1/Σw²."""
    k_hat: float
    """Shape k̂ of the tail of the weights; below 0.7 averages can be trusted. 0 for equal weights."""
    drawn_from: Route
    """What the samples were drawn from: linearised residuals, a surrogate of the residuals, or TMCMC on the model."""
    degree: int
    """Degree of the polynomials that the residuals were drawn from; 1 for linearised residuals, 0 for TMCMC."""
    surrogate_error: float | None
    """Standard deviation of the logarithm of the weights; None for TMCMC."""
    r_hat: float | None
    """R-hat of the chains on what was drawn from; below 1.01 they have forgotten where they began. None for TMCMC."""
    displacement: float | None
    """Mean square distance of samples half a run apart over twice the variance, of the slowest parameter; 1 for chains
    that move. None for TMCMC."""
    stages: int = 0
    """Stages of TMCMC; 0 for other ways."""
    log_evidence: float
    """Logarithm of the evidence: likelihood integrated over the prior. It compares sets of parameters with the same
    residuals and the same rule for the errors."""
    log_evidence_sd: float
    """Its standard deviation by sampling."""
    gradient_solutions: int
    """Number of points that were solved with derivatives."""
    plain_solutions: int
    """Number of points that were solved without."""
    failed: int
    """Number of points at which the model could not be solved; they have the weight zero."""
    paired_anew_percent: float
    """Weighted part of the samples at which test modes and model modes would be paired in another way, in %."""
    recalled: int
    """Number of solutions from the journal of an earlier run."""
    seconds: float
    """Duration, s."""
    executor: str
    """Where the solutions were made."""
    parameters: tuple[PosteriorParameter, ...]
    """All parameters, tied ones too."""
    free: tuple[str, ...]
    """Names of the sampled parameters, the columns of the samples."""
    noise_levels: tuple[PosteriorNoise, ...]
    """Sizes of the errors."""
    bent: tuple[BentPair, ...] = ()
    """Pairs of parameters whose joint distribution is bent, the most bent first."""
    others: tuple[OtherRegion, ...] = ()
    """Regions outside the samples that explain the data about as well."""
    starts: int = 0
    """Number of updates from other points that looked for such regions."""
    further_sd: float = 0.005
    """Standard deviation of the errors of a frequency in further tests, relative."""
    further: tuple[FurtherTest, ...] = ()
    """Configurations without a test, the one that would teach most first."""
    predictions: int = 0
    """Number of samples at which the model was solved for predictions."""
    predictions_failed: int = 0
    """Number of these at which it could not be solved."""
    frequencies: tuple[PosteriorFrequency, ...] = ()
    """Natural frequencies of all configurations over the samples, with errors of the model if these are taken."""
    unused_chance: float | None = None
    """Part of the samples, as a test would measure them, that are together as far from the others as the measured
    frequencies that the update did not use; None without such frequencies, or without errors of the test."""
    functions: tuple[PosteriorFunctions, ...] = ()
    """FRFs of `[response]` over the samples, with errors of the model if these are taken."""
    linear_enough: bool = True
    """True if the intervals of linearised residuals agree with those of the samples."""
    tried: tuple[str, ...] = ()
    """What did not hold before, in sentences."""
    left_out: tuple[str, ...] = ()
    """Kinds of residual that are not in the likelihood, with reasons."""
    reduced_orders: tuple[int, ...] = ()
    """Orders of the reduced models on which the samples were solved; none for the full model."""
    full_model_error: float | None = None
    """Standard deviation of the difference of log likelihood between full and reduced model, over some samples; None
    without a reduced model."""
    samples_key: str
    """Key of the samples (draws, free), each in its unit."""
    weights_key: str
    """Key of their weights (draws,), which sum to one."""
    linear_key: str
    """Key of samples with linearised residuals (n, free), each in its unit."""
    sizes_key: str
    """Key of the sampled sizes of the errors (draws, sizes), factors on the stated standard deviations."""
    sentences: tuple[str, ...]
    """What the samples show, in sentences, the most important first."""
    alerts: tuple[Alert, ...] = ()
    """What limits the result."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications on the methods."""
