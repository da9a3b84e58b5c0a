"""CPENTA with mid-side nodes: 18 points, mean volumetric strain near ν = ½."""

from __future__ import annotations

from femtune.fem.contribution import Contribution
from femtune.fem.elements.solid import solid
from femtune.fem.elements.solid_points import pentahedron_points
from femtune.fem.elements.solid_quadratic import MEAN, Quadratic
from femtune.fem.elements.solid_shape import PENTA15 as SHAPE
from femtune.fem.structure import ElementBatch, Structure

_ORDER = (
    "list corners 1 to 3 around one triangle and 4 to 6 above them, then the middles of the sides 1-2 2-3 3-1, "
    "1-4 2-5 3-6, 4-5 5-6 6-4"
)

_POINTS = pentahedron_points(3)
PENTA15 = Quadratic(SHAPE, _POINTS, _POINTS, MEAN).formulation(_ORDER)


def penta15(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CPENTA with mid-side nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, PENTA15)
