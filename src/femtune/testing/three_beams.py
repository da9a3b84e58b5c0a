"""Three beams in line, the middle one thinner and off the axis of the others: a benchmark with known frequencies.

Spans .3, .4 and .3 m of ten elements, breadth .2 m, depth .1 m outside and .05 m in the middle, 25 mm off axis, fixed
ends, steel, consistent mass. Source: Mottershead, Link and Friswell (2011), section 6; the depths and the offset are
recovered from their frequencies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from femtune.fem import FieldRef, Structure
from femtune.model import Configuration
from femtune.testing.structures import Part, bars, make_structure

ELEMENTS, MIDDLE = 10, (4, 5, 6, 7)
"""Number of elements, and those of the middle beam."""
YOUNG_GPA, OFFSET_M = 210.0, 0.025
"""True values."""
TRUE_HZ = (563.90, 1030.52, 2126.51, 3001.34, 3808.26)
"""Frequencies at the true values; the fourth mode is axial."""
CLAMPED = Configuration(supports_added=((1, "126"), (11, "126"), *((n, "345") for n in range(1, 12))))
"""Both ends fixed, motion in the plane only."""
OFFSETS = tuple(FieldRef("CBAR", e, name) for e in MIDDLE for name in ("W2A", "W2B"))
"""Fields of the offset, after `with_offsets`: −a in all of them is an offset a."""
MODULI = tuple(FieldRef("CBAR", e, "E") for e in range(1, ELEMENTS + 1))
"""Fields of Young's modulus, Pa."""

_BREADTH, _DENSITY, _LENGTH = 0.2, 7860.0, 0.1


def three_beams(offset_m: float = OFFSET_M, mass_offset_m: float | None = None) -> Structure:
    """The beams as bars between grid points on the axis of the outer ones.

    Parameters
    ----------
    offset_m : of the middle beam, in the direction −y
    mass_offset_m : of its mass, where that differs from the one of its stiffness; elements 1001 … are the mass then
    """
    parts = [_part(offset_m)]
    if mass_offset_m is not None:
        parts = [_with(parts[0], rho=0.0), _with(_part(mass_offset_m), E=0.0, G=0.0)]
    xyz = [[_LENGTH * i, 0.0, 0.0] for i in range(ELEMENTS + 1)]
    return make_structure(xyz, parts, consistent_mass=True, lumped_along=0.0)


def _part(offset_m: float) -> Part:
    middle = np.isin(np.arange(1, ELEMENTS + 1), MIDDLE)
    depth = np.where(middle, 0.05, 0.1)
    E = 1e9 * YOUNG_GPA
    values: dict[str, ArrayLike] = {"E": E, "G": E / 2.6, "A": _BREADTH * depth, "I1": _BREADTH * depth**3 / 12.0,
              "I2": _BREADTH**3 * depth / 12.0, "J": 1e-5, "rho": _DENSITY}  # fmt: skip
    part = bars([[i, i + 1] for i in range(ELEMENTS)], values)
    arms = np.where(middle[:, None], [0.0, -offset_m, 0.0], 0.0)
    return Part(part.kind, part.card, part.connection, part.values, {**part.facts, "offset_a": arms, "offset_b": arms})


def _with(part: Part, **values: float) -> Part:
    return Part(part.kind, part.card, part.connection, {**part.values, **values}, part.facts)
