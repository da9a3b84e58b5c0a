"""Curved shells (CQUAD8, CTRIA6): strains of the surface with ties, at the points of one rule.

The in-plane strain e + z k is tied in the same way at every height, so that offset and coupling laws lock no more than
the membrane does. The change of an element's mean strain due to tying is added back; without it constant stress would
not be in equilibrium on elements whose sides are not parallel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution, joined
from femtune.fem.elements.differential import Differential, of_surface
from femtune.fem.elements.kind import QUADRILATERAL_PARTS, TRIANGLE_PARTS, ElementKind
from femtune.fem.elements.shells import curved_strains
from femtune.fem.elements.shells.checks import check_curved
from femtune.fem.elements.shells.curved_strains import QUAD_SHEAR, QUAD_STRAIN, TRI_SHEAR, TRI_STRAIN, Tie
from femtune.fem.elements.shells.curved_surface import (
    QUAD8_SHAPE,
    TRI6_SHAPE,
    CurvedNodes,
    CurvedShape,
    Surface,
    triangle_bubble,
)
from femtune.fem.elements.shells.flat import placed_pieces
from femtune.fem.elements.shells.laws import stiffness_terms
from femtune.fem.elements.shells.mass import shell_mass
from femtune.fem.elements.shells.normals import shared_normals
from femtune.fem.elements.shells.strains import OFFSET, Rows
from femtune.fem.elements.shells.uneven import uneven_thickness
from femtune.fem.elements.solids.solid import lumped
from femtune.fem.structure import ElementBatch, Structure

ELEMENTS_PER_CHUNK = 64
"""Elements that are computed together: their strain rows (about 2 MB) fit in a core's cache."""


@dataclass(frozen=True, eq=False)
class CurvedFormulation:
    """A shape and the ties of its strains."""

    shape: CurvedShape
    strain: Tie
    shear: Tie
    bubble: Callable[[Reals], Reals] | None = None

    @cached_property
    def ties(self) -> tuple[Reals, Reals]:
        """From the components at the tying points of strain and of shear to those at the points of the rule."""
        points = self.shape.points
        return self.strain.to(points), self.shear.to(points)


def curved_pieces(
    batch: ElementBatch, structure: Structure, formulation: CurvedFormulation
) -> Iterator[list[Contribution]]:
    """Stiffness and mass of curved shells, some elements at a time; errors as of ``check_curved``."""
    check_curved(batch, structure, formulation.shape)
    uneven = uneven_thickness(batch, formulation.shape.corner_shares)
    terms = uneven.terms(stiffness_terms(batch, structure, 0))
    normals = shared_normals(batch, structure)
    return placed_pieces(
        batch,
        structure,
        terms,
        shell_mass(batch, uneven),
        lambda part: curved_shells(batch, structure, formulation, normals, part),
        ELEMENTS_PER_CHUNK,
    )


def curved_shells(
    batch: ElementBatch, structure: Structure, formulation: CurvedFormulation, normals: Reals, part: slice
) -> CurvedShells:
    """A part of a batch in its position; `normals` (e, n, 3) are the shared ones of the whole batch."""
    at = batch.nodes[part]
    missing = at < 0
    xyz = np.where(missing[:, :, None], 0.0, structure.nodes.xyz[at])
    nodes = CurvedNodes(formulation.shape, xyz, normals[part], missing)
    return CurvedShells(
        formulation, nodes, structure.nodes.frames[at], batch.facts["theta"][part], batch.facts["direction"][part]
    )


