"""Rigid elements: RBE2 and RBAR as equations."""

from __future__ import annotations

from collections.abc import Iterable

from femtune.errors import FemtuneError
from femtune.fem.constraints import ALL_COMPONENTS, rigid_bar_rows, rigid_element_rows
from femtune.fem.structure import ConstraintRows, join_constraints
from femtune.files.nastran.building import Building, listed_numbers
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.record import Record


def read_rigid(building: Building, grids: Grids) -> ConstraintRows:
    """Equations of all RBE2 and RBAR elements."""
    parts = []
    for record in building.records("RBE2", "RBAR"):
        with building.errors.catch():
            parts.append(_placed(record, grids))
    return join_constraints(parts)


def _placed(record: Record, grids: Grids) -> ConstraintRows:
    """Rows of an element; errors of the kernel get the card's place in the file."""
    try:
        return _spider(record, grids) if record.name == "RBE2" else _bar(record, grids)
    except FemtuneError as error:
        if error.where is None or error.where.file:
            raise
        raise FemtuneError(error.code, error.what, where=record.where, values=error.values, hint=error.hint) from error


def _spider(record: Record, grids: Grids) -> ConstraintRows:
    components = _numbers(record.component("CM"))
    if not components or components == [0]:
        raise record.error("deck.field-value", "RBE2 names no components", at="CM",
                           hint="write digits from 1 to 6, as in 123456")  # fmt: skip
    numbers = _dependents(record)
    for number in (record.integer("GN"), *numbers):
        grids.row(number, record)
    return rigid_element_rows(grids.table, record.integer("GN"), numbers, components, record.integer("EID"))


def _dependents(record: Record) -> list[int]:
    """Grid points GM1, GM2 …; a real number at the end is the thermal expansion coefficient."""
    fields = list(record.card.fields[3:])
    while fields and (not fields[-1].strip() or record.card.is_real(2 + len(fields))):
        fields.pop()
    numbers = listed_numbers(record, fields)
    if not numbers:
        raise record.error("deck.field-value", "RBE2 has no dependent grid points",
                           hint="list them after CM, or remove the card")  # fmt: skip
    return numbers


def _bar(record: Record, grids: Grids) -> ConstraintRows:
    ends = (record.integer("GA"), record.integer("GB"))
    for number in ends:
        grids.row(number, record)
    free = (_of(record, "CNA"), _of(record, "CNB"))
    if not any(free):
        free = (list(ALL_COMPONENTS), [])
    follow = (_of(record, "CMA"), _of(record, "CMB"))
    return rigid_bar_rows(grids.table, ends, free, follow, record.integer("EID"))


def _of(record: Record, name: str) -> list[int]:
    return [c for c in _numbers(record.component(name)) if c]


def _numbers(digits: Iterable[str]) -> list[int]:
    return [int(d) for d in digits]
