"""A car subframe as a test bed: pressed steel members, welds, bolts, rubber bushings and accelerometers.

Two curved side members and three arched cross members, closed boxes of two half shells each with flanges at the seam,
joined node to node; gussets; four brackets bolted on with two bolts each (RBE2); four bushings of rubber between
steel sleeves, each with an RBE2 in its bore whose middle node is the mount; stiffeners (CBAR) along two cross members;
sixty accelerometers (CONM2). About 1.0 × 0.6 × 0.2 m and 20 kg, in SI units (m, N, kg). The geometry is the same at
any number of degrees of freedom. ``python -m structures.subframe 40000 out.bdf`` writes a deck.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from femtune.arrays import Reals
from femtune.fem.fields import FieldRef
from structures.meshed import (
    Elements,
    Hole,
    Material,
    MeshedStructure,
    Patch,
    PointMass,
    Property,
    RigidTie,
    Weld,
    element_batches,
    holed_sheet,
    lifted,
    node_numbers,
    sheet,
    sized,
    solid_ring,
    ticks,
    triangle_sheet,
    tube,
    washer,
    weld,
    write_structure,
)

# ----------------------------------------------------------------------------------------------------
# The drawing of the subframe: members, flanges, gussets, brackets and bushings in the reference space, in metres.
#
# x runs along the vehicle, y to the left, z up. Members are closed boxes of two half shells that meet at z = 0, where
# flanges stand out. `bend` turns the straight boxes into curved members of varying height.


FLANGE = 0.025
HALF_HEIGHT = 0.025
SIDE_Y = (0.205, 0.285)
BRACKET_GAP, BRACKET_HEIGHT = 0.004, 0.04
BOLT_RADII = (0.008, 0.016)
"""Of the hole and of the washer, between which a bolt holds the sheet."""

BUSHING_RADII = (0.007, 0.013, 0.027)
"""Bore and outside of the inner sleeve, outside of the rubber."""

# Cells in the rear half, across the side members and upright, beside those along the front half: if all were equal,
# all would be split at the same size, and the number of degrees of freedom would jump by half.
REAR_SIZE, ACROSS_SIZE, UPRIGHT_SIZE = 1.23, {1: 0.87, -1: 1.26}, 1.1

# Breaks along the side members: bushings, cross members, their flanges, gussets and brackets begin and end there.
STATIONS = (
    *(-0.5, -0.42, -0.365, -0.31, -0.285, -0.26, -0.18, -0.1, -0.04, -0.015),
    *(0.03, 0.075, 0.1, 0.18, 0.26, 0.285, 0.31, 0.365, 0.42, 0.5),
)
BUSHING_X = {"front": (-0.5, -0.42), "rear": (0.42, 0.5)}
BRACKET_X = {"front": (-0.26, -0.18, -0.1), "rear": (0.1, 0.18, 0.26)}


@dataclass(frozen=True)
class Cross:
    """A cross member: its edges and middle along x, and the side (−1 or 1) with gussets; 0 is none.

    Flanges stand out from both edges, or from the one with gussets: the other is folded.
    """

    name: str
    x: tuple[float, float, float]
    gusset: int = 0

    @property
    def y(self) -> tuple[float, ...]:
        """Breaks across the vehicle."""
        right = (SIDE_Y[0], SIDE_Y[0] - FLANGE) + ((SIDE_Y[0] - 2.0 * FLANGE,) if self.gusset else ())
        return tuple(sorted([*right, *(-y for y in right)]))


CROSSES = (
    Cross("front", (-0.42, -0.365, -0.31), gusset=1),
    Cross("middle", (-0.015, 0.03, 0.075)),
    Cross("rear", (0.31, 0.365, 0.42), gusset=-1),
)
SIDES = {"left": 1, "right": -1}


@dataclass(frozen=True)
class Drawing:
    """All patches at one element size (m); `aspect` makes cells longer upright and across the side members."""

    size: float
    solids: bool
    aspect: float = 1.0

    @cached_property
    def z(self) -> tuple[Reals, Reals]:
        """Heights of the lower and of the upper half shell."""
        size = UPRIGHT_SIZE * self.aspect * self.size
        return ticks((-HALF_HEIGHT, 0.0), size), ticks((0.0, HALF_HEIGHT), size)

    @property
    def bushing_z(self) -> Reals:
        """Heights along the bushings, two cells or more."""
        lower, upper = self.z
        return np.concatenate([lower, upper[1:]])

    def along(self, breaks: Sequence[float]) -> Reals:
        """Ticks along x; flanges, which meet at corners, have the same cells in front and rear."""
        ordered = sorted(breaks)
        rear = [a + b > 0.0 and b - a > 1.1 * FLANGE for a, b in pairwise(ordered)]
        return ticks(ordered, [self.size * (REAR_SIZE if one else 1.0) for one in rear])

    def across(self, breaks: Sequence[float]) -> Reals:
        """Ticks along y outside the side members."""
        return ticks(breaks, self.size)

    def side_y(self, sign: int) -> Reals:
        """Ticks across a side member."""
        return ticks([sign * y for y in SIDE_Y], ACROSS_SIZE[sign] * self.aspect * self.size)

    def holes(self, sign: int, spans: Sequence[tuple[float, float]], radius: float) -> list[Hole]:
        """Holes in the middle of spans of a side member."""
        return [Hole(self.along(span), self.side_y(sign), radius) for span in spans]

    def bolts(self, sign: int, end: str) -> list[Hole]:
        """The places of the two bolts of a bracket, as wide as the washers."""
        a, b, c = BRACKET_X[end]
        return self.holes(sign, [(a, b), (b, c)], BOLT_RADII[1])

    def bushing(self, sign: int, end: str) -> Hole:
        """The hole that a bushing fills."""
        return self.holes(sign, [BUSHING_X[end]], BUSHING_RADII[2])[0]

    def patches(self) -> Iterator[Patch]:
        """Every patch of the structure."""
        for name, sign in SIDES.items():
            yield from side_member(self, name, sign)
            for end in BRACKET_X:
                yield from bracket(self, sign, end)
            for end in BUSHING_X:
                yield from bushing(self, sign, end)
        for cross in CROSSES:
            yield from cross_member(self, cross)


def side_member(draw: Drawing, name: str, sign: int) -> Iterator[Patch]:
    """Box with end plates, holes for bushings (both plates) and bolts (top), and flanges."""
    group = f"side {name}"
    x, inner, outer = draw.along(STATIONS), sign * SIDE_Y[0], sign * SIDE_Y[1]
    for half, z in zip(("lower", "upper"), draw.z, strict=True):
        yield sheet(f"{group} {half}", x, outer, z, sign)
        yield sheet(f"{group} {half}", x, inner, z, -sign)
        yield sheet(f"{group} {half}", x[0], draw.side_y(sign), z, -1)
        yield sheet(f"{group} {half}", x[-1], draw.side_y(sign), z, 1)
    bushings = [draw.bushing(sign, end) for end in BUSHING_X]
    bolts = [hole for end in BRACKET_X for hole in draw.bolts(sign, end)]
    yield from _plate(draw, f"{group} lower", sign, -HALF_HEIGHT, bushings)
    yield from _plate(draw, f"{group} upper", sign, HALF_HEIGHT, bushings + bolts)
    yield from (washer(f"{group} upper", hole, BOLT_RADII[0], HALF_HEIGHT) for hole in bolts)
    yield sheet("side flanges", x, draw.across((outer, outer + sign * FLANGE)), 0.0)
    yield from _inner_flange(draw, inner, sign)


def _plate(draw: Drawing, group: str, sign: int, z: float, holes: list[Hole]) -> Iterator[Patch]:
    """Top or bottom of a side member: around holes by rings, between them by rows."""
    outward = 1 if z > 0 else -1
    yield from (holed_sheet(group, hole, z, outward) for hole in holes)
    taken = {hole.x[0] for hole in holes}
    for a, b in pairwise(STATIONS):
        if a not in taken:
            yield sheet(group, draw.along((a, b)), draw.side_y(sign), z, outward)


def _inner_flange(draw: Drawing, inner: float, sign: int) -> Iterator[Patch]:
    y = draw.across((inner, inner - sign * FLANGE))
    edges = [STATIONS[0], *(x for cross in CROSSES for x in (cross.x[0], cross.x[-1])), STATIONS[-1]]
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        yield sheet("side flanges", draw.along([x for x in STATIONS if a <= x <= b]), y, 0.0)


def cross_member(draw: Drawing, cross: Cross) -> Iterator[Patch]:
    """Box between the side members' webs, with flanges and gussets."""
    group = f"cross {cross.name}"
    x, y = draw.along(cross.x), draw.across(cross.y)
    for half, z, sign in zip(("lower", "upper"), draw.z, (-1, 1), strict=True):
        yield sheet(f"{group} {half}", cross.x[0], y, z, -1)
        yield sheet(f"{group} {half}", cross.x[-1], y, z, 1)
        yield sheet(f"{group} {half}", x, y, sign * HALF_HEIGHT, sign)
    free = draw.across([y for y in cross.y if abs(y) < SIDE_Y[0]])
    for edge, sign in ((cross.x[0], -1), (cross.x[-1], 1)):
        if cross.gusset in (0, sign):
            yield sheet("cross flanges", draw.along((edge, edge + sign * FLANGE)), free, 0.0)
    if cross.gusset:
        yield from _gussets(draw, cross)


