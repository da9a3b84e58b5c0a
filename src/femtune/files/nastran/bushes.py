"""Bushes: CBUSH with PBUSH (stiffness, damping, loss factors), their frames and the arms to their locations.

Gaps (CGAP with PGAP) are bushes without arms, with the stiffness of their initial state.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.fem.elements.discrete import BUSH
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.bars import check_line, element_frame, orientation_vector
from femtune.files.nastran.building import BatchRows, Building, Library
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.coordinates import length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Properties, Roles, read_properties
from femtune.files.nastran.reading import ElementReading
from femtune.parameters.jet import Jet

_LINES = ("K", "B", "GE")
_FLAGS = ("K", "B", "GE", "RCV", "M", "T", "D")
_COINCIDENT_ENDS = 1e-10
"""Distance of the ends, relative to their coordinates, up to which a bush has no axis: above rounding."""


def read_bushes(reading: ElementReading) -> list[ElementBatch]:
    """Batch of CBUSH."""
    building, grids = reading.building, reading.grids
    properties = read_properties(building, "CBUSH")
    values = Library(lambda pid, user: _values(building, properties.find(pid, user), pid))
    rows = BatchRows(BUSH.key, "CBUSH")
    for record in building.records("CBUSH"):
        with building.errors.catch():
            _add(rows, record, building, grids, properties, values)
    return rows.batches()


def _values(building: Building, record: CardEntry, pid: int) -> Roles:
    """K1 to K6, B1 to B6 and GE1 to GE6; each line of the card starts with the flag of its values."""
    flags = _flags(record.card)
    spare = 8 * max(-(-len(record.card.fields) // 8), 1) + 1
    roles: dict[str, int] = {}
    for flag in _LINES:
        roles |= _line(building, record, pid, flag, flags.get(flag, spare), flag in flags)
    return roles


def _flags(card: Card) -> dict[str, int]:
    """Position of each flag of a PBUSH."""
    flags = {card.text(at): at for at in range(1, max(len(card.fields), 2), 8)}
    wrong = [flag for flag in flags if flag and flag not in _FLAGS]
    if wrong:
        raise card.error(
            "deck.field-value/bush-flag", index=flags[wrong[0]], unknown_flag=wrong[0], flags=" ".join(_FLAGS)
        )
    if "M" in flags and any(card.real(flags["M"] + i, 0.0) for i in range(1, 7)):
        raise card.error("deck.section/bush-mass", index=flags["M"])
    return flags


def _line(building: Building, record: CardEntry, pid: int, flag: str, at: int, present: bool) -> dict[str, int]:
    """The six values of a line; if the card lacks the line, it is written with its flag after the last line."""
    names = tuple(f"{flag}{i}" for i in range(1, 7))
    line = CardEntry(record.card, names, at + 1)
    new = None if present else (at, flag)
    if flag == "GE" and all(line.blank(name) for name in names[1:]):
        # Nastran gives all directions the first loss factor if the others are blank
        first = building.value(line, pid, "GE1", flag=new)
        derive = building.values.derive
        return {"GE1": first, **{n: derive(FieldRef("PBUSH", pid, n), _same, first) for n in names[1:]}}
    return {name: building.value(line, pid, name, flag=new) for name in names}


def _same(x: Jet) -> Jet:
    return x


def _add(
    rows: BatchRows, record: CardEntry, building: Building, grids: Grids, properties: Properties, values: Library[Roles]
) -> None:
    eid = record.integer("EID")
    pid = record.integer("PID", eid)
    properties.find(pid, record)
    roles = values.get(pid, record)
    a = grids.row(record.integer("GA"), record)
    second = record.integer("GB", 0)
    b = grids.row(second, record) if second else -1
    nominal = {k: building.values.values[at] for k, at in roles.items()}
    facts = _placement(record, grids, a, b, nominal)
    rows.add(eid, [a, b], grids.dofs(a) + grids.dofs(b), roles, facts)


def _placement(record: CardEntry, grids: Grids, a: int, b: int, stiffness: Mapping[str, float]) -> dict[str, NDArray]:
    """Element axes and the arms from the grid points to the springs."""
    xyz = grids.table.xyz
    start, end = xyz[a], xyz[b if b >= 0 else a]
    place = _location(record, grids, start, end)
    arm_b = place - end if b >= 0 else np.zeros(3)
    return {"frame": _frame(record, grids, a, end - start, stiffness), "arm_a": place - start, "arm_b": arm_b}


def _location(record: CardEntry, grids: Grids, start: Reals, end: Reals) -> Reals:
    ocid = record.integer("OCID", -1)
    if ocid >= 0:
        return grids.systems.get(ocid, record).point(np.array(record.reals("S1", "S2", "S3")))
    return start + record.real("S", 0.5) * (end - start)


def _frame(record: CardEntry, grids: Grids, a: int, line: Reals, stiffness: Mapping[str, float]) -> Reals:
    if not record.blank("CID"):
        return grids.systems.get(record.integer("CID"), record).frame(grids.table.xyz[a])
    if length(line) <= _COINCIDENT_ENDS * max(1.0, length(grids.table.xyz[a])):
        raise record.error("deck.orientation/bush", at="CID", card=record.name)
    v = _any_across(line) if _axial_only(record, stiffness) else orientation_vector(record, grids, a)
    check_line(record, line, v)
    return element_frame(line, v)


def _axial_only(record: CardEntry, stiffness: Mapping[str, float]) -> bool:
    """Whether only directions 1 and 4 act, so that the transverse axes need no orientation."""
    oriented = not all(record.blank(x) for x in ("X1", "X2", "X3"))
    return not oriented and not any(stiffness[flag + i] for flag in "KB" for i in "2356")


def _any_across(line: Reals) -> Reals:
    """A basic direction that is not along the line."""
    return np.eye(3)[int(np.argmin(np.abs(line)))]


# ----------------------------------------------------------------------------------------------------
# Gaps.


def read_gaps(reading: ElementReading) -> list[ElementBatch]:
    """Batch of CGAP: linear springs, as in the linear solutions of Nastran."""
    building, grids = reading.building, reading.grids
    properties = read_properties(building, "CGAP")
    values = Library(lambda pid, user: _gap_values(building, properties.find(pid, user), pid))
    rows, states = BatchRows(BUSH.key, "CGAP"), {True: 0, False: 0}
    for record in building.records("CGAP"):
        with building.errors.catch():
            pid = record.integer("PID", record.integer("EID"))
            roles = values.get(pid, record)
            a, b = grids.row(record.integer("GA"), record), grids.row(record.integer("GB"), record)
            line = grids.table.xyz[b] - grids.table.xyz[a]
            across = {"K2": float(building.values.values[roles["K2"]])}
            frame = _frame(record, grids, a, line, dict.fromkeys(_ACROSS, 0.0) | across)
            none = np.zeros(3)
            facts = {"frame": frame, "arm_a": none, "arm_b": none}
            rows.add(record.integer("EID"), [a, b], grids.dofs(a) + grids.dofs(b), roles, facts)
            states[properties.find(pid, record).real("U0", 0.0) <= 0.0] += 1
    if cards := building.deck.by_name("CGAP"):
        count = f"{len(cards)} CGAP {'are each' if len(cards) > 1 else 'is'}"
        where, closed = cards[0].where(), states[True]
        building.notices.append(Notice("deck.linear-gap", where=where, count=count, closed=closed, open=states[False]))
    return rows.batches()


_ACROSS = tuple(flag + i for flag in "KB" for i in "2356")


def _gap_values(building: Building, record: CardEntry, pid: int) -> Roles:
    """K1 along the gap and K2 = K3 across it in the initial state; all others are zero."""
    none = building.values.add(FieldRef("PGAP", pid, "none"), 0.0)
    roles = dict.fromkeys((*(f"K{i}" for i in range(1, 7)), *(f"GE{i}" for i in range(1, 7))), none)
    for name in ("KA", "KB", "KT"):
        if record.real(name, -1.0 if name == "KA" else 0.0) < 0.0:
            raise record.error("deck.field-value/gap-stiffness", at=name)
    if record.real("U0", 0.0) > 0.0:
        return roles | {"K1": building.value(record, pid, "KB")}
    roles["K1"] = building.value(record, pid, "KA")
    if not record.blank("KT"):
        roles["K2"] = building.value(record, pid, "KT")
    elif record.real("MU1", 0.0) != 0.0:
        # the default of Nastran
        friction = building.values.add(FieldRef("PGAP", pid, "friction"), record.real("MU1"))
        roles["K2"] = building.values.derive(FieldRef("PGAP", pid, "KT"), _times, roles["K1"], friction)
    return roles | {"K3": roles["K2"]}


def _times(a: Jet, b: Jet) -> Jet:
    return a * b
