"""Solids: CHEXA, CPENTA, CTETRA and CPYRAM with PSOLID."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.fem.elements.solids.hexa8 import HEXA8_KIND
from femtune.fem.elements.solids.penta6 import PENTA6_KIND
from femtune.fem.elements.solids.pyram5 import PYRAM5_KIND
from femtune.fem.elements.solids.quadratic import HEXA20_KIND, PENTA15_KIND, PYRAM13_KIND, TETRA10_KIND
from femtune.fem.elements.solids.tetra4 import TETRA4_KIND
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import Building, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.element_columns import read_elements
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Properties, Roles, read_properties
from femtune.files.nastran.reading import ElementReading
from femtune.files.nastran.solid_laws import SolidLaws


class _SolidShape(NamedTuple):
    """Corners and most grid points of a card, and the kinds of its batches without and with mid-side points."""

    corners: int
    most: int
    plain: str
    curved: str
    sides: tuple[tuple[int, int, int, int], ...]
    turned: tuple[int, ...]


def _prism(n: int) -> tuple[tuple[int, int, int, int], ...]:
    """Sides at the corners of a prism over n corners: to the next one, the one before, and the one across."""
    below = [(i, (i + 1) % n, (i - 1) % n, n + i) for i in range(n)]
    return (*below, *((n + i, n + (i - 1) % n, n + (i + 1) % n, i) for i in range(n)))


_PYRAMID = tuple((i, (i + 1) % 4, (i - 1) % 4, 4) for i in range(4))
# the sides at each corner in a right-handed order, and the order of the grid points that turns an element inside out:
# for prisms the two faces are exchanged, otherwise the corners of the base run the other way round
_SHAPES = {
    "CHEXA": _SolidShape(
        8, 20, HEXA8_KIND.key, HEXA20_KIND.key, _prism(4),
        (4, 5, 6, 7, 0, 1, 2, 3, 16, 17, 18, 19, 12, 13, 14, 15, 8, 9, 10, 11),
    ),
    "CPENTA": _SolidShape(
        6, 15, PENTA6_KIND.key, PENTA15_KIND.key, _prism(3), (3, 4, 5, 0, 1, 2, 12, 13, 14, 9, 10, 11, 6, 7, 8)
    ),
    "CTETRA": _SolidShape(
        4, 10, TETRA4_KIND.key, TETRA10_KIND.key, ((0, 1, 2, 3),), (0, 2, 1, 3, 6, 5, 4, 7, 9, 8)
    ),
    "CPYRAM": _SolidShape(
        5, 13, PYRAM5_KIND.key, PYRAM13_KIND.key, _PYRAMID, (0, 3, 2, 1, 4, 8, 7, 6, 5, 9, 12, 11, 10)
    ),
}  # fmt: skip
_FIRST_NODE_FIELD = 2
"""Index of the first grid point on an element card."""
_ELEMENT_AXES = -1
"""Value of CORDM for material axes along those of the element."""
# faces opposite to each other, by corner: their centres give the element's axes
_FACES = (((0, 3, 4, 7), (1, 2, 5, 6)), ((0, 1, 4, 5), (2, 3, 6, 7)), ((0, 1, 2, 3), (4, 5, 6, 7)))


@dataclass(frozen=True)
class SolidSection:
    """One PSOLID: positions of its material's values, and the system of the material axes (−1: the element's)."""

    number: int
    roles: Roles
    isotropic: bool
    axes: int


def read_solids(reading: ElementReading) -> list[ElementBatch]:
    """Batches of solids, separate for each card and for elements with and without mid-side points."""
    building, grids, materials = reading.building, reading.grids, reading.materials
    if not any(building.deck.by_name(card) for card in _SHAPES):
        return []
    laws = SolidLaws(building, materials)
    properties = read_properties(building, "CHEXA")
    sections = Library(lambda pid, user: _section(building, properties, laws, grids, pid, user))
    batches = [batch for card in _SHAPES for batch in _read(card, building, grids, properties, sections)]
    building.notices += [*_unused_fields(properties), *_stiff_tetrahedra(batches, building)]
    return batches


def _section(
    building: Building, properties: Properties, laws: SolidLaws, grids: Grids, pid: int, user: CardEntry
) -> SolidSection:
    record = properties.find(pid, user)
    kind = record.text("FCTN", "SMECH")
    if kind != "SMECH":
        raise record.error("deck.solid-section", at="FCTN", kind=kind)
    law = laws.get(record.integer("MID"), record)
    axes = record.integer("CORDM", 0)
    if axes > 0:
        grids.systems.get(axes, record)
    elif axes < _ELEMENT_AXES:
        raise record.error("deck.solid-section/material-system", at="CORDM")
    # a PSOLID has no values, but writing back must know which one an element refers to
    section = building.values.add(FieldRef(record.name, pid, "none"), 0.0)
    return SolidSection(pid, {**law.roles, "section": section}, law.isotropic, axes)


def _read(
    card: str, building: Building, grids: Grids, properties: Properties, sections: Library[SolidSection]
) -> list[ElementBatch]:
    shape = _SHAPES[card]
    plain, curved = (_Rows(kind, card, grids.table.xyz) for kind in (shape.plain, shape.curved))

    def section_of(pid: int, record: CardEntry) -> SolidSection:
        properties.find(pid, record)
        return sections.get(pid, record)

    def add_plain(eid: int, section: SolidSection, nodes: list[int]) -> bool:
        if not section.isotropic and section.axes != 0:
            return False
        (curved if len(nodes) > shape.corners else plain).add(eid, nodes, section, _BASIC)
        return True

    def add(record: CardEntry) -> None:
        numbers = node_numbers(record)
        rows = curved if len(numbers) > shape.corners else plain
        section = section_of(record.integer("PID", record.integer("EID")), record)
        nodes = [grids.row(number, record) if number else -1 for number in numbers]
        own, turned = right_handed(card, np.array([nodes]), grids.table.xyz)
        rows.turned += [record.integer("EID")] * bool(turned[0])
        nodes = own[0].tolist()
        rows.add(record.integer("EID"), nodes, section, _axes(record, section, nodes, grids))

    read_elements(building, grids, card, (shape.corners, shape.most), section_of, add_plain, add)
    batches = [*plain.batches(), *curved.batches()]
    if turned := plain.turned + curved.turned:
        first = next(c for c in building.deck.by_name(card) if c.is_integer(0) and c.integer(0) == turned[0])
        building.notices.append(
            Notice("deck.turned-solids", where=first.where(), count=_count(len(turned), card), element=turned[0])
        )
    return batches


def right_handed(card: str, nodes: NDArray[np.int64], xyz: Reals) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Rows of the grid points (m, n) with elements turned that are inside out at every corner, and (m,) which they are.

    Commercial programs accept both orders. An element that is inside out at some corners only is left as it is.
    """
    shape = _SHAPES[card]
    corners = xyz[nodes[:, : shape.corners]]
    volume = np.stack([np.linalg.det(corners[:, others] - corners[:, [at]]) for at, *others in shape.sides], axis=1)
    turned = np.asarray((volume < 0.0).all(axis=1))
    out = nodes.copy()
    out[turned] = nodes[turned][:, list(shape.turned[: nodes.shape[1]])]
    return out, turned


