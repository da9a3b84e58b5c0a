"""Stochastic updating as records: mean and covariance of the parameters, from repeated tests."""

from __future__ import annotations

from femtune.results.base import CitationRecord, Record


class ScatteringParameter(Record):
    """Mean and standard deviation of one parameter over the repeats, in its unit."""

    parameter: str
    """Name of the parameter."""
    start: float
    """Value from which the update of the means began."""
    mean: float
    """Mean."""
    sd: float
    """Standard deviation of single structures or assemblies, not of the mean."""
    correlation: tuple[float, ...]
    """Correlation with each parameter of this list (no unit)."""
    cosine_distance: float | None
    """Distance 1 − cos of its scaled sensitivities from the leading space of the measured covariance: near 0 for a
    parameter that scatters; None with fewer than four frequencies, where it says nothing."""
    outside_bounds: bool
    """True where the mean lies outside the parameter's bounds, which this step does not enforce."""


class ScatteringOutput(Record):
    """One frequency over the repeats, beside that of the updated distribution."""

    label: str
    """Test mode."""
    repeats: int
    """How many repeats have it."""
    measured_mean_hz: float
    """Mean of the repeats, in Hz."""
    measured_sd_hz: float
    """Standard deviation of the repeats, in Hz."""
    model_mean_hz: float
    """Mean over the cloud of the forward check, in Hz."""
    model_sd_hz: float
    """Standard deviation over that cloud, in Hz."""


class QuantifyResults(Record):
    """Stochastic updating and its forward check."""

    configuration: str
    """Configuration whose tests were repeated."""
    method: str
    """Formulation: "second-order", "perturbation", "cross-covariance" or "output-difference"."""
    status: str
    """Name of the status."""
    message: str
    """How it ended, in a sentence."""
    ok: bool
    """True where mean and covariance may be used."""
    estimate: str
    """How mean and covariance of the repeats were estimated."""
    repeats: int
    """Number of repeats."""
    solutions: int
    """Model solutions, the update of the means included, the forward check not."""
    samples: int
    """Samples of the forward check."""
    covariance_error_percent: float
    """Difference of the covariances of cloud and repeats, relative, in measured standard deviations, in %."""
    chance_error_percent: float
    """The difference that chance makes between so many repeats and the truth, in %."""
    unexplained_percent: float
    """Share of the measured variance that no scatter of these parameters reaches, to first order, in %."""
    agrees: bool
    """True where the cloud repeats the measured means and covariance."""
    parameters: tuple[ScatteringParameter, ...]
    """One record a free parameter."""
    outputs: tuple[ScatteringOutput, ...]
    """One record a compared frequency."""
    sentences: tuple[str, ...]
    """What the step says, the verdict first."""
    repeats_key: str | None
    """Key of the measured frequencies, shape (repeats, outputs), Hz; NaN where not measured."""
    covariance_key: str | None
    """Key of their estimated covariance, shape (outputs, outputs), Hz²."""
    cloud_key: str | None
    """Key of the frequencies of the cloud, shape (samples, outputs), Hz."""
    parameter_covariance_key: str | None
    """Key of the covariance of the parameters, shape (parameters, parameters), in their units."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications behind the method."""
