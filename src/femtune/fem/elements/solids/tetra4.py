"""The tetrahedron of four nodes (CTETRA): constant strains.

It is exact for constant strains and far too stiff for anything else, in bending and where ν is near one half.
"""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution
from femtune.fem.elements.differential import Differential
from femtune.fem.elements.kind import ElementKind
from femtune.fem.elements.solids.first_order import first_order, first_order_differential, reference
from femtune.fem.elements.solids.parts import TETRAHEDRON_PARTS
from femtune.fem.elements.solids.shape import TETRAHEDRON_SIDES, tetrahedron_points
from femtune.fem.elements.solids.solid import solid
from femtune.fem.elements.solids.strains import SolidFormulation, SolidPlaces, StrainGroup
from femtune.fem.structure import ElementBatch, Structure

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)


def functions(points: Reals) -> Reals:
    """(k, 4) shape functions at points (k, 3)."""
    return np.concatenate([1.0 - points.sum(axis=1, keepdims=True), points], axis=1)


def derivatives(points: Reals) -> Reals:
    """(k, 3, 4) their derivatives."""
    return np.tile(np.concatenate([np.full((3, 1), -1.0), np.eye(3)], axis=1), (len(points), 1, 1))


TETRA = reference(functions, derivatives, tetrahedron_points(), CORNERS, CORNERS.mean(axis=0), np.zeros((0, 4)))


def tetra4_strains(places: SolidPlaces) -> list[StrainGroup]:
    """The strains."""
    return [first_order(TETRA, places.xyz).full()]


TETRA4 = SolidFormulation(
    ("full",),
    tetra4_strains,
    TETRA.shares,
    TETRA.checked,
    "list three corners clockwise as seen from outside the solid, then the fourth",
)


def tetra4(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTETRA with four nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, TETRA4)


def tetra4_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """Differential stiffness of the mean stresses."""
    return first_order_differential(batch, structure, TETRA)


TETRA4_KIND = ElementKind(
    "tetra4", tetra4, sides=TETRAHEDRON_SIDES, children=TETRAHEDRON_PARTS, differential=tetra4_differential
)
