"""Selection, update and write-back as records: identifiability, updated values, written deck."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from femtune.assembly.study import quantities
from femtune.assembly.update_method import method_of
from femtune.citations import citation
from femtune.correlation.kinds import EXPANSION_METHODS
from femtune.errors import FemtuneError
from femtune.fem.elements import KINDS
from femtune.files.nastran.field_refs import BARS, WITHOUT_CARD
from femtune.files.nastran.field_units import field_nature
from femtune.modal import freq_and_damping
from femtune.residuals.frequency import FrequencyResidual
from femtune.results.base import CitationRecord, Record
from femtune.results.checks import ModelCheck
from femtune.results.fisher import FisherResults
from femtune.results.iterations import IterationFrfs
from femtune.results.left_out import ModeLeftOutOfFrfs
from femtune.results.reduction import ReductionResults
from femtune.results.search import (
    CertificateResults,
    SmallestChangeResults,
    StartsResults,
    WeightChoiceResults,
    certificate_results,
    smallest_change_results,
    starts_results,
    weight_choice_results,
)
from femtune.results.selection import SelectionMeasures
from femtune.results.stages import StageResults
from femtune.results.truncation import FrfTruncation
from femtune.results.validation import GoodnessResults, goodness, goodness_results
from femtune.selection import combination_text, sentences, verdict
from femtune.selection.combinations import NO_EFFECT
from femtune.updating.posterior import IntervalKind

if TYPE_CHECKING:
    from femtune.assembly.study import Study
    from femtune.files.study_file.step_tables import UpdateTable
    from femtune.model import Assignment
    from femtune.parameters import DerivedQuantity, Jet, ParameterSet
    from femtune.residuals import Evaluation
    from femtune.selection import Combination, Identifiability
    from femtune.updating import Marginal, MultiStart, UpdateResult

BoundState = Literal["", "lower", "upper"]


class ParameterFacts(Record):
    """A parameter of the study."""

    name: str
    """Name."""
    fields: tuple[str, ...]
    """Fields of the deck that it sets, "PBAR 1 I1"; empty if there is none."""
    unit: str
    """Unit of its values; "" for a factor."""
    nominal: float
    """Initial value, in `unit`."""
    lower: float | None
    """Lower bound, in `unit`; None for a tied parameter."""
    upper: float | None
    """Upper bound, in `unit`; None for a tied parameter."""
    prior_mean: float | None
    """Mean of the prior, in `unit`; None for a tied parameter."""
    prior_sd: float | None
    """Standard deviation of the prior, in `unit`; None for a tied parameter."""
    tie: str = ""
    """Expression of other parameters; "" for a free parameter."""
    elements: int | None = None
    """Number of elements in its region; None if it affects all that use its fields."""


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


class PairingEvent(Record):
    """A change of pairing between two iterations."""

    iteration: int
    """Iteration after which it happened."""
    configuration: str
    """Name of the configuration."""
    sentence: str
    """The change, in words."""


class IterationModeRecord(Record):
    """A paired mode at one point of the history."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency of the test in Hz."""
    freq_hz: float
    """Frequency of the model in Hz."""
    mac: float | None
    """MAC of the pair, of close modes with the model's motion nearest to the test's; None without a measured shape."""


class IterationRecord(Record):
    """One point of the update's history."""

    iteration: int
    """Number, 0 at the start."""
    objective_percent: float
    """Weighted mean error √(Σr²/Σw²) in %."""
    step_length: float | None
    """Norm of the step in normalised parameters (no unit); None at the start."""
    damping: float | None
    """Levenberg-Marquardt damping of the step (no unit); None without damping."""
    parameters: tuple[float, ...]
    """Values of the free parameters, each in its unit, in the order of UpdateResults.history_parameters."""
    active_bounds: tuple[str, ...] = ()
    """Names of parameters at a bound."""
    events: tuple[str, ...] = ()
    """Changes of pairing that followed, in words."""
    to_smallest_change: bool = False
    """True on the way from the minimum within the bounds to the smallest change."""
    long_step: bool = False
    """True for a long step, taken since no short one reduced the objective function."""
    modes: tuple[IterationModeRecord, ...] = ()
    """Paired modes; empty if no modes are compared, and in older results without this field."""


