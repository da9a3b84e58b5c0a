"""The first page of a review: key numbers, verdicts on the criteria, changed parameters, open points."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Heading, Paragraph, Table, TwoColumns, columns, row
from femtune.document.numbers import NONE, NOT_TESTED, counted, listed, short, signed_percent, value, with_unit
from femtune.steps.run.page.basis import basis
from femtune.steps.run.page.short_form import not_tested, undetermined
from femtune.steps.run.page.summary import is_green, summary
from femtune.steps.update.page.parameters import interval_ends, physical_values, sampled_remarks
from femtune.steps.validate.page import verdict_cell

if TYPE_CHECKING:
    from femtune.document.document import Block, Tone
    from femtune.steps.report_source import ReportSource
    from femtune.steps.update.record.update import ParameterFacts, ParameterResult
    from femtune.study.record import VerdictWord

_MOST_VALUES = 16
"""Changed values on the first page, which must fit one sheet of paper."""


def review(source: ReportSource) -> list[Block]:
    """Key numbers and alerts, the verdict, changed values, open questions."""
    # a study may compare FRFs or masses alone, without modes
    compared = source.results.correlations or source.results.update
    open_ = [*undetermined(source), *not_tested(source)] if compared else []
    changes, stays = _changes(source), [Heading("What stays open"), *open_] if open_ else []
    ends: list[Block] = [TwoColumns((*changes,), (*stays,))] if changes and stays else [*changes, *stays]
    return [*summary(source), *_verdict(source), *basis(source), *ends]


def comparison(source: ReportSource) -> list[Block]:
    """The first page of a comparison without an update: key numbers and alerts, the verdict, what it is based on."""
    return [*summary(source), *_verdict(source), *basis(source)]


@dataclass(frozen=True)
class _Judged:
    """One verdict: `data` says whether the update used what it judges."""

    name: str
    data: str
    configuration: str
    asked: str
    limit: float
    limit_side: float
    measured: float | None
    unit: str
    verdict: VerdictWord
    why: str


def _judged(source: ReportSource) -> Iterable[_Judged]:
    for c in source.results.correlations:
        if c.stage == source.final_version or (source.results.update is None and c.stage == "before"):
            for one in c.criteria:
                side = 1.0 if one.sense == "at most" else -1.0
                yield _Judged(
                    one.name, "all paired modes", c.configuration, _asked(one.sense, one.limit, one.unit), one.limit,
                    side, one.measured, one.unit, one.verdict, one.remark,
                )  # fmt: skip
    validation = source.results.validation
    for v in validation.verdicts if validation else ():
        side = 1.0 if v.sense == "at most" else -1.0
        yield _Judged(
            v.criterion, f"not used: {v.data}", v.configuration, _asked(v.sense, v.required, v.unit), v.required,
            side, v.measured, v.unit, v.verdict, v.remark,
        )  # fmt: skip


def _asked(sense: str, limit: float, unit: str) -> str:
    return with_unit(f"{'≤' if sense == 'at most' else '≥'} {value(limit)}", unit)


def _verdict(source: ReportSource) -> list[Block]:
    groups: dict[tuple[str, str, str], list[_Judged]] = {}
    for one in _judged(source):
        groups.setdefault((one.name, one.data, one.asked), []).append(one)
    if not groups:
        return [Heading("Acceptance criteria"), Paragraph("Not tested: no criterion was evaluated.", "muted")]
    rows = [_verdict_row(group) for group in groups.values()]
    counts = {word: sum(r[-1].text == word for r in rows) for word in ("pass", "fail", NOT_TESTED)}
    said = f"{counts['pass']} of {counted(len(rows), 'criterion', 'criteria')} passed"
    said += f", {counts['fail']} failed" if counts["fail"] else ""
    left = counts[NOT_TESTED]
    said += f", {left} {'was' if left == 1 else 'were'} not tested" if left else ""
    passed: Tone = "good" if is_green(source) else ""
    tone: Tone = "poor" if counts["fail"] else passed if counts["pass"] else "muted"
    heads = columns("Criterion", "Data", ">Required", ">Worst", "Where and why", "Verdict")
    note = "Worst value over all configurations; details in the sections on validation and acceptance criteria."
    return [
        Heading("Acceptance criteria"),
        Paragraph(f"{said}{_profile(source)}.", tone),
        Table("", heads, tuple(rows), note),
    ]


def _profile(source: ReportSource) -> str:
    validation = source.results.validation
    return f" ({validation.profile})" if validation and validation.profile else ""


def _verdict_row(group: list[_Judged]) -> tuple[Cell, ...]:
    tested = [one for one in group if one.verdict != NOT_TESTED]
    first = group[0]
    if not tested:
        return row(first.name, first.data, first.asked, NONE, first.why or NONE, verdict_cell(NOT_TESTED))
    worst = max(tested, key=lambda one: (one.verdict == "fail", one.limit_side * (one.measured or 0.0)))
    left = len(group) - len(tested)
    where = worst.configuration + (f": {worst.why}" if worst.why else "")
    where += _despite(worst) + (f"; not tested in {left} of {len(group)}" if left else "")
    measured = NONE if worst.measured is None else with_unit(short(worst.measured), worst.unit)
    return row(first.name, first.data, first.asked, measured, where, verdict_cell(worst.verdict))


def _despite(one: _Judged) -> str:
    """Why a criterion failed though its number is within the limit."""
    within = one.measured is not None and one.limit_side * one.measured <= one.limit_side * one.limit
    return (
        " (the value is within the limit, but a mode without a partner fails it)"
        if one.verdict == "fail" and within
        else ""
    )


def _changes(source: ReportSource) -> list[Block]:
    update = source.results.update
    if update is None:
        return []
    facts = {p.name: p for p in source.results.parameters}
    changed = [(facts[p.name], p) for p in update.parameters if p.name in facts and not p.physical]
    changed.sort(key=lambda entry: -abs(entry[1].change_percent or 0.0))
    heads = columns("Parameter", "Unit", ">Initial", ">Updated", ">95 %", ">Change %")
    more = len(changed) - _MOST_VALUES
    note = f"and {counted(more, 'more parameter')} in the section on parameters" if more > 0 else ""
    tables = [Table("", heads, tuple(_changed(*entry) for entry in changed[:_MOST_VALUES]), note)] if changed else []
    bound = [p.name for p in update.parameters if p.at_bound]
    said = f"{listed(bound)} {'is at its bound' if len(bound) == 1 else 'are at their bounds'}."
    at_bound = [Paragraph(said, "poor")] if bound else []
    return [
        Heading("What changed"), *tables, *physical_values(update.parameters, _MOST_VALUES),
        *sampled_remarks(source.results.posterior), *at_bound,
    ]  # fmt: skip


def _changed(fact: ParameterFacts, parameter: ParameterResult) -> tuple[Cell, ...]:
    interval = interval_ends(parameter.interval_95)
    return row(
        parameter.name, fact.unit or NONE, value(fact.nominal), value(parameter.value), interval,
        signed_percent(parameter.change_percent),
    )  # fmt: skip
