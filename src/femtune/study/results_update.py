"""Records about parameters: which ones the data determine, their values, and what was written back."""

from __future__ import annotations

from typing import Literal

from femtune.study.results_base import Citation, Record
from femtune.study.results_checks import ModelCheck
from femtune.study.results_reduction import ReductionResults
from femtune.study.results_search import StartsResults, WeightChoiceResults
from femtune.study.results_select import SelectionMeasures
from femtune.study.results_stages import StageResults
from femtune.study.results_validation import GoodnessResults

BoundState = Literal["", "lower", "upper"]


class ParameterFacts(Record):
    """A parameter as the study describes it."""

    name: str
    """Name."""
    fields: tuple[str, ...]
    """Fields of the deck that it sets, "PBAR 1 I1"; empty where there is none."""
    unit: str
    """Unit of its values; "" for a factor."""
    nominal: float
    """Start value, in `unit`."""
    lower: float | None
    """Lower bound, in `unit`; None for a tied parameter."""
    upper: float | None
    """Upper bound, in `unit`; None for a tied parameter."""
    prior_mean: float | None
    """Mean of the prior, in `unit`; None for a tied parameter."""
    prior_sd: float | None
    """Standard deviation of the prior, in `unit`; None for a tied parameter."""
    tie: str = ""
    """Expression of other parameters that it follows; "" for a free parameter."""
    elements: int | None = None
    """Number of elements in its region; None where it moves all that use its fields."""


class Share(Record):
    """A parameter's share in a combination."""

    parameter: str
    """Name of the parameter."""
    coefficient: float
    """Coefficient in the unit vector of normalised parameters (no unit)."""


class Combination(Record):
    """A combination of parameters, a right singular vector of the scaled Jacobian."""

    singular_value: float
    """Its singular value (no unit); 0 where the data say nothing about it."""
    sd_ratio: float | None
    """Posterior over prior standard deviation along it, 0 to 1 (no unit); 1 where the data say nothing."""
    sentence: str
    """In words: "column_1_EI rises while column_2_EI falls by as much: no measured mode changes"."""
    shares: tuple[Share, ...]
    """Coefficients by parameter."""


class Identifiability(Record):
    """What the data say about one parameter."""

    parameter: str
    """Name of the parameter."""
    sd_ratio: float | None
    """Posterior over prior standard deviation, 0 to 1 (no unit); None where not tested."""
    verdict: str
    """In words: "determined by the data", "not determined by these data", "not tested"."""
    sentence: str = ""
    """Explanation in words."""


class Sensitivity(Record):
    """How one compared frequency answers to the free parameters, at the start values."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """Label of the test mode whose partner it is."""
    percent_per_percent: tuple[float, ...]
    """Change of the model's frequency in % for a change of 1 % of the start value, by free parameter."""


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
    """How many combinations the data determine."""
    rank_threshold: float
    """Singular values below this count as zero (no unit)."""
    undetermined: tuple[Combination, ...]
    """Combinations that no residual depends on."""
    weakly_determined: tuple[Combination, ...]
    """Combinations that the prior determines more than the data."""
    correlation_key: str | None
    """Key of the correlation matrix of the parameters, posterior, shape (parameters, parameters); None: not tested."""
    parameters: tuple[Identifiability, ...]
    """One record a free parameter."""
    model_checks: tuple[ModelCheck, ...] = ()
    """What an update cannot mend: mass, lumping, mesh; empty where it was not looked at."""
    sentences: tuple[str, ...] = ()
    """What the data determine, in words for the reader of the report."""
    measures: SelectionMeasures | None = None
    """Likeness, information, order and energies; None in results without them."""


class PairingEvent(Record):
    """A change of pairing between two iterations."""

    iteration: int
    """Iteration after which it happened."""
    configuration: str
    """Name of the configuration."""
    sentence: str
    """What changed, in words."""