class WrittenValue(Record):
    """A parameter's value in one field of the deck."""

    field: str
    """The field: "PBAR 1 I1"."""
    value: float
    """The value of the written text, in units of the deck."""


class PhysicalValue(Record):
    """A field that a factor multiplies."""

    field: str
    """The field: "PBAR 1 I1"."""
    unit: str
    """Unit of its values in the units of the study; "" if it has none, or if the card does not tell."""
    nominal: float
    """Initial value, in `unit`."""
    value: float
    """Updated value, in `unit`."""
    interval_95: tuple[float, float] | None
    """95 % interval, in `unit`; None if the parameter has none."""


class ParameterResult(Record):
    """A parameter after the update."""

    name: str
    """Name."""
    value: float
    """Final value, in the unit of the parameter."""
    sd: float | None
    """Its standard deviation, in the unit of the parameter; None if `sd_reason` gives a reason."""
    sd_reason: str
    """The reason why there is no sd: "at bound, σ not given"; "" where there is one."""
    interval_95: tuple[float, float] | None = None
    """Equal-tailed 95 % interval in the unit of the parameter, within its bounds; None if none is given."""
    interval_kind: IntervalKind = ""
    """Distribution of the interval: "normal" for stated standard deviations, "Student's t" if the variance was
    estimated from the residuals; "truncated" if a bound cuts off a part of that distribution; "bounds" if the data
    hardly narrow what the bounds leave open; "" without interval."""
    mean: float | None = None
    """Mean of this distribution, in the unit of the parameter."""
    median: float | None = None
    """Its median."""
    change_percent: float | None
    """(final − nominal)/|nominal| in %; None if the nominal value is zero."""
    at_bound: BoundState
    """"lower", "upper" or "" (inside)."""
    written: tuple[WrittenValue, ...] = ()
    """Values in the updated deck."""
    physical: tuple[PhysicalValue, ...] = ()
    """Fields that a factor multiplies, with their values; empty for a parameter that is no factor of fields."""


class DerivedResult(Record):
    """A quantity that follows from the parameters."""

    name: str
    """Name."""
    expression: str
    """Expression of parameters."""
    unit: str
    """Unit; "" where none is given."""
    nominal: float | None
    """Its initial value, in `unit`; None if the expression is not finite."""
    value: float | None
    """Its value after the update, in `unit`; None if the expression is not finite."""
    sd: float | None
    """Standard deviation by linear propagation, in `unit`; None where not given."""
    sd_reason: str = ""
    """The reason why none is given: "stiffness: at bound, σ not given"."""
    interval_95: tuple[float, float] | None = None
    """Equal-tailed 95 % interval, in `unit`; None if none is given."""
    interval_kind: IntervalKind = ""
    """Distribution of the interval, as for a parameter."""
    mean: float | None = None
    """Mean of this distribution, in `unit`."""
    median: float | None = None
    """Its median."""


class ResidualCount(Record):
    """Residuals of one kind."""

    kind: str
    """"frequency", "shape", "mass", …"""
    sd_of_test: bool = False
    """True if their standard deviations are those that the test has, in place of values of the study."""
    count: int
    """Their number."""
    misfit: float | None
    """Their root mean square at the end in units of the stated standard deviations (no unit), corrected for the
    fitted parameters: about 1 if the stated standard deviations are correct; None: not known (an earlier femtune)."""
    freedom: float = 0.0
    """Degrees of freedom of these residuals after the fit (no unit)."""
    widened: bool = False
    """True if they are significantly larger than noise with the stated standard deviations (1 % point of χ²); the
    standard deviations of the parameters are then increased by the misfit."""
    rms_before: float | None = None
    """Their root mean square at the start, in units of the stated standard deviations (no unit); None: not known."""
    rms_after: float | None = None
    """The same at the end (no unit)."""
    error_before_percent: float | None = None
    """Weighted mean error √(Σr²/Σw²) of this kind at the start, in % of the measured values; None: not known."""
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
    """Number of residuals."""
    error_before_percent: float | None
    """Size of the misfit at the start, in % of the measured values; None if it was not compared."""
    error_after_percent: float
    """The same at the end, in %."""
    rms_after: float
    """Root mean square of its residuals at the end, in units of the stated standard deviation (no unit)."""