def _gussets(draw: Drawing, cross: Cross) -> Iterator[Patch]:
    start = (cross.x[-1] if cross.gusset > 0 else cross.x[0]) + cross.gusset * FLANGE
    x = draw.along((start, start + cross.gusset * FLANGE))[:: cross.gusset]
    for sign in SIDES.values():
        outer = sign * (SIDE_Y[0] - FLANGE)
        y = draw.across((outer, outer - sign * FLANGE))[::-sign]
        yield from triangle_sheet("gussets", x, y, 0.0)


def bracket(draw: Drawing, sign: int, end: str) -> Iterator[Patch]:
    """A bolted bracket: base plate with two holes, an upright wall on the outer edge and two triangular ribs."""
    group, foot = f"brackets {end}", HALF_HEIGHT + BRACKET_GAP
    x, y = draw.along(BRACKET_X[end]), draw.side_y(sign)
    for hole in draw.bolts(sign, end):
        yield from (holed_sheet(group, hole, foot), washer(group, hole, BOLT_RADII[0], foot))
    z = np.linspace(foot, foot + BRACKET_HEIGHT, len(y))
    yield sheet(group, x, sign * SIDE_Y[1], z, sign)
    from_wall = y[::-sign]
    yield from triangle_sheet(group, x[0], from_wall, z, -1)
    yield from triangle_sheet(group, x[-1], from_wall, z, 1)


