"""Acceptance criteria: the criterion's number beside the measured one."""

from __future__ import annotations

from collections.abc import Iterable

from femtune.report.document import Block, Cell, Column, Paragraph, Table, columns, row
from femtune.report.numbers import NONE, NOT_TESTED, value, with_unit
from femtune.report.sections.verdict_cell import verdict_cell
from femtune.report.source import STAGE_HEADS, STAGE_WORDS, Source, stages
from femtune.study.results_base import Stage
from femtune.study.results_correlation import Criterion


def criteria(source: Source) -> list[Block]:
    """One table a stage of what was measured; then what was not tested, each reason once."""
    blocks = [table for stage in stages(source) if (table := _table(source, stage)) is not None]
    blocks += _not_tested(source)
    return [*blocks, *source.after_notes] if blocks else [Paragraph("Not tested: no criterion was evaluated.")]


def _table(source: Source, stage: Stage) -> Block | None:
    rows = [
        row(c.configuration, *criterion_cells(criterion))
        for c in source.results.correlations
        if c.stage == stage
        for criterion in tested(c.criteria)
    ]
    heads: tuple[Column, ...] = columns("Configuration", "Criterion", ">Asked", ">Measured", "Verdict", "Remark")
    return Table(STAGE_WORDS[stage].capitalize(), heads, tuple(rows)) if rows else None


def tested(criteria: Iterable[Criterion]) -> list[Criterion]:
    """Criteria with a verdict."""
    return [c for c in criteria if c.verdict != NOT_TESTED]


def untested(criteria: Iterable[Criterion]) -> dict[str, tuple[str, ...]]:
    """Criteria that were not tested, with what they ask, by the reason."""
    found: dict[str, tuple[str, ...]] = {}
    for c in criteria:
        if c.verdict == NOT_TESTED:
            found[c.remark] = (*found.get(c.remark, ()), f"{c.name} {_asked(c)}")
    return found


def _not_tested(source: Source) -> list[Block]:
    """Configurations with the same criteria and the same reason share a row; of two stages the last one's is told."""
    found: dict[tuple[tuple[str, ...], tuple[str, ...], str], list[str]] = {}
    for name in source.results.study.configurations:
        for names, (when, reason) in _of_configuration(source, name).items():
            found.setdefault((names, tuple(when), reason), []).append(name)
    rows = [
        row(", ".join(where), " and ".join(when), "; ".join(names), reason or NONE)
        for (names, when, reason), where in found.items()
    ]
    heads = columns("Configurations", "When", "Criteria", "Reason")
    return [Table("Criteria that were not tested", heads, tuple(rows))] if rows else []


def _of_configuration(source: Source, name: str) -> dict[tuple[str, ...], tuple[list[str], str]]:
    """Stages and reason by the criteria; reasons hold numbers that differ from stage to stage."""
    found: dict[tuple[str, ...], tuple[list[str], str]] = {}
    for stage in stages(source):
        at = source.at(name, stage)
        for reason, names in untested(at.criteria if at else ()).items():
            found[names] = ([*found.get(names, ([], ""))[0], STAGE_HEADS[stage]], reason)
    return found


def criterion_cells(c: Criterion) -> tuple[Cell, ...]:
    """Name, what is asked, what was measured, verdict and remark."""
    measured = with_unit(value(c.measured), c.unit) if c.measured is not None else NOT_TESTED
    return row(c.name, _asked(c), measured, verdict_cell(c.verdict), c.remark or NONE)


def _asked(c: Criterion) -> str:
    return with_unit(f"{'≤' if c.sense == 'at most' else '≥'} {value(c.limit)}", c.unit)
