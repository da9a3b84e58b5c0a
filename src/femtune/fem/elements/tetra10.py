"""CTETRA with mid-side nodes: 8 points for the stiffness, 14 for the mass, mean volumetric strain near ν = ½.

The eight are of degree 3, as constant strains with curved sides need.
"""

from __future__ import annotations

from femtune.fem.contribution import Contribution
from femtune.fem.elements.solid import solid
from femtune.fem.elements.solid_points import eight_points, tetrahedron_points
from femtune.fem.elements.solid_quadratic import MEAN, Quadratic
from femtune.fem.elements.solid_shape import TETRA10 as SHAPE
from femtune.fem.structure import ElementBatch, Structure

_ORDER = "list corners 1 to 3 around the side away from 4, then the middles of the sides 1-2 2-3 3-1, 1-4 2-4 3-4"

TETRA10 = Quadratic(SHAPE, eight_points(), tetrahedron_points(), MEAN).formulation(_ORDER)


def tetra10(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTETRA with mid-side nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, TETRA10)