def bushing(draw: Drawing, sign: int, end: str) -> Iterator[Patch]:
    """Outer sleeve of shells, and inside it rubber and the inner sleeve of solids."""
    hole = draw.bushing(sign, end)
    z = draw.bushing_z
    bore, inner, outer = BUSHING_RADII
    yield tube("outer sleeves", hole.ring(outer), z)
    if draw.solids:
        for group, radii in ((f"rubber {end}", (inner, outer)), ("inner sleeves", (bore, inner))):
            yield solid_ring(group, np.array([hole.ring(r) for r in ticks(radii, draw.size)]), z)


def mount_points(draw: Drawing, sign: int, end: str) -> Reals:
    """What the middle of a bushing holds: the bore of the inner sleeve, without solids the outer sleeve."""
    hole, z = draw.bushing(sign, end), draw.bushing_z
    ring = hole.ring(BUSHING_RADII[0] if draw.solids else BUSHING_RADII[2])
    return np.concatenate([lifted(ring, height) for height in z])


def bolt_points(hole: Hole) -> Reals:
    """What a bolt joins: edge of the hole and of the washer, in the member and in the bracket."""
    sheets = (HALF_HEIGHT, HALF_HEIGHT + BRACKET_GAP)
    return np.concatenate([lifted(hole.ring(radius), z) for z in sheets for radius in BOLT_RADII])


def stiffener_points(draw: Drawing, cross: Cross) -> Reals:
    """The middle line of a cross member's bottom plate."""
    y = draw.across(cross.y)
    return np.column_stack([np.full(len(y), cross.x[1]), y, np.full(len(y), -HALF_HEIGHT)])


