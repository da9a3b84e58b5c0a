"""Dimensions of the rack in m, and what all of its models share.

Four posts of 30 × 30 × 3 mm aluminium tube, with beams of the same tube along x and y at three levels. Steel blocks
connect them at the twelve corners. Steel panels fill the back of both bays (5 mm), and the
two lower levels (boards of 6 mm).
"""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

SIDE, WALL, BOARD, SHEET = 0.030, 0.003, 0.006, 0.005
HALF = SIDE / 2
X, Y, Z = (0.015, 0.585), (0.015, 0.435), (0.015, 0.55, 0.985)
"""Coordinates of the axes of the tubes."""
CONNECTED = 0.08
"""Length of the connected part of a beam beside a block, and width of the edge of a panel beside a beam."""
BACK, BOARDS = Y[1], Z[:2]
"""Plane of the panels of the back, and those of the boards."""
BEAM, STEEL, JOINED, EDGE = 1, 2, 3, 4
"""Numbers of materials: tubes, blocks and panels, connected parts of the tubes, edges of the panels."""
NOMINAL = {"E1": 70.0e9, "E2": 210.0e9, "E3": 70.0e9, "E4": 210.0e9, "D1": 2700.0, "D2": 7850.0}
"""Moduli of tubes, steel, connected parts and edges of panels, densities of aluminium and steel."""
FIELDS = {"E1": ("MAT1 1 E",), "E2": ("MAT1 2 E",), "E3": ("MAT1 3 E",), "E4": ("MAT1 4 E",),
          "D1": ("MAT1 1 RHO", "MAT1 3 RHO"), "D2": ("MAT1 2 RHO", "MAT1 4 RHO")}  # fmt: skip
MATERIALS = {BEAM: ("BEAM", "E1", "D1"), STEEL: ("STEEL", "E2", "D2"), JOINED: ("JOINED", "E3", "D1"),
             EDGE: ("EDGE", "E4", "D2")}  # fmt: skip
"""By number of a material: its name, its modulus and its density."""
POISSON = {BEAM: 0.33, STEEL: 0.3, JOINED: 0.33, EDGE: 0.3}
Point = tuple[float, float, float]


def stations(first: float, last: float, divided: int = 1) -> list[float]:
    """Along a beam between the centres of two blocks: faces of the blocks, connected parts, and between them."""
    a, b = first + HALF + CONNECTED, last - HALF - CONNECTED
    inner = np.linspace(a, b, divided * 2 * round((b - a) / 0.12) + 1).tolist()
    near = [first + HALF + CONNECTED * i / (2 * divided) for i in range(2 * divided)]
    return [round(s, 6) for s in (first, *near, *inner, *(first + last - s for s in near[::-1]), last)]


def at_edge(at: tuple[float, float], ends: tuple[tuple[float, ...], tuple[float, ...]]) -> bool:
    """Whether a place in the plane of a panel lies beside a beam, whose axes are at `ends` in both directions."""
    return any(abs(c - a) < HALF + CONNECTED for c, axes in zip(at, ends) for a in axes)


def beams() -> list[tuple[Point, Point]]:
    """Ends of all beams, at the centres of the blocks."""
    posts = [((x, y, a), (x, y, b)) for x in X for y in Y for a, b in pairwise(Z)]
    across = [((X[0], y, z), (X[1], y, z)) for y in Y for z in Z]
    return [*posts, *across, *(((x, Y[0], z), (x, Y[1], z)) for x in X for z in Z)]


def blocks() -> list[Point]:
    """Centres of the blocks."""
    return list(product(X, Y, Z))


def feet() -> list[Point]:
    """Centres of the blocks on the table."""
    return list(product(X, Y, Z[:1]))


def outer(place: Point) -> Point:
    """The outer corner or edge of the rack beside a point on the axis of a tube."""
    return tuple(
        round(p + (HALF if p == ends[-1] else -HALF), 6) if p in (ends[0], ends[-1]) else p
        for p, ends in zip(place, (X, Y, Z))
    )  # type: ignore[return-value]


def sensors() -> dict[int, tuple[Point, Point]]:
    """Sensors by number: the point on the axis of a tube or in a panel, and the place on the surface beside it."""
    middle = [(x, y, round(0.5 * (a + b), 6)) for x in X for y in Y for a, b in pairwise(Z)]
    middle += [(0.5 * sum(X), Y[0], z) for z in Z] + [(0.5 * sum(X), Y[1], Z[2])]
    on_axes = [(point, outer(point)) for point in (*blocks(), *middle)]
    panels: list[Point] = [(0.5 * sum(X), 0.5 * sum(Y), z) for z in BOARDS]
    panels += [(0.5 * sum(X), BACK, round(0.5 * (a + b), 6)) for a, b in pairwise(Z)]
    return {901 + i: pair for i, pair in enumerate([*on_axes, *((p, p) for p in panels)])}
