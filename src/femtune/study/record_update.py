"""Records of parameters: what they are, what the data determine, what the update found and what was written."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.citations import citation
from femtune.files.nastran.field_refs import BARS
from femtune.files.study_file.steps import UpdateTable
from femtune.model import Assignment
from femtune.residuals import Evaluation
from femtune.select import Combination as SelectedCombination
from femtune.select import Identifiability, combination_text, sentences, verdict
from femtune.select.identifiability import NO_EFFECT
from femtune.study.load import Study
from femtune.study.record_derived import derived_results
from femtune.study.record_goodness import goodness, goodness_results
from femtune.study.record_search import starts_results, weight_choice_results
from femtune.study.results_base import Citation
from femtune.study.results_reduction import ReductionResults
from femtune.study.results_update import (
    BoundState,
    Combination,
    ComparisonResults,
    Iteration,
    PairingEvent,
    ParameterFacts,
    ParameterResult,
    ResidualCount,
    SelectionResults,
    Sensitivity,
    Share,
    UpdateResults,
    WrittenValue,
)
from femtune.study.results_update import (
    Identifiability as IdentifiabilityRecord,
)
from femtune.study.update_method import method_of
from femtune.update import MultiStart, UpdateResult

Arrays = dict[str, NDArray]


def citations(keys: Iterable[str]) -> tuple[Citation, ...]:
    """Publications by key."""
    found = (citation(key) for key in dict.fromkeys(keys))
    return tuple(Citation(key=c.key, text=c.text, bibtex=c.bibtex) for c in found)


_ALWAYS = ("allemang1982", "lieven1988", "guyan1965")
_BY_KIND = {
    "shell-quad": ("dvorkin1984", "pian1984"),
    "shell-tri": ("lee2004",),
    "shell-quad8": ("bathe1986", "macneal1992"),
    "shell-tri6": ("bathe1989", "neunteufel2021"),
    "generic": ("gladwell1995",),
}
_OFFSETS = ("mottershead1996",)


def what_ran(study: Study) -> tuple[Citation, ...]:
    """Publications of the comparison, of the elements that the deck has, and of the responses where they are asked."""
    kinds = sorted({batch.kind for batch in study.built.structure.batches})
    elements = (key for kind in kinds for key in _BY_KIND.get(kind, ()))
    moved = any(a.ref.card in BARS for a in study.model.assignments)
    responses = () if study.file.response is None else ("heylen1996",)
    return citations((*_ALWAYS, *elements, *(_OFFSETS if moved else ()), *responses))


def parameter_facts(study: Study) -> tuple[ParameterFacts, ...]:
    """The parameters as the study describes them."""
    values = study.parameters.values(np.zeros(len(study.parameters.free)))
    out = []
    for p in study.parameters.parameters:
        free, mine = p.free, [a for a in study.model.assignments if a.parameter == p.name]
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
        undetermined=tuple(_combination(result, c) for c in result.undetermined),
        weakly_determined=tuple(_combination(result, c) for c in result.weak),
        correlation_key="selection/correlation",
        parameters=tuple(
            IdentifiabilityRecord(parameter=name, sd_ratio=float(ratio), verdict=verdict(float(ratio)))
            for name, ratio in zip(result.names, result.reduction)
        ),
        sentences=tuple(sentences(result)),
    )


def _sensitivities(evaluation: Evaluation) -> Iterable[Sensitivity]:
    """Logarithmic derivatives of the model's frequencies, where frequencies are compared."""
    compared = {b.configuration for b in evaluation.blocks if b.kind == "frequency"}
    for state in evaluation.states:
        for pair in state.pairs(True) if state.case.name in compared else ():
            slopes = pair.eigenvalue_gradient / (2.0 * pair.eigenvalue)
            yield Sensitivity(
                configuration=state.case.name,
                test_label=pair.label,
                percent_per_percent=tuple(float(v) for v in slopes),
            )


def _combination(result: Identifiability, c: SelectedCombination) -> Combination:
    shares = tuple(
        Share(parameter=name, coefficient=float(a)) for name, a in zip(result.names, c.coefficients) if abs(a) >= 1e-3
    )
    return Combination(
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

    `written` holds what stands in the deck by parameter; `mean_error_written` the mean error of these values.
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
        regularisation=table.regularisation,
        regularisation_weight=_weight(table, result),
        weight_choice=weight_choice_results(result),
        starts=None if starts is None else starts_results(starts, table.seed),
        residual_counts=_counts(result),
        comparisons=tuple(_comparisons(result)),
        citations=citations((*result.citations, "bard1974", "wald1940")),
        goodness=goodness_results(goodness(study, result)),
        reduction=reduction,
    )


def _search_words(study: Study) -> str:
    return method_of(study.file.update, study.parameters).search.words


def _weight(table: UpdateTable, result: UpdateResult) -> float | None:
    """The weight where the regularisation has one: as it was given or found."""
    if table.regularisation in ("none", "prior"):
        return None
    return float(table.weight) if table.regularisation == "truncated" else result.side.weight


def _iteration(result: UpdateResult, number: int) -> Iteration:
    i = result.history[number]
    return Iteration(
        iteration=i.number,
        objective_percent=100.0 * i.mean_error,
        step_length=i.step if number else None,
        damping=i.damping if number else None,
        parameters=tuple(float(v) for v in result.parameters.denormalise(i.x)),
        active_bounds=i.at_bound,
        events=i.events,
    )


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
    values, sd, intervals = result.values, result.sd, result.interval()
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
            interval_95=intervals[p.name] if known else None,
            change_percent=100.0 * (values[p.name] - start) / abs(start) if start else None,
            at_bound=_bound(result, p.name),
            written=written.get(p.name, ()),
        )


def _reason(result: UpdateResult, name: str) -> str:
    parameters = result.parameters
    used = np.flatnonzero(parameters.jets(result.x)[name].grad)
    reasons = {result.covariance.reasons[int(i)] for i in used if int(i) in result.covariance.reasons}
    return "; ".join(sorted(reasons)) or "σ not given"


def _bound(result: UpdateResult, name: str) -> BoundState:
    for i, p in enumerate(result.parameters.free):
        if p.name == name and name in result.history[-1].at_bound:
            lower, upper = result.parameters.bounds
            return "lower" if result.x[i] - lower[i] < upper[i] - result.x[i] else "upper"
    return ""


def _counts(result: UpdateResult) -> tuple[ResidualCount, ...]:
    counts = Counter(result.after.kinds)
    found = result.covariance
    return tuple(
        ResidualCount(
            kind=kind,
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


def _rms(at: Evaluation, kind: str) -> float | None:
    """In units of the stated standard deviations."""
    values = [v for b in at.blocks if b.kind == kind for v in b.values]
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _error_percent(at: Evaluation, kind: str) -> float | None:
    """Weighted mean error of the comparisons of one kind."""
    mine = replace(at, blocks=tuple(b for b in at.blocks if b.kind == kind))
    return 100.0 * mine.mean_error if mine.blocks else None
