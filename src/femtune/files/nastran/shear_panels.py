"""Shear panels: CSHEAR with PSHEAR."""

from __future__ import annotations

from femtune.fem.elements.shear_panel import SHEAR_PANEL
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows, Building, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Materials, Properties, Roles, read_properties
from femtune.files.nastran.reading import ElementReading

_CORNERS = ("G1", "G2", "G3", "G4")


def read_shear_panels(reading: ElementReading) -> list[ElementBatch]:
    """The batch of CSHEAR."""
    building, grids, materials = reading.building, reading.grids, reading.materials
    properties = read_properties(building, "CSHEAR")
    sections = Library(lambda pid, user: _section(building, properties.find(pid, user), pid, materials))
    rows = BatchRows(SHEAR_PANEL.key, "CSHEAR")
    for record in building.records("CSHEAR"):
        with building.errors.catch():
            rows.add(record.integer("EID"), *_nodes(record, grids), _roles(record, properties, sections), {})
    return rows.batches()


def _roles(record: CardEntry, properties: Properties, sections: Library[Roles]) -> Roles:
    pid = record.integer("PID", record.integer("EID"))
    properties.find(pid, record)
    return sections.get(pid, record)


def _section(building: Building, record: CardEntry, pid: int, materials: Materials) -> Roles:
    material = materials.get(record.integer("MID"), record)
    if building.values.values[material["G"]] == 0.0:
        raise record.error("deck.shell-section", at="MID")
    if record.real("T") <= 0.0:
        raise record.error("deck.shell-section/shear-panel-thickness", at="T")
    for name in ("F1", "F2"):
        if record.real(name, 0.0) < 0.0:
            raise record.error("deck.shell-section/shear-panel-effectiveness", at=name, name=name)
    values = {role: building.value(record, pid, name) for role, name in _VALUES.items()}
    return {**material, **values}


_VALUES = {"t": "T", "NSM": "NSM", "F1": "F1", "F2": "F2"}


def _nodes(record: CardEntry, grids: Grids) -> tuple[list[int], list[int]]:
    """Rows of the corners in the node table, and their translations."""
    numbers = [record.integer(name) for name in _CORNERS]
    for i, number in enumerate(numbers):
        if number in numbers[:i]:
            raise record.error("deck.shell-corners", at=_CORNERS[i], number=number)
    rows = [grids.row(number, record) for number in numbers]
    return rows, [dof for row in rows for dof in grids.dofs(row)[:3]]
