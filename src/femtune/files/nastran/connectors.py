"""Welds and fasteners between two shell surfaces: CWELD with PWELD, CFAST with PFAST."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.fem.elements import KINDS
from femtune.fem.elements.connector import FASTENER, WELD
from femtune.fem.fields import FieldRef
from femtune.fem.patches import (
    EndMotion,
    Patch,
    SurfacePoint,
    at_grid,
    on_auxiliary_points,
    on_surface,
    square_around,
)
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows, Building
from femtune.files.nastran.card import LARGEST_COORDINATE, CardEntry
from femtune.files.nastran.coordinates import cross, length
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Materials, Properties, read_properties
from femtune.files.nastran.reading import ElementReading

# ----------------------------------------------------------------------------------------------------
# The shells of a model as patches.


_MOST_PROJECTIONS = 16
"""Number of shells of a property, those with the nearest centres, that a point is projected on.

More than one layer of neighbours in a regular mesh; each projection is an iteration.
"""
_COINCIDENT_ENDS = 1e-9
"""Distance of the ends, relative to the size of a patch, up to which the connector has no length: rounding."""


@dataclass(frozen=True, eq=False)
class _Shells:
    """All shells by number, and the shells at each grid point."""

    building: Building
    grids: Grids
    batches: Sequence[ElementBatch]

    @cached_property
    def _places(self) -> dict[int, tuple[ElementBatch, int]]:
        shells = [b for b in self.batches if KINDS[b.kind].shell]
        return {int(number): (batch, i) for batch in shells for i, number in enumerate(batch.ids)}

    @cached_property
    def _at_points(self) -> dict[int, list[int]]:
        shells: dict[int, list[int]] = {}
        for number, (batch, i) in self._places.items():
            for row in batch.nodes[i]:
                if row >= 0:
                    shells.setdefault(int(row), []).append(number)
        return shells

    @cached_property
    def _of_property(self) -> dict[int, Integers]:
        shells: dict[int, list[int]] = {}
        for name in sorted({batch.card for batch, _ in self._places.values()}):
            for card in self.building.deck.by_name(name):
                if card.is_integer(0) and card.integer(0) in self._places:
                    shells.setdefault(card.integer(1, card.integer(0)), []).append(card.integer(0))
        return {pid: np.array(numbers) for pid, numbers in shells.items()}

    def patch(self, number: int, record: CardEntry) -> Patch:
        """A shell that a card refers to; if it lacks a mid-side grid point, only its corners are used."""
        if number not in self._places:
            raise record.error("deck.connector/shell", number=number)
        batch, i = self._places[number]
        rows = batch.nodes[i]
        if (rows < 0).any():
            rows = rows[: len(rows) // 2]
        return Patch(rows, self.grids.table.xyz[rows])

    def thickness(self, number: int, record: CardEntry) -> int:
        """Position of the thickness of a shell in the value table."""
        batch, i = self._places[number]
        if "t" not in batch.roles:
            raise record.error("deck.connector/spot", number=number)
        return int(batch.roles["t"][i])

    def beside(self, number: int) -> list[int]:
        """Shells that share a grid point with a shell."""
        batch, i = self._places[number]
        neighbours = {other for row in batch.nodes[i] if row >= 0 for other in self._at_points[int(row)]}
        return sorted(neighbours - {number})

    def near(self, pid: int, point: Reals, record: CardEntry) -> list[int]:
        """Shells of a property, the nearest first."""
        if pid not in self._of_property:
            raise record.error("deck.connector/property", number=pid)
        numbers = self._of_property[pid]
        distance = np.array([np.linalg.norm(self._centre(int(n)) - point) for n in numbers])
        return numbers[np.argsort(distance, kind="stable")[:_MOST_PROJECTIONS]].tolist()

    def _centre(self, number: int) -> Reals:
        if number not in self._centres:
            batch, i = self._places[number]
            rows = batch.nodes[i]
            self._centres[number] = self.grids.table.xyz[rows[rows >= 0]].mean(axis=0)
        return self._centres[number]

    @cached_property
    def _centres(self) -> dict[int, Reals]:
        return {}

    def of_same_property(self, number: int, others: Sequence[int]) -> list[int]:
        """Those of some shells that have the property of a shell."""
        members = next((numbers for numbers in self._of_property.values() if number in numbers), np.zeros(0, np.int64))
        return [n for n in others if n in members]


def _projected(
    shells: _Shells, point: Reals, numbers: Sequence[int], record: CardEntry
) -> tuple[int, SurfacePoint] | None:
    """The shell on which the projection of a point lies; the nearest of several."""
    projections = [(n, shells.patch(n, record).project(point)) for n in numbers]
    inside = [(n, p) for n, p in projections if p.is_inside]
    return min(inside, key=lambda shell: shell[1].distance, default=None)


# ----------------------------------------------------------------------------------------------------
# The two ends of a connector, by the format of its card.


_SIDE = np.sqrt(np.pi) / 2.0
"""Ratio of the side of the square of auxiliary points to the diameter: the square has the area of the section."""


@dataclass(frozen=True)
class _Ends:
    """Both ends, and their shells (0 for none)."""

    a: EndMotion
    b: EndMotion
    shells: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class _Reading:
    """Data for finding the ends of connectors."""

    grids: Grids
    shells: _Shells

    def of_grids(self, record: CardEntry) -> _Ends:
        """GRIDID: patches of three to eight grid points; a blank among the first four ends the corners."""
        patches = [self._listed(record, start) for start in (8, 16)]
        if not len(patches[1].rows):
            raise record.error("deck.connector/one-patch")
        ends = []
        for patch, point in zip(patches, self._points(record)):
            foot = patch.project(point)
            if not foot.is_inside:
                raise record.error("deck.connector/outside")
            ends.append(on_surface(foot))
        return _Ends(ends[0], ends[1])

    def _listed(self, record: CardEntry, start: int) -> Patch:
        """Corners in the first four fields (three for a triangle), the middles of the sides in the others."""
        numbers = [record.card.integer(start + i, 0) for i in range(8)]
        corners = [n for n in numbers[:4] if n]
        middles = [n for n in numbers[4:] if n]
        if not corners and not middles:
            return Patch(np.zeros(0, np.int64), np.zeros((0, 3)))
        if len(corners) < 3 or len(middles) not in (0, len(corners)) or 0 in numbers[:3]:
            raise record.card.error("deck.connector/patch", index=start)
        rows = np.array([self.grids.row(n, record) for n in (*corners, *middles)])
        return Patch(rows, self.grids.table.xyz[rows])

    def of_elements(self, record: CardEntry) -> _Ends:
        """ELEMID: the shells that the fields of the second line name."""
        numbers = (record.card.integer(8), record.card.integer(9))
        ends = []
        for number, point in zip(numbers, self._points(record)):
            foot = self.shells.patch(number, record).project(point)
            if not foot.is_inside:
                raise record.error("deck.connector/outside-shell", number=number)
            ends.append(on_surface(foot))
        return _Ends(ends[0], ends[1], numbers)

    def of_points(self, record: CardEntry) -> _Ends:
        """ALIGN: two grid points."""
        rows = [self.grids.row(record.integer(name), record) for name in ("GA", "GB")]
        xyz = self.grids.table.xyz[rows]
        if length(xyz[1] - xyz[0]) == 0.0:
            raise record.error("deck.zero-length")
        a, b = (at_grid(row, x, np.zeros(3)) for row, x in zip(rows, xyz))
        return _Ends(a, b)

    def of_patches(self, record: CardEntry, names: tuple[int, int], diameter: float, by_property: bool) -> _Ends:
        """ELPAT, PARTPAT, ELEM and PROP: four auxiliary points on the shells around each end."""
        ends, numbers = [], []
        for name, point in zip(names, self._points(record)):
            candidates = self.shells.near(name, point, record) if by_property else [name]
            projection = _projected(self.shells, point, candidates, record)
            if projection is None and not by_property:
                projection = _projected(self.shells, point, self.shells.beside(name), record)
            if projection is None:
                code = "deck.connector/outside-property" if by_property else "deck.connector/outside-shell"
                raise record.error(code, number=name)
            ends.append(self._with_auxiliary_points(record, projection, diameter, by_property))
            numbers.append(projection[0])
        return _Ends(ends[0], ends[1], (numbers[0], numbers[1]))

    def _with_auxiliary_points(
        self, record: CardEntry, projection: tuple[int, SurfacePoint], diameter: float, by_property: bool
    ) -> EndMotion:  # fmt: skip
        number, point = projection
        others = self.shells.beside(number)
        if by_property:
            others = self.shells.of_same_property(number, others)
        around = []
        for corner in square_around(point, _SIDE * diameter):
            foot = point.patch.project(corner)
            if not foot.is_inside:
                neighbour = _projected(self.shells, corner, others, record)
                if neighbour is None or neighbour[1].distance > diameter:
                    raise record.error("deck.connector/auxiliary", number=number)
                foot = neighbour[1]
            around.append(foot)
        if all(np.array_equal(p.xyz, point.xyz) for p in around):
            raise record.error("deck.connector/point-like", number=number)
        return on_auxiliary_points(point, around)

    def _points(self, record: CardEntry) -> tuple[Reals, Reals]:
        """Points at which the ends are sought: GA and GB if given, otherwise GS or XS YS ZS."""
        a, b = (self._given(record, name) for name in ("GA", "GB"))
        return a, b

    def _given(self, record: CardEntry, name: str) -> Reals:
        number = record.integer(name, 0)
        return self.grids.location(number, record) if number else self._general(record)

    def _general(self, record: CardEntry) -> Reals:
        if record.integer("GS", 0):
            return self.grids.location(record.integer("GS"), record)
        start = 16 if record.name == "CWELD" else 8
        has_place = record.name == "CFAST" or record.text("TYPE") in _PATCHES
        if has_place and not all(record.card.blank(start + i) for i in range(3)):
            return self._place(record, start)
        raise record.error("deck.connector/no-place", at="GS")

    def _place(self, record: CardEntry, start: int) -> Reals:
        """The point whose coordinates are in three fields."""
        xyz = np.array([record.card.real(start + i, 0.0) for i in range(3)])
        far = np.flatnonzero(np.abs(xyz) > LARGEST_COORDINATE)
        if len(far):
            raise record.card.error("deck.field-value/coordinate", index=start + int(far[0]))
        return xyz


def _diameter(section: CardEntry) -> float:
    """D of a property, above zero and not above the limit of coordinates."""
    diameter = float(section.real("D"))
    if not 0.0 < diameter <= LARGEST_COORDINATE:
        raise section.error("deck.connector/diameter", at="D")
    return diameter


def _axes(record: CardEntry, ends: _Ends, direction: Reals | None = None) -> tuple[float, Reals]:
    """Length and axes (columns): the first along the line between the ends, the second in the plane of a direction."""
    line = ends.b.xyz - ends.a.xyz
    size = length(line)
    scale = float(np.abs(np.concatenate([ends.a.xyz, ends.b.xyz])).max()) or 1.0
    x = line / size if size > _COINCIDENT_ENDS * scale else ends.a.normal
    if direction is None:
        helper = np.eye(3)[int(np.argmin(np.abs(np.round(x, 12))))]
        y = helper - (helper @ x) * x
    else:
        z = cross(x, direction)
        if length(z) <= 1e-8:
            raise record.error("deck.connector/axes")
        y = cross(z / length(z), x)
    y = y / length(y)
    return (size if size > _COINCIDENT_ENDS * scale else 0.0), np.column_stack([x, y, cross(x, y)])


def _facts(grids: Grids, ends: _Ends, axes: Reals) -> tuple[list[int], dict[str, NDArray]]:
    """Rows of the grid points, the nearest to each end first, and the motion of the ends along the axes."""
    rows = np.unique(np.concatenate([ends.a.rows, ends.b.rows]))
    xyz = grids.table.xyz
    first = [int(e.rows[np.argmin(np.linalg.norm(xyz[e.rows] - e.xyz, axis=1))]) for e in (ends.a, ends.b)]
    rest = [r for r in rows.tolist() if r not in first]
    order = list(dict.fromkeys([*first, *rest]))
    place = {row: i for i, row in enumerate(order)}
    motion = np.zeros((12, len(order), 6))
    for k, end in enumerate((ends.a, ends.b)):
        for i, row in enumerate(end.rows.tolist()):
            frame = grids.table.frames[row]
            block = motion[6 * k : 6 * k + 6, place[row]]
            block[:, :3] += end.motion[:, i, :3] @ frame
            block[:, 3:] += end.motion[:, i, 3:] @ frame
    turned = np.einsum("ia,kinc->kanc", axes, motion.reshape(4, 3, len(order), 6)).reshape(12, -1)
    arm = axes.T @ (0.5 * (ends.b.xyz - ends.a.xyz))
    return order, {"ends": turned, "arm": arm}


# ----------------------------------------------------------------------------------------------------
# CWELD with PWELD.


_FORMATS = ("GRIDID", "ELEMID", "ALIGN", "ELPAT", "PARTPAT")
_PATCHES = ("ELPAT", "PARTPAT")


def read_connectors(reading: ElementReading) -> list[ElementBatch]:
    """Batches of CWELD and CFAST, on shells that were read before."""
    building, grids, materials, batches = reading.building, reading.grids, reading.materials, reading.batches
    if not any(building.deck.by_name(card) for card in ("CWELD", "CFAST")):
        return []
    ends = _Reading(grids, _Shells(building, grids, batches))
    return [*_Welds(building, materials, ends).read(), *_Fasteners(building, ends).read()]


def _batches(
    building: Building, card: str, add: Callable[[CardEntry], None], rows: Mapping[Any, BatchRows]
) -> list[ElementBatch]:
    """Add every record of a card to its rows, collecting the errors."""
    for record in building.records(card):
        with building.errors.catch():
            add(record)
    return [batch for key in sorted(rows) for batch in rows[key].batches()]


@dataclass
class _Welds:
    """Welds of one deck."""

    building: Building
    materials: Materials
    reading: _Reading
    rows: dict[tuple[int, bool], BatchRows] = field(default_factory=dict)
    properties: Properties = field(init=False)

    def __post_init__(self) -> None:
        self.properties = read_properties(self.building, "CWELD")

    @cached_property
    def _with_patches(self) -> set[int]:
        """Properties whose diameter determines auxiliary points and therefore is fixed."""
        cards = self.building.deck.by_name("CWELD")
        return {c.integer(1, c.integer(0, 0)) for c in cards if c.text(3) in _PATCHES and c.is_integer(1)}

    def read(self) -> list[ElementBatch]:
        """Their batches."""
        return _batches(self.building, "CWELD", self._add, self.rows)

    def _add(self, record: CardEntry) -> None:
        pid = record.integer("PID", record.integer("EID"))
        section = self.properties.find(pid, record)
        diameter = _diameter(section)
        ends = self._ends(record, section, diameter)
        distance, axes = _axes(record, ends)
        roles = self._roles(section, pid)
        form = record.text("TYPE")
        spot = section.text("TYPE") == "SPOT" and form in (*_PATCHES, "ELEMID")
        nodes, facts = _facts(self.reading.grids, ends, axes)
        facts["length"] = np.array(distance)
        if spot:
            shells = self.reading.shells
            roles |= {name: shells.thickness(n, record) for name, n in zip(("tA", "tB"), ends.shells)}
        else:
            facts |= _effective_length(section, distance, diameter)
        rows = self.rows.setdefault((len(nodes), spot), BatchRows(WELD.key, "CWELD"))
        grids = self.reading.grids
        rows.add(record.integer("EID"), nodes, [d for n in nodes for d in grids.dofs(n)], roles, facts)

    def _ends(self, record: CardEntry, section: CardEntry, diameter: float) -> _Ends:
        form = record.text("TYPE")
        if form not in _FORMATS:
            raise record.error("deck.connector/format", at="TYPE", card=record.name, known=" ".join(_FORMATS))
        tied = section.text("MSET", "OFF") == "ON" and form != "ALIGN"
        if tied and (record.integer("GA", 0) or record.integer("GB", 0)):
            raise record.error("deck.connector/equations", at="GA")
        if form == "ALIGN":
            return self.reading.of_points(record)
        if form == "GRIDID":
            return self.reading.of_grids(record)
        if form == "ELEMID":
            return self.reading.of_elements(record)
        names = (record.card.integer(8), record.card.integer(9))
        return self.reading.of_patches(record, names, diameter, form == "PARTPAT")

    def _roles(self, section: CardEntry, pid: int) -> dict[str, int]:
        material = self.materials.get(section.integer("MID"), section)
        if min(self.building.values.values[material[name]] for name in "EG") <= 0.0:
            raise section.error("deck.connector/modulus", at="MID")
        if pid in self._with_patches:
            fixed = self.building.values.add(FieldRef("PWELD", pid, "diameter"), section.real("D"))
            return {**material, "D": fixed}
        return {**material, "D": self.building.value(section, pid, "D")}


def _effective_length(section: CardEntry, distance: float, diameter: float) -> dict[str, NDArray]:
    """The true length, limited to LDMIN and LDMAX times the diameter."""
    least, most = section.real("LDMIN", 0.2), section.real("LDMAX", 5.0)
    if not 0.0 < least <= most:
        raise section.error("deck.connector/limits", at="LDMIN")
    within = least * diameter <= distance <= most * diameter
    factor = 0.0 if within else float(np.clip(distance / diameter, least, most))
    return {"fixed": np.array(distance if within else 0.0), "factor": np.array(factor)}


# ----------------------------------------------------------------------------------------------------
# CFAST with PFAST.


_STIFFNESSES = ("KT1", "KT2", "KT3", "KR1", "KR2", "KR3")


@dataclass
class _Fasteners:
    """Fasteners of one deck."""

    building: Building
    reading: _Reading
    rows: dict[int, BatchRows] = field(default_factory=dict)
    properties: Properties = field(init=False)

    def __post_init__(self) -> None:
        self.properties = read_properties(self.building, "CFAST")

    def read(self) -> list[ElementBatch]:
        """Their batches."""
        return _batches(self.building, "CFAST", self._add, self.rows)

    def _add(self, record: CardEntry) -> None:
        pid = record.integer("PID", record.integer("EID"))
        section = self.properties.find(pid, record)
        if record.text("TYPE") not in ("PROP", "ELEM"):
            raise record.error("deck.connector/format", at="TYPE", card=record.name, known="PROP ELEM")
        diameter = _diameter(section)
        names = (record.integer("IDA"), record.integer("IDB"))
        ends = self.reading.of_patches(record, names, diameter, record.text("TYPE") == "PROP")
        nodes, facts = _facts(self.reading.grids, ends, self._frame(record, section, ends))
        values = {f"K{i + 1}": name for i, name in enumerate(_STIFFNESSES)} | {"M": "MASS", "GE": "GE"}
        roles = {role: self.building.value(section, pid, name) for role, name in values.items()}
        rows = self.rows.setdefault(len(nodes), BatchRows(FASTENER.key, "CFAST"))
        grids = self.reading.grids
        rows.add(record.integer("EID"), nodes, [d for n in nodes for d in grids.dofs(n)], roles, facts)

    def _frame(self, record: CardEntry, section: CardEntry, ends: _Ends) -> Reals:
        """Axes of the springs: of the line (MCID −1), with the second axis of a system (MFLAG 0), or its own."""
        number = section.integer("MCID", -1)
        if number == -1:
            return _axes(record, ends)[1]
        system = self.reading.grids.systems.get(number, section).frame(0.5 * (ends.a.xyz + ends.b.xyz))
        flag = section.integer("MFLAG", 0)
        if flag not in (0, 1):
            raise section.error("deck.connector/flag", at="MFLAG")
        return system if flag else _axes(record, ends, system[:, 1])[1]
