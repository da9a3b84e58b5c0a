"""Closed sections: BOX, BOX1.

Torsion by Bredt's formula, with a contribution of the corners; shear centres by thin-wall theory. The shear factors
are the area of the walls along the force, between the other two walls, over the whole area: a commercial program lists
0.117647 and 0.852941 for a box of 6 × 1 with walls of 0.1. Cowper's factors are lower (0.138 instead of 0.245 for a
force along the short side of a box of 0.6 × 0.2 with walls of 0.0025).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from femtune.files.nastran.sections.shape import (
    Properties,
    Rectangle,
    Shape,
    composite,
    symmetric,
    total,
)
from femtune.files.nastran.sections.torsion import arm, box_torsion, crossing, rectangle_torsion, tee, wall

Walls = tuple[tuple[Any, Any], ...]


def _box(w: Any, h: Any, t: Any, s: Any) -> Properties:
    inner_w, inner_h = w - 2.0 * s, h - 2.0 * t
    area = w * h - inner_w * inner_h
    I1, I2 = (w * h**3 - inner_w * inner_h**3) / 12.0, (h * w**3 - inner_h * inner_w**3) / 12.0
    torsion = box_torsion(inner_w, inner_h, t, t, s, s)
    return symmetric(area, I1, I2, torsion, 2.0 * inner_h * s / area, 2.0 * inner_w * t / area)


def _box1(w: Any, h: Any, top: Any, bottom: Any, right: Any, left: Any) -> Properties:
    """A box with four different walls; y and z from its lower left corner."""
    inner = w - left - right
    middle = left + inner / 2.0
    parts = [
        Rectangle(h / 2.0, left / 2.0, h, left),
        Rectangle(h / 2.0, w - right / 2.0, h, right),
        Rectangle(bottom / 2.0, middle, bottom, inner),
        Rectangle(h - top / 2.0, middle, top, inner),
    ]
    b, c = w - (left + right) / 2.0, h - (top + bottom) / 2.0
    clear = h - top - bottom
    torsion = box_torsion(inner, clear, bottom, top, left, right)
    y, z = cell_shear_centre(b, c, bottom, top, left, right)
    centre = bottom / 2.0 + y, left / 2.0 + z
    return composite(parts, torsion, clear * (left + right), inner * (bottom + top), centre)


def cell_shear_centre(b: Any, c: Any, low: Any, high: Any, left: Any, right: Any) -> tuple[Any, Any]:
    """Shear centre (y, z) of a box seen from the corner of its low and left middle lines, by thin-wall theory.

    The middle lines are b wide and c high. The shear flow is q = −V (S + closing) around the cell, with S = ∫ (bending)
    t ds and ∮ q/t ds = 0; V acts at the point where its moment about the corner is that of q.
    """
    walls = ((b, low), (c, right), (b, high), (c, left))
    area = total([length * t for length, t in walls])
    y, z = (b * high * c + c * (left + right) * c / 2.0) / area, (c * right * b + b * (low + high) * b / 2.0) / area
    corners_y, corners_z = (-y, -y, c - y, c - y), (-z, b - z, b - z, -z)
    by_y, by_z = (_flow_moment(walls, corners, b, c) for corners in (corners_y, corners_z))
    I1, I2, I12 = (
        _product(walls, f, g)
        for f, g in ((corners_y, corners_y), (corners_z, corners_z), (corners_y, corners_z))
    )  # fmt: skip
    determinant = I1 * I2 - I12 * I12
    return (I1 * by_z - I12 * by_y) / determinant, -(I2 * by_y - I12 * by_z) / determinant


def _flow_moment(walls: Walls, corners: Sequence[Any], b: Any, c: Any) -> Any:
    """Moment about the first corner of the flow S + closing, S = ∫ f t ds with f linear between the corners."""
    start, flows = 0.0 * b, []
    for i, (length, t) in enumerate(walls):
        f, g = corners[i], corners[(i + 1) % 4]
        flows.append(start * length + t * length**2 * (2.0 * f + g) / 6.0)
        start = start + t * length * (f + g) / 2.0
    around = total([length / t for length, t in walls])
    closing = -total([flow / t for flow, (_, t) in zip(flows, walls)]) / around
    return b * (flows[1] + closing * c) + c * (flows[2] + closing * b)


def _product(walls: Walls, f: Sequence[Any], g: Sequence[Any]) -> Any:
    """∫ f g t ds around the cell, f and g linear between the corners."""
    pairs = [(f[i], f[(i + 1) % 4], g[i], g[(i + 1) % 4]) for i in range(4)]
    return total([L * t * (2.0 * (p * r + q * s) + p * s + q * r) / 6.0 for (L, t), (p, q, r, s) in zip(walls, pairs)])


BOX_SHAPES: Mapping[str, Shape] = {
    "BOX": Shape(
        4,
        _box,
        lambda w, h, t, s: w > 2 * s > 0 and h > 2 * t > 0,
        "walls DIM3 and DIM4 should be positive and thinner than half of height DIM2 and width DIM1",
    ),
    "BOX1": Shape(
        6,
        _box1,
        lambda w, h, top, bottom, right, left: (
            min(top, bottom, right, left) > 0 and h > top + bottom and w > right + left
        ),
        "walls DIM3 to DIM6 should be positive, DIM3 + DIM4 less than the height DIM2, DIM5 + DIM6 than the width DIM1",
    ),
}


# ----------------------------------------------------------------------------------------------------
# Solid sections: BAR, HEXA, CROSS, H.
#
# Torsion of a cross and an H: arms and their junctions. Shear factors: 5/6 of the part in the direction of the shear;
# the transverse bar of a CROSS carries none.


RECTANGLE_SHEAR_FACTOR = 5 / 6
"""Shear factor of a rectangle: parabolic shear stress, ν = 0 (Cowper 1966)."""


def _bar(w: Any, h: Any) -> Properties:
    return symmetric(
        w * h, w * h**3 / 12, h * w**3 / 12, rectangle_torsion(w, h), RECTANGLE_SHEAR_FACTOR, RECTANGLE_SHEAR_FACTOR
    )


def _hexagon(wedge: Any, w: Any, h: Any) -> Properties:
    """A rectangle between two triangles of length `wedge`; torsion by Saint-Venant's A⁴/40 Iₚ for compact sections."""
    inner = w - 2.0 * wedge
    I1 = inner * h**3 / 12.0 + wedge * h**3 / 24.0
    # two triangles with their centroids a third of their length beyond the rectangle
    away = inner / 2.0 + wedge / 3.0
    I2 = h * inner**3 / 12.0 + h * wedge**3 / 18.0 + h * wedge * away**2
    area = h * (w - wedge)
    return symmetric(area, I1, I2, area**4 / (40.0 * (I1 + I2)), RECTANGLE_SHEAR_FACTOR, RECTANGLE_SHEAR_FACTOR)


