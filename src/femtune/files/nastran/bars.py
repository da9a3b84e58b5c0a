"""Bars and beams: CBAR and CBEAM with BAROR and BEAMOR, orientation, offsets and pin flags."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.elements.bar import BAR
from femtune.fem.elements.tapered_beam import TAPERED_BEAM
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.beam_sections import BeamSection, read_pbarl, read_pbeam, read_pbeaml
from femtune.files.nastran.building import BatchRows, Building, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.composite_beams import read_pbcomp
from femtune.files.nastran.coordinates import cross, length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Materials, Properties, read_properties
from femtune.files.nastran.reading import ElementReading

# ----------------------------------------------------------------------------------------------------
# Sections of bars and beams by property number: PBAR, PBARL, PBEAM, PBEAML, PBCOMP, with their material.


@dataclass
class BarProperties:
    """Sections with the material's E G rho GE, by property number."""

    building: Building
    properties: Properties
    materials: Materials
    _library: Library[BeamSection] = field(init=False)

    def __post_init__(self) -> None:
        self._library = Library(self._make)

    def get(self, pid: int, user: CardEntry) -> BeamSection:
        """The section of a property that an element refers to."""
        self.properties.find(pid, user)
        return self._library.get(pid, user)

    def _make(self, pid: int, user: CardEntry) -> BeamSection:
        record = self.properties.find(pid, user)
        material = self.materials.get(record.integer("MID"), record)
        section = self._section(record, pid, material)
        if self.building.values.values[material["G"]] == 0.0:
            _check_constant(record, section)
            # without a shear modulus the bar is shear-rigid
            none = self.building.values.add(FieldRef(record.name, pid, "no shear flexibility"), 0.0)
            stiff = {name: none for name in section.roles if name[:2] in ("K1", "K2")}
            section = replace(section, roles={**section.roles, **stiff})
        return replace(section, roles={**material, **section.roles})

    def _section(self, record: CardEntry, pid: int, material: Mapping[str, int]) -> BeamSection:
        if record.name == "PBCOMP":
            return read_pbcomp(self.building, record, pid, material, self.materials)
        return _READERS[record.name](self.building, record, pid)


def _check_constant(record: CardEntry, section: BeamSection) -> None:
    """Beams that change along their length, or whose axes lie beside each other, are made by their flexibility."""
    if section.stations:
        raise record.error("deck.section/shear-modulus", at="MID", card=record.name)


def read_pbar(b: Building, record: CardEntry, pid: int) -> BeamSection:
    """A constant section of a bar."""
    return BeamSection({n: b.value(record, pid, n) for n in ("A", "I1", "I2", "I12", "J", "K1", "K2", "NSM")})


_READERS = {"PBAR": read_pbar, "PBARL": read_pbarl, "PBEAM": read_pbeam, "PBEAML": read_pbeaml}
assert set(_READERS) <= set(CATALOGUE)


_DEFAULTS = {"CBAR": "BAROR", "CBEAM": "BEAMOR"}
_LEAST_ORIENTATION_SINE = 1e-8
"""Sine of the angle between a bar and its orientation vector up to which plane 1 is undefined: half of the digits."""


def read_bars(reading: ElementReading) -> list[ElementBatch]:
    """Batches of CBAR and of CBEAM."""
    building, grids, materials = reading.building, reading.grids, reading.materials
    batches = []
    for card, defaults in _DEFAULTS.items():
        properties = BarProperties(building, read_properties(building, card), materials)
        rows: dict[int, BatchRows] = {}
        for record in building.records(card, defaults=building.defaults(defaults)):
            with building.errors.catch():
                _add(rows, record, grids, properties)
        batches += [batch for count in sorted(rows) for batch in rows[count].batches()]
    return batches


def _add(rows: dict[int, BatchRows], record: CardEntry, grids: Grids, properties: BarProperties) -> None:
    """Add an element to the batch of its number of stations (0 for a constant section)."""
    eid = record.integer("EID")
    section = properties.get(record.integer("PID", eid), record)
    a, b = grids.row(record.integer("GA"), record), grids.row(record.integer("GB"), record)
    _check_no_warping(record, properties)
    facts = _placement(record, grids, a, b)
    facts["pins"] = np.concatenate([_pins(record, "PA"), _pins(record, "PB")])
    if section.stations:
        facts["stations"] = np.array(section.stations)
    kind = (TAPERED_BEAM if section.stations else BAR).key
    batch = rows.setdefault(len(section.stations), BatchRows(kind, record.name))
    batch.add(eid, [a, b], grids.dofs(a) + grids.dofs(b), section.roles, facts)


