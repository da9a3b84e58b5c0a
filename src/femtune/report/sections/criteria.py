"""Acceptance criteria: the criterion's number beside the measured one."""

from __future__ import annotations

from femtune.report.document import Block, Cell, Column, Paragraph, Table, Tone, columns, row
from femtune.report.numbers import NONE, NOT_TESTED, value, with_unit
from femtune.report.source import STAGE_WORDS, Source, stages
from femtune.study.results_base import Stage
from femtune.study.results_correlation import Criterion

_TONES: dict[str, Tone] = {"pass": "good", "fail": "poor", "not tested": "muted"}


def criteria(source: Source) -> list[Block]:
    """One table a stage."""
    blocks = [table for stage in stages(source) if (table := _table(source, stage)) is not None]
    return [*blocks, *source.after_notes] if blocks else [Paragraph("Not tested: no criterion was evaluated.")]


def _table(source: Source, stage: Stage) -> Block | None:
    rows = [
        row(c.configuration, *criterion_cells(criterion))
        for c in source.results.correlations
        if c.stage == stage
        for criterion in c.criteria
    ]
    heads: tuple[Column, ...] = columns("Configuration", "Criterion", ">Asked", ">Measured", "Verdict", "Remark")
    return Table(STAGE_WORDS[stage].capitalize(), heads, tuple(rows)) if rows else None


def criterion_cells(c: Criterion) -> tuple[Cell, ...]:
    """Name, what is asked, what was measured, verdict and remark."""
    sign = "≤" if c.sense == "at most" else "≥"
    measured = with_unit(value(c.measured), c.unit) if c.measured is not None else NOT_TESTED
    return row(
        c.name, with_unit(f"{sign} {value(c.limit)}", c.unit), measured,
        Cell(c.verdict, tone=_TONES[c.verdict]), c.remark or NONE,
    )  # fmt: skip