def node_numbers(record: CardEntry) -> list[int]:
    """Grid points of a solid: its corners, or with all mid-side points, 0 for one that is left out.

    Raises
    ------
    FemtuneError : ``deck.solid-nodes``
    """
    shape = _SHAPES[record.name]
    _check_length(record, shape)
    numbers = [record.integer(name, 0) for name in record.names[_FIRST_NODE_FIELD : _FIRST_NODE_FIELD + shape.most]]
    for i, number in enumerate(numbers):
        if number < 0 or (number == 0 and i < shape.corners):
            code = "deck.solid-nodes/negative" if number else "deck.solid-nodes/missing-corner"
            raise record.error(code, at=f"G{i + 1}", corner=i + 1, card=record.name, corners=shape.corners)
    given = [number for number in numbers if number]
    if len(set(given)) < len(given):
        i = next(i for i, number in enumerate(numbers) if number and number in numbers[:i])
        other = _other_shape(record, numbers)
        code = "deck.solid-nodes/collapsed" if other else "deck.solid-nodes/repeated"
        raise record.error(code, at=f"G{i + 1}", grid=numbers[i], other=other)
    return numbers if len(given) > shape.corners else numbers[: shape.corners]


def _check_length(record: CardEntry, shape: _SolidShape) -> None:
    if len(record.card.fields) > _FIRST_NODE_FIELD + shape.most:
        at = next(i for i in range(_FIRST_NODE_FIELD + shape.most, len(record.card.fields)) if not record.card.blank(i))
        raise record.card.error("deck.solid-nodes", index=at, record_name=record.name, most=shape.most)


def _other_shape(record: CardEntry, numbers: Sequence[int]) -> str:
    """The card to use for a collapsed element, or ""."""
    corners = len(set(numbers[: _SHAPES[record.name].corners]))
    fits = [name for name, shape in _SHAPES.items() if shape.corners == corners and name != record.name]
    return fits[0] if fits else ""


