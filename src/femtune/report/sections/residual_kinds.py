"""What was compared, by kind of residual, before and after the update."""

from __future__ import annotations

from femtune.report.document import Block, Cell, Paragraph, Table, columns, row
from femtune.report.numbers import NONE, percent, short
from femtune.study.results_update import ComparisonResults, ResidualCount, UpdateResults

_UNFOLDED = 12
"""Comparisons that are shown at once."""
_NOTE = (
    "Mean error: √(Σr²/Σσ⁻²) of one kind, relative to what is compared. Root mean square: of the residuals r, in units "
    "of the standard deviations that the study states; about 1 where only the test's scatter is left."
)


def residual_kinds(update: UpdateResults) -> list[Block]:
    """A table of kinds; nothing where the results do not have it."""
    known = [kind for kind in update.residual_counts if kind.rms_after is not None]
    if not known:
        return []
    heads = columns("Residuals", ">Number", ">Mean error % before", ">after", ">Root mean square before", ">after")
    by_kind = Table("Residuals by kind", heads, tuple(_row(kind) for kind in known))
    return [by_kind, Paragraph(_NOTE, tone="muted"), *_comparisons(update)]


def _row(kind: ResidualCount) -> tuple[Cell, ...]:
    return row(
        kind.kind,
        str(kind.count),
        _percent(kind.error_before_percent),
        _percent(kind.error_after_percent),
        short(kind.rms_before),
        short(kind.rms_after),
    )


def _comparisons(update: UpdateResults) -> list[Block]:
    """Every comparison by itself, unfolded where they are few."""
    heads = columns("Configuration", "Compared", ">Values", ">Error % before", ">after", ">Root mean square after")
    rows = tuple(_comparison(c) for c in update.comparisons)
    return [Table("Every comparison", heads, rows, folded=len(rows) > _UNFOLDED)] if rows else []


def _comparison(c: ComparisonResults) -> tuple[Cell, ...]:
    return row(
        c.configuration,
        f"{c.kind} {c.label}",
        str(c.count),
        _percent(c.error_before_percent),
        percent(c.error_after_percent),
        short(c.rms_after),
    )


def _percent(value: float | None) -> str:
    return NONE if value is None else percent(value)
