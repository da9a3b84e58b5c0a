"""CHEXA with mid-side nodes: serendipity functions, 27 points, volumetric strain linear within the element."""

from __future__ import annotations

from femtune.fem.contribution import Contribution
from femtune.fem.elements.solid import solid
from femtune.fem.elements.solid_points import hexahedron_points
from femtune.fem.elements.solid_quadratic import LINEAR, Quadratic
from femtune.fem.elements.solid_shape import HEXA20 as SHAPE
from femtune.fem.structure import ElementBatch, Structure

_ORDER = (
    "list corners 1 to 4 around one face and 5 to 8 above them, then the middles of the sides 1-2 2-3 3-4 4-1, "
    "1-5 2-6 3-7 4-8, 5-6 6-7 7-8 8-5"
)

_POINTS = hexahedron_points(3)
HEXA20 = Quadratic(SHAPE, _POINTS, _POINTS, LINEAR).formulation(_ORDER)


def hexa20(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CHEXA with mid-side nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, HEXA20)
