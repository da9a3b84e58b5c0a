"""The bootstrap as a record: distribution of the parameters from the FRFs of one test."""

from __future__ import annotations

from femtune.identification.kinds import Drawing
from femtune.study.record import CitationRecord, Record
from femtune.uncertainty.kinds import Jacobian


class BootstrappedParameter(Record):
    """One parameter over the bootstrap runs, in its unit."""

    parameter: str
    """Name of the parameter."""
    value: float
    """Result of the update, from all data."""
    mean: float
    """Mean of the runs."""
    sd: float
    """Standard deviation of the runs."""
    cov_percent: float | None
    """Coefficient of variation: standard deviation over the mean of the parameter itself, in %; None for a mean of
    zero."""
    bias: float
    """Mean of the runs less the result of the update, in standard deviations of the runs (no unit)."""
    linear_sd: float
    """Standard deviation of the runs by linearisation: that of the first Gauss-Newton steps."""
    fisher_sd: float
    """Standard deviation by the inverse Fisher information at the result, from the stated standard deviations."""
    fisher_cov_percent: float | None
    """That one over the result of the update, in %."""
    interval_95: tuple[float, float]
    """95 % interval from percentiles of the runs, widened for the number of frequency lines."""
    at_bound_percent: float
    """Part of the runs that ended at a bound of the parameter, in %."""


class BootstrapResults(Record):
    """Bootstrap about the result of the update."""

    method: Drawing
    """What is drawn: frequency lines, single FRF values, or noise of the stated standard deviations."""
    runs: int
    """Number of runs."""
    converged: int
    """Number of runs that converged; the others are left out."""
    seed: int
    """Seed of the random numbers."""
    drawn_from: int
    """Number of frequency lines or values that are drawn from; of residuals for noise."""
    identified: bool = False
    """Whether what is drawn are the measured FRFs behind those of an identified test, which are compared."""
    jacobian: Jacobian
    """Derivatives of the steps: those at the result of the update, or those of each point."""
    own_jacobian: int
    """Number of runs that needed derivatives at other points."""
    largest_difference: float | None
    """Largest difference between runs with shared and with own derivatives, in standard deviations; None if not
    checked."""
    checked: int
    """Number of runs that were made with both."""
    solutions: int
    """Number of points at which the model was solved, in all runs."""
    recalled: int
    """Number of runs from the journal of an earlier run."""
    seconds: float
    """Duration, s."""
    executor: str
    """Where the runs were made."""
    parameters: tuple[BootstrappedParameter, ...]
    """All parameters, tied ones too."""
    free: tuple[str, ...]
    """Names of the free parameters, the columns of samples and correlation."""
    samples_key: str
    """Key of the values of the free parameters in the runs, shape (converged, free), each in its unit."""
    correlation_key: str
    """Key of their correlation, shape (free, free)."""
    sentences: tuple[str, ...]
    """What the runs show, in sentences."""
    reduced_orders: tuple[int, ...] = ()
    """Orders of the reduced models on which the runs were made, one per configuration; none if they were made on the
    full model."""
    remarks: tuple[str, ...] = ()
    """Worker processes that were replaced."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications on the method."""