class PoleResults(Record):
    """A measured pole λ = ω(−ζ + i√(1 − ζ²)) and that of the damped model, before and after the update."""

    configuration: str
    """Name of the configuration."""
    label: str
    """Label of the test mode; of close modes whose mean poles are compared, all labels."""
    measured_hz: float
    """Measured natural frequency, the modulus of λ over 2π, in Hz."""
    before_hz: float | None
    """That of the model at the start, in Hz; None if the mode was not paired."""
    after_hz: float
    """The same at the end, in Hz."""
    measured_ratio: float
    """Measured damping ratio (no unit)."""
    before_ratio: float | None
    """That of the model at the start (no unit); None if the mode was not paired."""
    after_ratio: float
    """The same at the end (no unit)."""


class UpdateResults(Record):
    """The update."""

    status: str
    """Name of the status: "CONVERGED_AT_BOUNDS"."""
    message: str
    """The outcome, in a sentence."""
    ok: bool
    """True if the result is an optimum."""
    method: str
    """Name of the solver, in words."""
    objective_before_percent: float
    """Weighted mean error √(Σr²/Σw²) at the start, in %."""
    objective_after_percent: float
    """The same at the end, in %."""
    objective_as_written_percent: float | None
    """The same for the values written to the deck, in %; None if nothing was written."""
    history_parameters: tuple[str, ...]
    """Names of the columns of IterationRecord.parameters."""
    history: tuple[IterationRecord, ...]
    """One record per iteration, beginning with the initial point."""
    frfs: tuple[IterationFrfs, ...] = ()
    """Compared FRFs at each iteration; empty without FRF residuals, and in older results."""
    parameters: tuple[ParameterResult, ...]
    """Free and tied parameters after the update."""
    derived: tuple[DerivedResult, ...] = ()
    """Quantities that follow from the parameters, as the study defines them."""
    pairing_events: tuple[PairingEvent, ...]
    """Changes of pairing; empty if there were none."""
    regularisation: str
    """Name of the regularisation; "none" without regularisation."""
    regularisation_weight: float | None
    """Its weight (no unit)."""
    interval_samples: float | None = None
    """Effective number of samples of the distribution within the bounds, of the parameter with the fewest; 0 if the
    samples did not become stationary; None if no samples were needed."""
    residual_counts: tuple[ResidualCount, ...]
    """Residuals by kind."""
    comparisons: tuple[ComparisonResults, ...] = ()
    """Every comparison by itself."""
    poles: tuple[PoleResults, ...] = ()
    """Poles of residuals of kind complex-eigenvalue and damping."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications on the methods of the update."""
    goodness: GoodnessResults | None = None
    """Goodness of fit: whether the residuals are noise; None in older results without this field."""
    stages: tuple[StageResults, ...] = ()
    """Stages of a bottom-up study, in their order; the history has the best run of each, one after another."""
    weight_choice: WeightChoiceResults | None = None
    """Choice of the regularisation weight; None if it was given or there is none."""
    starts: StartsResults | None = None
    """The starts of a multi-start update; None for a single start."""
    reduction: ReductionResults | None = None
    """Reduced models of the update; None if it used the full model."""
    fisher: FisherResults | None = None
    """Fisher information of the FRFs at the result; None without residuals of measured FRFs."""
    frf_truncation: tuple[FrfTruncation, ...] = ()
    """Error of the FRFs of residuals by truncation of the modes, at start and end; empty without FRF residuals."""
    left_out_modes: tuple[ModeLeftOutOfFrfs, ...] = ()
    """Modes of the model that are left out of the compared FRFs; empty where none is."""
    iteration: int | None = None
    """The iteration whose point is the result; None in older results, where it is the last one."""
    chi_square: float | None = None
    """Sum of squares at the result, side constraint included (no unit); None in older results."""
    certificate: CertificateResults | None = None
    """First-order conditions at the result; None of a bottom-up study, and in older results."""
    smallest_change: SmallestChangeResults | None = None
    """The smallest change within a margin of the minimum; None where the result is the minimum within the bounds."""


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
    """Value of the update, before rounding, in units of the deck; None for a text."""
    rounded_value: float | None
    """Value of the new text, in units of the deck; None for a text."""
    parameter: str = ""
    """Parameter that sets it."""


