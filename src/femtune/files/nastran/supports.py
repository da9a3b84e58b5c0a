"""Supports: SPC, SPC1 and SPCADD as sets of held g-set DOFs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.files.nastran.building import Building, listed_numbers
from femtune.files.nastran.grids import Grids, unknown_grid
from femtune.files.nastran.lists import read_list
from femtune.files.nastran.record import Record

Integers = NDArray[np.int64]


def read_supports(building: Building, grids: Grids) -> dict[int, Integers]:
    """Held DOFs of each set, those of SPCADD included."""
    held: dict[int, set[int]] = {}
    for record in building.records("SPC", "SPC1"):
        with building.errors.catch():
            number = record.integer("SID")
            dofs = (
                _single(building, record, grids)
                if record.name == "SPC"
                else listed_dofs(record, grids, record.component("C", "0"), 2)
            )
            held.setdefault(number, set()).update(dofs)
    for number, parts in read_unions(building, "SPCADD", set(held)).items():
        held[number] = set().union(*(held[part] for part in parts))
    return {number: np.array(sorted(dofs), dtype=np.int64) for number, dofs in held.items()}


def read_unions(building: Building, card: str, known: set[int]) -> dict[int, list[int]]:
    """Members of the sets that SPCADD or MPCADD put together.

    A set cannot be a union and have cards of its own, and its members are no unions, as in Nastran.
    """
    unions: dict[int, list[int]] = {}
    numbers = {record.card.integer(0, 0) for record in building.records(card) if record.card.is_integer(0)}
    for record in building.records(card):
        with building.errors.catch():
            number, parts = record.integer("SID"), listed_numbers(record, record.card.fields[1:])
            missing = [part for part in parts if part not in known]
            if missing or number in known:
                nested = [part for part in missing if part in numbers]
                raise _nested(record, number, nested[0]) if nested else _bad_union(record, number, missing, card)
            unions.setdefault(number, []).extend(parts)
    return unions


def _bad_union(record: Record, number: int, missing: list[int], card: str) -> FemtuneError:
    if missing:
        return record.error("deck.missing-set", f"{card} {number} refers to set {missing[0]}, which has no cards",
                            hint=f"take {missing[0]} off the card or add its cards")  # fmt: skip
    return record.error("deck.missing-set", f"set {number} is a {card} and has cards of its own",
                        hint=f"give the {card} another number")  # fmt: skip


def _nested(record: Record, number: int, part: int) -> FemtuneError:
    return record.error("deck.missing-set", f"{record.name} {number} refers to set {part}, which is another "
                        f"{record.name}", hint="list the sets that it puts together instead")  # fmt: skip


def _single(building: Building, record: Record, grids: Grids) -> set[int]:
    """SPC: up to two points with their components."""
    dofs: set[int] = set()
    for end in "12":
        number = record.integer("G" + end, 0)
        if number == 0:
            continue
        dofs |= dofs_of_point(record, grids, number, record.component("C" + end, "0"))
        if record.real("D" + end, 0.0) != 0.0:
            building.notices.append(_enforced(record, number))
    return dofs


def _enforced(record: Record, number: int) -> Notice:
    what = f"SPC gives grid point {number} a displacement; in normal modes it is held at zero"
    return Notice("deck.enforced-displacement", what, record.where)


def listed_dofs(record: Record, grids: Grids, components: str, start: int) -> set[int]:
    """Components of a list of points from field `start` on; points that only lie in a THRU range may be missing."""
    points = read_list(record.card.fields[start:], record.where)
    missing = [n for n in points.singles if n not in grids.points]
    if missing:
        raise unknown_grid(missing[0], record)
    numbers = points.among(grids.points) if points.spans or points.every else points.singles
    return {dof for number in numbers for dof in dofs_of_point(record, grids, number, components)}


def dofs_of_point(record: Record, grids: Grids, number: int, components: str) -> set[int]:
    """g-set DOFs of components of a grid point or scalar point that a card names."""
    if number in grids.records and components == "0":
        raise record.error("deck.field-value", f"no components are given for grid point {number}",
                           hint="write digits from 1 to 6, as in 123456")  # fmt: skip
    return {grids.dof(number, int(c), record) for c in components}