class Iteration(Record):
    """One point of the update's history."""

    iteration: int
    """Number, 0 at the start."""
    objective_percent: float
    """Weighted mean error √(Σr²/Σw²) in %."""
    step_length: float | None
    """Norm of the step in normalised parameters (no unit); None at the start."""
    damping: float | None
    """Damping of the step (no unit); None where there is none."""
    parameters: tuple[float, ...]
    """Values of the free parameters, each in its unit, in the order of UpdateResults.history_parameters."""
    active_bounds: tuple[str, ...] = ()
    """Names of parameters at a bound."""
    events: tuple[str, ...] = ()
    """Changes of pairing that followed, in words."""


class WrittenValue(Record):
    """A parameter's value in one field of the deck."""

    field: str
    """The field: "PBAR 1 I1"."""
    value: float
    """The value as its text reads, in units of the deck."""


class ParameterResult(Record):
    """A parameter after the update."""

    name: str
    """Name."""
    value: float
    """Final value, in the unit of the parameter."""
    sd: float | None
    """Its standard deviation, in the unit of the parameter; None with a reason beside it."""
    sd_reason: str
    """Why there is no sd: "at bound, σ not given"; "" where there is one."""
    interval_95: tuple[float, float] | None = None
    """95 % confidence interval in the unit of the parameter: normal where the scatter is the stated one, Student's t
    where it was estimated from the residuals; None where there is no sd."""
    change_percent: float | None
    """(final − nominal)/|nominal| in %; None where the nominal value is zero."""
    at_bound: BoundState
    """"lower", "upper" or "" (inside)."""
    written: tuple[WrittenValue, ...] = ()
    """What stands in the updated deck."""


class DerivedResult(Record):
    """A quantity that follows from the parameters."""

    name: str
    """Name."""
    expression: str
    """Expression of parameters."""
    unit: str
    """Unit; "" where none is given."""
    nominal: float | None
    """Its value at the start, in `unit`; None where the expression has none."""
    value: float | None
    """Its value after the update, in `unit`; None where the expression has none there."""
    sd: float | None
    """Standard deviation by linear propagation, in `unit`; None where not given."""
    sd_reason: str = ""
    """Why none is given: "stiffness: at bound, σ not given"."""


class ResidualCount(Record):
    """How many residuals of one kind went in."""

    kind: str
    """"frequency", "shape", "mass", …"""
    count: int
    """How many."""
    misfit: float
    """Their root mean square at the end in units of the stated standard deviations (no unit), freed of the parameters'
    share: about 1 where the data scatter as stated."""
    freedom: float = 0.0
    """How many of these residuals the fitted parameters leave free (no unit)."""
    widened: bool = False
    """True where they are larger than chance explains (1 % point of χ² with that freedom) if the scatter is as stated:
    the residuals are not noise alone, and the standard deviations of the parameters are widened by the misfit."""
    rms_before: float | None = None
    """Their root mean square at the start, in units of the stated standard deviations (no unit); None: not known."""
    rms_after: float | None = None
    """The same at the end (no unit)."""
    error_before_percent: float | None = None
    """Weighted mean error √(Σr²/Σw²) of this kind at the start, in % of what is compared; None: not known."""
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
    """How many residuals it has."""
    error_before_percent: float | None
    """Size of the misfit at the start, in % of what is compared; None where it was not compared then."""
    error_after_percent: float
    """The same at the end, in %."""
    rms_after: float
    """Root mean square of its residuals at the end, in units of the stated standard deviation (no unit)."""


