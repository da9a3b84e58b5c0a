"""Solid sections: BAR, HEXA, CROSS, H.

A cross and an H resist torsion as rows of walls. Shear factors: 5/6 of the part that stands in the direction of the
shear; a bar across the shear of a CROSS carries none of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from femtune.files.nastran.sections.shape import Properties, Rectangle, Shape, composite, symmetric
from femtune.files.nastran.sections.torsion import rectangle_torsion, thin_walls

SHEAR = 5 / 6


def _bar(w: Any, h: Any) -> Properties:
    return symmetric(w * h, w * h**3 / 12, h * w**3 / 12, rectangle_torsion(w, h), SHEAR, SHEAR)


def _hexagon(wedge: Any, w: Any, h: Any) -> Properties:
    """A rectangle between two triangles of length `wedge`; torsion by Saint-Venant's A⁴/40 Iₚ for compact sections."""
    inner = w - 2.0 * wedge
    I1 = inner * h**3 / 12.0 + wedge * h**3 / 24.0
    # two triangles with their centroids a third of their length beyond the rectangle
    away = inner / 2.0 + wedge / 3.0
    I2 = h * inner**3 / 12.0 + h * wedge**3 / 18.0 + h * wedge * away**2
    area = h * (w - wedge)
    return symmetric(area, I1, I2, area**4 / (40.0 * (I1 + I2)), SHEAR, SHEAR)


def _cross(arms: Any, upright: Any, h: Any, level: Any) -> Properties:
    """`arms` is the length of both arms beyond the upright, `upright` and `level` are thicknesses."""
    arm = arms / 2.0
    zero, away = 0.0 * h, (upright + arm) / 2.0
    parts = [Rectangle(zero, zero, h, upright), Rectangle(zero, away, level, arm), Rectangle(zero, -away, level, arm)]
    across = level * (arms + upright)
    return composite(parts, thin_walls((h, upright), (arms, level)), SHEAR * h * upright, SHEAR * across)


def _h(inner: Any, sides: Any, h: Any, level: Any) -> Properties:
    """Two uprights of half of `sides` each, a bar of length `inner` and thickness `level` between them."""
    side = sides / 2.0
    zero, away = 0.0 * h, (inner + side) / 2.0
    parts = [Rectangle(zero, away, h, side), Rectangle(zero, -away, h, side), Rectangle(zero, zero, level, inner)]
    torsion = thin_walls((h, side), (h, side), (inner + side, level))
    return composite(parts, torsion, SHEAR * h * sides, level * (inner + side))


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
