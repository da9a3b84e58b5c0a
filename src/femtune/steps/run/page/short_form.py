"""The report in short form, for a terminal: at most two screens, with a reference to the page for the rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import Cell, Heading, Listing, Paragraph, Section, Table, columns, row
from femtune.document.numbers import (
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
from femtune.steps.bootstrap.page import parameter_table
from femtune.steps.judge.page import LEVELS
from femtune.steps.report_source import versions
from femtune.steps.run.page.summary import summary
from femtune.steps.specimens.page import specimen_blocks
from femtune.steps.update.page.parameters import (
    derived_quantities,
    interval_ends,
    interval_remarks,
    physical_values,
    sampled_remarks,
)
from femtune.steps.update.page.starts import optima
from femtune.steps.validate.page import deviation_table, untested_reasons, validation_verdicts

if TYPE_CHECKING:
    from femtune.document.document import Block, Level
    from femtune.steps.correlate.record.correlation import CorrelationResults, ModePairRecord
    from femtune.steps.report_source import ReportSource, Scores
    from femtune.steps.update.record.update import ParameterFacts, UpdateResults

_MOST_MODES = 12
"""Test modes in the table: the short form must fit two screens of a terminal."""
_MOST_PARAMETERS = 24
"""Parameters in the table: the short form must fit two screens of a terminal."""
_MOST_LINES = 6
"""Lines of a list; a last line gives the number of the others."""


def short_form(source: ReportSource) -> tuple[Section, ...]:
    """Summary, modes, parameters, starts, bootstrap, what is undetermined, what was not tested."""
    parts = (
        ("summary", "Summary", summary(source)),
        ("modes", "Modes", _modes(source)),
        ("parameters", "Parameters", _parameters(source)),
        ("starts", "Starts", _starts(source)),
        ("bootstrap", "Bootstrap", _bootstrap(source)),
        ("specimens", "Specimens", _specimens(source)),
        ("validation", "Validation", _validation(source)),
        ("open", "What was not determined or tested", [*undetermined(source), *not_tested(source)]),
    )
    return tuple(Section(name, title, tuple(blocks)) for name, title, blocks in parts if blocks)


def _starts(source: ReportSource) -> list[Block]:
    update = source.results.update
    return [] if update is None else optima(update, _MOST_LINES)


def _bootstrap(source: ReportSource) -> list[Block]:
    bootstrap = source.results.bootstrap
    return [] if bootstrap is None else [Listing(bootstrap.sentences), parameter_table(bootstrap)]


def _specimens(source: ReportSource) -> list[Block]:
    specimens = source.results.specimens
    return [] if specimens is None else specimen_blocks(specimens)


def _validation(source: ReportSource) -> list[Block]:
    """Verdicts on data that the update did not use, and which outputs those are; the sentence is in the summary."""
    validation = source.results.validation
    held = [Paragraph(f"{a.sentence}.") for a in source.results.alerts if a.code == "study.worst-held"]
    return [
        *held,
        *([] if validation is None else [*validation_verdicts(validation)[1:], *deviation_table(validation)]),
    ]


def _modes(source: ReportSource) -> list[Block]:
    names = [c for c in source.results.study.configurations if source.before(c)]
    return [*(_table(source.shown(name)) for name in names), *_reasons(source)]


def _table(comparisons: list[CorrelationResults]) -> Block:
    words = ("before", "after")[: len(comparisons)]
    heads = columns("Mode", ">Test Hz", *(f">{t} {w}" for w in words for t in ("Hz", "Error %", "MAC")))
    modes = _test_modes(comparisons)
    rows = [
        row(label, freq(hz), *(cell for s in comparisons for cell in _cells(s, label)))
        for label, hz in modes[:_MOST_MODES]
    ]
    more = len(modes) - _MOST_MODES
    note = f"and {counted(more, 'more test mode')} in the HTML report" if more > 0 else ""
    return Table(comparisons[0].configuration, heads, tuple(rows), note)


def _test_modes(comparisons: list[CorrelationResults]) -> list[tuple[str, float]]:
    modes: dict[str, float] = {}
    for s in comparisons:
        modes |= {p.test_label: p.test_freq_hz for p in s.pairs}
        modes |= {m.test_label: m.test_freq_hz for m in (*s.unpaired_test, *s.suspension)}
        modes |= {m.test_label: m.test_freq_hz for m in s.left_out}
    return sorted(modes.items(), key=lambda entry: entry[1])


def _cells(comparison: CorrelationResults, label: str) -> list[Cell]:
    pair = next((p for p in comparison.pairs if p.test_label == label), None)
    if pair is None:
        left_out = any(m.test_label == label for m in comparison.left_out)
        suspension = any(m.test_label == label for m in comparison.suspension)
        word = "left out" if left_out else "suspension" if suspension else "no partner"
        return [Cell(word, tone="muted"), *[Cell(NONE, tone="muted")] * 2]
    return [Cell(freq(pair.model_freq_hz)), Cell(signed_percent(pair.freq_error_percent)), Cell(_mac(pair))]


def _mac(pair: ModePairRecord) -> str:
    return unit_fraction(pair.mac)


def _reasons(source: ReportSource) -> list[Block]:
    """Each reason once, below the tables."""
    left_out = source.left_out()
    lines = [f"Left out, {', '.join(m.configurations)}: {', '.join(m.labels)}: {m.reason}" for m in left_out]
    lines += [f"{a.sentence}." for a in source.results.alerts if a.code == "correlate.suspension"]
    return [Paragraph(line, tone="muted") for line in _some(lines, "reason")]


def _parameters(source: ReportSource) -> list[Block]:
    facts, update = source.results.parameters, source.results.update
    if update is None or not facts:
        return []
    results = {p.name: p for p in update.parameters}
    heads = columns("Parameter", "Unit", ">Nominal", ">Updated", ">± σ", ">95 %", ">Change %", ">σ / prior σ", "")
    rows = []
    for fact in facts[:_MOST_PARAMETERS]:
        result = results.get(fact.name)
        if result is not None:
            spread = short(result.sd) if result.sd is not None else NONE
            remark = _remark(fact, result.sd_reason if result.sd is None else "")
            change = signed_percent(result.change_percent)
            ratio = NONE if result.sd is None or not fact.prior_sd else percent(result.sd / fact.prior_sd)
            rows.append(
                row(
                    fact.name,
                    fact.unit or NONE,
                    value(fact.nominal),
                    value(result.value),
                    spread,
                    interval_ends(result.interval_95),
                    change,
                    ratio,
                    remark,
                )
            )
    more = len(facts) - _MOST_PARAMETERS
    others = f"And {counted(more, 'more parameter')} in the HTML report. " if more > 0 else ""
    note = f"{others}{_PRIOR_NOTE}"
    return [
        Table("", heads, tuple(rows), note),
        *interval_remarks(update.parameters),
        *sampled_remarks(source.results.posterior),
        *physical_values(update.parameters, _MOST_PARAMETERS),
        *derived_quantities(update.derived),
    ]


_PRIOR_NOTE = "Without a stated prior, the prior σ is the width of the bounds divided by √12."


def _remark(fact: ParameterFacts, reason: str) -> Cell:
    return Cell(reason, tone="poor") if reason else Cell(f"tied: {fact.tie}" if fact.tie else "", tone="muted")


def undetermined(source: ReportSource) -> list[Block]:
    """What the data leave open."""
    selection = source.results.selection
    if selection is None:
        return [Paragraph("The identifiability of the parameters was not tested.")]
    weak, combinations = len(selection.weakly_determined), selection.undetermined
    tail = f"; {counted(weak, 'combination')} {'is' if weak == 1 else 'are'} weakly determined" if weak else ""
    update = source.results.update
    fisher = None if update is None else update.fisher
    known: list[Block] = [] if fisher is None else [Listing(fisher.sentences)]
    known += [Paragraph(s.sentence) for s in selection.smoothness if s.sentence]
    if not combinations:
        return [Paragraph(f"The data determine all combinations of the parameters{tail}."), *known]
    lines = _some([c.sentence for c in combinations], "combination")
    return [Heading(f"Undetermined by the data{tail}"), Listing(tuple(lines)), *known]


def not_tested(source: ReportSource) -> list[Block]:
    """Predictions and criteria that were not tested."""
    validation = source.results.validation
    if validation is None:
        return [Paragraph("Not tested: prediction of data that the update did not use. No validation was run.")]
    lines = [*_untested_criteria(source), *untested_reasons(validation), *validation.not_tested]
    return [Heading("Not tested"), Listing(tuple(_some(lines, "line")))] if lines else []


def _untested_criteria(source: ReportSource) -> list[str]:
    """A line each reason: what is compared, with the standards that ask for it."""
    reasons: dict[str, dict[str, set[str]]] = {}
    # reasons contain numbers that the update changes: those of the last version are shown
    last = [s for s in source.results.correlations if s.stage == versions(source)[-1]]
    for c in (c for s in last for c in s.criteria if c.verdict == NOT_TESTED):
        quantity, _, standard = c.name.rpartition(", ")
        reasons.setdefault(c.remark, {}).setdefault(quantity or c.name, set()).add(standard if quantity else "")
    return [f"criteria{reason and f' ({reason})'}: {_with_standards(names)}" for reason, names in reasons.items()]


def _with_standards(names: dict[str, set[str]]) -> str:
    shown = {name: ", ".join(sorted(filter(None, standards))) for name, standards in names.items()}
    return "; ".join(f"{name} ({standards})" if standards else name for name, standards in shown.items())


def _some(lines: list[str], noun: str) -> list[str]:
    more = len(lines) - _MOST_LINES
    return [*lines[:_MOST_LINES], *([f"and {counted(more, f'more {noun}')} in the HTML report"] if more > 0 else [])]


def verdict(source: ReportSource) -> tuple[str, Level]:
    """One sentence and how serious it is: the verdict on the run; of results without a verdict how well they agree."""
    judged = source.results.judgement
    if judged is not None:
        return judged.line, LEVELS[judged.verdict]
    update, before, after = source.results.update, source.scores("before"), source.scores(source.final_version)
    if before is None:
        return _without_modes(source, update)
    if update is None or after is None:
        return f"Test and model were compared without an update: {agreement(before)}.", "info"
    if not update.ok:
        return (
            f"The update did not reach an optimum ({update.message}); at the best point {agreement(after)}.",
            "problem",
        )
    caveats = _caveats(source, update)
    sentence = f"After the update, {agreement(after)} (before: {_numbers(before)}){_tail(caveats)}."
    return sentence, "warning" if caveats else "info"


def _without_modes(source: ReportSource, update: UpdateResults | None) -> tuple[str, Level]:
    """Where no modes were measured the weighted mean error is all that there is."""
    if update is None:
        return "Test and model have not been compared.", "warning"
    first, last = percent(update.objective_before_percent), percent(update.objective_after_percent)
    if not update.ok:
        return f"The update did not reach an optimum ({update.message}); weighted mean error {last} %.", "problem"
    caveats = _caveats(source, update)
    sentence = f"After the update, the weighted mean error is {last} % (before: {first} %){_tail(caveats)}."
    return sentence, "warning" if caveats else "info"


def agreement(scores: Scores) -> str:
    """How well paired modes agree, without a full stop."""
    if not scores.pairs:
        return "no test mode could be paired with a model mode"
    if scores.mean_error_percent is None:
        return f"{counted(scores.pairs, 'test mode')} could be paired"
    mac = f" and the lowest MAC is {unit_fraction(scores.lowest_mac)}" if scores.lowest_mac is not None else ""
    return (
        f"the mean frequency error of {counted(scores.pairs, 'paired mode')} is "
        f"{percent(scores.mean_error_percent)} %{mac}"
    )


def _numbers(scores: Scores) -> str:
    if scores.mean_error_percent is None:
        return "no pairs"
    mac = f", lowest MAC {unit_fraction(scores.lowest_mac)}" if scores.lowest_mac is not None else ""
    return f"{percent(scores.mean_error_percent)} % mean frequency error{mac}"


def _tail(caveats: list[str]) -> str:
    return f"; {' and '.join(caveats)}" if caveats else ""


def _caveats(source: ReportSource, update: UpdateResults) -> list[str]:
    """What must be said in the same breath as the success."""
    at_bound = sum(bool(p.at_bound) for p in update.parameters)
    open_ = len(source.results.selection.undetermined) if source.results.selection else 0
    misfit = update.goodness is not None and update.goodness.verdict == "fail"
    return [
        *([f"{counted(at_bound, 'parameter')} {'is' if at_bound == 1 else 'are'} at a bound"] if at_bound else []),
        *([f"the data leave {counted(open_, 'combination')} of parameters undetermined"] if open_ else []),
        *(["the remaining misfit exceeds the measurement error"] if misfit else []),
        *_failed(source),
    ]


def _failed(source: ReportSource) -> list[str]:
    """That criteria failed on data that were not used."""
    verdicts = source.results.validation.verdicts if source.results.validation else ()
    failed = sum(v.verdict == "fail" for v in verdicts)
    return [f"{counted(failed, 'criterion', 'criteria')} failed on data that were not used"] if failed else []
