"""Isoparametric solids with mid-side nodes, with projected volumetric strain to avoid locking as ν approaches ½.

The strains at the points are ε + ⅓ (v̄ − v) on the three normal ones, v = tr ε and v̄ its projection (Hughes, Int. J.
Numer. Meth. Engng 15 (1980) 1413-1418), for any law. The projection keeps the mean, so that constant strains pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution
from femtune.fem.elements.differential import Differential, SolidRule, of_quadratic_solid
from femtune.fem.elements.kind import DifferentialKernel, ElementKind
from femtune.fem.elements.solids.parts import HEXAHEDRON_PARTS, PENTAHEDRON_PARTS, TETRAHEDRON_PARTS, pyramid_parts
from femtune.fem.elements.solids.shape import (
    HEXA20_SHAPE,
    HEXAHEDRON_SIDES,
    PENTA15_SHAPE,
    PENTAHEDRON_SIDES,
    PYRAM13_SHAPE,
    PYRAMID_SIDES,
    TETRA10_SHAPE,
    TETRAHEDRON_SIDES,
    Gradients,
    SolidPoints,
    SolidShape,
    Tabulated,
    eight_points,
    gradients,
    hexahedron_points,
    mass_shares,
    pentahedron_points,
    pyramid_points,
    reference_sides,
    tabulated,
    tetrahedron_points,
)
from femtune.fem.elements.solids.solid import solid
from femtune.fem.elements.solids.strains import Rows, SolidFormulation, SolidPlaces, StrainGroup, grid_points
from femtune.fem.structure import ElementBatch, Structure


@dataclass(frozen=True)
class Projection:
    """Projection of the volumetric strain: its part in a space of functions, and a share of the rest.

    Parameters
    ----------
    basis : gradients -> (m, p, q) functions at the points times the square root of the volume there, orthonormal
    share : Poisson's ratio of the deck (m,) -> (m,) the share of the rest that is kept
    """

    basis: Callable[[Gradients], Reals]
    share: Callable[[Reals], Reals] = np.zeros_like


def linear_functions(at: Gradients) -> Reals:
    """The linear functions of position."""
    root = np.sqrt(at.volume)[:, :, None]
    functions = np.concatenate([np.ones_like(root), at.places], axis=2)
    return np.asarray(np.linalg.qr(functions * root)[0])


def constant_function(at: Gradients) -> Reals:
    """The constant."""
    return np.asarray(np.sqrt(at.volume / at.volume.sum(axis=1, keepdims=True))[:, :, None])


NEARLY_INCOMPRESSIBLE = 0.45
"""Poisson's ratio of the deck above which ``MEAN`` changes an element.

λ/μ = 2ν/(1 − 2ν) is 9 there. Metals (ν about 0.3) and hard plastics (up to 0.4) keep the more
accurate full strain; rubber does not lock.
"""


def kept_share(poisson: Reals) -> Reals:
    """The share s of the varying part with s² (λ + ⅔ μ) = ⅔ μ; 1 for other materials."""
    # a ratio equal to the limit but for rounding is not above it
    much = poisson > NEARLY_INCOMPRESSIBLE + 1e-9
    return np.where(much, np.sqrt(np.maximum(1.0 - 2.0 * poisson, 0.0) / (1.0 + np.abs(poisson))), 1.0)


LINEAR = Projection(linear_functions)
"""Linear functions, for all materials: for shapes with so many displacements that they do not lock."""

MEAN = Projection(constant_function, kept_share)
"""The mean, only for ν near ½, as it reduces accuracy elsewhere.

