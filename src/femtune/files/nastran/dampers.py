"""Dampers along a line: CVISC with PVISC, and the spring-damper CBUSH1D with PBUSH1D."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows, Building, Library
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.coordinates import length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Roles
from femtune.files.nastran.properties import Properties, read_properties
from femtune.files.nastran.record import Record

_KINDS = {"CVISC": "line-dashpot", "CBUSH1D": "line-spring"}


def read_dampers(building: Building, grids: Grids) -> list[ElementBatch]:
    """Batches of CVISC and of CBUSH1D."""
    found = []
    for card, kind in _KINDS.items():
        properties = read_properties(building, card)
        values = _library(building, properties)
        rows = BatchRows(kind, card)
        for record in building.records(card):
            with building.errors.catch():
                _add(rows, record, grids, properties, values)
        found += rows.batches()
    return found


def _library(building: Building, properties: Properties) -> Library[Roles]:
    return Library(lambda pid, user: _roles(building, properties.find(pid, user), pid))


def _roles(building: Building, record: Record, pid: int) -> Roles:
    if record.name == "PBUSH1D":
        _check_linear(building, record)
    return {name: building.value(record, pid, name) for name in CATALOGUE[record.name].values}


def _check_linear(building: Building, record: Record) -> None:
    """Mass is an error; springs and dampers that are not linear are left out with a notice."""
    if record.real("M", 0.0):
        raise record.error("deck.section", "mass of a PBUSH1D is not modelled", at="M",
                           hint="give the mass by CONM2 cards at the two points")  # fmt: skip
    if len(record.card.fields) > 8:
        what = f"only K and C of PBUSH1D {record.card.text(0)} count; its laws on further lines are left out"
        building.notices.append(Notice("deck.nonlinear-damper", what, record.where))


def _add(
    rows: BatchRows, record: Record, grids: Grids, properties: Properties, values: Library[Roles]
) -> None:  # fmt: skip
    eid = record.integer("EID")
    pid = record.integer("PID", eid)
    properties.find(pid, record)
    roles = values.get(pid, record)
    first, second = ("G1", "G2") if record.name == "CVISC" else ("GA", "GB")
    a = grids.row(record.integer(first), record)
    other = record.integer(second, ... if record.name == "CVISC" else 0)
    b = grids.row(other, record) if other else -1
    rows.add(eid, [a, b], grids.dofs(a) + grids.dofs(b), roles, {"axis": _axis(record, grids, a, b)})


def _axis(record: Record, grids: Grids, a: int, b: int) -> NDArray[np.float64]:
    """Unit vector from end to end, or the x-axis of the system that a CBUSH1D names."""
    if record.name == "CBUSH1D" and not record.blank("CID"):
        return grids.systems.get(record.integer("CID"), record).frame(grids.table.xyz[a])[:, 0]
    if b < 0:
        raise record.error("deck.orientation", "a CBUSH1D to ground needs its axis", at="CID",
                           hint="give the coordinate system whose x-axis it follows in CID (0 for basic)")  # fmt: skip
    line = grids.table.xyz[b] - grids.table.xyz[a]
    if length(line) == 0.0:
        raise record.error("deck.zero-length", "the two ends of the element are at the same point",
                           hint="correct the grid points, or use CDAMP2 or CBUSH there")  # fmt: skip
    return np.asarray(line / length(line))