@dataclass(frozen=True, eq=False)
class CurvedShells:
    """m curved shells with n nodes in their positions.

    Parameters
    ----------
    frames : (m, n, 3, 3) displacement frames of the grid points
    theta : (m,) angle from the line along r to the material's x axis, at each point
    along : (m, 3) a vector whose projection on the surface is that axis, zero if `theta` applies
    """

    formulation: CurvedFormulation
    nodes: CurvedNodes
    frames: Reals
    theta: Reals
    along: Reals

    @property
    def normals(self) -> Reals:
        """Normals that the grid points share with the neighbours."""
        return self.nodes.normals

    def direction(self, number: int, own: NDArray[np.int64]) -> tuple[Reals, Reals]:
        """Not needed: curved shells have no uniaxial rows."""
        return np.ones(len(own)), np.zeros(len(own))

    def rows(self, offsets: bool, coupling: bool) -> Rows:
        """Strain rows at the points of the rule, along the material's axes."""
        strain, curvature = self._in_plane
        rows = _named("m", strain) | _named("b", curvature * np.sqrt(1.0 / 12.0)) | self._sheared
        rows["drill"] = (curved_strains.turning(self._surface) * self._roots)[:, :, 0]
        if coupling:
            rows |= _named("c", curvature)
        if offsets:
            # at the height z0 the strain is e + z0 k; the rotations about the normal are those of the grid points
            rows |= {f"m{k}{OFFSET}": v for k, v in zip(("1", "2", "12"), np.moveaxis(curvature, 2, 0))}
            rows["drill" + OFFSET] = np.zeros_like(rows["drill"])
        return {name: self._on_nodes(row) for name, row in rows.items()}

    def shares(self, consistent: bool, point: int | None = None) -> Reals:
        """Integrals of products of the shape functions, or lumped in proportion to their diagonal; or of one point.

        If lumped, the mass of a point is shared by the nodes in the same ratio as that of the whole element.
        """
        functions = self._surface.functions[:, :, 0] * np.sqrt(self._areas)[:, :, None]
        if consistent and point is not None:
            functions = functions[:, point : point + 1]
        shares = np.swapaxes(functions, 1, 2) @ functions
        if consistent:
            return np.asarray(0.5 * (shares + np.swapaxes(shares, 1, 2)))
        part = 1.0 if point is None else (self._areas[:, point] / self._areas.sum(axis=1))[:, None, None]
        return lumped(shares) * part

    @cached_property
    def _surface(self) -> Surface:
        return self.nodes.surface(self.formulation.shape.points)

    @cached_property
    def _areas(self) -> Reals:
        """(m, p) shares of the area."""
        return self._surface.area * self.formulation.shape.weights

    @property
    def _roots(self) -> Reals:
        return np.sqrt(self._areas)[:, :, None, None, None]

    @cached_property
    def _frames(self) -> Reals:
        return self._surface.frames(self.nodes.axes)

    @cached_property
    def _material(self) -> tuple[Reals, Reals]:
        """(m, p) cosine and sine of the angle from x to the material's x axis."""
        given = np.asarray(np.any(self.along, axis=1))
        start = np.where(given[:, None, None], self.along[:, None], self._surface.bases[:, :, 0])
        x, y = np.moveaxis(np.einsum("mpij,mpj->mpi", self._frames[:, :, :2], start), 2, 0)
        angle = np.arctan2(y, x) + np.where(given, 0.0, self.theta)[:, None]
        return np.cos(angle), np.sin(angle)

    @cached_property
    def _in_plane(self) -> tuple[Reals, Reals]:
        """(m, p, 3, n, 6) strain and curvature along the material's axes, times the roots of the weights."""
        strain, curvature = (self._mean_kept(part) for part in (curved_strains.membrane, curved_strains.curvature))
        if self.formulation.bubble is not None:
            curvature = curvature + _times(self._cartesian, self._bubble)
        turn = curved_strains.turned_strain(*self._material)
        return _times(turn, strain) * self._roots, _times(turn, curvature) * self._roots

    def _mean_kept(self, rows: Callable[[Surface], Reals]) -> Reals:
        """Tied strains xx, yy, xy with the mean of the untied ones."""
        tied = _times(self._cartesian, _tied(self.formulation.ties[0], rows(self._at_strain_ties)))
        shares = self._areas / self._areas.sum(axis=1, keepdims=True)
        change = _times(self._cartesian, rows(self._surface)) - tied
        return tied + np.einsum("mp,mpkna->mkna", shares, change)[:, None]

    @cached_property
    def _at_strain_ties(self) -> Surface:
        return self.nodes.surface(self.formulation.strain.points)

    @cached_property
    def _cartesian(self) -> Reals:
        return curved_strains.cartesian_strain(self._surface.along(self._frames))

    @cached_property
    def _bubble(self) -> Reals:
        """(m, p, 3, n, 6) curvature rr, ss, rs of the bubble of the director."""
        assert self.formulation.bubble is not None
        shape, axes = self.formulation.shape, np.swapaxes(self.nodes.axes[:, :, :2], 1, 2)
        excess = curved_strains.shear(self._surface) - self._covariant_shear
        values = self.formulation.bubble(shape.points)
        return curved_strains.bubble_curvature(self._surface, values, shape.weights, axes, excess)

    @cached_property
    def _covariant_shear(self) -> Reals:
        ties = self.nodes.surface(self.formulation.shear.points)
        return _tied(self.formulation.ties[1], curved_strains.shear(ties))

    @cached_property
    def _sheared(self) -> Rows:
        c, s = self._material
        turn = np.moveaxis(np.array([[c, s], [-s, c]]), (0, 1), (2, 3))
        rows = _times(turn @ self._surface.along(self._frames), self._covariant_shear) * self._roots
        return {"s1": rows[:, :, 0], "s2": rows[:, :, 1]}

    def _on_nodes(self, rows: Reals) -> Reals:
        """(m, p, 6n) rows on the displacements of the grid points in their displacement frames."""
        m, p, n, _ = rows.shape
        flat = np.swapaxes(rows, 1, 2).reshape(m, n, 2 * p, 3) @ self.frames
        return np.asarray(np.swapaxes(flat.reshape(m, n, p, 6), 1, 2).reshape(m, p, 6 * n))


