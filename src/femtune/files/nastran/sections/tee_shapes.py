"""Open sections of two walls: T, T1, T2, L.

Torsion as thin walls over their middle lines, shear factors by thin-wall theory; the shear centre is where the middle
lines meet, since the shear flows of all walls pass through it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from femtune.files.nastran.sections.shape import Properties, Rectangle, Shape, composite
from femtune.files.nastran.sections.shear import shear_areas
from femtune.files.nastran.sections.torsion import thin_walls


def _t(w: Any, h: Any, flange: Any, web: Any, up: float = 1.0) -> Properties:
    """Flange at the top (up = 1) or at the bottom (up = −1); y from the flange's middle line."""
    zero, stem = 0.0 * h, h - flange
    parts = [Rectangle(zero, zero, flange, w), Rectangle(-up * h / 2.0, zero, stem, web)]
    torsion = thin_walls((w, flange), (h - flange / 2.0, web))
    points = {"left": (zero, -w / 2.0), "right": (zero, w / 2.0), "joint": (zero, zero),
              "foot": (-up * (h - flange / 2.0), zero)}  # fmt: skip
    walls = [("left", "joint", w / 2.0, flange), ("right", "joint", w / 2.0, flange),
             ("joint", "foot", h - flange / 2.0, web)]  # fmt: skip
    upright, level = shear_areas(points, walls)
    return composite(parts, torsion, upright, level, (zero, zero))


def _t1(h: Any, stem: Any, flange: Any, web: Any) -> Properties:
    """An upright flange at the right end of a level web: T2 with y and z exchanged, `stem` beyond the flange."""
    turned = _t(h, stem + flange, flange, web)
    swapped = {"I1": "I2", "I2": "I1", "K1": "K2", "K2": "K1", "N1": "N2", "N2": "N1"}
    return {role: turned[swapped.get(role, role)] for role in turned}


def _l(w: Any, h: Any, level: Any, upright: Any) -> Properties:
    """Corner at the lower left; y and z from where the middle lines meet."""
    zero, free = 0.0 * h, w - upright
    parts = [
        Rectangle((h - level) / 2.0, zero, h, upright),
        Rectangle(zero, w / 2.0, level, free),
    ]
    torsion = thin_walls((w - upright / 2.0, level), (h - level / 2.0, upright))
    across, along = w - upright / 2.0, h - level / 2.0
    points = {"right": (zero, across), "corner": (zero, zero), "top": (along, zero)}
    areas = shear_areas(points, [("right", "corner", across, level), ("corner", "top", along, upright)])
    return composite(parts, torsion, *areas, (zero, zero))


_RULE = "dimensions should be positive, the height DIM2 greater than DIM3 and the width DIM1 greater than DIM4"


def _two_walls(w: float, h: float, level: float, upright: float) -> bool:
    return min(level, upright) > 0 and h > level and w > upright


TEE_SHAPES: Mapping[str, Shape] = {
    "T": Shape(4, _t, _two_walls, _RULE),
    "T2": Shape(4, lambda w, h, flange, web: _t(w, h, flange, web, up=-1.0), _two_walls, _RULE),
    "T1": Shape(
        4,
        _t1,
        lambda h, stem, flange, web: min(stem, flange, web) > 0 and h > web,
        "dimensions should be positive, and the height DIM1 greater than the thickness DIM4",
    ),
    "L": Shape(4, _l, _two_walls, _RULE),
}