class NewCardValue(Record):
    """A field in which a new card differs from the one that it was copied from."""

    field: str
    """Name of the field: "T"."""
    old_text: str
    """Text in the card that was copied, before the update."""
    value: float
    """Value of the update, before rounding, in units of the deck; for a reference the number of the card."""
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
    """Number of elements that refer to it."""
    values: tuple[NewCardValue, ...]
    """Fields in which it differs, apart from its number."""


class RepointedElements(Record):
    """Elements of one kind that refer to a new card."""

    card: str
    """Kind of element: "CQUAD4"."""
    field: str
    """Field that holds the reference: "PID"."""
    before: str
    """Text of the field before: "1"; "" if it was blank."""
    after: str
    """Card that it refers to now: "PSHELL 21"."""
    elements: tuple[int, ...]
    """Numbers of the elements."""


class WriteBackResults(Record):
    """Changes in the updated deck."""

    files: tuple[str, ...]
    """Files written, relative to the run folder."""
    edits: tuple[EditedField, ...]
    """Changed fields."""
    new_cards: tuple[NewCardFacts, ...] = ()
    """Cards that were added for the elements of regions."""
    repointed: tuple[RepointedElements, ...] = ()
    """Elements that refer to them."""
    splits: tuple[str, ...]
    """Cards split because elements that are not updated share them, a sentence each."""
    without_field: tuple[str, ...]
    """Parameters that have no field, a sentence each."""
    lost: tuple[str, ...] = ()
    """Those of these sentences whose updated values the written deck does not contain."""
    includes_changed: tuple[str, ...]
    """INCLUDE lines whose path was changed, a sentence each."""


# ----------------------------------------------------------------------------------------------------
# How the records of derived quantities are made.


_NO_VALUE = "its expression is not finite at the updated parameters"


def derived_results(study: Study, result: UpdateResult) -> Iterable[DerivedResult]:
    """The derived quantities of a study after an update; an expression without a value there says so."""
    for quantity in quantities(study):
        before, after = (_known(quantity, result.parameters, x) for x in (np.zeros(len(result.x)), result.x))
        sd = np.nan if after is None else result.spread(after.grad)
        sampled = partial(quantity.at_samples, result.parameters)
        found = None if after is None else result.marginal(after, sampled)
        yield DerivedResult(
            name=quantity.name,
            expression=quantity.expression.text,
            unit=quantity.unit,
            nominal=None if before is None else float(before.value),
            value=None if after is None else float(after.value),
            sd=float(sd) if np.isfinite(sd) else None,
            sd_reason="" if np.isfinite(sd) else _why_no_sd(result, after),
            **_interval(found),
        )


def _interval(found: Marginal | None) -> dict[str, Any]:
    """The fields of a record that hold a distribution."""
    if found is None:
        return {}
    low, high = found.interval
    return {"interval_95": (low, high), "interval_kind": found.kind, "mean": found.mean, "median": found.median}


def _known(quantity: DerivedQuantity, parameters: ParameterSet, x: np.ndarray) -> Jet | None:
    try:
        return quantity.at(parameters, x)
    except FemtuneError:
        return None


def _why_no_sd(result: UpdateResult, after: Jet | None) -> str:
    if after is None:
        return _NO_VALUE
    names = [p.name for p in result.parameters.free]
    found = (int(i) for i in np.flatnonzero(after.grad) if int(i) in result.covariance.reasons)
    return "; ".join(f"{names[i]}: {result.covariance.reasons[i]}" for i in found) or "σ not given"


# ----------------------------------------------------------------------------------------------------
# How the records of parameters are made: what the data determine, and what the update found.


Arrays = dict[str, NDArray]


def citations(keys: Iterable[str]) -> tuple[CitationRecord, ...]:
    """Publications by key."""
    found = (citation(key) for key in dict.fromkeys(keys))
    return tuple(CitationRecord(key=c.key, text=c.text, bibtex=c.bibtex) for c in found)


_ALWAYS = ("allemang1982", "lieven1988", "hunt1992", "guyan1965")
_OFFSETS = ("mottershead1996",)