The mean alone would leave the three motions u = (a·x) x − ½ a |x|², whose strains are (a·x) I, without stiffness; with
``kept_share`` the result at the deck's ratio is as if λ applied to the mean and μ to the whole strain. Ratio and share
are taken from the deck once, so that a parameter that changes the ratio does not change the element.
"""


@dataclass(frozen=True, eq=False)
class Quadratic:
    """A shape, the rules for its stiffness and its mass, and the projection of its volumetric strain."""

    shape: SolidShape
    points: SolidPoints
    mass_points: SolidPoints
    projection: Projection

    def formulation(self, order: str) -> SolidFormulation:
        """The formulation, for the parts common to all solids."""
        return SolidFormulation(
            ("full",), self.strains, self.shares, self.jacobians, order, self.shape.corners, self.squares
        )

    def strains(self, places: SolidPlaces) -> list[StrainGroup]:
        """Strains at the points, their volumetric part projected."""
        at, share = gradients(self._table, places.xyz), self.projection.share(places.poisson)
        root = np.sqrt(at.volume)[:, :, None, None]
        rows = _strain_rows(at.along * root)
        if (share < 1.0).any():
            volumetric, basis = rows[:, :, :3].sum(axis=2), self.projection.basis(at)
            change = _project(basis, volumetric) - volumetric
            rows[:, :, :3] += ((1.0 - share) / 3.0)[:, None, None, None, None] * change[:, :, None]
        return [StrainGroup(rows)]

    def squares(self, places: SolidPlaces) -> Rows:
        """Matrices of the traces and of the shears of an isotropic law, from products of gradients alone.

        With h the integral of ∂Nₐ/∂xᵢ ∂N_b/∂xⱼ, and h̄ that of the projected traces: λ multiplies h̄, and μ multiplies
        tr h on the diagonal, plus h with i and j exchanged, plus ⅔ (h̄ − h).
        """
        at, share = gradients(self._table, places.xyz), self.projection.share(places.poisson)
        flat = (at.along * np.sqrt(at.volume)[:, :, None, None]).reshape(*at.volume.shape, -1)
        h = _symmetric(np.swapaxes(flat, 1, 2) @ flat)
        trace = h
        if (share < 1.0).any():
            part = np.swapaxes(self.projection.basis(at), 1, 2) @ flat
            projected, rest = _symmetric(np.swapaxes(part, 1, 2) @ part), (share**2)[:, None, None]
            trace = projected + rest * (h - projected)
        return {"trace": trace, "shear": _shears(h) + (trace - h) / 1.5}

    def shares(self, xyz: Reals) -> Reals:
        """Integrals of products of the shape functions."""
        return mass_shares(self._mass_table, xyz)

    def jacobians(self, xyz: Reals) -> Reals:
        """Jacobians at the points of both rules, those nearest to each corner first.

        Right-handed points suffice for the computation; at a corner a curved side may be tangent to its neighbour.
        """
        return np.swapaxes(reference_sides(self._checked, xyz), 2, 3)

    @cached_property
    def _table(self) -> Tabulated:
        return tabulated(self.shape, self.points)

    @cached_property
    def _mass_table(self) -> Tabulated:
        return tabulated(self.shape, self.mass_points)

    @cached_property
    def _checked(self) -> Tabulated:
        rules = {id(rule): rule.places for rule in (self.mass_points, self.points)}
        places = np.concatenate(list(rules.values()))
        corners = self.shape.nodes[: self.shape.corners, None]
        nearest = np.linalg.norm(places - corners, axis=2).argmin(axis=1)
        ordered = np.concatenate([places[nearest], np.delete(places, nearest, axis=0)])
        return tabulated(self.shape, SolidPoints(ordered, np.ones(len(ordered))))


def _strain_rows(along: Reals) -> Reals:
    """(m, p, 6, n, 3) strains xx, yy, zz, xy, yz, zx from gradients (m, p, n, 3)."""
    m, p, n, _ = along.shape
    out = np.zeros((m, p, 6, n, 3))
    for i in range(3):
        out[:, :, i, :, i] = along[..., i]
    for row, (i, j) in zip((3, 4, 5), ((0, 1), (1, 2), (2, 0))):
        out[:, :, row, :, i], out[:, :, row, :, j] = along[..., j], along[..., i]
    return out


def _project(basis: Reals, rows: Reals) -> Reals:
    flat = rows.reshape(*rows.shape[:2], -1)
    return np.asarray((basis @ (np.swapaxes(basis, 1, 2) @ flat)).reshape(rows.shape))


def _shears(h: Reals) -> Reals:
    """(m, 3n, 3n) of twice the squares of normal strains and the squares of shears."""
    m, d, _ = h.shape
    by_node = h.reshape(m, d // 3, 3, d // 3, 3)
    out = by_node.transpose(0, 1, 4, 3, 2).copy()
    sums = np.einsum("maibi->mab", by_node)
    for i in range(3):
        out[:, :, i, :, i] += sums
    return out.reshape(m, d, d)


def _symmetric(matrix: Reals) -> Reals:
    # exact symmetry, which matrix products do not guarantee
    return np.asarray(0.5 * (matrix + np.swapaxes(matrix, 1, 2)))


# ----------------------------------------------------------------------------------------------------
# CHEXA with mid-side nodes: serendipity functions, 27 points, volumetric strain linear within the element.


_HEXA_ORDER = (
    "list corners 1 to 4 around one face and 5 to 8 above them, then the middles of the sides 1-2 2-3 3-4 4-1, "
    "1-5 2-6 3-7 4-8, 5-6 6-7 7-8 8-5"
)

_HEXA_POINTS = hexahedron_points(3)
HEXA20 = Quadratic(HEXA20_SHAPE, _HEXA_POINTS, _HEXA_POINTS, LINEAR).formulation(_HEXA_ORDER)


def hexa20(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CHEXA with mid-side nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, HEXA20)


# ----------------------------------------------------------------------------------------------------
# CPENTA with mid-side nodes: 18 points, mean volumetric strain near ν = ½.


_PENTA_ORDER = (
    "list corners 1 to 3 around one triangle and 4 to 6 above them, then the middles of the sides 1-2 2-3 3-1, "
    "1-4 2-5 3-6, 4-5 5-6 6-4"
)

_PENTA_POINTS = pentahedron_points(3)
PENTA15 = Quadratic(PENTA15_SHAPE, _PENTA_POINTS, _PENTA_POINTS, MEAN).formulation(_PENTA_ORDER)


def penta15(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CPENTA with mid-side nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, PENTA15)


# ----------------------------------------------------------------------------------------------------
# CPYRAM with mid-side nodes: Bedrosian's functions, 27 points, volumetric strain linear within the element.


_PYRAM_ORDER = (
    "list corners 1 to 4 around the base and 5 above it, then the middles of the sides 1-2 2-3 3-4 4-1, 1-5 2-5 3-5 4-5"
)

_PYRAM_POINTS = pyramid_points(3)
PYRAM13 = Quadratic(PYRAM13_SHAPE, _PYRAM_POINTS, _PYRAM_POINTS, LINEAR).formulation(_PYRAM_ORDER)


def pyram13(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CPYRAM with mid-side nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, PYRAM13)


# ----------------------------------------------------------------------------------------------------
# CTETRA with mid-side nodes: 8 points for the stiffness, 14 for the mass, mean volumetric strain near ν = ½.
#
# The eight are of degree 3, as constant strains with curved sides need.


_TETRA_ORDER = "list corners 1 to 3 around the side away from 4, then the middles of the sides 1-2 2-3 3-1, 1-4 2-4 3-4"

TETRA10 = Quadratic(TETRA10_SHAPE, eight_points(), tetrahedron_points(), MEAN).formulation(_TETRA_ORDER)


def tetra10(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTETRA with mid-side nodes; errors ``element.solid-shape``."""
    return solid(batch, structure, TETRA10)


