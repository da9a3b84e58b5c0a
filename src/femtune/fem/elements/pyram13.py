"""CPYRAM with mid-side nodes: Bedrosian's functions, 27 points, volumetric strain linear within the element."""

from __future__ import annotations

from femtune.fem.contribution import Contribution
from femtune.fem.elements.solid import solid
from femtune.fem.elements.solid_points import pyramid_points
from femtune.fem.elements.solid_quadratic import LINEAR, Quadratic
from femtune.fem.elements.solid_shape import PYRAM13 as SHAPE
from femtune.fem.structure import ElementBatch, Structure

_ORDER = (
    "list corners 1 to 4 around the base and 5 above it, then the middles of the sides 1-2 2-3 3-4 4-1, 1-5 2-5 3-5 4-5"
)

_POINTS = pyramid_points(3)
PYRAM13 = Quadratic(SHAPE, _POINTS, _POINTS, LINEAR).formulation(_ORDER)


def pyram13(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CPYRAM with mid-side nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, PYRAM13)