def what_ran(study: Study) -> tuple[CitationRecord, ...]:
    """Publications of the comparison, of the elements that the deck has, and of the responses where they are asked."""
    kinds = sorted({batch.kind for batch in study.built.structure.batches})
    elements = (key for kind in kinds for key in KINDS[kind].papers)
    moved = any(a.ref.card in BARS for a in study.model.assignments)
    limits = study.file.validation
    compared = study.file.response is not None or limits.frac is not None or limits.fdac is not None
    responses = ("heylen1996", "pascual1997") if compared else ()
    # the errors of all methods are compared
    expansions = (
        ()
        if study.file.correlate.expand == "none"
        else tuple(key for kind in EXPANSION_METHODS.values() for key in kind.citations)
    )
    return citations((*_ALWAYS, *expansions, *elements, *(_OFFSETS if moved else ()), *responses))


def parameter_facts(study: Study) -> tuple[ParameterFacts, ...]:
    """The parameters as the study describes them."""
    values = study.parameters.values(np.zeros(len(study.parameters.free)))
    out = []
    for p in study.parameters.parameters:
        free, mine = p.free, [a for a in study.model.assignments if a.parameter == study.in_study(p.name)]
        out.append(
            ParameterFacts(
                name=p.name,
                fields=tuple(str(a.ref) for a in mine),
                elements=_region_size(study, mine),
                unit=p.unit,
                nominal=values[p.name],
                lower=p.lower if free else None,
                upper=p.upper if free else None,
                prior_mean=p.mean if free else None,
                prior_sd=float(p.sd) if free else None,
                tie="" if p.tie is None else p.tie.text,
            )
        )
    return tuple(out)


def _region_size(study: Study, mine: Sequence[Assignment]) -> int | None:
    """How many elements of a region use one of its fields; None without a region."""
    if not mine or mine[0].elements is None:
        return None
    structure = study.built.structure
    at = (structure.values.index(a.ref) for a in mine)
    users = {int(n) for i in at if i is not None for n in structure.users(i)}
    return len(users & mine[0].elements)


def selection_results(
    study: Study, result: Identifiability, evaluation: Evaluation, arrays: Arrays
) -> SelectionResults:
    """Identifiability as a record; its matrices are put into `arrays`."""
    arrays["selection/jacobian"] = result.scaled_jacobian
    arrays["selection/correlation"] = result.correlation
    rows = tuple(b.label for b in evaluation.blocks for _ in b.values)
    return SelectionResults(
        jacobian_key="selection/jacobian",
        row_labels=rows,
        column_labels=result.names,
        sensitivities=tuple(_sensitivities(evaluation)),
        singular_values=tuple(float(s) for s in result.singular_values),
        rank=result.rank,
        rank_threshold=NO_EFFECT,
        undetermined=tuple(combination_record(result, c) for c in result.undetermined),
        weakly_determined=tuple(combination_record(result, c) for c in result.weak),
        correlation_key="selection/correlation",
        parameters=tuple(
            IdentifiabilityResults(parameter=name, sd_ratio=float(ratio), verdict=verdict(float(ratio)))
            for name, ratio in zip(result.names, result.reduction)
        ),
        sentences=tuple(sentences(result)),
    )


def _sensitivities(evaluation: Evaluation) -> Iterable[Sensitivity]:
    """Logarithmic derivatives of the model's frequencies, where frequencies are compared."""
    compared = {b.configuration for b in evaluation.blocks if b.kind == FrequencyResidual.label}
    for state in evaluation.states:
        for pair in state.pairs(True) if state.case.name in compared else ():
            slopes = pair.eigenvalue_gradient / (2.0 * pair.eigenvalue)
            yield Sensitivity(
                configuration=state.case.name,
                test_label=pair.label,
                percent_per_percent=tuple(float(v) for v in slopes),
            )


def combination_record(result: Identifiability, c: Combination) -> CombinationRecord:
    shares = tuple(
        Share(parameter=name, coefficient=float(a)) for name, a in zip(result.names, c.coefficients) if abs(a) >= 1e-3
    )
    return CombinationRecord(
        singular_value=float(c.singular_value),
        sd_ratio=float(c.reduction),
        sentence=combination_text(result.names, c),
        shares=shares,
    )


