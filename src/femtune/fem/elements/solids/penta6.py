"""The pentahedron of six nodes (CPENTA): mean strains, and six modes with assumed stresses.

Across the thickness ζ the three strains in the plane of the triangle vary linearly, with the law of plane stress;
along the thickness there is a uniaxial stress that varies linearly over the triangle; and one mode is torsion, with
St Venant's stiffness. As a thin plate it is too stiff, like all three-cornered plates with constant shear strain.
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
    plane_mode,
    reference,
    uniaxial_mode,
)
from femtune.fem.elements.solids.parts import PENTAHEDRON_PARTS
from femtune.fem.elements.solids.shape import PENTAHEDRON_SIDES, pentahedron_points
from femtune.fem.elements.solids.solid import solid
from femtune.fem.elements.solids.strains import SolidFormulation, SolidPlaces, StrainGroup
from femtune.fem.structure import ElementBatch, Structure

CORNERS = np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 1], [1, 0, 1], [0, 1, 1]], float)
CENTRE = np.array([1.0, 1.0, 0.0]) / 3.0

# mean of the products of r and s about the triangle's centre
_MOMENTS = np.array([[2.0, -1.0], [-1.0, 2.0]]) / 36.0
_TORSION_FACTOR = 1.0 / 45.0
"""J I_p / A⁴: exact for St Venant's torsion of an equilateral triangle, within 5 % for a right-angled one."""


def functions(points: Reals) -> Reals:
    """(k, 6) shape functions at points (k, 3)."""
    r, s, t = points.T
    flat = np.stack([1.0 - r - s, r, s], axis=1)
    return 0.5 * np.concatenate([flat * (1.0 - t)[:, None], flat * (1.0 + t)[:, None]], axis=1)


def derivatives(points: Reals) -> Reals:
    """(k, 3, 6) their derivatives."""
    r, s, t = points.T
    flat, slopes = np.stack([1.0 - r - s, r, s], axis=1), np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
    below, above = ((1.0 + sign * t)[:, None, None] * slopes for sign in (-1.0, 1.0))
    along = np.concatenate([-flat, flat], axis=1)[:, None]
    return 0.5 * np.concatenate([np.concatenate([below, above], axis=2), along], axis=1)


def _modes() -> Reals:
    """Rows that give the factors of (r − 1/3) ζ and (s − 1/3) ζ."""
    return 0.5 * np.array([[1.0, -1.0, 0.0, -1.0, 1.0, 0.0], [1.0, 0.0, -1.0, -1.0, 0.0, 1.0]])


_CHECKED = np.concatenate([CORNERS, CENTRE[None]])
STRAINS = reference(functions, derivatives, pentahedron_points(2), _CHECKED, CENTRE, _modes())
MASS = reference(functions, derivatives, pentahedron_points(3), _CHECKED, CENTRE, _modes())


def penta6_strains(places: SolidPlaces) -> list[StrainGroup]:
    """Mean strains, bending across the thickness, stress along it, torsion."""
    element = first_order(STRAINS, places.xyz)
    root = np.sqrt(element.volume)
    along = np.linalg.cholesky(_MOMENTS).T @ element.gamma * root[:, None, None]
    bending = plane_mode(element, 0, 1, (0, 1), root * MEAN)
    return [element.full(), bending, uniaxial_mode(element, 2, along), torsion(element)]


def torsion(element: FirstOrder) -> StrainGroup:
    """Shear strain of a rotation of the triangle about its normal that is linear in ζ."""
    one, two = element.sides[:, 0], element.sides[:, 1]
    frame = plane_frame(one, two)
    area = 0.5 * np.linalg.norm(np.cross(one, two), axis=1)
    edges = sum(np.sum(edge * edge, axis=1) for edge in (one, two, two - one))
    polar = area * edges / 36.0
    height = np.sum(element.sides[:, 2] * frame[:, :, 2], axis=1)
    size = np.sqrt(element.volume * _TORSION_FACTOR * area**3 / polar) / height
    turn = [0.5 * (frame[:, :, :2] @ dual[:, :, None])[:, :, 0] for dual in plane_duals(one, two, frame)]
    around = [np.cross(frame[:, :, 2], dual) for dual in turn]
    rows = sum(element.gamma[:, k, :, None] * around[k][:, None] for k in range(2)) * size[:, None, None]
    # each shear has half of the torsional stiffness of the polar moment
    half = np.zeros((len(rows), 2, 2, *rows.shape[1:]))
    half[:, 0, 0] = half[:, 1, 1] = rows / np.sqrt(2.0)
    return StrainGroup(half, frame)


PENTA6 = SolidFormulation(
    ("full", "plane", "uniaxial", "transverse"),
    penta6_strains,
    MASS.shares,
    STRAINS.checked,
    "list the corners of one triangle clockwise as seen from outside the solid, then those opposite them in that order",
)


def penta6(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CPENTA with six nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, PENTA6)


def penta6_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """Differential stiffness of the mean stresses."""
    return first_order_differential(batch, structure, STRAINS)


PENTA6_KIND = ElementKind(
    "penta6", penta6, sides=PENTAHEDRON_SIDES, children=PENTAHEDRON_PARTS, differential=penta6_differential
)
