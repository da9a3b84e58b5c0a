"""Bushes: CBUSH with PBUSH, its own frame and the arms to its location."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.fem.structure import ElementBatch
from femtune.fem.values import FieldRef
from femtune.files.nastran.bars import check_line, element_frame, orientation_vector
from femtune.files.nastran.building import BatchRows, Building, Library
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.coordinates import length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Roles
from femtune.files.nastran.properties import Properties, read_properties
from femtune.files.nastran.record import Record

Reals = NDArray[np.float64]

_STIFFNESSES = ("K1", "K2", "K3", "K4", "K5", "K6")
_FLAGS = ("K", "B", "GE", "RCV", "M", "T", "D")
_COINCIDENT = 1e-10


def read_bushes(building: Building, grids: Grids) -> list[ElementBatch]:
    """Batch of CBUSH."""
    properties = read_properties(building, "CBUSH")
    values = Library(lambda pid, user: _stiffnesses(building, properties.find(pid, user), pid))
    rows = BatchRows("bush", "CBUSH")
    for record in building.records("CBUSH"):
        with building.errors.catch():
            _add(rows, record, building, grids, properties, values)
    return rows.batches()


def _stiffnesses(building: Building, record: Record, pid: int) -> Roles:
    """K1 to K6 stand after the flag K, on whichever line of the card it is."""
    card = record.card
    flags = {card.text(at): at for at in range(1, max(len(card.fields), 2), 8)}
    wrong = [flag for flag in flags if flag and flag not in _FLAGS]
    if wrong:
        raise card.error("deck.field-value", f"flag '{wrong[0]}' of PBUSH is not known", index=flags[wrong[0]],
                         hint=f"known: {' '.join(_FLAGS)}")  # fmt: skip
    if "M" in flags and any(card.real(flags["M"] + i, 0.0) for i in range(1, 7)):
        raise card.error("deck.section", "mass of a PBUSH (flag M) is not modelled", index=flags["M"],
                         hint="give the mass by a CONM2")  # fmt: skip
    own = Record(card, CATALOGUE["PBUSH"].fields, flags.get("K", 1) - 1)
    if "K" not in flags:
        # a card of damping only has no place for stiffnesses
        return {k: building.values.add(FieldRef("PBUSH", pid, k), 0.0) for k in _STIFFNESSES}
    return {k: building.value(own, pid, k) for k in _STIFFNESSES}


def _add(
    rows: BatchRows, record: Record, building: Building, grids: Grids, properties: Properties, values: Library[Roles]
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


def _placement(record: Record, grids: Grids, a: int, b: int, stiffness: Mapping[str, float]) -> dict[str, NDArray]:
    """Element axes and the arms from the grid points to the springs."""
    xyz = grids.table.xyz
    start, end = xyz[a], xyz[b if b >= 0 else a]
    place = _location(record, grids, start, end)
    arm_b = place - end if b >= 0 else np.zeros(3)
    return {"frame": _frame(record, grids, a, end - start, stiffness), "arm_a": place - start, "arm_b": arm_b}


def _location(record: Record, grids: Grids, start: Reals, end: Reals) -> Reals:
    ocid = record.integer("OCID", -1)
    if ocid >= 0:
        return grids.systems.get(ocid, record).point(np.array(record.reals("S1", "S2", "S3")))
    return start + record.real("S", 0.5) * (end - start)


def _frame(record: Record, grids: Grids, a: int, line: Reals, stiffness: Mapping[str, float]) -> Reals:
    if not record.blank("CID"):
        return grids.systems.get(record.integer("CID"), record).frame(grids.table.xyz[a])
    if length(line) <= _COINCIDENT * max(1.0, length(grids.table.xyz[a])):
        raise record.error("deck.orientation", "a CBUSH between coincident points or to ground needs its axes",
                           at="CID", hint="give the coordinate system of its axes in CID (0 for basic)")  # fmt: skip
    v = _any_across(line) if _axial_only(record, stiffness) else orientation_vector(record, grids, a)
    check_line(record, line, v)
    return element_frame(line, v)


def _axial_only(record: Record, stiffness: Mapping[str, float]) -> bool:
    """Without orientation the axes across the line do not matter where only K1 and K4 act."""
    oriented = not all(record.blank(x) for x in ("X1", "X2", "X3"))
    return not oriented and not any(stiffness[k] for k in ("K2", "K3", "K5", "K6"))


def _any_across(line: Reals) -> Reals:
    """A basic direction that is not along the line."""
    return np.eye(3)[int(np.argmin(np.abs(line)))]