def update_results(
    study: Study,
    result: UpdateResult,
    written: dict[str, tuple[WrittenValue, ...]],
    mean_error_written: float | None,
    reduction: ReductionResults | None = None,
    starts: MultiStart | None = None,
) -> UpdateResults:
    """The update as a record.

    `written` holds the values in the deck by parameter; `mean_error_written` the mean error of these values.
    """
    table = study.file.update
    return UpdateResults(
        status=result.status.name,
        message=result.status.value,
        ok=result.status.ok,
        method=f"sensitivity method: {_search_words(study)}",
        objective_before_percent=100.0 * result.before.mean_error,
        objective_after_percent=100.0 * result.after.mean_error,
        objective_as_written_percent=None if mean_error_written is None else 100.0 * mean_error_written,
        history_parameters=tuple(p.name for p in result.parameters.free),
        history=tuple(_iteration(result, i) for i in range(len(result.history))),
        parameters=tuple(_parameters(study, result, written)),
        derived=tuple(derived_results(study, result)),
        pairing_events=tuple(_events(result)),
        regularisation=table.regularisation if table.weight_on == "whole-change" else result.side.word,
        regularisation_weight=_weight(table, result),
        weight_choice=weight_choice_results(result),
        starts=None if starts is None else starts_results(starts, table.seed),
        interval_samples=_samples(result),
        residual_counts=_counts(study, result),
        comparisons=tuple(_comparisons(result)),
        poles=tuple(_poles(result)),
        citations=citations((*result.citations, "bard1974", "wald1940", *_sampler(result))),
        goodness=goodness_results(goodness(study, result)),
        reduction=reduction,
        iteration=result.number,
        chi_square=2.0 * result.objective,
        certificate=certificate_results(result),
        smallest_change=smallest_change_results(result),
    )


def _sampler(result: UpdateResult) -> tuple[str, ...]:
    """Publication on the samples of a truncated distribution, where they were needed."""
    posterior = result.covariance.posterior
    return ("belisle1993",) if posterior is not None and posterior.truncated else ()


def _samples(result: UpdateResult) -> float | None:
    posterior = result.covariance.posterior
    drawn = None if posterior is None else posterior.drawn
    return None if drawn is None else drawn.effective * drawn.settled


def _search_words(study: Study) -> str:
    return method_of(study.file.update, study.parameters).search.words


def _weight(table: UpdateTable, result: UpdateResult) -> float | None:
    """The weight where the regularisation has one: as given or determined."""
    if table.regularisation in ("none", "prior"):
        return None
    return float(table.weight) if table.regularisation == "truncated" else result.side.weight


def _iteration(result: UpdateResult, number: int) -> IterationRecord:
    i = result.history[number]
    return IterationRecord(
        iteration=i.number,
        objective_percent=100.0 * i.mean_error,
        step_length=i.step if number else None,
        damping=i.damping if number else None,
        parameters=tuple(float(v) for v in result.parameters.denormalise(i.x)),
        active_bounds=i.at_bound,
        events=i.events,
        to_smallest_change=i.to_smallest_change,
        long_step=i.long_step,
        modes=tuple(
            IterationModeRecord(
                configuration=m.configuration, test_label=m.test_label, test_freq_hz=m.test_freq_hz,
                freq_hz=m.freq_hz, mac=m.mac if np.isfinite(m.mac) else None,
            )
            for m in i.modes
        ),
    )  # fmt: skip


def _events(result: UpdateResult) -> Iterable[PairingEvent]:
    # the longest name first: a name may hold a colon, and begin with another name
    names = sorted((state.case.name for state in result.after.states), key=len, reverse=True)
    for i in result.history:
        for text in i.events:
            name = next(n for n in names if text.startswith(f"{n}: "))
            yield PairingEvent(iteration=i.number, configuration=name, sentence=text.removeprefix(f"{name}: "))


def _parameters(
    study: Study, result: UpdateResult, written: dict[str, tuple[WrittenValue, ...]]
) -> Iterable[ParameterResult]:
    values, sd, marginals = result.values, result.sd, result.marginals()
    nominal = result.parameters.values(np.zeros(len(result.x)))
    for p in result.parameters.parameters:
        spread = sd[p.name]
        known = bool(np.isfinite(spread))
        start = nominal[p.name]
        yield ParameterResult(
            name=p.name,
            value=values[p.name],
            sd=spread if known else None,
            sd_reason="" if known else _reason(result, p.name),
            **_interval(marginals[p.name]),
            change_percent=100.0 * (values[p.name] - start) / abs(start) if start else None,
            at_bound=_bound(result, p.name),
            written=written.get(p.name, ()),
            physical=tuple(_physical(study, p.name, values[p.name], start, marginals[p.name])),
        )