def sensor_places() -> dict[str, Reals]:
    """Places by name where accelerometers can sit: corners of the drawing, which every mesh has."""
    places: dict[str, Reals] = {}
    for name, sign in SIDES.items():
        lines = {
            "outer": (SIDE_Y[1], -HALF_HEIGHT),
            "inner": (SIDE_Y[0], HALF_HEIGHT),
            "rim": (SIDE_Y[1] + FLANGE, 0.0),
        }
        for line, (y, z) in lines.items():
            places |= {f"{name} {line} {x:+.3f}": np.array([x, sign * y, z]) for x in STATIONS}
    for cross in CROSSES:
        lines = {"front": (cross.x[0], HALF_HEIGHT), "rear": (cross.x[-1], -HALF_HEIGHT)}
        for line, (x, z) in lines.items():
            places |= {f"cross {cross.name} {line} {y:+.3f}": np.array([x, y, z]) for y in cross.y[1:-1]}
    for name, sign in SIDES.items():
        for end, (a, *_, b) in BRACKET_X.items():
            top = HALF_HEIGHT + BRACKET_GAP + BRACKET_HEIGHT
            places |= {f"bracket {name} {end} {x:+.3f}": np.array([x, sign * SIDE_Y[1], top]) for x in (a, b)}
    return places


def bend(points: Reals) -> Reals:
    """From the reference space to the vehicle: kicked-up ends, bowed sides, arched and tapered cross members.

    Ends and bushings only move as wholes, so that sleeves stay round.
    """
    x, y, z = points.T
    rise = _step((np.abs(x) - 0.12) / 0.28)
    middle = np.where(np.abs(y) < SIDE_Y[0], (1.0 - (y / SIDE_Y[0]) ** 2) ** 2, 0.0)
    height = (1.1 - 0.2 * rise) * (1.0 - 0.3 * middle)
    lift = 0.05 * rise + 0.02 * middle * (1.0 - 4.0 * (x + 0.35))
    return np.column_stack([x, y * (0.92 + 0.08 * rise), z * height + lift])


def _step(u: Reals) -> Reals:
    """From 0 to 1, flat at both ends."""
    inside = np.clip(u, 0.0, 1.0)
    return np.asarray(inside**2 * (3.0 - 2.0 * inside))


SENSORS = 60
SENSOR_MASS = 0.004
MOUNT_MASS, MOUNT_INERTIA = 2.6, 2.5e-3
FIRST_SENSOR, FIRST_BOLT, FIRST_MOUNT = 101, 201, 301
_FIRST_TIE, _FIRST_MASS = 9_000_001, 9_100_001
_GUESS, _ASPECTS = 0.02, (1.0, 1.15, 0.85)

MATERIALS = (
    Material(1, "steel of the side members", 2.10e11, 0.3, 7850.0),
    Material(2, "steel of the cross members", 2.07e11, 0.3, 7850.0),
    Material(3, "steel of brackets, gussets and sleeves", 2.05e11, 0.29, 7850.0),
    Material(4, "rubber of the front bushings", 6.0e6, 0.49, 1100.0, 0.15),
    Material(5, "rubber of the rear bushings", 9.0e6, 0.49, 1120.0, 0.12),
)
PROPERTIES = (
    Property(1, "side left lower", "PSHELL", 1, (2.2e-3,)),
    Property(2, "side left upper", "PSHELL", 1, (1.8e-3,)),
    Property(3, "side right lower", "PSHELL", 1, (2.2e-3,)),
    Property(4, "side right upper", "PSHELL", 1, (1.8e-3,)),
    Property(5, "cross front lower", "PSHELL", 2, (1.8e-3,)),
    Property(6, "cross front upper", "PSHELL", 2, (1.6e-3,)),
    Property(7, "cross middle lower", "PSHELL", 2, (1.6e-3,)),
    Property(8, "cross middle upper", "PSHELL", 2, (1.5e-3,)),
    Property(9, "cross rear lower", "PSHELL", 2, (1.8e-3,)),
    Property(10, "cross rear upper", "PSHELL", 2, (1.6e-3,)),
    Property(11, "side flanges", "PSHELL", 1, (3.6e-3,)),
    Property(12, "cross flanges", "PSHELL", 2, (3.0e-3,)),
    Property(13, "gussets", "PSHELL", 3, (3.0e-3,)),
    Property(14, "brackets front", "PSHELL", 3, (3.0e-3,)),
    Property(15, "brackets rear", "PSHELL", 3, (2.5e-3,)),
    Property(16, "outer sleeves", "PSHELL", 3, (2.5e-3,)),
    Property(17, "rubber front", "PSOLID", 4),
    Property(18, "rubber rear", "PSOLID", 5),
    Property(19, "inner sleeves", "PSOLID", 3),
    Property(20, "stiffeners", "PBAR", 3, (1.2e-4, 1.44e-9, 1.0e-9, 2.0e-9)),
)


