"""Bars and beams: CBAR and CBEAM with BAROR and BEAMOR, orientation, offsets and pin flags."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.fem.structure import ElementBatch
from femtune.files.nastran.bar_properties import BarProperties
from femtune.files.nastran.building import BatchRows, Building
from femtune.files.nastran.coordinates import cross, length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Materials
from femtune.files.nastran.properties import read_properties
from femtune.files.nastran.record import Record

Reals = NDArray[np.float64]

_DEFAULTS = {"CBAR": "BAROR", "CBEAM": "BEAMOR"}
_PARALLEL = 1e-8


def read_bars(building: Building, grids: Grids, materials: Materials) -> list[ElementBatch]:
    """Batches of CBAR and of CBEAM."""
    found = []
    for card, defaults in _DEFAULTS.items():
        properties = BarProperties(building, read_properties(building, card), materials)
        rows: dict[int, BatchRows] = {}
        for record in building.records(card, defaults=building.defaults(defaults)):
            with building.errors.catch():
                _add(rows, record, grids, properties)
        found += [batch for count in sorted(rows) for batch in rows[count].batches()]
    return found


def _add(rows: dict[int, BatchRows], record: Record, grids: Grids, properties: BarProperties) -> None:
    """One element more, in the batch of its number of stations (0: a constant section)."""
    eid = record.integer("EID")
    section = properties.get(record.integer("PID", eid), record)
    a, b = grids.row(record.integer("GA"), record), grids.row(record.integer("GB"), record)
    facts = _placement(record, grids, a, b)
    facts["pins"] = np.concatenate([_pins(record, "PA"), _pins(record, "PB")])
    if section.stations:
        facts["stations"] = np.array(section.stations)
    kind = "tapered-beam" if section.stations else "bar"
    batch = rows.setdefault(len(section.stations), BatchRows(kind, record.name))
    batch.add(eid, [a, b], grids.dofs(a) + grids.dofs(b), section.roles, facts)


def _pins(record: Record, name: str) -> NDArray[np.bool_]:
    flags = record.component(name)
    return np.array([str(i + 1) in flags for i in range(6)])


def _placement(record: Record, grids: Grids, a: int, b: int) -> dict[str, NDArray]:
    """Orientation vector and offsets in the basic frame."""
    kinds = _offset_kinds(record)
    _check_no_warping(record)
    v = orientation_vector(record, grids, a, basic=kinds[0] == "B")
    line = grids.table.xyz[b] - grids.table.xyz[a]
    ends = (("A", a, kinds[1]), ("B", b, kinds[2]))
    offsets = [_offset(record, grids, end, row, kind, line, v) for end, row, kind in ends]
    check_line(record, line + offsets[1] - offsets[0], v)
    of_line = np.array([kind == "O" for kind in kinds[1:]])
    return {"orientation": v, "offset_a": offsets[0], "offset_b": offsets[1], "offset_of_line": of_line}


def _offset_kinds(record: Record) -> str:
    """OFFT: orientation in the displacement frame (G) or basic (B), offsets in it (G) or in the line's frame (O)."""
    kinds: str = record.text("OFFT", "GGG")
    # decks of old programs have a flag there that tells a vector (1) from a grid point (2)
    kinds = "GGG" if kinds in ("1", "2") else kinds
    if len(kinds) != 3 or kinds[0] not in "GB" or set(kinds[1:]) - set("GO"):
        raise record.error("deck.offset-frame", f"OFFT '{kinds}' of {record.name} is not known", at="OFFT",
                           hint="known: GGG BGG GGO BGO GOG BOG GOO BOO")  # fmt: skip
    return kinds


def _check_no_warping(record: Record) -> None:
    if record.name == "CBEAM" and (record.integer("SA", 0) or record.integer("SB", 0)):
        raise record.error("deck.section", "warping of beams (SA, SB) is not modelled", at="SA",
                           hint="take the scalar points off the CBEAM if warping does not matter")  # fmt: skip


def orientation_vector(record: Record, grids: Grids, a: int, basic: bool = False) -> Reals:
    """Vector v from X1 X2 X3, or from end A to the grid point G0, in the basic frame.

    Raises
    ------
    FemtuneError : ``deck.orientation`` where neither is given
    """
    if _names_point(record):
        return grids.location(record.integer("X1"), record) - grids.table.xyz[a]
    x = record.reals("X1", "X2", "X3")
    if not any(x):
        raise record.error("deck.orientation", "the element has no orientation vector", at="X1",
                           hint="fill X1 X2 X3, or G0, or give a BAROR or BEAMOR card")  # fmt: skip
    return np.array(x) if basic else grids.vector(a, x)


def _names_point(record: Record) -> bool:
    """Whether X1 is a grid point G0; X2 and X3 of a BAROR or BEAMOR don't count beside the card's own G0."""
    filled = not record.card.blank(record.at("X1"))
    given = replace(record, defaults=None) if filled or record.defaults is None else record.defaults
    return given.has_integer("X1") and given.blank("X2") and given.blank("X3")


def _offset(record: Record, grids: Grids, end: str, row: int, kind: str, line: Reals, v: Reals) -> Reals:
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
    """(3, 3) columns x along the line, y in the plane of line and v, z = x × y."""
    x = line / length(line)
    z = cross(x, v)
    z = z / length(z)
    return np.column_stack([x, cross(z, x), z])


def check_line(record: Record, line: Reals, v: Reals) -> None:
    """Errors ``deck.zero-length`` and ``deck.orientation`` of an element's axis and orientation vector."""
    size = length(line)
    if size == 0.0:
        raise record.error("deck.zero-length", "the two ends of the element are at the same point",
                           hint="correct grid points or offsets; join coincident points by RBE2 or CBUSH")  # fmt: skip
    if length(cross(line, v)) <= _PARALLEL * size * length(v):
        raise record.error("deck.orientation", "the orientation vector is parallel to the element",
                           hint="choose a vector that points away from the element's axis")  # fmt: skip
