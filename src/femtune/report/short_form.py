"""The short form of the report, for a terminal: two screens, each fact once, what is left to the page said."""

from __future__ import annotations

from femtune.report.document import Block, Cell, Heading, Listing, Paragraph, Section, Table, columns, row
from femtune.report.numbers import (
    NONE,
    NOT_TESTED,
    counted,
    freq,
    percent,
    short,
    signed_percent,
    unit_fraction,
    value,
)
from femtune.report.sections.derived import derived_quantities
from femtune.report.sections.summary import summary
from femtune.report.sections.validation import untested_reasons, validation_verdicts
from femtune.report.source import Source, stages
from femtune.study.results_correlation import CorrelationResults, PairedMode
from femtune.study.results_update import ParameterFacts

_MODES, _PARAMETERS, _LINES = 12, 24, 6


def short_form(source: Source) -> tuple[Section, ...]:
    """Summary, modes, parameters, what is undetermined, what was not tested."""
    parts = (
        ("summary", "Summary", summary(source)),
        ("modes", "Modes", _modes(source)),
        ("parameters", "Parameters", _parameters(source)),
        ("validation", "Validation", _validation(source)),
        ("open", "What stays open", [*_undetermined(source), *_not_tested(source)]),
    )
    return tuple(Section(name, title, tuple(blocks)) for name, title, blocks in parts if blocks)


def _validation(source: Source) -> list[Block]:
    """Verdicts on data that the update did not use; the sentence stands in the summary."""
    found = source.results.validation
    return [] if found is None else validation_verdicts(found)[1:]


def _modes(source: Source) -> list[Block]:
    names = [c for c in source.results.study.configurations if source.before(c)]
    return [*(_table(source.shown(name)) for name in names), *_reasons(source)]


def _table(stages: list[CorrelationResults]) -> Block:
    words = ("before", "after")[: len(stages)]
    heads = columns("Mode", ">Test Hz", *(f">{t} {w}" for w in words for t in ("Hz", "Error %", "MAC")))
    modes = _test_modes(stages)
    rows = [row(label, freq(hz), *(cell for s in stages for cell in _cells(s, label))) for label, hz in modes[:_MODES]]
    more = len(modes) - _MODES
    note = f"and {counted(more, 'more test mode')} on the page" if more > 0 else ""
    return Table(stages[0].configuration, heads, tuple(rows), note)


def _test_modes(stages: list[CorrelationResults]) -> list[tuple[str, float]]:
    found: dict[str, float] = {}
    for s in stages:
        found |= {p.test_label: p.test_freq_hz for p in s.pairs}
        found |= {m.test_label: m.test_freq_hz for m in s.unpaired_test}
        found |= {m.test_label: m.test_freq_hz for m in s.left_out}
    return sorted(found.items(), key=lambda entry: entry[1])


def _cells(stage: CorrelationResults, label: str) -> list[Cell]:
    pair = next((p for p in stage.pairs if p.test_label == label), None)
    if pair is None:
        left_out = any(m.test_label == label for m in stage.left_out)
        return [Cell("left out" if left_out else "no partner", tone="muted"), *[Cell(NONE, tone="muted")] * 2]
    return [Cell(freq(pair.model_freq_hz)), Cell(signed_percent(pair.freq_error_percent)), Cell(_mac(pair))]


def _mac(pair: PairedMode) -> str:
    return unit_fraction(pair.mac)


def _reasons(source: Source) -> list[Block]:
    """Each reason once, below the tables."""
    found = source.left_out()
    lines = [f"Left out, {', '.join(m.configurations)}: {', '.join(m.labels)}: {m.reason}" for m in found]
    return [Paragraph(line, tone="muted") for line in _some(lines, "reason")]


def _parameters(source: Source) -> list[Block]:
    facts, update = source.results.parameters, source.results.update
    if update is None or not facts:
        return []
    results = {p.name: p for p in update.parameters}
    ratios = {p.parameter: p.sd_ratio for p in source.results.selection.parameters} if source.results.selection else {}
    heads = columns("Parameter", "Unit", ">Nominal", ">Updated", ">± σ", ">Change %", ">σ / prior σ", "")
    rows = []
    for fact in facts[:_PARAMETERS]:
        result = results.get(fact.name)
        if result is not None:
            spread = short(result.sd) if result.sd is not None else NONE
            remark = _remark(fact, result.sd_reason if result.sd is None else "")
            change = signed_percent(result.change_percent)
            ratio = percent(ratios.get(fact.name))
            rows.append(
                row(
                    fact.name,
                    fact.unit or NONE,
                    value(fact.nominal),
                    value(result.value),
                    spread,
                    change,
                    ratio,
                    remark,
                )
            )
    more = len(facts) - _PARAMETERS
    note = f"and {counted(more, 'more parameter')} on the page" if more > 0 else ""
    return [Table("", heads, tuple(rows), note), *derived_quantities(update.derived)]


def _remark(fact: ParameterFacts, reason: str) -> Cell:
    return Cell(reason, tone="poor") if reason else Cell(f"tied: {fact.tie}" if fact.tie else "", tone="muted")


def _undetermined(source: Source) -> list[Block]:
    selection = source.results.selection
    if selection is None:
        return [Paragraph("Which parameters the data determine was not tested.")]
    weak, found = len(selection.weakly_determined), selection.undetermined
    tail = f"; {counted(weak, 'combination')} {'is' if weak == 1 else 'are'} weakly determined" if weak else ""
    if not found:
        return [Paragraph(f"The data leave no combination of parameters undetermined{tail}.")]
    lines = _some([c.sentence for c in found], "combination")
    return [Heading(f"Undetermined by the data{tail}"), Listing(tuple(lines))]


def _not_tested(source: Source) -> list[Block]:
    found = source.results.validation
    if found is None:
        return [Paragraph("Not tested: the model on data that were not used; no validation was run.")]
    lines = [*_untested_criteria(source), *untested_reasons(found), *found.not_tested]
    return [Heading("Not tested"), Listing(tuple(_some(lines, "line")))] if lines else []


def _untested_criteria(source: Source) -> list[str]:
    """A line each reason: what is compared, with the standards that ask for it."""
    reasons: dict[str, dict[str, set[str]]] = {}
    # reasons hold numbers that the update moves: those of the last stage are told
    last = [s for s in source.results.correlations if s.stage == stages(source)[-1]]
    for c in (c for s in last for c in s.criteria if c.verdict == NOT_TESTED):
        quantity, _, standard = c.name.rpartition(", ")
        reasons.setdefault(c.remark, {}).setdefault(quantity or c.name, set()).add(standard if quantity else "")
    return [f"criteria{reason and f', since {reason}'}: {_with_standards(names)}" for reason, names in reasons.items()]


def _with_standards(names: dict[str, set[str]]) -> str:
    shown = {name: ", ".join(sorted(filter(None, standards))) for name, standards in names.items()}
    return "; ".join(f"{name} ({standards})" if standards else name for name, standards in shown.items())


def _some(lines: list[str], noun: str) -> list[str]:
    more = len(lines) - _LINES
    return [*lines[:_LINES], *([f"and {counted(more, f'more {noun}')} on the page"] if more > 0 else [])]