@dataclass(frozen=True, eq=False)
class Subframe(MeshedStructure):
    """The structure with the numbers of its accelerometers, bolt nodes and mounts (middles of the bushings)."""

    sensors: tuple[int, ...] = ()
    bolts: tuple[int, ...] = ()
    mounts: tuple[int, ...] = ()


def subframe(n_dofs: int, solids: bool = True, seed: int = 0) -> Subframe:
    """A subframe of about `n_dofs` degrees of freedom (within some per cent), from 5,000 to 1,000,000.

    Parameters
    ----------
    solids : False leaves rubber and inner sleeves away; the mounts then hold the outer sleeves
    seed : of the first accelerometer's place; the others are put as far as possible from those before

    Raises
    ------
    FemtuneError : ``testing.mesh-size`` below some 5,000 degrees of freedom
    """
    builds = [partial(_at_size, solids=solids, seed=seed, aspect=aspect) for aspect in _ASPECTS]
    made = sized(builds, n_dofs, _GUESS * (40_000 / n_dofs) ** 0.5)
    assert isinstance(made, Subframe)
    return made


def write_subframe(structure: MeshedStructure, path: Path | str, boundary: str = "free") -> Path:
    """Write a Nastran deck of normal modes (SOL 103, 56 modes) in SI units; see `subframe_deck.write_structure`.

    Parameters
    ----------
    boundary : "free"; "held" holds the mounts; "loaded" puts a mass of 2.6 kg on each of them
    """
    mounts = structure.mounts if isinstance(structure, Subframe) else ()
    if boundary == "held":
        return write_structure(structure, path, held=mounts)
    if boundary == "loaded":
        return write_structure(structure, path, added=_mount_masses(structure, mounts))
    if boundary == "free":
        return write_structure(structure, path)
    raise ValueError(f'boundary is "free", "held" or "loaded", not {boundary!r}')


def subframe_study_parameters(solids: bool = True) -> tuple[FieldRef, ...]:
    """Twelve thicknesses and three moduli: steel of the sides and both rubbers, without solids the three steels."""
    thicknesses = [FieldRef("PSHELL", number, "T") for number in range(1, 13)]
    moduli = [FieldRef("MAT1", number, "E") for number in ((1, 4, 5) if solids else (1, 2, 3))]
    return (*thicknesses, *moduli)


def _at_size(size: float, solids: bool, seed: int, aspect: float = 1.0) -> Subframe:
    draw = Drawing(size, solids, aspect)
    mesh = weld([*draw.patches(), *_stiffeners(draw)])
    ties = _ties(draw, mesh)
    sensors = dict(zip(_sensor_rows(mesh, seed), range(FIRST_SENSOR, FIRST_SENSOR + SENSORS), strict=True))
    xyz = bend(mesh.points)
    xyz = np.concatenate([xyz, [xyz[tie.rows].mean(axis=0) for tie in ties]])
    named = {**sensors, **_tie_nodes(ties)}
    used = {name for name, _ in mesh.cells}
    properties = tuple(p for p in PROPERTIES if p.name in used)
    return Subframe(
        title="car subframe" + ("" if solids else " without the solids of its bushings"),
        node_ids=node_numbers(len(xyz), named),
        xyz=xyz,
        elements=element_batches(mesh, properties),
        properties=properties,
        materials=tuple(m for m in MATERIALS if m.id in {p.material for p in properties}),
        rigid=ties,
        masses=tuple(PointMass(_FIRST_MASS + i, "accelerometer", row, SENSOR_MASS) for i, row in enumerate(sensors)),
        sensors=tuple(sensors.values()),
        bolts=tuple(n for n in named.values() if FIRST_BOLT <= n < FIRST_MOUNT),
        mounts=tuple(n for n in named.values() if n >= FIRST_MOUNT),
    )


def _stiffeners(draw: Drawing) -> list[Patch]:
    lines = [stiffener_points(draw, cross) for cross in CROSSES if cross.gusset]
    return [Patch("stiffeners", p, np.stack([np.arange(len(p) - 1), np.arange(1, len(p))], axis=-1)) for p in lines]


