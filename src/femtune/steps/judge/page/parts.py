"""The residuals in parts, the shapes beside their neighbours, and the errors by kind: tables of the evidence."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Listing, Table, columns, row
from femtune.document.numbers import NONE, short
from femtune.steps.judge.reasons.parts import mixed_sentence
from femtune.steps.judge.record.parts import LEAST_SHARE, RESERVED

if TYPE_CHECKING:
    from femtune.document.document import Block, Tone
    from femtune.steps.judge.record.parts import KindOfErrors, NeighbourRecord, PartRecord
    from femtune.steps.report_source import ReportSource

_FURTHER_PARTS = 8
"""Rows beyond those of all residuals and of each kind: what is not noise, and as much again for comparison."""
_NOTE = (
    "Chi-square is the sum of squares of what the parameters cannot change, in units of the standard deviations; for "
    "noise of the stated size it is about its degrees of freedom. p is the probability of at least this chi-square, "
    "corrected for the number of parts and of tests."
)
_NEIGHBOURS_NOTE = (
    "The difference between the test shape and its model shape is split into its part in the shapes of the "
    "neighbouring model modes and the rest. Noise contributes equally to both, whatever its size. A larger part is an "
    "error of the model, or of the test: modes that its identification did not separate, a wrong gain or position of a "
    "sensor."
)
_KINDS_NOTE = (
    "The last column is the factor on the stated standard deviation with which errors count in the intervals of the "
    "parameters. Residuals that are larger than stated widen the intervals; smaller ones do not narrow them, except "
    'with scatter = "estimated" while no test of the fit fails.'
)


def parts_blocks(source: ReportSource) -> Iterable[Block]:
    """Tables of the parts, of the neighbours, and of the errors by kind."""
    parts = None if source.results.judgement is None else source.results.judgement.parts
    if parts is None:
        return
    whole = [p for p in parts.parts if p.family == "kinds"]
    fine = sorted((p for p in parts.parts if p.family != "kinds"), key=lambda p: (p.p_family_wise, p.p_value))
    if parts.parts:
        heads = columns("Part of the residuals", ">Values", ">Chi-square", ">Degrees of freedom", ">p")
        rows = tuple(_part(p) for p in (*whole, *fine[:_FURTHER_PARTS]))
        left = len(fine) - _FURTHER_PARTS
        more = f" {left} further parts, none with a smaller p, are in the results." if left > 0 else ""
        yield Table("The residuals in parts", heads, rows, _NOTE + more)
    if parts.untested:
        yield Listing(tuple(f"Not tested: {u.kind} residuals, because {u.reason}." for u in parts.untested))
    mixed = sorted(parts.neighbours, key=lambda n: n.p_value)[:_FURTHER_PARTS]
    if mixed:
        heads = columns("Configuration", "Most of a neighbour", ">F", ">Degrees of freedom", ">p")
        yield Table("Shapes beside their neighbours", heads, tuple(_neighbour(n) for n in mixed), _NEIGHBOURS_NOTE)
    if parts.kinds:
        heads = columns(
            "Residuals", "Standard deviation", ">Stated", ">Residuals show", ">Degrees of freedom", ">In intervals"
        )
        update = source.results.update
        counted = {} if update is None else {c.kind: c.error_factor for c in update.residual_counts}
        rows = tuple(_kind(k, counted.get(k.kind, 1.0)) for k in parts.kinds)
        yield Table("Size of the errors by kind", heads, rows, _KINDS_NOTE)


def _part(p: PartRecord) -> tuple[Cell, ...]:
    tone: Tone = "poor" if p.p_family_wise < RESERVED else ""
    return (
        Cell(p.words), Cell(str(p.values)), Cell(short(p.chi_square)), Cell(short(p.degrees_of_freedom)),
        Cell(_chance(p.p_family_wise), tone=tone),
    )  # fmt: skip


def _neighbour(n: NeighbourRecord) -> tuple[Cell, ...]:
    tone: Tone = "poor" if n.p_family_wise < RESERVED and n.share >= LEAST_SHARE else ""
    return (
        Cell(n.configuration), Cell(mixed_sentence(n)), Cell(short(n.F)),
        Cell(f"{n.degrees_of_freedom[0]}, {n.degrees_of_freedom[1]}"), Cell(_chance(n.p_family_wise), tone=tone),
    )  # fmt: skip


def _kind(k: KindOfErrors, counts: float) -> tuple[Cell, ...]:
    origin = "assumed" if k.assumed else "stated"
    shown = NONE if k.factor is None else short(k.fits) if k.fits is not None else f"{short(k.factor)} times"
    name = f"{k.key} ({origin})" if k.key else origin
    return row(k.kind, name, short(k.stated), shown, short(k.degrees_of_freedom), short(counts))


def _chance(p: float) -> str:
    return short(p) if p >= 1e-12 else "< 1e−12"
