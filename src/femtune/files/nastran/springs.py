"""Scalar springs, masses and dashpots: CELAS1 to 4, CMASS1 to 4, CDAMP1 to 4, with PELAS, PMASS and PDAMP."""

from __future__ import annotations

from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows, Building
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.properties import Properties, read_properties
from femtune.files.nastran.record import Record

_KINDS = {"spring": "CELAS", "scalar-mass": "CMASS", "dashpot": "CDAMP"}
# 1 and 3 have a property card, 2 and 4 hold their value; 3 and 4 join scalar points only
_WITH_PROPERTY = "13"


def read_scalars(building: Building, grids: Grids) -> list[ElementBatch]:
    """Batches of CELAS1 to CELAS4, CMASS1 to CMASS4 and CDAMP1 to CDAMP4."""
    found = []
    for kind, stem in _KINDS.items():
        for number in "1234":
            card = stem + number
            rows = BatchRows(kind, card)
            properties = read_properties(building, card) if number in _WITH_PROPERTY else None
            for record in building.records(card):
                with building.errors.catch():
                    _add(rows, record, building, grids, properties)
            found += rows.batches()
    return found


def _add(rows: BatchRows, record: Record, building: Building, grids: Grids, properties: Properties | None) -> None:
    eid = record.integer("EID")
    source, number = record, eid
    if properties is not None:
        number = record.integer("PID", eid)
        source = properties.find(number, record)
    roles = {name: building.value(source, number, name) for name in CATALOGUE[source.name].values}
    ends = [_end(record, end, grids) for end in "12"]
    if ends[0][1] < 0 and ends[1][1] < 0:
        raise record.error("deck.field-value", "both ends of the element are grounded",
                           hint="fill G1 and C1" if "G1" in record.names else "fill S1")  # fmt: skip
    rows.add(eid, [row for row, _ in ends], [dof for _, dof in ends], roles, {})


def _end(record: Record, end: str, grids: Grids) -> tuple[int, int]:
    """Row of the node table (−1 for ground and scalar points) and g-set DOF (−1 for ground) of an end."""
    if "G1" not in record.names:
        return -1, _scalar_point(record, "S" + end, grids)
    number = record.integer("G" + end, 0)
    if number == 0:
        return -1, -1
    component = record.component("C" + end, "0")
    grid = number in grids.records
    if len(component) != 1 or (grid and component == "0"):
        raise record.error("deck.field-value", "an end of a scalar element is one component of a grid point",
                           at="C" + end, hint="write one digit from 1 to 6 (blank for a scalar point)")  # fmt: skip
    dof = grids.dof(number, int(component), record)
    return (grids.row(number, record) if grid else -1), dof


def _scalar_point(record: Record, name: str, grids: Grids) -> int:
    number = record.integer(name, 0)
    if number in grids.records:
        raise record.error("deck.field-value", f"{record.name} joins scalar points, and {number} is a grid point",
                           at=name, hint=f"use {record.name[:-1]}1 or {record.name[:-1]}2")  # fmt: skip
    return grids.dof(number, 0, record) if number else -1
