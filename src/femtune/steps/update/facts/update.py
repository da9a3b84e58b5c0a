"""The update, its parameters and its iterations as records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.correlation.kinds import EXPANSION_METHODS
from femtune.errors import FemtuneError
from femtune.fem.elements import KINDS
from femtune.files.nastran.field_refs import BARS, WITHOUT_CARD
from femtune.files.nastran.field_units import field_nature
from femtune.modal import freq_and_damping
from femtune.residuals.frequency import FrequencyResidual
from femtune.selection import combination_text, sentences, verdict
from femtune.selection.combinations import NO_EFFECT
from femtune.steps.judge.facts.parts import assumed_kinds, parts_results
from femtune.steps.judge.record.parts import NOT_ACCEPTED
from femtune.steps.update.facts.search import (
    certificate_results,
    minimum_results,
    smallest_change_results,
    starts_results,
    weight_choice_results,
)
from femtune.steps.update.record.reduction import ReductionResults
from femtune.steps.validate.facts import goodness, goodness_results
from femtune.study.record import CitationRecord
from femtune.study.study import quantities
from femtune.study.update_method import method_of

if TYPE_CHECKING:
    from femtune.files.study_file.update import UpdateTable
    from femtune.model import Assignment
    from femtune.parameters import DerivedQuantity, Jet, ParameterSet
    from femtune.residuals import Evaluation
    from femtune.selection import Combination, Identifiability
    from femtune.steps.judge.record.parts import PartRecord
    from femtune.study.study import Study
    from femtune.updating import Marginal, MultiStart, UpdateResult
    from femtune.validation import GoodnessOfFit
from typing import TYPE_CHECKING

from femtune.citations import citation
from femtune.steps.select.record.identifiability import (
    CombinationRecord,
    IdentifiabilityResults,
    SelectionResults,
    Sensitivity,
    Share,
)
from femtune.steps.update.record.update import (
    BoundState,
    ComparisonResults,
    DerivedResult,
    IterationModeRecord,
    IterationRecord,
    PairingEvent,
    ParameterFacts,
    ParameterResult,
    PhysicalValue,
    PoleResults,
    ResidualCount,
    UpdateResults,
    WrittenValue,
)

_NO_VALUE = "its expression is not finite at the updated parameters"


def derived_results(study: Study, result: UpdateResult) -> Iterable[DerivedResult]:
    """The derived quantities of a study after an update; an expression without a value has a sentence instead."""
    for quantity in quantities(study):
        before, after = (_known(quantity, result.parameters, x) for x in (np.zeros(len(result.x)), result.x))
        sd = np.nan if after is None else result.spread(after.grad)
        sampled = partial(quantity.at_samples, result.parameters)
        marginal = None if after is None else result.marginal(after, sampled)
        yield DerivedResult(
            name=quantity.name,
            expression=quantity.expression.text,
            unit=quantity.unit,
            nominal=None if before is None else float(before.value),
            value=None if after is None else float(after.value),
            sd=float(sd) if np.isfinite(sd) else None,
            sd_reason="" if np.isfinite(sd) else _why_no_sd(result, after),
            **_interval(marginal),
        )


def _interval(marginal: Marginal | None) -> dict[str, Any]:
    """The fields of a record that hold a distribution."""
    if marginal is None:
        return {}
    low, high = marginal.interval
    return {
        "interval_95": (low, high),
        "interval_kind": marginal.kind,
        "mean": marginal.mean,
        "median": marginal.median,
    }


def _known(quantity: DerivedQuantity, parameters: ParameterSet, x: np.ndarray) -> Jet | None:
    try:
        return quantity.at(parameters, x)
    except FemtuneError:
        return None


def _why_no_sd(result: UpdateResult, after: Jet | None) -> str:
    if after is None:
        return _NO_VALUE
    names = [p.name for p in result.parameters.free]
    indices = (int(i) for i in np.flatnonzero(after.grad) if int(i) in result.covariance.reasons)
    return "; ".join(f"{names[i]}: {result.covariance.reasons[i]}" for i in indices) or "σ not given"


Arrays = dict[str, NDArray]


_CITED_ALWAYS = ("allemang1982", "lieven1988", "hunt1992", "guyan1965")
"""Publications of methods that every comparison of test and model uses."""


_CITED_FOR_OFFSETS = ("mottershead1996",)
"""Publications of updating with offsets as parameters."""


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
    return citations((*_CITED_ALWAYS, *expansions, *elements, *(_CITED_FOR_OFFSETS if moved else ()), *responses))


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
        goodness=goodness_results(_goodness(study, result), _worst_part(study, result)),
        reduction=reduction,
        iteration=result.number,
        chi_square=2.0 * result.objective,
        certificate=certificate_results(result),
        smallest_change=smallest_change_results(result),
        minimum=minimum_results(result),
        looked_further=table.look_further,
    )


def _goodness(study: Study, result: UpdateResult) -> GoodnessOfFit:
    """The test of all residuals, which says so where their stated deviations are assumptions."""
    assumed = assumed_kinds(study).issuperset(b.kind for b in result.after.blocks)
    return replace(goodness(study, result), assumed=assumed)


def _worst_part(study: Study, result: UpdateResult) -> PartRecord | None:
    parts = parts_results(study, result)
    return None if parts is None else parts.named(NOT_ACCEPTED)


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
        events=(*i.events, *filter(None, [i.better_minimum])),
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
            sentence = text.removeprefix(f"{name}: ")
            yield PairingEvent(iteration=i.number, configuration=name, sentence=sentence, merged=i.merged)


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


def _physical(
    study: Study, name: str, value: float, start: float, marginal: Marginal | None
) -> Iterable[PhysicalValue]:
    """The fields that a factor multiplies; one of matrices has none."""
    table = study.model.structure.values
    for owner, i, relative in study.model.placed:
        ref = table.refs[i]
        if owner != study.in_study(name) or not relative or ref.card in WITHOUT_CARD:
            continue
        factor = float(table.values[i])
        ends = None if marginal is None else sorted(factor * end for end in marginal.interval)
        yield PhysicalValue(
            field=str(ref),
            unit=field_nature(ref).unit_in(study.file.study.unit_system),
            nominal=factor * start,
            value=factor * value,
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
    covariance = result.covariance
    return tuple(
        ResidualCount(
            kind=kind,
            sd_of_test=kind in of_test,
            count=count,
            misfit=covariance.misfit[kind],
            freedom=covariance.freedom[kind],
            widened=covariance.factors.get(kind, 1.0) > 1.0,
            error_factor=covariance.factors.get(kind, 1.0),
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


def citations(keys: Iterable[str]) -> tuple[CitationRecord, ...]:
    """Publications by key."""
    cited = (citation(key) for key in dict.fromkeys(keys))
    return tuple(CitationRecord(key=c.key, text=c.text, bibtex=c.bibtex) for c in cited)
