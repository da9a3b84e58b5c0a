"""The hexahedron of eight nodes (CHEXA): mean strains, and twelve modes with assumed stresses.

On a parallelepiped it is the hybrid element of Pian and Tong with 18 stresses exactly: along each of the three sides,
stresses in the plane of the two others vary linearly, with the law of plane stress; and along each side there is a
uniaxial stress that varies with the product of the two other coordinates. One layer of elements bends as a plate, with
E/(1 − ν²), and the element does not lock as ν approaches one half. On a distorted shape the axes are those of its
middle.
"""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution
from femtune.fem.elements.differential import Differential
from femtune.fem.elements.kind import ElementKind
from femtune.fem.elements.solids.first_order import (
    MEAN,
    first_order,
    first_order_differential,
    plane_mode,
    reference,
    uniaxial_mode,
)
from femtune.fem.elements.solids.parts import HEXAHEDRON_PARTS
from femtune.fem.elements.solids.shape import HEXAHEDRON_SIDES, hexahedron_points
from femtune.fem.elements.solids.solid import solid
from femtune.fem.elements.solids.strains import SolidFormulation, SolidPlaces, StrainGroup
from femtune.fem.structure import ElementBatch, Structure

CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)


def functions(points: Reals) -> Reals:
    """(k, 8) shape functions at points (k, 3)."""
    return np.asarray(np.prod(1.0 + points[:, None] * CORNERS, axis=2) / 8.0)


def derivatives(points: Reals) -> Reals:
    """(k, 3, 8) their derivatives."""
    factors = 1.0 + points[:, None] * CORNERS
    others = [factors[:, :, (i + 1) % 3] * factors[:, :, (i + 2) % 3] for i in range(3)]
    return np.stack([CORNERS[:, i] * others[i] / 8.0 for i in range(3)], axis=1)


def _modes() -> Reals:
    """ηζ, ζξ, ξη and ξηζ at the corners, divided by eight."""
    x, y, z = CORNERS.T
    return np.stack([y * z, z * x, x * y, x * y * z]) / 8.0


_CHECKED = np.concatenate([CORNERS, np.zeros((1, 3))])
STRAINS = reference(functions, derivatives, hexahedron_points(2), _CHECKED, np.zeros(3), _modes())
MASS = reference(functions, derivatives, hexahedron_points(3), _CHECKED, np.zeros(3), _modes())


def hexa8_strains(places: SolidPlaces) -> list[StrainGroup]:
    """Mean strains, three modes in the planes of two sides, three modes along a side."""
    element = first_order(STRAINS, places.xyz)
    root = np.sqrt(element.volume)
    linear, both = root * MEAN, root * MEAN * MEAN
    # along the third side the first goes with its product with ξ, the second with that with η
    planes = [plane_mode(element, i, (i + 1) % 3, ((i + 1) % 3, i), linear) for i in range(3)]
    warp = both[:, None, None] * element.gamma[:, 3:]
    return [element.full(), *planes, *(uniaxial_mode(element, i, warp) for i in range(3))]


HEXA8 = SolidFormulation(
    ("full", *("plane",) * 3, *("uniaxial",) * 3),
    hexa8_strains,
    MASS.shares,
    STRAINS.checked,
    "list the corners of one face clockwise as seen from outside the solid, then those opposite them in the same order",
)


def hexa8(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CHEXA with eight nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, HEXA8)


def hexa8_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """Differential stiffness of the mean stresses."""
    return first_order_differential(batch, structure, STRAINS)


HEXA8_KIND = ElementKind(
    "hexa8", hexa8, sides=HEXAHEDRON_SIDES, children=HEXAHEDRON_PARTS, differential=hexa8_differential
)
