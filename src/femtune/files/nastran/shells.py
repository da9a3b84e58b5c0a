"""Shells: CQUAD4, CTRIA3, CQUADR, CTRIAR, CQUAD8 and CTRIA6 with PSHELL, PCOMP or PCOMPG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import add
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.fem.elements.shells.curved import SHELL_QUAD8, SHELL_TRI6
from femtune.fem.elements.shells.flat import SHELL_QUAD, SHELL_ROTATION_TRI, SHELL_TRI
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.coordinates import cross, length
from femtune.files.nastran.element_columns import read_elements
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import read_properties
from femtune.files.nastran.plane_laws import PlaneLaws
from femtune.files.nastran.reading import ElementReading
from femtune.files.nastran.shell_properties import COUPLING, ShellProperties, ShellSection, Thicknesses


class _ShellShape(NamedTuple):
    """Corners of a card, all of its grid points, and the kind of its batch."""

    corners: int
    nodes: int
    kind: str

    @property
    def curved(self) -> bool:
        """Whether it has mid-side grid points."""
        return self.nodes > self.corners


_SHAPES = {
    "CQUAD4": _ShellShape(4, 4, SHELL_QUAD.key),
    "CTRIA3": _ShellShape(3, 3, SHELL_TRI.key),
    "CQUADR": _ShellShape(4, 4, SHELL_QUAD.key),
    "CTRIAR": _ShellShape(3, 3, SHELL_ROTATION_TRI.key),
    "CQUAD8": _ShellShape(4, 8, SHELL_QUAD8.key),
    "CTRIA6": _ShellShape(3, 6, SHELL_TRI6.key),
}
_LEFT_OUT = -1
"""Row in place of a mid-side grid point that is left out."""
_LEAST_DIRECTION_SINE = 1e-6
"""Sine of the angle between the normal and the x axis of THETA's system up to which the projection is undefined."""
_NO_DIRECTION = np.zeros(3)


def read_shells(reading: ElementReading) -> list[ElementBatch]:
    """Batches of shells, separate for each card."""
    building, grids, materials = reading.building, reading.grids, reading.materials
    laws = PlaneLaws(building, materials)
    return [batch for card in _SHAPES for batch in _read(card, building, grids, laws)]


def _read(card: str, building: Building, grids: Grids, laws: PlaneLaws) -> list[ElementBatch]:
    if not building.deck.by_name(card):
        return []
    reading = _ShellReading(building, grids, ShellProperties(building, read_properties(building, card), laws), card)
    sizes = tuple({_SHAPES[card].corners, _SHAPES[card].nodes})
    read_elements(building, grids, card, sizes, reading.properties.get, reading.add_plain, reading.add)
    building.notices += reading.thicknesses.notices(card)
    if card == "CQUADR":
        where = building.deck.by_name(card)[0].where()
        building.notices.append(Notice("deck.quad-rotations", where=where, level="info"))
    return reading.batches()


class _Row(NamedTuple):
    """One element: its number, rows of its nodes, positions of thickness and offsets, material direction.

    `inertia` is the position of the bending inertia relative to that of the thickness; `corners` are the positions of
    thicknesses at the corners if the shape lets them vary over the element.
    """

    id: int
    nodes: list[int]
    section: ShellSection
    thickness: int
    offset: int
    mass_offset: int
    offset_given: bool
    theta: float
    direction: Reals
    inertia: int
    corners: list[int] | None = None


