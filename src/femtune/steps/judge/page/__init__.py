"""The section of the report with the reasons for the verdict, and the evidence of each topic below them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Table, columns
from femtune.steps.judge.page.missing import missing_blocks
from femtune.steps.judge.page.parts import parts_blocks

if TYPE_CHECKING:
    from femtune.document.document import Block, Level
    from femtune.steps.judge.record.judgement import VerdictOfRun
    from femtune.steps.judge.record.reason import ReasonRecord
    from femtune.steps.report_source import ReportSource

LEVELS: Mapping[VerdictOfRun, Level] = {
    "accepted": "info",
    "accepted with reservations": "warning",
    "not accepted": "problem",
}
"""How serious each verdict is."""

EVIDENCE: tuple[Callable[[ReportSource], Iterable[Block]], ...] = (missing_blocks, parts_blocks)
"""Blocks of the topics, in their order."""


def judgement(source: ReportSource) -> list[Block]:
    """All reasons, then the evidence by topic; no blocks without a judgement."""
    found = source.results.judgement
    if found is None:
        return []
    heads = columns("Weight", "Reason", "Where")
    reasons = [Table("", heads, tuple(_row(r) for r in found.reasons))] if found.reasons else []
    return [*reasons, *(block for topic in EVIDENCE for block in topic(source))]


def _row(r: ReasonRecord) -> tuple[Cell, ...]:
    return Cell(r.weight, tone="poor" if r.weight == "not accepted" else ""), Cell(r.sentence), Cell(r.place)
