"""Closed sections: BOX, BOX1.

Torsion after Bredt; shear factors and shear centres by thin-wall theory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from femtune.files.nastran.sections.shape import Properties, Rectangle, Shape, composite, symmetric, total
from femtune.files.nastran.sections.shear import shear_areas
from femtune.files.nastran.sections.torsion import box_torsion, closed_cell

Walls = tuple[tuple[Any, Any], ...]


def _box(w: Any, h: Any, t: Any, s: Any) -> Properties:
    inner_w, inner_h = w - 2.0 * s, h - 2.0 * t
    area = w * h - inner_w * inner_h
    I1, I2 = (w * h**3 - inner_w * inner_h**3) / 12.0, (h * w**3 - inner_h * inner_w**3) / 12.0
    upright, level = _ring(w - s, h - t, t, t, s, s)
    return symmetric(area, I1, I2, box_torsion(w, h, t, s), upright / area, level / area)


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
    torsion = closed_cell(b * c, (b, top), (b, bottom), (c, left), (c, right))
    y, z = cell_shear_centre(b, c, bottom, top, left, right)
    centre = bottom / 2.0 + y, left / 2.0 + z
    return composite(parts, torsion, *_ring(b, c, bottom, top, left, right), centre)


def _ring(b: Any, c: Any, low: Any, high: Any, left: Any, right: Any) -> tuple[Any, Any]:
    """Areas that carry a shear along y and along z: middle lines b wide and c high."""
    zero = 0.0 * b
    points = {"a": (zero, zero), "b": (zero, b), "c": (c, b), "d": (c, zero)}
    return shear_areas(
        points, [("a", "b", b, low), ("b", "c", c, right), ("c", "d", b, high), ("d", "a", c, left)], True
    )


def cell_shear_centre(b: Any, c: Any, low: Any, high: Any, left: Any, right: Any) -> tuple[Any, Any]:
    """Shear centre (y, z) of a box seen from the corner of its low and left middle lines, by thin-wall theory.

    Middle lines b wide and c high. A shear V flows as q = −V (S + closing) around the cell, with S = ∫ (bending) t ds
    and ∮ q/t ds = 0; it acts where its moment about the corner is that of q.
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