@dataclass
class _ShellReading:
    """Elements of one card, row by row."""

    building: Building
    grids: Grids
    properties: ShellProperties
    card: str
    rows: list[_Row] = field(default_factory=list)
    thicknesses: Thicknesses = field(init=False)
    none: int = field(init=False)
    shape: _ShellShape = field(init=False)

    def __post_init__(self) -> None:
        self.shape = _SHAPES[self.card]
        names = tuple(f"T{i + 1}" for i in range(self.shape.corners))
        self.thicknesses = Thicknesses(self.building, names, not self.shape.curved)
        self.none = self.building.values.add(FieldRef(self.card, 0, "none"), 0.0)

    def add_plain(self, eid: int, section: ShellSection, nodes: list[int]) -> bool:
        """Add an element that has only grid points; returns False if its PSHELL has no thickness."""
        if section.thickness is None:
            return False
        off = section.offset is not None
        offset = self.none if section.offset is None else section.offset
        nodes = [*nodes, *[_LEFT_OUT] * (self.shape.nodes - len(nodes))]
        row = _Row(
            id=eid,
            nodes=nodes,
            section=section,
            thickness=section.thickness,
            offset=offset,
            mass_offset=self.none,
            offset_given=off,
            theta=0.0,
            direction=_NO_DIRECTION,
            inertia=section.roles["RI"],
        )
        self.rows.append(row)
        return True

    def add(self, record: CardEntry) -> None:
        """Add any element."""
        eid = record.integer("EID")
        section = self.properties.get(record.integer("PID", eid), record)
        nodes = _nodes(record, self.grids)
        corners = self.thicknesses.at_corners(record, eid, section)
        thickness = self.thicknesses.get(record, eid, section, corners)
        lift, offset = self._offsets(record, eid, section)
        given = not record.blank("ZOFFS") or section.offset is not None
        theta, direction = _material_axis(record, self.grids, nodes[: self.shape.corners], section)
        row = _Row(
            id=eid,
            nodes=nodes,
            section=section,
            thickness=thickness,
            offset=offset,
            mass_offset=lift,
            offset_given=given,
            theta=theta,
            direction=direction,
            corners=corners if self.shape.curved else None,
            inertia=self.thicknesses.inertia(record, eid, section, corners),
        )
        self.rows.append(row)

    def _offsets(self, record: CardEntry, eid: int, section: ShellSection) -> tuple[int, int]:
        """Positions of the offsets of the mass (ZOFFS) and of the stiffness (with that of a laminate's middle)."""
        if record.blank("ZOFFS"):
            return self.none, self.none if section.offset is None else section.offset
        lift = self.building.value(record, eid, "ZOFFS")
        if section.offset is None:
            return lift, lift
        ref = FieldRef(record.name, eid, "offset")
        return lift, self.building.values.derive(ref, add, lift, section.offset)

    def batches(self) -> list[ElementBatch]:
        """The batch, or an empty list if no element was added."""
        if not self.rows:
            return []
        ids, nodes, sections, thickness, offset, lift, offset_given, theta, direction, inertia, corners = zip(
            *self.rows
        )
        at = np.array(nodes, dtype=np.int64)
        dofs = np.where(at[:, :, None] >= 0, 6 * at[:, :, None] + np.arange(6), -1).reshape(len(at), -1)
        roles, facts = _section_columns(sections)
        roles |= {"t": np.array(thickness, np.int64), "z0": np.array(offset, np.int64)}
        roles["RI"] = np.array(inertia, np.int64)
        roles["zm"] = roles["z0"] if lift == offset else np.array(lift, np.int64)
        facts |= {"offset_given": np.array(offset_given), "theta": np.array(theta), "direction": np.array(direction)}
        if any(given is not None for given in corners):
            facts["uneven"] = np.array([given is not None for given in corners])
            every = np.array(
                [[t] * self.shape.corners if given is None else given for given, t in zip(corners, thickness)]
            )
            roles |= {f"t{i + 1}": column for i, column in enumerate(every.T)}
        return [ElementBatch(self.shape.kind, self.card, np.array(ids, np.int64), at, dofs, roles, facts)]


def _section_columns(sections: tuple[ShellSection, ...]) -> tuple[dict[str, NDArray], dict[str, NDArray]]:
    """Roles and facts of the sections, element by element."""
    known = {section.number: section for section in sections}
    row = {number: i for i, number in enumerate(known)}
    at = np.array([row[section.number] for section in sections])
    each = list(known.values())

    def column(of: Sequence[Mapping[str, int]], name: str, kind: type) -> NDArray:
        return np.array([one[name] for one in of], dtype=kind)[at]

    roles, facts = [s.roles for s in each], [s.facts for s in each]
    couple = any(flags["has_coupling"] for flags in facts)
    names = [name for name in each[0].roles if couple or name not in (*COUPLING, "GEC")]
    return (
        {name: column(roles, name, np.int64) for name in names},
        {name: column(facts, name, np.bool_) for name in each[0].facts},
    )


def _nodes(record: CardEntry, grids: Grids) -> list[int]:
    """Rows of the grid points in the node table, −1 for a mid-side point that is left out."""
    shape = _SHAPES[record.name]
    if shape.nodes == 4 and record.blank("G4"):
        raise record.error("deck.shell-corners/no-fourth-corner", at="G4")
    names = [f"G{i + 1}" for i in range(shape.nodes)]
    numbers = [record.integer(name, 0 if i >= shape.corners else ...) for i, name in enumerate(names)]
    for i, number in enumerate(numbers):
        if number and number in numbers[:i]:
            raise record.error(_repeated(numbers, shape, i), at=names[i], grid=number)
    given = [number or i < shape.corners for i, number in enumerate(numbers)]
    return [grids.row(number, record) if is_given else _LEFT_OUT for number, is_given in zip(numbers, given)]


def _repeated(numbers: list[int], shape: _ShellShape, i: int) -> str:
    """The message for a grid point that an element has twice; for a collapsed element it names the card to use."""
    if i >= shape.corners:
        return "deck.shell-corners/repeated"
    if shape.corners == 4 and len(set(numbers[:4])) == 3:
        return "deck.shell-corners/collapsed-curved" if shape.curved else "deck.shell-corners/collapsed"
    return "deck.shell-corners/repeated-corner"


def _material_axis(record: CardEntry, grids: Grids, nodes: list[int], section: ShellSection) -> tuple[float, Reals]:
    """Angle in rad from side G1-G2 to the material's x axis, or the basic vector whose projection is that axis.

    A vector along the normal has no projection; isotropic shells need none.
    """
    if record.blank("THETA"):
        return 0.0, _NO_DIRECTION
    if not record.has_integer("THETA"):
        return float(np.radians(record.real("THETA"))), _NO_DIRECTION
    corners = grids.table.xyz[nodes]
    axis = grids.systems.get(record.integer("THETA"), record).frame(corners.mean(axis=0))[:, 0]
    normal = cross(corners[2] - corners[0], corners[-1] - corners[1])
    if length(cross(normal, axis)) <= _LEAST_DIRECTION_SINE * length(normal):
        if section.isotropic:
            return 0.0, _NO_DIRECTION
        raise record.error("deck.orientation/material-axis", at="THETA")
    return 0.0, axis
