"""The drawing of the subframe: members, flanges, gussets, brackets and bushings in the reference space, in metres.

x runs along the vehicle, y to the left, z up. Members are closed boxes of two half shells that meet at z = 0, where
flanges stand out. `bend` turns the straight boxes into curved members of varying height.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from femtune.testing.subframe_patches import (
    Hole,
    Patch,
    holed_sheet,
    lifted,
    sheet,
    solid_ring,
    ticks,
    triangle_sheet,
    tube,
    washer,
)

Reals = NDArray[np.float64]

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