class UpdateResults(Record):
    """How the parameters were found."""

    status: str
    """Name of the status: "CONVERGED_AT_BOUNDS"."""
    message: str
    """What happened, in a sentence."""
    ok: bool
    """True where the result is an optimum."""
    method: str
    """Name of the solver, in words."""
    objective_before_percent: float
    """Weighted mean error √(Σr²/Σw²) at the start, in %."""
    objective_after_percent: float
    """The same at the end, in %."""
    objective_as_written_percent: float | None
    """The same for the values written to the deck, in %; None where nothing was written."""
    history_parameters: tuple[str, ...]
    """Names of the columns of Iteration.parameters."""
    history: tuple[Iteration, ...]
    """One record an iteration, the start first."""
    parameters: tuple[ParameterResult, ...]
    """Free and tied parameters after the update."""
    derived: tuple[DerivedResult, ...] = ()
    """Quantities that follow from the parameters, as the study defines them."""
    pairing_events: tuple[PairingEvent, ...]
    """Changes of pairing; empty where there were none."""
    regularisation: str
    """Name of the regularisation; "none" where there is none."""
    regularisation_weight: float | None
    """Its weight (no unit)."""
    residual_counts: tuple[ResidualCount, ...]
    """Residuals by kind."""
    comparisons: tuple[ComparisonResults, ...] = ()
    """Every comparison by itself."""
    citations: tuple[Citation, ...] = ()
    """Publications behind what ran in the update."""
    goodness: GoodnessResults | None = None
    """Whether the residuals are noise; None in results of before it was tested."""
    stages: tuple[StageResults, ...] = ()
    """Stages of a bottom-up study, in their order; the history has the best run of each, one after another."""
    weight_choice: WeightChoiceResults | None = None
    """How the weight of the regularisation was found; None where it was given or there is none."""
    starts: StartsResults | None = None
    """Many starts; None where the update had one."""
    reduction: ReductionResults | None = None
    """Reduced models that the update searched on; None where it ran on the full model."""


class EditedField(Record):
    """A field of the deck that was changed; references to new cards are in RepointedElements."""

    card: str
    """Card and identification: "PBAR 1"."""
    field: str
    """Name of the field: "I1"."""
    file: str
    """File of the deck that was read, relative to the study file."""
    line: int
    """Line in that file, from 1."""
    old_text: str
    """Text before."""
    new_text: str
    """Text after."""
    value: float | None
    """Value of the update, before rounding, in units of the deck; None where the field holds a word."""
    rounded_value: float | None
    """Value that the new text reads as, in units of the deck; None where the field holds a word."""
    parameter: str = ""
    """Parameter that sets it."""


class NewCardValue(Record):
    """A field in which a new card differs from the one that it was copied from."""

    field: str
    """Name of the field: "T"."""
    old_text: str
    """Text in the card that was copied, before the update."""
    value: float
    """Value of the update, before rounding, in units of the deck; the number of a card where it is a reference."""
    rounded_value: float
    """Value that the new card holds, in units of the deck."""
    parameter: str = ""
    """Parameter that sets it; "" for a reference to another new card."""


class NewCardFacts(Record):
    """A card that was added to the deck: a copy with other values, for the elements of a region."""

    card: str
    """Card and identification: "PSHELL 21"."""
    copied_from: str
    """Card that it is a copy of: "PSHELL 1"."""
    region: str
    """Parameters whose regions it is for."""
    elements: int
    """How many elements stand on it."""
    values: tuple[NewCardValue, ...]
    """Fields in which it differs, apart from its number."""


class RepointedElements(Record):
    """Elements of one kind that refer to a new card."""

    card: str
    """Kind of element: "CQUAD4"."""
    field: str
    """Field that holds the reference: "PID"."""
    before: str
    """What the field said before: "1"; "" where it was blank."""
    after: str
    """Card that it refers to now: "PSHELL 21"."""
    elements: tuple[int, ...]
    """Numbers of the elements."""


class WriteBackResults(Record):
    """What was written to the updated deck."""

    files: tuple[str, ...]
    """Files written, relative to the run folder."""
    edits: tuple[EditedField, ...]
    """Changed fields."""
    new_cards: tuple[NewCardFacts, ...] = ()
    """Cards that were added for the elements of regions."""
    repointed: tuple[RepointedElements, ...] = ()
    """Elements that refer to them now."""
    splits: tuple[str, ...]
    """Cards split because elements that are not updated share them, a sentence each."""
    without_field: tuple[str, ...]
    """Parameters that have no field, a sentence each."""
    includes_changed: tuple[str, ...]
    """INCLUDE lines whose path had to change, a sentence each."""