def _differential(shape: SolidShape, points: SolidPoints) -> DifferentialKernel:
    """Differential stiffness of stresses that are linear within an element, by a rule of integration."""
    table = tabulated(shape, points)

    def differential(batch: ElementBatch, structure: Structure) -> Differential:
        xyz = grid_points(batch, structure, slice(None))
        at = gradients(table, xyz)
        nodes = xyz - xyz[:, : shape.corners].mean(axis=1, keepdims=True)
        return of_quadratic_solid(batch, structure, SolidRule(nodes, at.places, at.along, at.volume))

    return differential


HEXA20_KIND = ElementKind(
    "hexa20", hexa20, sides=HEXAHEDRON_SIDES, children=HEXAHEDRON_PARTS, volume=HEXA20_SHAPE,
    differential=_differential(HEXA20_SHAPE, _HEXA_POINTS),
)  # fmt: skip
PENTA15_KIND = ElementKind(
    "penta15", penta15, sides=PENTAHEDRON_SIDES, children=PENTAHEDRON_PARTS, volume=PENTA15_SHAPE,
    differential=_differential(PENTA15_SHAPE, _PENTA_POINTS),
)  # fmt: skip
TETRA10_KIND = ElementKind(
    "tetra10", tetra10, sides=TETRAHEDRON_SIDES, children=TETRAHEDRON_PARTS, volume=TETRA10_SHAPE,
    differential=_differential(TETRA10_SHAPE, eight_points()),
)  # fmt: skip
PYRAM13_KIND = ElementKind(
    "pyram13", pyram13, sides=PYRAMID_SIDES, children=pyramid_parts("tetra10"), volume=PYRAM13_SHAPE,
    differential=_differential(PYRAM13_SHAPE, _PYRAM_POINTS),
)  # fmt: skip
