"""The section of the report with the reasons for the verdict, and the evidence of each topic below them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Paragraph, columns, table_or_none
from femtune.steps.judge.page.coverage import coverage_blocks
from femtune.steps.judge.page.linearity import linearity_blocks
from femtune.steps.judge.page.missing import missing_blocks
from femtune.steps.judge.page.parts import parts_blocks

if TYPE_CHECKING:
    from femtune.document.document import Block, Level
    from femtune.steps.judge.record.judgement import JudgementResults, VerdictOfRun
    from femtune.steps.judge.record.reason import ReasonRecord
    from femtune.steps.report_source import ReportSource

LEVELS: Mapping[VerdictOfRun, Level] = {
    "accepted": "info",
    "accepted with reservations": "warning",
    "not accepted": "problem",
}
"""How serious each verdict is."""

EVIDENCE: tuple[Callable[[ReportSource], Iterable[Block]], ...] = (
    missing_blocks,
    parts_blocks,
    linearity_blocks,
    coverage_blocks,
)
"""Blocks of the topics, in their order."""


def judgement_verdict(found: JudgementResults) -> tuple[str, Level]:
    """The line of the verdict, and how serious it is."""
    return found.line, LEVELS[found.verdict]


def judgement(source: ReportSource) -> list[Block]:
    """All reasons, then the evidence by topic."""
    found = source.results.judgement
    if found is None:
        return [Paragraph("The verdict was not computed: the run did not end, or its results are of an older version.")]
    heads = columns("Weight", "Reason", "Where")
    table = table_or_none("", heads, [_row(r) for r in found.reasons], "No check failed, and nothing was left out.")
    return [table, *(block for topic in EVIDENCE for block in topic(source))]


def _row(r: ReasonRecord) -> tuple[Cell, ...]:
    return Cell(r.weight, tone="poor" if r.weight == "not accepted" else ""), Cell(r.sentence), Cell(r.place)
