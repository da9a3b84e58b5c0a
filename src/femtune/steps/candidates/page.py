"""Candidate models: criteria, parameters, distances, and what the data leave undetermined."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import (
    AlertBox,
    Cell,
    Figure,
    KeyNumber,
    KeyNumbers,
    Listing,
    Paragraph,
    Section,
    Table,
    columns,
    row,
)
from femtune.document.figures.candidates import candidates_svg
from femtune.document.numbers import NONE, counted, percent, short, typeset, unit_fraction
from femtune.steps.candidates.record import log_evidence_or_least

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from femtune.document.document import Block, Document, Level
    from femtune.steps.candidates.record import CandidateResults, CandidatesResults, CandidateValue
    from femtune.steps.report_source import ReportSource, Subject


_MOST_COLUMNS = 14
"""Models side by side in the tables of parameters and distances; more do not fit the width of a page."""


def _of(source: ReportSource) -> CandidatesResults:
    assert source.results.candidates is not None
    return source.results.candidates


def shown_models(comparison: CandidatesResults) -> tuple[CandidateResults, ...]:
    """The solved models that tables have room for: all, or those of the best evidence, in the order of the study."""
    solved = comparison.solved
    if len(solved) <= _MOST_COLUMNS:
        return solved
    best = sorted(solved, key=log_evidence_or_least, reverse=True)
    kept = {c.name for c in best[:_MOST_COLUMNS]}
    return tuple(c for c in solved if c.name in kept)


def candidate_numbers(comparison: CandidatesResults) -> KeyNumbers:
    """How many models, and the best by each criterion."""
    ranked = [c for c in comparison.solved if c.bic is not None]
    by_bic = min(ranked, key=lambda c: c.bic or 0.0)
    by_evidence = max(ranked, key=log_evidence_or_least)
    admissible = sum(c.admissible for c in comparison.solved)
    return KeyNumbers(
        (
            KeyNumber("Models", str(len(comparison.candidates)), remark="with the initial values"),
            KeyNumber("Best by BIC", by_bic.name, remark=f"weight {unit_fraction(by_bic.bic_weight)}"),
            KeyNumber(
                "Best by evidence", by_evidence.name, remark=f"probability {unit_fraction(by_evidence.probability)}"
            ),
            KeyNumber("Admissible models", str(admissible), remark=_rule(comparison)),
        )
    )


def _rule(comparison: CandidatesResults) -> str:
    if comparison.threshold is not None:
        return f"mean error ≤ {short(comparison.threshold)} × the smallest"
    return f"smallest largest residual ≤ {short(comparison.limit)}"


def candidates_summary(source: ReportSource) -> list[Block]:
    """Numbers, sentences, what should be known, and the picture."""
    candidates = _of(source)
    alerts = alert_boxes(candidates.alerts)
    return [candidate_numbers(candidates), Listing(candidates.sentences), *alerts, *_picture(source)]


def _picture(source: ReportSource) -> list[Block]:
    candidates = _of(source)
    models = shown_models(candidates)
    rows = [candidates.solved.index(c) for c in models]
    best = max(models, key=log_evidence_or_least)
    distance = source.arrays[candidates.distances_key][rows, candidates.solved.index(best)]
    draw = partial(
        candidates_svg, [c.name for c in models], [len(c.parameters) for c in models],
        [c.error_percent or 0.0 for c in models], (100.0 * distance).tolist(), best.name,
    )  # fmt: skip
    alt = f"Mean error of each candidate model, and distance of its parameters from {best.name}"
    return [Figure(draw, "", alt, wide=True)]


def candidates_table(source: ReportSource) -> list[Block]:
    """The table of criteria, and the remarks of the study."""
    candidates = _of(source)
    return [criteria_table(candidates), *_sampled(candidates), *_notes(candidates)]


def _sampled(comparison: CandidatesResults) -> list[Block]:
    """A line each candidate with a sampled evidence, those of the best first."""
    found = [c for c in comparison.solved if c.sampled_log_evidence is not None]
    if not found:
        return []
    heads = columns(
        "Model", ">ln Z by samples", ">Its deviation", ">Probability", ">ln Z of linear residuals",
        ">Effective samples", ">k̂", ">ln density of configurations left out",
    )  # fmt: skip
    best = max(c.sampled_log_evidence or 0.0 for c in found)
    linear = max((c.log_evidence for c in found if c.log_evidence is not None), default=0.0)
    rows = tuple(
        row(
            c.name, typeset(f"{(c.sampled_log_evidence or 0.0) - best:.2f}"), short(c.sampled_log_evidence_sd),
            unit_fraction(c.sampled_probability, NONE),
            NONE if c.log_evidence is None else typeset(f"{c.log_evidence - linear:.2f}"),
            NONE if c.sampled_effective is None else f"{c.sampled_effective:.0f}", short(c.sampled_k_hat),
            _left_out_density(c),
        )
        for c in sorted(found, key=lambda c: c.sampled_log_evidence or 0.0, reverse=True)
    )  # fmt: skip
    note = "Logarithms beside the largest of their column. A density in brackets rests on weights that do not hold."
    return [Table("Evidence by samples", heads, rows, note)]


def _left_out_density(candidate: CandidateResults) -> str:
    if not candidate.left_out_evidence:
        return NONE
    text = typeset(f"{sum(one.log_density for one in candidate.left_out_evidence):.1f}")
    return text if candidate.left_out_trusted else f"({text})"


def criteria_table(comparison: CandidatesResults) -> Table:
    """A line each candidate."""
    heads = columns(
        "Model", ">Parameters", ">Determined", ">Mean error %", ">ΔBIC", ">Weight", ">Probability", ">Prediction %",
        ">Largest residual", ">Smallest largest", "Admissible", ">Cluster", ">Starts at the optimum",
    )  # fmt: skip
    least = min((c.bic for c in comparison.solved if c.bic is not None), default=0.0)
    return Table("", heads, tuple(_criteria(c, least) for c in comparison.candidates))


def _criteria(c: CandidateResults, least: float) -> tuple[Cell, ...]:
    if c.problem:
        return row(c.name, str(len(c.parameters)), *[NONE] * 8, Cell("not solved", tone="poor"), NONE, NONE)
    return row(
        c.name,
        str(len(c.parameters)),
        str(c.rank),
        short(c.error_percent),
        NONE if c.bic is None else typeset(f"{c.bic - least:.1f}"),
        unit_fraction(c.bic_weight, NONE),
        unit_fraction(c.probability, NONE),
        short(c.prediction_percent),
        short(c.worst_residual),
        short(c.worst_residual if c.least_worst_residual is None else c.least_worst_residual),
        Cell("yes", tone="good") if c.admissible else "no",
        NONE if c.cluster is None else str(c.cluster),
        f"{c.starts_at_best} of {c.starts}" if c.parameters else NONE,
    )


def _notes(comparison: CandidatesResults) -> list[Block]:
    notes = tuple(f"{c.name}: {c.note}" for c in comparison.candidates if c.note)
    return [Listing(notes)] if notes else []


def candidates_parameters(source: ReportSource) -> list[Block]:
    """The table of parameters."""
    return [parameter_table(_of(source)), *_cut(_of(source))]


def _cut(comparison: CandidatesResults) -> list[Block]:
    left = len(comparison.solved) - len(shown_models(comparison))
    return [Paragraph(f"{left} models of lower evidence are not shown; results in JSON have all.", "muted")] * bool(
        left
    )


def parameter_table(comparison: CandidatesResults) -> Table:
    """A line each parameter, a column each model."""
    models = shown_models(comparison)
    by_model = [{v.parameter: v for v in c.values} for c in models]
    heads = columns("Parameter", *(f">{c.name}" for c in models))
    names = [v.parameter for v in models[0].values]
    return Table("", heads, tuple(row(name, *(_value(values[name]) for values in by_model)) for name in names))


def _value(v: CandidateValue) -> str:
    if v.role != "updated":
        return f"{'=' if v.role == 'tied' else '·'} {short(v.value)}"
    spread = "" if v.sd is None else f" ± {typeset(f'{v.sd:.2g}')}"
    return f"{short(v.value)}{spread}{' !' if v.at_bound else ''}"


def candidates_distances(source: ReportSource) -> list[Block]:
    """The table of distances."""
    candidates = _of(source)
    return [distance_table(candidates, source.arrays), *_cut(candidates)]


def distance_table(comparison: CandidatesResults, arrays: Mapping[str, NDArray]) -> Table:
    """Distances between the models that are shown, in %."""
    models = shown_models(comparison)
    at = [comparison.solved.index(c) for c in models]
    distances = 100.0 * arrays[comparison.distances_key][np.ix_(at, at)]
    rows = (row(c.name, *map(percent, line.tolist())) for c, line in zip(models, distances))
    return Table("", columns("", *(f">{c.name}" for c in models)), tuple(rows))


def candidates_undetermined(source: ReportSource) -> list[Block]:
    """Combinations by model."""
    return undetermined_blocks(_of(source).solved)


def undetermined_blocks(models: Sequence[CandidateResults]) -> list[Block]:
    """A sentence for each combination that a model leaves undetermined."""
    sentences = tuple(f"{c.name}: {one.sentence}" for c in models for one in c.undetermined)
    return [Listing(sentences)] if sentences else [Paragraph("The data determine all parameters of every model.")]


def candidates_instances(source: ReportSource) -> list[Block]:
    """Instances that are not falsified, by candidate."""
    return instance_blocks(_of(source))


def instance_blocks(comparison: CandidatesResults) -> list[Block]:
    """How many instances are left, ranges of their parameters, and of the frequencies that they predict."""
    models = [c for c in shown_models(comparison) if c.instances is not None]
    if not models:
        return []
    heads = columns(
        "Model", ">Instances", ">Not falsified", ">Drawn near", ">Not falsified", "Ranges of the parameters"
    )
    rows = []
    ranges: dict[tuple[str, int], dict[str, str]] = {}
    for c in models:
        found = c.instances
        assert found is not None
        names = "; ".join(f"{p.parameter} {short(p.lower)} … {short(p.upper)}" for p in found.parameters)
        counts = [str(n) for n in (found.drawn, found.kept, found.drawn_near, found.kept_near)]
        rows.append(row(c.name, *counts, names or "all are falsified"))
        for p in found.predictions:
            of_mode = ranges.setdefault((p.configuration, p.mode), {})
            of_mode[c.name] = f"{p.lower_hz:.5g} … {p.upper_hz:.5g}"
    blocks: list[Block] = [Table("", heads, tuple(rows))]
    if ranges:
        of_models = [c.name for c in models if c.instances is not None and c.instances.predictions]
        heads = columns("Configuration", ">Mode", *(f">{name}, Hz" for name in of_models))
        lines = [row(case, str(n), *(of.get(m, NONE) for m in of_models)) for (case, n), of in ranges.items()]
        blocks.append(Table("", heads, tuple(lines)))
    return blocks


def candidates_verdict(comparison: CandidatesResults) -> tuple[str, Level]:
    """The first sentence of the comparison."""
    level: Level = "warning" if any(a.level != "info" for a in comparison.alerts) else "info"
    return f"{counted(len(comparison.candidates), 'model')} compared. {comparison.sentences[0]}", level


def candidates_document(subject: Subject, comparison: CandidatesResults) -> Document:
    """Sentences, criteria, parameters, and what is undetermined."""
    verdict, level = candidates_verdict(comparison)
    alerts = tuple(AlertBox(a.level, a.code, a.sentence, a.where) for a in comparison.alerts)
    sections = (
        Section(
            "candidates", "Candidate models", (candidate_numbers(comparison), Listing(comparison.sentences), *alerts)
        ),
        Section("criteria", "Criteria", (criteria_table(comparison),)),
        Section("parameters", "Parameters", (parameter_table(comparison),)),
        *((Section("instances", "Instances", tuple(blocks)),) if (blocks := instance_blocks(comparison)) else ()),
        Section("open", "What the data do not determine", tuple(undetermined_blocks(comparison.solved))),
    )
    return subject.document(verdict, level, sections)
