"""Candidate models as records: what each reaches, and how they compare."""

from __future__ import annotations

from femtune.steps.select.record.identifiability import CombinationRecord
from femtune.study.record import Alert, Record


class CandidateValue(Record):
    """Value of a parameter in a candidate model."""

    parameter: str
    """Name of the parameter."""
    value: float
    """Value at the optimum."""
    sd: float | None
    """Standard deviation; None if the parameter does not move, or none can be given."""
    role: str
    """"updated", "tied" or "initial value"."""
    at_bound: bool
    """True at a bound."""


class LeftOutPrediction(Record):
    """Prediction of one configuration by the candidate that was updated with all others."""

    configuration: str
    """Name of the configuration."""
    error_percent: float | None
    """Weighted mean error of its residuals, in %; None if it could not be predicted."""
    reason: str = ""
    """Why it could not be predicted."""


class InstanceInterval(Record):
    """Range of a parameter over the instances that are not falsified."""

    parameter: str
    """Name of the parameter."""
    lower: float
    """Smallest value."""
    upper: float
    """Largest value."""


class InstancePrediction(Record):
    """Range of a natural frequency over the instances that are not falsified."""

    configuration: str
    """Name of the configuration."""
    mode: int
    """Number of the mode at the initial values, from 1."""
    lower_hz: float
    """Smallest value, Hz."""
    upper_hz: float
    """Largest value, Hz."""


class InstanceResults(Record):
    """A population of instances of a candidate, and what those predict that are not falsified."""

    drawn: int
    """Number of instances within the bounds, at points of a Latin hypercube."""
    kept: int
    """Number of them that are not falsified."""
    drawn_near: int
    """Number of instances that were drawn where the linearised residuals keep a wider limit; 0 if there were none."""
    kept_near: int
    """Number of them that are not falsified."""
    failed: int
    """Number of instances that could not be solved or paired, which are falsified."""
    parameters: tuple[InstanceInterval, ...]
    """Ranges of the parameters that move, over all that are not falsified; none if all are."""
    predictions: tuple[InstancePrediction, ...]
    """Ranges of the frequencies of all configurations; none if all instances are falsified."""
    instances_key: str
    """Key of the instances that are not falsified, shape (instances, parameters + frequencies): values of the
    parameters that move, and frequencies in Hz in the order of `predictions`."""


class LeftOutEvidence(Record):
    """What the samples of a candidate predict of a configuration that is left out."""

    configuration: str
    """Name of the configuration."""
    log_density: float
    """Logarithm of the density of its residuals, given those of the others."""
    k_hat: float | None
    """Shape of the tail of the weights; below 0.7 the density can be trusted. None with too few samples."""


class CandidateResults(Record):
    """One candidate model at its optimum."""

    name: str
    """Name of the candidate."""
    parameters: tuple[str, ...]
    """Parameters that move."""
    ties: dict[str, str]
    """Expressions of parameters that follow others, by name."""
    note: str
    """Remark of the study."""
    status: str
    """Status of the update; "" if the candidate could not be solved."""
    problem: str
    """Why it could not be solved; "" otherwise."""
    values: tuple[CandidateValue, ...] = ()
    """All parameters of the study."""
    error_percent: float | None = None
    """Weighted mean error, in %."""
    chi2: float | None = None
    """Sum of the squared residuals in their stated standard deviations."""
    residuals: int = 0
    """Number of independent residuals."""
    rank: int = 0
    """Number of combinations of parameters that the data determine."""
    undetermined: tuple[CombinationRecord, ...] = ()
    """Combinations that they do not determine."""
    worst_residual: float | None = None
    """Largest absolute residual, in stated standard deviations."""
    least_worst_residual: float | None = None
    """Smallest largest residual that values of the parameters were found to reach, by which a model is admissible: the
    least-squares values are not those whose largest residual is smallest. None in results of earlier versions."""
    worst_label: str = ""
    """What this residual compares."""
    starts: int = 1
    """Number of starts."""
    starts_at_best: int = 1
    """Number of starts that reached this optimum."""
    starts_unpaired: int = 0
    """Number of starts that could not be solved, or from which fewer modes found their partners; they are not used."""
    start_errors_percent: tuple[float, ...] = ()
    """Weighted mean error at the end of each start that is used, in %; empty in older results."""
    other_optima: int = 0
    """Number of other optima that are equally good within the noise."""
    left_out: tuple[LeftOutPrediction, ...] = ()
    """Predictions of configurations that were left out, one at a time."""
    prediction_percent: float | None = None
    """Weighted mean error of all these predictions, in %; None if one is missing."""
    bic: float | None = None
    """Bayesian information criterion; only differences between candidates count."""
    bic_weight: float | None = None
    """Relative support by BIC, 0 to 1."""
    log_evidence: float | None = None
    """Logarithm of the evidence, with residuals linear near the optimum; only differences count. None if the candidate
    is not ranked, or the integral was not found."""
    probability: float | None = None
    """Probability by the evidence, if all candidates are equally probable beforehand, 0 to 1."""
    sampled_log_evidence: float | None = None
    """Logarithm of the sampled evidence, where it was asked for."""
    sampled_log_evidence_sd: float | None = None
    """Standard deviation of this logarithm."""
    sampled_effective: float | None = None
    """Effective number of its samples; None without parameters, and in results of earlier versions."""
    sampled_k_hat: float | None = None
    """Shape of the tail of their weights; below 0.7 the evidence can be trusted."""
    sampled_probability: float | None = None
    """Probability by the sampled evidence, if all candidates are equally probable beforehand, 0 to 1."""
    not_sampled: str = ""
    """Why there is no sampled evidence although it was asked for."""
    left_out_evidence: tuple[LeftOutEvidence, ...] = ()
    """Each configuration left out, by the samples."""
    left_out_trusted: bool = False
    """True if the weights of the samples hold for all of them (k̂ up to 0.7)."""
    admissible: bool = False
    """True if no residual exceeds the limit, or the mean error is within the threshold."""
    cluster: int | None = None
    """Number of its cluster of admissible models, from 1; None for others."""
    instances: InstanceResults | None = None
    """Instances that are drawn and falsified; None if the study asks for none, or no parameter moves."""


def log_evidence_or_least(candidate: CandidateResults) -> float:
    """By which candidates are put in order; one without an evidence is the last."""
    return float("-inf") if candidate.log_evidence is None else candidate.log_evidence


class CandidatesResults(Record):
    """Comparison of candidate models."""

    candidates: tuple[CandidateResults, ...]
    """The candidates in the order of the study, the initial values first."""
    scatter: str
    """"stated" or "estimated", as in [residuals]."""
    size: float
    """Standard deviation of the residuals in units of the stated one; 1 with stated scatter."""
    limit: float | None
    """Largest absolute residual of an admissible model, in stated standard deviations; None with a threshold."""
    threshold: float | None
    """Largest weighted mean error of an admissible model relative to the smallest one; None without a threshold."""
    probability: float
    """Probability with which a right model is admissible."""
    cluster_distance: float
    """Mean distance of two clusters below which they are one."""
    distances_key: str
    """Key of the distances between the parameters of the candidates that were solved, shape (m, m): root mean square
    difference of the parameters relative to their initial values."""
    sentences: tuple[str, ...]
    """The comparison in sentences."""
    alerts: tuple[Alert, ...] = ()
    """What should be known about the comparison."""

    @property
    def solved(self) -> tuple[CandidateResults, ...]:
        """The candidates that could be solved: the rows and columns of the distances."""
        return tuple(c for c in self.candidates if not c.problem)
