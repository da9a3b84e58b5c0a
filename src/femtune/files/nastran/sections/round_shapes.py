"""Round sections: ROD, TUBE, TUBE2.

Shear factors: 0.9 for a rod reproduces frequencies that commercial Nastran lists, to six digits; 1/2 is that of a
thin tube (Cowper 1966, at ν = 0).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from femtune.files.nastran.sections.shape import Properties, Shape, symmetric

ROD_SHEAR, TUBE_SHEAR = 0.9, 0.5


def _rod(r: Any) -> Properties:
    bending = math.pi / 4 * r**4
    return symmetric(math.pi * r**2, bending, bending, 2.0 * bending, ROD_SHEAR, ROD_SHEAR)


def _tube(outer: Any, inner: Any) -> Properties:
    bending = math.pi / 4 * (outer**4 - inner**4)
    return symmetric(math.pi * (outer**2 - inner**2), bending, bending, 2.0 * bending, TUBE_SHEAR, TUBE_SHEAR)


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
        lambda outer, wall: _tube(outer, outer - wall),
        lambda outer, wall: outer >= wall > 0,
        "the wall DIM2 should be positive and no thicker than the outer radius DIM1",
    ),
}