def _ties(draw: Drawing, mesh: Weld) -> tuple[RigidTie, ...]:
    """Bolts, then mounts; their middle nodes follow the nodes of the mesh."""
    bolts = [hole for sign in SIDES.values() for end in BRACKET_X for hole in draw.bolts(sign, end)]
    rims = [("bolt", bolt_points(hole), "123456") for hole in bolts]
    grip = "123" if draw.solids else "123456"
    rims += [("mount", mount_points(draw, sign, end), grip) for sign in SIDES.values() for end in BUSHING_X]
    return tuple(
        RigidTie(_FIRST_TIE + i, name, len(mesh.points) + i, mesh.rows(points), components)
        for i, (name, points, components) in enumerate(rims)
    )


def _tie_nodes(ties: tuple[RigidTie, ...]) -> dict[int, int]:
    first = {"bolt": FIRST_BOLT, "mount": FIRST_MOUNT}
    named: dict[int, int] = {}
    for tie in ties:
        named[tie.centre] = first[tie.name]
        first[tie.name] += 1
    return named


def _sensor_rows(mesh: Weld, seed: int) -> list[int]:
    """Rows of the nodes under the accelerometers, each as far as possible from those before."""
    places = np.array(list(sensor_places().values()))
    chosen = [int(np.random.default_rng(seed).integers(len(places)))]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < SENSORS:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return [int(row) for row in mesh.rows(places[chosen])]


def _mount_masses(structure: MeshedStructure, mounts: tuple[int, ...]) -> tuple[PointMass, ...]:
    rows = np.flatnonzero(np.isin(structure.node_ids, mounts))
    start = _FIRST_MASS + SENSORS
    return tuple(PointMass(start + i, "mass on mount", int(r), MOUNT_MASS, MOUNT_INERTIA) for i, r in enumerate(rows))


def main(arguments: list[str]) -> int:
    """Write the deck of a subframe: number of degrees of freedom, path, and "shells" to leave the solids away."""
    if len(arguments) not in (2, 3) or not arguments[0].isdigit():
        print("usage: python -m structures.subframe <degrees of freedom> <deck> [shells]", file=sys.stderr)
        return 2
    made = subframe(int(arguments[0]), solids="shells" not in arguments[2:])
    print(f"{write_subframe(made, arguments[1])}: {made.n_dofs} degrees of freedom, {len(made.xyz)} grids")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))


# ----------------------------------------------------------------------------------------------------
# Figures of a generated mesh: mass, distortion of its elements, nodes that are free or double.


_NEXT = {3: (1, 2, 0), 4: (1, 2, 3, 0)}
# neighbours of each corner of a hexahedron, right-handed
_CORNER = np.array([[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]])
_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])


@dataclass(frozen=True)
class MeshQuality:
    """The worst of each.

    Parameters
    ----------
    mass : kg, of elements and point masses
    aspect : longest edge over shortest edge of an element
    warp : distance of a quadrilateral's corners from its mean plane over its mean edge
    skew_deg : departure of a shell's corner from 90° (quadrilateral) or 60° (triangle)
    jacobian : smallest over largest corner volume of a hexahedron; 0 or less is collapsed or inverted
    unused_nodes : nodes that neither an element nor a rigid tie uses
    nearest : m, smallest distance of two nodes
    """

    mass: float
    aspect: float
    warp: float
    skew_deg: float
    jacobian: float
    unused_nodes: int
    nearest: float


def mesh_quality(structure: MeshedStructure) -> MeshQuality:
    """Measure a mesh."""
    x = structure.xyz
    shells = [b for b in structure.elements if b.card in ("CQUAD4", "CTRIA3")]
    quads = [b for b in shells if b.card == "CQUAD4"]
    solids = [b for b in structure.elements if b.card == "CHEXA"]
    return MeshQuality(
        mass=sum(batch_masses(structure)) + sum(m.mass for m in structure.masses),
        aspect=max(float(aspect_ratios(x, b).max()) for b in shells + solids),
        warp=max((float(warps(x, b).max()) for b in quads), default=0.0),
        skew_deg=max((float(skews_deg(x, b).max()) for b in shells), default=0.0),
        jacobian=min((float(corner_ratios(x, b).min()) for b in solids), default=1.0),
        unused_nodes=len(x) - len(_used(structure)),
        nearest=_nearest(structure),
    )


