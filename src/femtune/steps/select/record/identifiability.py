"""Records of what the data determine: sensitivities, combinations of parameters, smoothness."""

from __future__ import annotations

from femtune.steps.info.record.checks import ModelCheck
from femtune.steps.judge.record.missing import MissingResults
from femtune.steps.select.record.fisher import FisherResults
from femtune.steps.select.record.selection import SelectionMeasures
from femtune.study.record import Record


class Share(Record):
    """A parameter's share in a combination."""

    parameter: str
    """Name of the parameter."""
    coefficient: float
    """Coefficient in the unit vector of normalised parameters (no unit)."""


class CombinationRecord(Record):
    """A combination of parameters, a right singular vector of the scaled Jacobian."""

    singular_value: float
    """Its singular value (no unit); 0 if the data contain no information on it."""
    sd_ratio: float | None
    """Posterior over prior standard deviation along it, 0 to 1 (no unit); 1 if the data have no information on it."""
    sentence: str
    """The combination and its effect, in a sentence."""
    shares: tuple[Share, ...]
    """Coefficients by parameter."""


class IdentifiabilityResults(Record):
    """Identifiability of one parameter."""

    parameter: str
    """Name of the parameter."""
    sd_ratio: float | None
    """Posterior over prior standard deviation, 0 to 1 (no unit); None if not tested."""
    verdict: str
    """In words: "determined by the data", "partly determined …", "weakly determined …", "not tested"."""
    sentence: str = ""
    """Explanation in words."""


class Sensitivity(Record):
    """Sensitivities of one compared frequency to the free parameters, at the initial values."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """Label of the test mode whose partner it is."""
    percent_per_percent: tuple[float, ...]
    """Change of the model's frequency in % by free parameter, for a change of 1 % of the initial value, or of the width
    of the bounds where that is zero."""


class SmoothnessRecord(Record):
    """The misfit δ = ½ rᵀr along one parameter between its bounds, the others at their initial values."""

    parameter: str
    """Name of the parameter."""
    verdict: str
    """"smooth"; "rough" where slopes do not explain the changes of the misfit over a small part of the range; "several
    minima"; "no solution" where the model could be solved at fewer than two points."""
    holds_percent: float
    """Part of the range between the bounds, in %, over which slopes hold in the worst place; 0 for a kink or jump."""
    where: float
    """Value of the parameter there."""
    minima: tuple[float, ...]
    """Values near which the misfit has separate minima."""
    points: int
    """Number of points at which the misfit was computed."""
    failed: int
    """Number of points without a solution."""
    sentence: str
    """The same in words; "" for a smooth misfit."""


class SelectionResults(Record):
    """Which parameters and combinations the data determine."""

    jacobian_key: str | None
    """Key of the scaled Jacobian ∂residual/∂(normalised parameter), shape (residuals, parameters); no unit."""
    row_labels: tuple[str, ...]
    """Residuals: "BC mode 1 frequency"."""
    column_labels: tuple[str, ...]
    """Free parameters."""
    sensitivities: tuple[Sensitivity, ...] = ()
    """One record a compared frequency, columns as column_labels; empty where frequencies are not compared."""
    singular_values: tuple[float, ...]
    """Of the scaled Jacobian, falling (no unit)."""
    rank: int
    """Number of combinations that the data determine."""
    rank_threshold: float
    """Singular values below this, in stated standard deviations, and below a thousandth of the largest are treated as
    zero (no unit)."""
    undetermined: tuple[CombinationRecord, ...]
    """Combinations without effect on any residual."""
    weakly_determined: tuple[CombinationRecord, ...]
    """Combinations that the prior determines more than the data."""
    correlation_key: str | None
    """Key of the correlation matrix of the parameters, posterior, shape (parameters, parameters); None: not tested."""
    parameters: tuple[IdentifiabilityResults, ...]
    """One record a free parameter."""
    model_checks: tuple[ModelCheck, ...] = ()
    """Checks for errors that updating cannot correct: mass, lumping, mesh; empty if not checked."""
    sentences: tuple[str, ...] = ()
    """Identifiability, in sentences."""
    measures: SelectionMeasures | None = None
    """Collinearity, information, order and energies; None if not computed."""
    fisher: FisherResults | None = None
    """Fisher information of the FRFs at the initial values; None without residuals of measured FRFs."""
    smoothness: tuple[SmoothnessRecord, ...] = ()
    """The misfit along each free parameter; empty if not requested."""
    missing: MissingResults | None = None
    """Fields of the deck that no parameter represents, tested where a first update ends; None if not requested, and in
    `femtune run`, whose verdict has this test."""