def _named(letter: str, rows: Reals) -> Rows:
    return {f"{letter}{k}": rows[:, :, i] for i, k in enumerate(("1", "2", "12"))}


def _tied(tie: Reals, rows: Reals) -> Reals:
    """(m, p, c, n, 6) at the points of the rule from (m, k, c, n, 6) at the tying points."""
    m, k, c, n, _ = rows.shape
    return np.asarray((tie @ rows.reshape(m, k * c, -1)).reshape(m, -1, c, n, 6))


def _times(matrix: Reals, rows: Reals) -> Reals:
    """Matrices (m, p, c, c) times rows (m, p, c, n, 6)."""
    return np.asarray((matrix @ rows.reshape(*rows.shape[:3], -1)).reshape(rows.shape))


# ----------------------------------------------------------------------------------------------------
# The eight-node shell.


QUAD8 = CurvedFormulation(QUAD8_SHAPE, QUAD_STRAIN, QUAD_SHEAR)


def quad8(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CQUAD8; errors as of ``check_curved``."""
    return joined(quad8_pieces(batch, structure))


def quad8_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same, some elements at a time."""
    return curved_pieces(batch, structure, QUAD8)


# ----------------------------------------------------------------------------------------------------
# The six-node shell.


TRI6 = CurvedFormulation(TRI6_SHAPE, TRI_STRAIN, TRI_SHEAR, triangle_bubble)


def tri6(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTRIA6; errors as of ``check_curved``."""
    return joined(tri6_pieces(batch, structure))


def tri6_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same, some elements at a time."""
    return curved_pieces(batch, structure, TRI6)


def _differential(batch: ElementBatch, structure: Structure, shape: CurvedShape) -> Differential:
    missing = batch.nodes < 0
    xyz = np.where(missing[:, :, None], 0.0, structure.nodes.xyz[batch.nodes])
    nodes = CurvedNodes(shape, xyz, np.zeros_like(xyz), missing)
    return of_surface(batch, structure, nodes.functions(shape.points), shape.weights, nodes.axes)


def quad8_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """Differential stiffness of the membrane forces along the axes of the mean plane."""
    return _differential(batch, structure, QUAD8_SHAPE)


def tri6_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """Differential stiffness of the membrane forces along the axes of the mean plane."""
    return _differential(batch, structure, TRI6_SHAPE)


SHELL_QUAD8 = ElementKind(
    "shell-quad8",
    quad8,
    quad8_pieces,
    faces=((0, 4, 7, -1), (1, 5, 4, -1), (2, 6, 5, -1), (3, 7, 6, -1), (4, 5, 6, 7)),
    children=QUADRILATERAL_PARTS,
    shell=True,
    surface=QUAD8_SHAPE,
    differential=quad8_differential,
    papers=("bathe1986", "macneal1992"),
)
SHELL_TRI6 = ElementKind(
    "shell-tri6",
    tri6,
    tri6_pieces,
    faces=((0, 3, 5, -1), (1, 4, 3, -1), (2, 5, 4, -1), (3, 4, 5, -1)),
    children=TRIANGLE_PARTS,
    shell=True,
    surface=TRI6_SHAPE,
    differential=tri6_differential,
    papers=("bathe1989", "neunteufel2021"),
)