def _physical(study: Study, name: str, value: float, start: float, found: Marginal | None) -> Iterable[PhysicalValue]:
    """The fields that a factor multiplies; one of matrices has none."""
    table = study.model.structure.values
    for owner, i, relative in study.model.placed:
        ref = table.refs[i]
        if owner != study.in_study(name) or not relative or ref.card in WITHOUT_CARD:
            continue
        own = float(table.values[i])
        ends = None if found is None else sorted(own * end for end in found.interval)
        yield PhysicalValue(
            field=str(ref),
            unit=field_nature(ref).unit_in(study.file.study.unit_system),
            nominal=own * start,
            value=own * value,
            interval_95=None if ends is None else (ends[0], ends[1]),
        )


def _reason(result: UpdateResult, name: str) -> str:
    parameters = result.parameters
    used = np.flatnonzero(parameters.jets(result.x)[name].grad)
    reasons = {result.covariance.reasons[int(i)] for i in used if int(i) in result.covariance.reasons}
    return "; ".join(sorted(reasons)) or "σ not given"


def _bound(result: UpdateResult, name: str) -> BoundState:
    for i, p in enumerate(result.parameters.free):
        if p.name == name and name in result.at_bound:
            lower, upper = result.parameters.bounds
            return "lower" if result.x[i] - lower[i] < upper[i] - result.x[i] else "upper"
    return ""


def _counts(study: Study, result: UpdateResult) -> tuple[ResidualCount, ...]:
    counts = Counter(result.after.kinds)
    of_test = {c.entry.kind for c in study.file.comparisons if c.entry.is_of_test}
    found = result.covariance
    return tuple(
        ResidualCount(
            kind=kind,
            sd_of_test=kind in of_test,
            count=count,
            misfit=found.misfit[kind],
            freedom=found.freedom[kind],
            widened=kind in found.widened,
            rms_before=_rms(result.before, kind),
            rms_after=_rms(result.after, kind),
            error_before_percent=_error_percent(result.before, kind),
            error_after_percent=_error_percent(result.after, kind),
        )
        for kind, count in counts.items()
    )


def _comparisons(result: UpdateResult) -> Iterable[ComparisonResults]:
    before = {(b.configuration, b.kind, b.mode): b.error for b in result.before.blocks}
    for b in result.after.blocks:
        first = before.get((b.configuration, b.kind, b.mode))
        yield ComparisonResults(
            configuration=b.configuration,
            kind=b.kind,
            label=b.mode,
            count=len(b.values),
            error_before_percent=None if first is None else 100.0 * first,
            error_after_percent=100.0 * b.error,
            rms_after=float(np.sqrt(np.mean(b.values**2))) if len(b.values) else 0.0,
        )


def _poles(result: UpdateResult) -> Iterable[PoleResults]:
    """Each pole once, although a study may compare both the pole and its damping ratio."""
    before, after = (
        {(b.configuration, p.label): p for b in at.blocks for p in b.poles} for at in (result.before, result.after)
    )
    for (configuration, label), pair in after.items():
        first = before.get((configuration, label))
        measured, end = (freq_and_damping(np.array([pole])) for pole in (pair.measured, pair.model))
        start = None if first is None else freq_and_damping(np.array([first.model]))
        yield PoleResults(
            configuration=configuration,
            label=label,
            measured_hz=float(measured[0][0]),
            before_hz=None if start is None else float(start[0][0]),
            after_hz=float(end[0][0]),
            measured_ratio=float(measured[1][0]),
            before_ratio=None if start is None else float(start[1][0]),
            after_ratio=float(end[1][0]),
        )


def _rms(at: Evaluation, kind: str) -> float | None:
    """In units of the stated standard deviations."""
    values = [v for b in at.blocks if b.kind == kind for v in b.values]
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _error_percent(at: Evaluation, kind: str) -> float | None:
    """Weighted mean error of the comparisons of one kind."""
    mine = replace(at, blocks=tuple(b for b in at.blocks if b.kind == kind))
    return 100.0 * mine.mean_error if mine.blocks else None