def batch_masses(structure: MeshedStructure) -> list[float]:
    """Mass of each batch of elements in kg, without what the point masses add."""
    properties = {p.id: p for p in structure.properties}
    densities = {m.id: m.rho for m in structure.materials}
    out = []
    for batch in structure.elements:
        entry = properties[batch.property]
        section = entry.values[0] if entry.values else 1.0
        out.append(densities[entry.material] * section * float(extents(structure.xyz, batch).sum()))
    return out


def extents(xyz: Reals, batch: Elements) -> Reals:
    """(e,) lengths, areas or volumes; a hexahedron counts as the mean of its corner volumes' trilinear integral."""
    p = xyz[batch.rows]
    if batch.card == "CBAR":
        return np.asarray(np.linalg.norm(p[:, 1] - p[:, 0], axis=1))
    if batch.card == "CHEXA":
        return _hexahedron_volumes(p)
    diagonals = (p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) if p.shape[1] == 3 else (p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    return np.asarray(np.linalg.norm(np.cross(*diagonals), axis=1) / 2.0)


def _hexahedron_volumes(p: Reals) -> Reals:
    """By the divergence theorem: flux of x/3 through two triangles on each side of every diagonal, in the mean."""
    faces = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
    a, b, c, d = (p[:, faces[:, i]] - p[:, :1] for i in range(4))
    triangles = ((a, b, c), (a, c, d), (a, b, d), (b, c, d))
    flux = sum(np.einsum("efi,efi->e", one, np.cross(two, three)) for one, two, three in triangles)
    return np.asarray(flux / 12.0)


def aspect_ratios(xyz: Reals, batch: Elements) -> Reals:
    """(e,) longest over shortest edge."""
    k = batch.rows.shape[1]
    edges = _EDGES if k == 8 else np.array([range(k), _NEXT[k]]).T
    p = xyz[batch.rows]
    length = np.linalg.norm(p[:, edges[:, 0]] - p[:, edges[:, 1]], axis=2)
    return np.asarray(length.max(axis=1) / length.min(axis=1))


def warps(xyz: Reals, batch: Elements) -> Reals:
    """(e,) distance of the corners from the mean plane over the mean edge."""
    p = xyz[batch.rows]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.abs(np.einsum("ei,ei->e", p[:, 1] - p[:, 0] + p[:, 3] - p[:, 2], normal)) / 4.0
    edge = np.linalg.norm(p[:, [1, 2, 3, 0]] - p, axis=2).mean(axis=1)
    return np.asarray(height / edge)


def skews_deg(xyz: Reals, batch: Elements) -> Reals:
    """(e,) largest departure of a corner's angle from that of the regular element."""
    p, k = xyz[batch.rows], batch.rows.shape[1]
    ahead = p[:, list(_NEXT[k])] - p
    behind = -np.roll(ahead, 1, axis=1)
    cosine = np.einsum("eki,eki->ek", ahead, behind)
    cosine /= np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return np.asarray(np.abs(angle - (60.0 if k == 3 else 90.0)).max(axis=1))


def corner_ratios(xyz: Reals, batch: Elements) -> Reals:
    """(e,) smallest over largest of the eight corner volumes of hexahedra."""
    p = xyz[batch.rows]
    edges = p[:, _CORNER] - p[:, :, None]
    volume = np.einsum("eki,eki->ek", np.cross(edges[:, :, 0], edges[:, :, 1]), edges[:, :, 2])
    return np.asarray(volume.min(axis=1) / np.abs(volume).max(axis=1))


def _used(structure: MeshedStructure) -> NDArray[np.int64]:
    parts = [b.rows.ravel() for b in structure.elements] + [tie.rows for tie in structure.rigid]
    return np.unique(np.concatenate([*parts, [tie.centre for tie in structure.rigid]]).astype(np.int64))


def _nearest(structure: MeshedStructure) -> float:
    """Middle nodes of ties may sit anywhere; all others are compared."""
    own = np.delete(structure.xyz, [tie.centre for tie in structure.rigid], axis=0)
    return float(cKDTree(own).query(own, k=2)[0][:, 1].min())
