"""Scalar springs, masses and dashpots: CELAS1 to 4, CMASS1 to 4, CDAMP1 to 4, with PELAS, PMASS and PDAMP."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.fem.elements.discrete import DASHPOT, LINE_DASHPOT, LINE_SPRING, SCALAR_MASS, SPRING
from femtune.fem.elements.rod import ROD
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows, Building, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.coordinates import length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Materials, Properties, Roles, read_properties
from femtune.files.nastran.reading import ElementReading
from femtune.parameters.jet import Jet

_KINDS = {SPRING.key: "CELAS", SCALAR_MASS.key: "CMASS", DASHPOT.key: "CDAMP"}
# 1 and 3 have a property card, 2 and 4 contain the value; 3 and 4 connect scalar points only
_WITH_PROPERTY = "13"


def read_scalars(reading: ElementReading) -> list[ElementBatch]:
    """Batches of CELAS1 to CELAS4, CMASS1 to CMASS4 and CDAMP1 to CDAMP4."""
    building, grids = reading.building, reading.grids
    batches = []
    for kind, stem in _KINDS.items():
        for number in "1234":
            card = stem + number
            rows = BatchRows(kind, card)
            properties = read_properties(building, card) if number in _WITH_PROPERTY else None
            for record in building.records(card):
                with building.errors.catch():
                    _add(rows, record, building, grids, properties)
            batches += rows.batches()
    return batches


def _add(rows: BatchRows, record: CardEntry, building: Building, grids: Grids, properties: Properties | None) -> None:
    eid = record.integer("EID")
    source, number = record, eid
    if properties is not None:
        number = record.integer("PID", eid)
        source = properties.find(number, record)
    roles = {name: building.value(source, number, name) for name in CATALOGUE[source.name].values}
    ends = [_end(record, end, grids) for end in "12"]
    if ends[0][1] < 0 and ends[1][1] < 0:
        raise record.error(
            "deck.field-value/both-grounded", hint="fill in G1 and C1" if "G1" in record.names else "fill in S1"
        )
    rows.add(eid, [row for row, _ in ends], [dof for _, dof in ends], roles, {})


def _end(record: CardEntry, end: str, grids: Grids) -> tuple[int, int]:
    """Row of the node table (−1 for ground and scalar points) and g-set DOF (−1 for ground) of an end."""
    if "G1" not in record.names:
        return -1, _scalar_point(record, "S" + end, grids)
    number = record.integer("G" + end, 0)
    if number == 0:
        return -1, -1
    component = record.component("C" + end, "0")
    grid = number in grids.records
    if len(component) != 1 or (grid and component == "0"):
        raise record.error("deck.field-value/scalar-end", at="C" + end)
    dof = grids.dof(number, int(component), record)
    return (grids.row(number, record) if grid else -1), dof


def _scalar_point(record: CardEntry, name: str, grids: Grids) -> int:
    number = record.integer(name, 0)
    if number in grids.records:
        raise record.error(
            "deck.field-value/not-a-scalar-point",
            at=name,
            record_name=record.name,
            number=number,
            general_name=record.name[:-1],
        )
    return grids.dof(number, 0, record) if number else -1


# ----------------------------------------------------------------------------------------------------
# Dampers along a line: CVISC with PVISC, and the spring-damper CBUSH1D with PBUSH1D.


_DAMPER_KINDS = {"CVISC": LINE_DASHPOT.key, "CBUSH1D": LINE_SPRING.key}


def read_dampers(reading: ElementReading) -> list[ElementBatch]:
    """Batches of CVISC and of CBUSH1D."""
    building, grids = reading.building, reading.grids
    batches = []
    for card, kind in _DAMPER_KINDS.items():
        properties = read_properties(building, card)
        values = _library(building, properties)
        rows = BatchRows(kind, card)
        for record in building.records(card):
            with building.errors.catch():
                _add_damper(rows, record, grids, properties, values)
        batches += rows.batches()
    return batches


def _library(building: Building, properties: Properties) -> Library[Roles]:
    return Library(lambda pid, user: _roles(building, properties.find(pid, user), pid))


def _roles(building: Building, record: CardEntry, pid: int) -> Roles:
    if record.name == "PBUSH1D":
        _check_linear(building, record)
    return {name: building.value(record, pid, name) for name in CATALOGUE[record.name].values}


def _check_linear(building: Building, record: CardEntry) -> None:
    """Raise an error for mass; nonlinear springs and dampers are ignored with a notice."""
    if record.real("M", 0.0):
        raise record.error("deck.section/bush-one-dimensional-mass", at="M")
    if len(record.card.fields) > 8:
        building.notices.append(Notice("deck.nonlinear-damper", where=record.where, number=record.card.text(0)))


def _add_damper(
    rows: BatchRows, record: CardEntry, grids: Grids, properties: Properties, values: Library[Roles]
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


def _axis(record: CardEntry, grids: Grids, a: int, b: int) -> NDArray[np.float64]:
    """Unit vector from end to end, or the x-axis of the system that a CBUSH1D names."""
    if record.name == "CBUSH1D" and not record.blank("CID"):
        return grids.systems.get(record.integer("CID"), record).frame(grids.table.xyz[a])[:, 0]
    if b < 0:
        raise record.error("deck.orientation/bush-one-dimensional", at="CID")
    line = grids.table.xyz[b] - grids.table.xyz[a]
    if length(line) == 0.0:
        raise record.error("deck.zero-length/damper")
    return np.asarray(line / length(line))


# ----------------------------------------------------------------------------------------------------
# Rods: CROD with PROD, CONROD, CTUBE with PTUBE.


def read_rods(reading: ElementReading) -> list[ElementBatch]:
    """Batches of CROD, of CONROD and of CTUBE."""
    building, grids, materials = reading.building, reading.grids, reading.materials
    properties = read_properties(building, "CROD")
    sections = Library(lambda pid, user: _section(building, properties.find(pid, user), pid, materials))
    rods, conrods = BatchRows(ROD.key, "CROD"), BatchRows(ROD.key, "CONROD")
    for record in building.records("CROD"):
        with building.errors.catch():
            _add_rod(rods, record, _property(record, properties, sections), grids)
    for record in building.records("CONROD"):
        with building.errors.catch():
            _add_rod(conrods, record, _section(building, record, record.integer("EID"), materials), grids)
    return rods.batches() + conrods.batches() + _read_tubes(building, grids, materials)


def _property(record: CardEntry, properties: Properties, sections: Library[Roles]) -> Roles:
    pid = record.integer("PID", record.integer("EID"))
    properties.find(pid, record)
    return sections.get(pid, record)


def _section(building: Building, record: CardEntry, number: int, materials: Materials) -> Roles:
    material = materials.get(record.integer("MID"), record)
    return {**material, **{name: building.value(record, number, name) for name in ("A", "J", "NSM")}}


def _add_rod(rows: BatchRows, record: CardEntry, roles: Roles, grids: Grids) -> None:
    a, b = grids.row(record.integer("G1"), record), grids.row(record.integer("G2"), record)
    if length(grids.table.xyz[b] - grids.table.xyz[a]) == 0.0:
        raise record.error("deck.zero-length/rod")
    rows.add(record.integer("EID"), [a, b], grids.dofs(a) + grids.dofs(b), roles, {})


def _read_tubes(building: Building, grids: Grids, materials: Materials) -> list[ElementBatch]:
    properties = read_properties(building, "CTUBE")
    sections = Library(lambda pid, user: _tube(building, properties.find(pid, user), pid, materials))
    tubes = BatchRows(ROD.key, "CTUBE")
    for record in building.records("CTUBE"):
        with building.errors.catch():
            _add_rod(tubes, record, _property(record, properties, sections), grids)
    return tubes.batches()


def _tube(building: Building, record: CardEntry, pid: int, materials: Materials) -> Roles:
    """Roles of a tube; a wall thickness of 0 means a solid bar, and different ends are an error, as in Nastran."""
    material = materials.get(record.integer("MID"), record)
    outer, wall = record.real("OD"), record.real("T", 0.0)
    if record.real("OD2", outer) not in (0.0, outer):
        raise record.error("deck.section/tapered-tube", at="OD2")
    if outer <= 0.0 or not 0.0 <= wall <= 0.5 * outer:
        raise record.error("deck.section/tube", at="T" if outer > 0.0 else "OD")
    sizes = [building.value(record, pid, name) for name in (("OD", "T") if wall else ("OD",))]
    rules: tuple[Callable[..., Jet], ...] = (tube_area, tube_torsion) if wall else (disc_area, disc_torsion)
    section = {
        role: building.values.derive(FieldRef("PTUBE", pid, role), rule, *sizes) for role, rule in zip("AJ", rules)
    }
    return {**material, **section, "NSM": building.value(record, pid, "NSM")}


def tube_area(outer: Jet, wall: Jet) -> Jet:
    """π(D − t)t of a tube of diameter D with wall thickness t."""
    return math.pi * (outer - wall) * wall


def tube_torsion(outer: Jet, wall: Jet) -> Jet:
    """Torsion constant A(D² − 2Dt + 2t²)/4, which is π(D⁴ − d⁴)/32 with the inner diameter d."""
    return 0.25 * tube_area(outer, wall) * (outer * outer - 2.0 * outer * wall + 2.0 * wall * wall)


def disc_area(outer: Jet) -> Jet:
    """πD²/4."""
    return 0.25 * math.pi * outer * outer


def disc_torsion(outer: Jet) -> Jet:
    """Torsion constant πD⁴/32."""
    return math.pi / 32.0 * (outer * outer * outer * outer)
