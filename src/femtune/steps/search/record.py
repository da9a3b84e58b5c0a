"""A search of the whole box as records: the surrogate, the searches, and the minimum confirmed on the model."""

from __future__ import annotations

from femtune.steps.screen.record import FailedModelRun
from femtune.steps.select.record.identifiability import CombinationRecord
from femtune.study.record import Alert, Record


class SearchedParameter(Record):
    """A free parameter in a search."""

    name: str
    """Name of the parameter."""
    unit: str
    """Its unit, "" for a factor."""
    lower: float
    """Lower bound."""
    upper: float
    """Upper bound."""
    initial: float
    """Initial value."""
    found: float
    """Value at the end of the global search."""
    value: float
    """Value after the least squares on the model that start there."""
    at_bound: bool
    """True if this value is at a bound."""
    variance_alone: float | None = None
    """Part of the variance of the residuals over the box that this parameter explains alone (Sobol's first index of all
    residuals together); None without polynomial chaos."""
    variance_total: float | None = None
    """Part that it explains with all its interactions."""


class SurrogateFacts(Record):
    """A surrogate of the residuals and its errors, all in standard deviations of the data."""

    method: str
    """"kriging", "radial-basis" or "chaos"."""
    trend: str | None
    """"constant", "linear" or "quadratic"; None for polynomial chaos."""
    correlation: str | None
    """Of Kriging: "gaussian", "matern-5/2", "matern-3/2" or "none"."""
    kernel: str | None
    """Of radial basis functions: "cubic", "quintic" or "thin-plate"."""
    terms: tuple[int, ...]
    """Of polynomial chaos: number of terms of each response; empty for others."""
    runs: int
    """Runs that it was fitted to at last, without those that failed."""
    responses: int
    """Number of responses: the residuals, or their principal components if there are many."""
    left_out_rms: float
    """Root mean square error of predicting each run from the others."""
    left_out_ratio: float
    """Root mean square of these errors relative to their predicted standard deviation; near 1 if the prediction
    intervals are right."""
    fresh_runs: int
    """Runs that checked it before they were added to it."""
    fresh_rms: float | None
    """Root mean square error of predicting them; None if there were none."""
    infill_by: str | None = None
    """Further runs were made where "improvement" of the objective or "error" of the surrogate was expected; None
    without further runs."""
    infill_runs: int = 0
    """Number of these runs, without those that failed."""
    infill_until: float | None = None
    """Error of left-out runs at which runs by error end; None if all were requested."""
    left_out_rms_before: float | None = None
    """`left_out_rms` before these runs."""


class SeedFacts(Record):
    """A search from one seed."""

    seed: int
    """The seed."""
    evaluations: int
    """Evaluations of the objective, of the surrogate or of the model."""
    chi2: float
    """Sum of the squared residuals at its end, on the surrogate or on the model."""
    same: bool
    """True if it ended at the best minimum."""
    converged: bool
    """False if it ended with the last generation."""


class FrontPoint(Record):
    """A point of the front of frequency errors against other errors."""

    parameters: tuple[float, ...]
    """Values of the free parameters, each in its unit, in the order of `GlobalSearchResults.parameters`."""
    frequency: float
    """Sum of the squared relative errors of the frequencies, on what was searched."""
    other: float
    """The second objective, on what was searched."""
    frequency_model: float | None
    """The first objective of the model at this point; None if that run failed."""
    other_model: float | None
    """The second objective of the model at this point."""
    third: float | None = None
    """The third objective, on what was searched; None without one."""
    third_model: float | None = None
    """The third objective of the model at this point."""


class FrontResults(Record):
    """The front: points that no point of the search is better than in all objectives."""

    label: str
    """The second objective: "sum of 1 − MAC", "sum of squared errors of the shapes" or "… of the rest"."""
    initial_frequency: float
    """The first objective at the initial values."""
    initial_other: float
    """The second objective there."""
    points: tuple[FrontPoint, ...]
    """Points that are spread over the front, in the order of their frequency errors."""
    evaluations: int
    """Evaluations of the objectives, of the surrogate or of the model."""
    front_key: str
    """Key of the whole front, shape (points, parameters + objectives): values of the parameters, and the objectives."""
    model_key: str = ""
    """Key of the objectives of the model at the points of the front, shape (points, objectives); NaN where no run was
    made."""
    third_label: str = ""
    """The third objective; "" without one."""
    initial_third: float | None = None
    """The third objective at the initial values."""


class GlobalSearchResults(Record):
    """The minimum of the squared residuals within the bounds."""

    on: str
    """"surrogate" or "model"."""
    method: str
    """"differential-evolution", "genetic" or "cma-es"."""
    runs: int
    """Runs of the model before the least squares."""
    failed: tuple[FailedModelRun, ...]
    """Runs that failed."""
    residuals: int
    """Number of residuals."""
    surrogate: SurrogateFacts | None
    """The surrogate; None if the model itself was searched."""
    seeds: tuple[SeedFacts, ...]
    """The searches."""
    parameters: tuple[SearchedParameter, ...]
    """The free parameters."""
    chi2_initial: float
    """Sum of the squared residuals of the model at the initial values."""
    chi2_searched: float
    """As the search has it at its end, on the surrogate or on the model."""
    chi2_model: float | None
    """Of the model at the same point; None if that run failed."""
    chi2: float
    """Of the model after the least squares."""
    status: str
    """Status of the least squares: name of a member of `femtune.Status`."""
    message: str
    """What the status means."""
    history_key: str
    """Key of the convergence, shape (points, 3): seed, evaluations, smallest χ² so far."""
    undetermined: tuple[CombinationRecord, ...] = ()
    """Combinations of the parameters that the data do not determine at the result."""
    front: FrontResults | None = None
    """The front of frequency errors against other errors; None if it was not requested."""
    sentences: tuple[str, ...]
    """The result in sentences."""
    alerts: tuple[Alert, ...] = ()
    """What should be known about it."""
