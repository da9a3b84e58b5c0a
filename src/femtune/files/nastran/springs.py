"""Scalar springs and masses: CELAS1 with PELAS, CELAS2, CMASS1 with PMASS, CMASS2."""

from __future__ import annotations

from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows, Building
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.properties import Properties, read_properties
from femtune.files.nastran.record import Record

# kind of the batch, card with a property, card with its own value, role
_SCALAR = (("spring", "CELAS1", "CELAS2", "K"), ("scalar-mass", "CMASS1", "CMASS2", "M"))


def read_scalars(building: Building, grids: Grids) -> list[ElementBatch]:
    """Batches of CELAS1, CELAS2, CMASS1 and CMASS2."""
    found = []
    for kind, with_property, own, role in _SCALAR:
        properties = read_properties(building, with_property)
        for card in (with_property, own):
            rows = BatchRows(kind, card)
            for record in building.records(card):
                with building.errors.catch():
                    _add(rows, record, building, grids, properties if card == with_property else None, role)
            found += rows.batches()
    return found


def _add(
    rows: BatchRows, record: Record, building: Building, grids: Grids, properties: Properties | None, role: str
) -> None:  # fmt: skip
    eid = record.integer("EID")
    source, number = record, eid
    if properties is not None:
        number = record.integer("PID", eid)
        source = properties.find(number, record)
    position = building.value(source, number, role)
    ends = [_end(record, end, grids) for end in "12"]
    if ends[0][1] < 0 and ends[1][1] < 0:
        raise record.error("deck.field-value", "both ends of the element are grounded",
                           hint="fill G1 and C1")  # fmt: skip
    rows.add(eid, [row for row, _ in ends], [dof for _, dof in ends], {role: position}, {})


def _end(record: Record, end: str, grids: Grids) -> tuple[int, int]:
    """Row of the node table (−1 for ground and scalar points) and g-set DOF (−1 for ground) of an end."""
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
