"""Rods: CROD with PROD, CONROD."""

from __future__ import annotations

from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows, Building, Library
from femtune.files.nastran.coordinates import length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Materials, Roles
from femtune.files.nastran.properties import Properties, read_properties
from femtune.files.nastran.record import Record


def read_rods(building: Building, grids: Grids, materials: Materials) -> list[ElementBatch]:
    """Batches of CROD and of CONROD."""
    properties = read_properties(building, "CROD")
    sections = Library(lambda pid, user: _section(building, properties.find(pid, user), pid, materials))
    rods, own = BatchRows("rod", "CROD"), BatchRows("rod", "CONROD")
    for record in building.records("CROD"):
        with building.errors.catch():
            _add(rods, record, _property(record, properties, sections), grids)
    for record in building.records("CONROD"):
        with building.errors.catch():
            _add(own, record, _section(building, record, record.integer("EID"), materials), grids)
    return rods.batches() + own.batches()


def _property(record: Record, properties: Properties, sections: Library[Roles]) -> Roles:
    pid = record.integer("PID", record.integer("EID"))
    properties.find(pid, record)
    return sections.get(pid, record)


def _section(building: Building, record: Record, number: int, materials: Materials) -> Roles:
    material = materials.get(record.integer("MID"), record)
    return {**material, **{name: building.value(record, number, name) for name in ("A", "J", "NSM")}}


def _add(rows: BatchRows, record: Record, roles: Roles, grids: Grids) -> None:
    a, b = grids.row(record.integer("G1"), record), grids.row(record.integer("G2"), record)
    if length(grids.table.xyz[b] - grids.table.xyz[a]) == 0.0:
        raise record.error("deck.zero-length", "the two ends of the element are at the same point",
                           hint="correct the grid points")  # fmt: skip
    rows.add(record.integer("EID"), [a, b], grids.dofs(a) + grids.dofs(b), roles, {})