def _cross(arms: Any, upright: Any, h: Any, level: Any) -> Properties:
    """`arms` is the length of both arms beyond the upright, `upright` and `level` are thicknesses."""
    arm_length = arms / 2.0
    zero, away = 0.0 * h, (upright + arm_length) / 2.0
    sides = (Rectangle(zero, z, level, arm_length) for z in (away, -away))
    parts = [Rectangle(zero, zero, h, upright), *sides]
    across = level * (arms + upright)
    torsion = 2.0 * (arm((h - level) / 2.0, upright) + arm(arm_length, level)) + crossing(upright, level)
    return composite(parts, torsion, RECTANGLE_SHEAR_FACTOR * h * upright, RECTANGLE_SHEAR_FACTOR * across)


def _h(inner: Any, sides: Any, h: Any, level: Any) -> Properties:
    """Two uprights with half of `sides` each, and a bar of length `inner` and thickness `level` between them."""
    side = sides / 2.0
    zero, away = 0.0 * h, (inner + side) / 2.0
    parts = [Rectangle(zero, away, h, side), Rectangle(zero, -away, h, side), Rectangle(zero, zero, level, inner)]
    torsion = 4.0 * arm((h - level) / 2.0, side) + wall(inner, level) + 2.0 * tee(level, side)
    return composite(parts, torsion, RECTANGLE_SHEAR_FACTOR * h * sides, level * (inner + side))


SOLID_SHAPES: Mapping[str, Shape] = {
    "BAR": Shape(2, _bar, lambda w, h: w > 0 and h > 0, "width DIM1 and height DIM2 should be positive"),
    "HEXA": Shape(
        3,
        _hexagon,
        lambda wedge, w, h: wedge > 0 and h > 0 and w > 2 * wedge,
        "dimensions should be positive, and the width DIM2 greater than the two wedges 2 DIM1",
    ),
    "CROSS": Shape(
        4,
        _cross,
        lambda arms, upright, h, level: min(arms, upright, level) > 0 and h > level,
        "dimensions should be positive, and the height DIM3 greater than the thickness DIM4",
    ),
    "H": Shape(
        4,
        _h,
        lambda inner, sides, h, level: min(inner, sides, level) > 0 and h > level,
        "dimensions should be positive, and the height DIM3 greater than the thickness DIM4",
    ),
}


# ----------------------------------------------------------------------------------------------------
# Round sections: ROD, TUBE, TUBE2.
#
ROD_SHEAR_FACTOR = 0.9
"""Of a solid round section: it reproduces frequencies that commercial Nastran lists, to six digits."""
TUBE_SHEAR_FACTOR = 0.5
"""Of a thin tube (Cowper 1966, at ν = 0)."""


def _rod(r: Any) -> Properties:
    bending = math.pi / 4 * r**4
    return symmetric(math.pi * r**2, bending, bending, 2.0 * bending, ROD_SHEAR_FACTOR, ROD_SHEAR_FACTOR)


def _tube(outer: Any, inner: Any) -> Properties:
    bending = math.pi / 4 * (outer**4 - inner**4)
    return symmetric(
        math.pi * (outer**2 - inner**2), bending, bending, 2.0 * bending, TUBE_SHEAR_FACTOR, TUBE_SHEAR_FACTOR
    )


def _tube2(outer: Any, wall: Any) -> Properties:
    """A tube by its wall thickness."""
    return _tube(outer, outer - wall)


ROUND_SHAPES: Mapping[str, Shape] = {
    "ROD": Shape(1, _rod, lambda r: r > 0, "the radius DIM1 should be positive"),
    "TUBE": Shape(
        2,
        _tube,
        lambda outer, inner: outer > inner >= 0,
        "the outer radius DIM1 should be greater than the inner radius DIM2",
    ),
    "TUBE2": Shape(
        2,
        _tube2,
        lambda outer, wall: outer >= wall > 0,
        "the wall DIM2 should be positive and no thicker than the outer radius DIM1",
    ),
}