def _axes(record: CardEntry, section: SolidSection, nodes: Sequence[int], grids: Grids) -> Reals:
    """(3, 3) material axes, as columns in the basic frame, at the centre of an element."""
    if section.isotropic:
        return _BASIC
    if section.axes == 0:
        return grids.basic.axes
    corners = grids.table.xyz[list(nodes[: _SHAPES[record.name].corners])]
    if section.axes > 0:
        return grids.systems.get(section.axes, record).frame(corners.mean(axis=0))
    if record.name != "CHEXA":
        raise record.error("deck.solid-section/element-axes", section_number=section.number, record_name=record.name)
    return element_axes(corners)


_BASIC = np.eye(3)


def element_axes(corners: Reals) -> Reals:
    """(3, 3) axes of a hexahedron from its corners (8, 3): the rotation nearest to the lines between opposite faces.

    It is the orthogonal factor of the polar decomposition of these three vectors, as in Nastran.
    """
    lines = np.column_stack([corners[list(b)].mean(axis=0) - corners[list(a)].mean(axis=0) for a, b in _FACES])
    left, _, right = np.linalg.svd(lines)
    return np.asarray(left @ right)


@dataclass
class _Rows:
    """Elements of one kind, row by row."""

    kind: str
    card: str
    xyz: Reals
    ids: list[int] = field(default_factory=list)
    nodes: list[list[int]] = field(default_factory=list)
    turned: list[int] = field(default_factory=list)
    sections: list[SolidSection] = field(default_factory=list)
    axes: list[Reals] = field(default_factory=list)

    def add(self, id: int, nodes: list[int], section: SolidSection, axes: Reals) -> None:
        """Add an element."""
        self.ids.append(id)
        self.nodes.append(nodes)
        self.sections.append(section)
        self.axes.append(axes)

    def batches(self) -> list[ElementBatch]:
        """The batch, or an empty list if no element was added."""
        if not self.ids:
            return []
        nodes, turned = right_handed(self.card, np.array(self.nodes, dtype=np.int64), self.xyz)
        self.turned += np.array(self.ids)[turned].tolist()
        at = 6 * nodes[:, :, None] + np.arange(3)
        dofs = np.where(nodes[:, :, None] >= 0, at, -1).reshape(len(nodes), -1)
        roles, isotropic = _columns(self.sections)
        frames = np.broadcast_to(_BASIC, (len(nodes), 3, 3)) if isotropic.all() else np.array(self.axes)
        facts = {"isotropic": isotropic, "material_frame": frames}
        return [ElementBatch(self.kind, self.card, np.array(self.ids, np.int64), nodes, dofs, roles, facts)]


def _columns(sections: Sequence[SolidSection]) -> tuple[dict[str, NDArray[np.int64]], NDArray[np.bool_]]:
    """Roles of the sections, element by element (one array for values that are one entry), and isotropic flags."""
    known = {section.number: section for section in sections}
    row = {number: i for i, number in enumerate(known)}
    at = np.array([row[section.number] for section in sections])
    shared: dict[tuple[int, ...], NDArray[np.int64]] = {}
    roles = {}
    for name in sections[0].roles:
        positions = tuple(section.roles[name] for section in known.values())
        if positions not in shared:
            shared[positions] = np.array(positions, np.int64)[at]
        roles[name] = shared[positions]
    return roles, np.array([section.isotropic for section in known.values()])[at]


def _unused_fields(properties: Properties) -> list[Notice]:
    """Notices of PSOLID cards that request another integration than that of the elements."""
    asking = [r for r in properties.own.values() if any(not r.blank(name) for name in ("IN", "STRESS", "ISOP"))]
    if not asking:
        return []
    return [Notice("deck.solid-integration", where=asking[0].where, level="info", count=_count(len(asking), "PSOLID"))]


def _stiff_tetrahedra(batches: Sequence[ElementBatch], building: Building) -> list[Notice]:
    tetrahedra = next((batch for batch in batches if batch.kind == TETRA4_KIND.key), None)
    if tetrahedra is None:
        return []
    first = next(card for card in building.deck.by_name("CTETRA") if card.integer(0, 0) == tetrahedra.ids[0])
    return [Notice("deck.stiff-tetrahedra", where=first.where(), count=_count(len(tetrahedra), "CTETRA"))]


def _count(number: int, name: str) -> str:
    return f"{number} {name} card{'s' if number > 1 else ''}"
