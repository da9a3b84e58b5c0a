"""Quantities that follow from the parameters, with their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence

from femtune.report.document import Block, Cell, Table, columns, row
from femtune.report.numbers import NONE, short, value
from femtune.study.results_update import DerivedResult


def derived_quantities(found: Sequence[DerivedResult]) -> list[Block]:
    """A table of them; nothing where the study defines none."""
    heads = columns("Quantity", "Unit", ">At the start", ">Updated", ">± σ", "Expression")
    return [Table("Derived quantities", heads, tuple(_row(d) for d in found))] if found else []


def _row(found: DerivedResult) -> tuple[Cell, ...]:
    spread = Cell(short(found.sd)) if found.sd is not None else Cell(found.sd_reason, tone="poor")
    nominal, updated = ("no value" if v is None else value(v) for v in (found.nominal, found.value))
    return row(found.name, found.unit or NONE, nominal, updated, spread, found.expression)
