"""Rigid elements as equations: RBE2, RBAR, RBAR1, RTRPLT, RTRPLT1, RROD; RBE1 and RBE3 are in `rigid_lists`."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from femtune.errors import FemtuneError, Notice
from femtune.fem.constraints import (
    ALL_COMPONENTS,
    rigid_bar_rows,
    rigid_element_rows,
    rigid_plate_rows,
    rigid_rod_rows,
)
from femtune.fem.structure import ConstraintRows, join_constraints
from femtune.files.nastran.building import Building, listed_numbers
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.record import Record
from femtune.files.nastran.rigid_lists import averaging_rows, body_rows


def read_rigid(building: Building, grids: Grids) -> ConstraintRows:
    """Equations of all rigid elements."""
    parts = []
    for record in building.records(*_READERS):
        with building.errors.catch():
            parts.append(_placed(record, grids))
    _note_expansion(building)
    return join_constraints(parts)


def _placed(record: Record, grids: Grids) -> ConstraintRows:
    """Rows of an element; errors of the kernel get the card's place in the file."""
    try:
        return _READERS[record.name](record, grids)
    except FemtuneError as error:
        if error.where is None or error.where.file:
            raise
        raise FemtuneError(error.code, error.what, where=record.where, values=error.values, hint=error.hint) from error


def _note_expansion(building: Building) -> None:
    """A coefficient of thermal expansion is the only real number on a rigid element, weights of RBE3 apart."""
    found = [record for record in building.records(*_READERS) if _expands(record)]
    if found:
        count = f"{len(found)} rigid element{'s give' if len(found) > 1 else ' gives'}"
        what = f"{count} a coefficient of thermal expansion; vibration knows no temperature, so it is not used"
        building.notices.append(Notice("deck.rigid-expansion", what, found[0].where, "info"))


def _expands(record: Record) -> bool:
    if record.name == "RBE3":
        return "ALPHA" in map(str.upper, record.card.fields)
    return any(record.card.is_real(at) for at in range(len(record.card.fields)))


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
    a, b = _points(record, grids, "GA", "GB")
    free = (_of(record, "CNA"), _of(record, "CNB"))
    if not any(free):
        free = (list(ALL_COMPONENTS), [])
    follow = (_of(record, "CMA"), _of(record, "CMB"))
    return rigid_bar_rows(grids.table, (a, b), free, follow, record.integer("EID"))


def _first_rules(record: Record, grids: Grids) -> ConstraintRows:
    """RBAR1 and RTRPLT1: end A moves the others, all their components where none are named."""
    names = {"GB": "CB"} if record.name == "RBAR1" else {"GB": "CMB", "GC": "CMC"}
    points = _points(record, grids, "GA", *names)
    dependent = [(n, _of(record, c) or list(ALL_COMPONENTS)) for n, c in zip(points[1:], names.values())]
    free = [(points[0], ALL_COMPONENTS)]
    return rigid_plate_rows(grids.table, points, free, dependent, record.integer("EID"), record.name)


def _plate(record: Record, grids: Grids) -> ConstraintRows:
    points = _points(record, grids, "GA", "GB", "GC")
    free, follow = ([(n, _of(record, kind + end)) for n, end in zip(points, "ABC")] for kind in ("CN", "CM"))
    return rigid_plate_rows(grids.table, points, free, follow, record.integer("EID"), record.name)


def _rod(record: Record, grids: Grids) -> ConstraintRows:
    a, b = _points(record, grids, "GA", "GB")
    chosen = [(end, c) for end, name in enumerate(("CMA", "CMB")) for c in _of(record, name)]
    if len(chosen) != 1 or chosen[0][1] > 3:
        raise record.error("deck.field-value", "an RROD has one dependent translation, at one of its ends", at="CMA",
                           hint="write 1, 2 or 3 into CMA or into CMB")  # fmt: skip
    return rigid_rod_rows(grids.table, (a, b), chosen[0], record.integer("EID"))


def _points(record: Record, grids: Grids, *names: str) -> list[int]:
    numbers = [record.integer(name) for name in names]
    for number in numbers:
        grids.row(number, record)
    return numbers


def _of(record: Record, name: str) -> list[int]:
    return [c for c in _numbers(record.component(name)) if c]


def _numbers(digits: Iterable[str]) -> list[int]:
    return [int(d) for d in digits]


_READERS: dict[str, Callable[[Record, Grids], ConstraintRows]] = {
    "RBE2": _spider,
    "RBAR": _bar,
    "RBAR1": _first_rules,
    "RBE1": body_rows,
    "RBE3": averaging_rows,
    "RROD": _rod,
    "RTRPLT": _plate,
    "RTRPLT1": _first_rules,
}
