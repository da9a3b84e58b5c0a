"""Curved bars: CBEND with PBEND."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.elements.curved_bar import CURVED_BAR
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.bars import orientation_vector
from femtune.files.nastran.building import BatchRows, Building, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.coordinates import cross, length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Materials, Roles, read_properties
from femtune.files.nastran.reading import ElementReading

# Tolerances of the geometry of an arc: rounding of coordinates and of RB or THETAB with seven digits
_LEAST_ORIENTATION_SINE = 1e-6
"""Sine of the angle between the chord and the orientation vector up to which the plane of the arc is undefined."""
_LEAST_CENTRE_COSINE = 1e-9
"""Cosine of the angle between the chord and the line to the centre up to which the radius is infinite (GEOM = 1)."""
_CLOSURE_ERROR = 1e-6
"""Largest distance of the end of the arc from grid point B, relative to the radius."""


def read_bends(reading: ElementReading) -> list[ElementBatch]:
    """Batch of CBEND."""
    building, grids, materials = reading.building, reading.grids, reading.materials
    properties = read_properties(building, "CBEND")
    sections = Library(lambda pid, user: _section(building, properties.find(pid, user), pid, materials))
    rows = BatchRows(CURVED_BAR.key, "CBEND")
    for record in building.records("CBEND"):
        with building.errors.catch():
            pid = record.integer("PID", record.integer("EID"))
            property_card = properties.find(pid, record)
            roles = sections.get(pid, record)
            a, b = grids.row(record.integer("GA"), record), grids.row(record.integer("GB"), record)
            facts = _arc(record, property_card, grids, a, b)
            rows.add(record.integer("EID"), [a, b], grids.dofs(a) + grids.dofs(b), roles, facts)
    return rows.batches()


def _section(building: Building, record: CardEntry, pid: int, materials: Materials) -> Roles:
    """Roles of a PBEND in its first form; pipes with a flexibility factor and eccentric arcs are errors."""
    if record.has_integer("A"):
        raise record.error("deck.section/pipe-bend", at="A")
    for name in ("RC", "ZC", "DELTAN"):
        if record.real(name, 0.0) != 0.0:
            raise record.error("deck.section/eccentric-bend", at=name, field=name)
    for name in ("A", "I1", "I2", "J"):
        if record.real(name, 0.0) <= 0.0:
            raise record.error("deck.section/bend", at=name)
    material = materials.get(record.integer("MID"), record)
    if building.values.values[material["G"]] <= 0.0:
        raise record.error("deck.section/bend", at="MID")
    names = ("A", "I1", "I2", "J", "NSM", "K1", "K2")
    return {**material, **{name: building.value(record, pid, name) for name in names}}


def _arc(record: CardEntry, section: CardEntry, grids: Grids, a: int, b: int) -> dict[str, NDArray]:
    """Axes at end A, radius and angle of the arc, by the rule that GEOM selects."""
    start, end = grids.table.xyz[a], grids.table.xyz[b]
    chord, v = end - start, orientation_vector(record, grids, a)
    size = length(chord)
    if size == 0.0:
        raise record.error("deck.orientation/bend-length", at="GB")
    if length(cross(chord, v)) <= _LEAST_ORIENTATION_SINE * size * length(v):
        raise record.error("deck.orientation/bend", at="X1")
    v = v / length(v)
    radius, angle, centre = _circle(record, section, start, chord, v)
    normal = cross(chord, v) / length(cross(chord, v))
    outward = (start - centre) / radius
    for axis in (normal, -normal):
        along = cross(axis, outward)
        if (
            length(radius * (np.cos(angle) * outward + np.sin(angle) * along) - (end - centre))
            <= _CLOSURE_ERROR * radius
        ):
            axes = np.column_stack([outward, along, axis])
            return {"axes": axes, "radius": np.array(radius), "angle": np.array(angle)}
    raise record.error("deck.orientation/bend", at="GEOM")


def _circle(record: CardEntry, section: CardEntry, start: Reals, chord: Reals, v: Reals) -> tuple[float, float, Reals]:
    """Radius, angle and centre of the arc."""
    size, rule = length(chord), record.integer("GEOM")
    across = v - (v @ chord) / size**2 * chord
    across = across / length(across)
    if rule == 1:
        # the centre lies on the line from A along v
        along = float(chord @ v)
        reach = size**2 / (2.0 * along) if abs(along) > _LEAST_CENTRE_COSINE * size else np.inf
        radius = abs(reach)
        _check_radius(record, radius, size, "GEOM")
        return radius, 2.0 * float(np.arcsin(size / (2.0 * radius))), start + reach * v
    if rule == 2:
        # v is the tangent at A
        toward = chord - (chord @ v) * v
        toward = toward / length(toward)
        radius = size**2 / (2.0 * float(chord @ toward))
        return radius, 2.0 * float(np.arctan2(chord @ toward, chord @ v)), start + radius * toward
    if rule == 3:
        radius = section.real("RB")
        _check_radius(section, radius, size, "RB")
        half = float(np.arcsin(size / (2.0 * radius)))
    elif rule == 4:
        half = 0.5 * float(np.radians(section.real("THETAB")))
        if not 0.0 < half < np.pi:
            raise section.error("deck.section/bend", at="THETAB")
        radius = size / (2.0 * np.sin(half))
    else:
        raise record.error("deck.orientation/bend", at="GEOM")
    # the centre and v are on opposite sides of the chord
    return radius, 2.0 * half, start + 0.5 * chord - radius * np.cos(half) * across


def _check_radius(record: CardEntry, radius: float, chord: float, at: str) -> None:
    if not np.isfinite(radius):
        raise record.error("deck.orientation/bend", at=at)
    if radius < 0.5 * chord * (1.0 - 1e-9):
        raise record.error("deck.orientation/bend-radius", at=at, radius=radius, least=0.5 * chord)
