"""The pyramid of five nodes (CPYRAM): mean strains, and three modes of its base with assumed stresses.

Beyond linear displacements there is the hourglass q of the base, u = q xy/(1 − z), z from the base to the apex. The
strain that it causes along a side of the base varies linearly across and has uniaxial stress, as in a quadrilateral;
its part normal to the base is a warp with transverse shear. Shape functions of Bedrosian, Int. J. Numer. Meth.
Engng 35 (1992) 95-108: their derivatives depend on x/(1 − z) and y/(1 − z) alone.
"""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution
from femtune.fem.elements.differential import Differential
from femtune.fem.elements.kind import ElementKind
from femtune.fem.elements.solids.first_order import (
    MEAN,
    FirstOrder,
    first_order,
    first_order_differential,
    plane_duals,
    plane_frame,
    reference,
    uniaxial_mode,
)
from femtune.fem.elements.solids.parts import pyramid_parts
from femtune.fem.elements.solids.shape import PYRAMID_SIDES, pyramid_points
from femtune.fem.elements.solids.solid import solid
from femtune.fem.elements.solids.strains import SolidFormulation, SolidPlaces, StrainGroup
from femtune.fem.structure import ElementBatch, Structure

BASE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
CENTRE = np.array([0.0, 0.0, 0.25])


def functions(points: Reals) -> Reals:
    """(k, 5) shape functions at points (k, 3) that are not the apex."""
    z = points[:, 2:]
    corners = (1.0 - z) * np.prod(1.0 + BASE * (points[:, :2] / (1.0 - z))[:, None], axis=2) / 4.0
    return np.concatenate([corners, z], axis=1)


def derivatives(points: Reals) -> Reals:
    """(k, 3, 5) their derivatives."""
    a, b = (points[:, :2] / (1.0 - points[:, 2:])).T[:, :, None]
    x, y = BASE.T
    zero = np.zeros((len(points), 1))
    rows = (x * (1.0 + y * b) / 4.0, zero), (y * (1.0 + x * a) / 4.0, zero), ((x * y * a * b - 1.0) / 4.0, zero + 1.0)
    return np.stack([np.concatenate(row, axis=1) for row in rows], axis=1)


_CHECKED = np.concatenate([np.pad(BASE, ((0, 0), (0, 1))), CENTRE[None]])
_MODES = np.array([[1.0, -1.0, 1.0, -1.0, 0.0]]) / 4.0
STRAINS = reference(functions, derivatives, pyramid_points(2), _CHECKED, CENTRE, _MODES)
MASS = reference(functions, derivatives, pyramid_points(3), _CHECKED, CENTRE, _MODES)


def pyram5_strains(places: SolidPlaces) -> list[StrainGroup]:
    """Mean strains, bending of the base in its plane along either side, its warp."""
    element = first_order(STRAINS, places.xyz)
    weight = np.sqrt(element.volume) * MEAN
    bending = weight[:, None, None] * element.gamma
    return [element.full(), *(uniaxial_mode(element, i, bending) for i in range(2)), warp(element, weight)]


def warp(element: FirstOrder, weight: Reals) -> StrainGroup:
    """Transverse shear of the base's displacement along its normal, which is q xy."""
    one, two = element.sides[:, 0], element.sides[:, 1]
    frame = plane_frame(one, two)
    rows = np.zeros((len(frame), 2, 2, 5, 3))
    for k, dual in enumerate(plane_duals(one, two, frame)):
        slope = dual[:, ::-1] * weight[:, None]
        rows[:, k] = slope[:, :, None, None] * element.gamma[:, :1, :, None] * frame[:, None, None, :, 2]
    return StrainGroup(rows, frame)


PYRAM5 = SolidFormulation(
    ("full", "uniaxial", "uniaxial", "transverse"),
    pyram5_strains,
    MASS.shares,
    STRAINS.checked,
    "list the corners of the base clockwise as seen from outside the solid, then the apex",
)


def pyram5(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CPYRAM with five nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, PYRAM5)


def pyram5_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """Differential stiffness of the mean stresses."""
    return first_order_differential(batch, structure, STRAINS)


PYRAM5_KIND = ElementKind(
    "pyram5", pyram5, sides=PYRAMID_SIDES, children=pyramid_parts("tetra4"), differential=pyram5_differential
)