def _pins(record: CardEntry, name: str) -> NDArray[np.bool_]:
    flags = record.component(name)
    return np.array([str(i + 1) in flags for i in range(6)])


def _placement(record: CardEntry, grids: Grids, a: int, b: int) -> dict[str, NDArray]:
    """Orientation vector and offsets in the basic frame."""
    kinds = _offset_kinds(record)
    v = orientation_vector(record, grids, a, basic=kinds[0] == "B")
    line = grids.table.xyz[b] - grids.table.xyz[a]
    ends = (("A", a, kinds[1]), ("B", b, kinds[2]))
    offsets = [_offset(record, grids, end, row, kind, line, v) for end, row, kind in ends]
    check_line(record, line + offsets[1] - offsets[0], v)
    of_line = np.array([kind == "O" for kind in kinds[1:]])
    return {"orientation": v, "offset_a": offsets[0], "offset_b": offsets[1], "offset_of_line": of_line}


def _offset_kinds(record: CardEntry) -> str:
    """OFFT: orientation in the displacement frame (G) or basic (B), offsets in it (G) or in the line's frame (O)."""
    kinds: str = record.text("OFFT", "GGG")
    # decks of old programs have a flag there: 1 for a vector, 2 for a grid point
    kinds = "GGG" if kinds in ("1", "2") else kinds
    if len(kinds) != 3 or kinds[0] not in "GB" or set(kinds[1:]) - set("GO"):
        raise record.error("deck.offset-frame", at="OFFT", letters=kinds, record_name=record.name)
    return kinds


def _check_no_warping(record: CardEntry, properties: BarProperties) -> None:
    """Refuse scalar points for warping if the section has a warping constant; without one they have no stiffness."""
    if record.name != "CBEAM" or not (record.integer("SA", 0) or record.integer("SB", 0)):
        return
    section = properties.properties.find(record.integer("PID", record.integer("EID")), record)
    warps = any(n.code == "deck.no-warping" and n.where == section.where for n in properties.building.notices)
    if section.name != "PBEAM" or warps:
        raise record.error("deck.section/warping-points", at="SA")


def orientation_vector(record: CardEntry, grids: Grids, a: int, basic: bool = False) -> Reals:
    """Vector v from X1 X2 X3, or from end A to the grid point G0, in the basic frame.

    Raises
    ------
    FemtuneError : ``deck.orientation`` if neither is given
    """
    if _names_point(record):
        return grids.location(record.integer("X1"), record) - grids.table.xyz[a]
    x = record.reals("X1", "X2", "X3")
    if not any(x):
        raise record.error("deck.orientation", at="X1")
    return np.array(x) if basic else grids.vector(a, x)


def _names_point(record: CardEntry) -> bool:
    """Whether X1 is a grid point G0; X2 and X3 of a BAROR or BEAMOR are ignored if the card has G0."""
    filled = not record.card.blank(record.at("X1"))
    given = replace(record, defaults=None) if filled or record.defaults is None else record.defaults
    return given.has_integer("X1") and given.blank("X2") and given.blank("X3")


def _offset(record: CardEntry, grids: Grids, end: str, row: int, kind: str, line: Reals, v: Reals) -> Reals:
    names = (f"W1{end}", f"W2{end}", f"W3{end}")
    if len(record.card.fields) <= record.at(names[0]):
        return np.zeros(3)
    w = record.reals(*names)
    if not any(w):
        return np.zeros(3)
    if kind == "G":
        return grids.vector(row, w)
    check_line(record, line, v)
    return element_frame(line, v) @ np.array(w)


def element_frame(line: Reals, v: Reals) -> Reals:
    """(3, 3) axes as columns: x along the line, y in the plane of the line and v, z = x × y."""
    x = line / length(line)
    z = cross(x, v)
    z = z / length(z)
    return np.column_stack([x, cross(z, x), z])


def check_line(record: CardEntry, line: Reals, v: Reals) -> None:
    """Raise ``deck.zero-length`` or ``deck.orientation`` for an element's axis and orientation vector."""
    size = length(line)
    if size == 0.0:
        raise record.error("deck.zero-length")
    if length(cross(line, v)) <= _LEAST_ORIENTATION_SINE * size * length(v):
        raise record.error("deck.orientation/parallel")
