"""Shells (CQUAD4, CTRIA3, CTRIAR): the parts common to all shapes, assembled from a formulation of the strains.

The stiffness is a list of products of rows, each with one coefficient; the rows are computed in chunks that fit in a
core's cache.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution, LowRank, joined
from femtune.fem.elements.differential import Differential, of_surface
from femtune.fem.elements.kind import QUADRILATERAL_PARTS, TRIANGLE_PARTS, ElementKind
from femtune.fem.elements.placement import ELEMENTS_PER_CHUNK
from femtune.fem.elements.shells.checks import check_shells
from femtune.fem.elements.shells.laws import ShellTerm, couples, stiffness_terms
from femtune.fem.elements.shells.mass import ShellMass, lumped, shell_mass
from femtune.fem.elements.shells.normals import shared_normals
from femtune.fem.elements.shells.placement import PlacedShells, ShellPlane, mean_plane, shell_plane
from femtune.fem.elements.shells.quad import ETA, GAUSS, QUAD, XI
from femtune.fem.elements.shells.strains import LETTERS_ON_TIES, TIES, Rows, ShellFormulation, ShellStrains, nodal_rows
from femtune.fem.elements.shells.tri import TRI, TRI_ROTATION
from femtune.fem.structure import ElementBatch, Structure

DRILLING_SCALE = 1e-6
"""Factor of PARAM K6ROT in the drilling stiffness, as in Nastran: K6ROT = 100 gives 1e-4 G t."""


def shell_quad(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CQUAD4.

    Raises
    ------
    FemtuneError : ``element.shell-shape``, ``element.shell-thickness``, ``element.material-direction``
    """
    return joined(shell_quad_pieces(batch, structure))


def shell_tri(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTRIA3; errors as of ``shell_quad``."""
    return joined(shell_tri_pieces(batch, structure))


def shell_quad_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same as ``shell_quad``, some elements at a time."""
    return shell_pieces(batch, structure, QUAD)


def shell_tri_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same as ``shell_tri``, some elements at a time."""
    return shell_pieces(batch, structure, TRI)


def shell_rotation_tri(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTRIAR; errors as of ``shell_quad``."""
    return joined(shell_rotation_tri_pieces(batch, structure))


def shell_rotation_tri_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same as ``shell_rotation_tri``, some elements at a time."""
    return shell_pieces(batch, structure, TRI_ROTATION)


def shell_pieces(
    batch: ElementBatch, structure: Structure, formulation: ShellFormulation
) -> Iterator[list[Contribution]]:
    """Stiffness and mass of shells of one formulation, some elements at a time; errors as of ``check_shells``."""
    check_shells(batch, structure)
    residual = formulation.residual(structure.nodes.xyz[batch.nodes])
    terms = stiffness_terms(batch, structure, formulation.uniaxial, residual)
    normals = shared_normals(batch, structure)
    return placed_pieces(
        batch,
        structure,
        terms,
        shell_mass(batch),
        lambda part: FlatShells(formulation, shell_plane(batch, structure, normals, part)),
    )


@dataclass(frozen=True, eq=False)
class FlatShells:
    """Shells on their mean planes."""

    formulation: ShellFormulation
    plane: ShellPlane

    @property
    def frames(self) -> Reals:
        """Displacement frames of the grid points."""
        return self.plane.frames

    @property
    def normals(self) -> Reals:
        """Normals of the mean planes."""
        return np.broadcast_to(self.plane.axes[:, None, :, 2], (*self.plane.heights.shape, 3))

    @cached_property
    def _strains(self) -> ShellStrains:
        return self.formulation.strains(self.plane)

    def rows(self, offsets: bool, coupling: bool) -> Rows:
        """Strain rows on the grid points."""
        return nodal_rows(self._strains, self.plane, offsets, coupling)

    def shares(self, consistent: bool, point: int | None = None) -> Reals:
        """Integrals of products of the shape functions, or their row sums."""
        shares = self.formulation.shares(self.plane.corners)
        return shares if consistent else lumped(shares)

    def direction(self, number: int, own: NDArray[np.int64]) -> tuple[Reals, Reals]:
        """Cosine and sine of a uniaxial row's direction in material axes."""
        assert self._strains.uniaxial is not None
        x, y = self._strains.uniaxial.along[own, number - 1].T
        c, s = self.plane.material[own].T
        return c * x + s * y, c * y - s * x


def placed_pieces(
    batch: ElementBatch,
    structure: Structure,
    terms: list[ShellTerm],
    mass: ShellMass,
    place: Callable[[slice], PlacedShells],
    chunk: int = ELEMENTS_PER_CHUNK,
) -> Iterator[list[Contribution]]:
    """Stiffness by its terms and mass, `chunk` elements at a time, of shells that `place` puts in position."""
    for part in _chunks(len(batch), chunk):
        placed = place(part)
        yield [*_stiffness(batch, structure, terms, placed, part), *mass.contributions(placed, structure, part)]


def _chunks(count: int, size: int) -> Iterator[slice]:
    return (slice(i, min(i + size, count)) for i in range(0, count, size))


def _stiffness(
    batch: ElementBatch, structure: Structure, terms: list[ShellTerm], placed: PlacedShells, part: slice
) -> Iterator[Contribution]:
    rows = placed.rows(bool(batch.facts["offset_given"][part].any()), bool(couples(batch)[part].any()))
    for name in [name for name in rows if name.startswith("drill")]:
        rows[name] = rows[name] * np.sqrt(DRILLING_SCALE * structure.drilling)
    for term in terms:
        lo, hi = np.searchsorted(term.at, [part.start, part.stop])
        if lo < hi:
            some = term.at[lo:hi] - part.start
            facts = {name: fact[lo:hi] for name, fact in term.facts.items()}
            if term.direction:
                facts |= dict(zip(("cos", "sin"), placed.direction(term.direction, some)))
            weights = None if term.weights is None else term.weights[lo:hi]
            squares = _squares(rows, term, some, weights)
            tied = TIES in rows and term.left[0][0] in LETTERS_ON_TIES
            stored = LowRank(rows[TIES][some], squares) if tied else squares
            yield Contribution(
                "stiffness", term.label, term.at[lo:hi], stored, term.roles, term.coefficient, facts, term.loss
            )


def _squares(rows: Rows, term: ShellTerm, some: NDArray[np.int64], weights: Reals | None) -> Reals:
    """LᵀL or LᵀR + RᵀL, times the weights, exactly symmetric."""
    left = _together(rows, term.left, term.point, some)
    # LᵀL is ½ (LᵀL + LᵀL), so that one expression serves both cases
    right = _together(rows, term.right, term.point, some) if term.right else 0.5 * left
    if weights is not None:
        right = right * np.repeat(weights, right.shape[1] // 2, axis=1)[:, :, None]
    half = np.swapaxes(left, 1, 2) @ right
    return np.asarray(half + np.swapaxes(half, 1, 2))


def _together(rows: Rows, names: tuple[str, ...], point: int | None, some: NDArray[np.int64]) -> Reals:
    """Rows of several names one after the other, of some elements of the chunk."""
    places = slice(None) if point is None else slice(point, point + 1)
    whole = np.concatenate([rows[name][:, places] for name in names], axis=1)
    return whole if len(some) == len(whole) else whole[some]


def flat_differential(batch: ElementBatch, structure: Structure, functions: Reals, weights: Reals) -> Differential:
    """Differential stiffness of the membrane forces along the mean plane's axes; arguments as of `of_surface`."""
    axes, _, _ = mean_plane(structure.nodes.xyz[batch.nodes])
    return of_surface(batch, structure, functions[None], weights, axes)


def quad_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """With bilinear displacements."""
    r, s = np.array(GAUSS).T[:, :, None]
    functions = np.stack([(1 + r * XI) * (1 + s * ETA), XI * (1 + s * ETA), (1 + r * XI) * ETA], axis=1) / 4.0
    return flat_differential(batch, structure, functions, np.ones(4))


def tri_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """With linear displacements."""
    functions = np.array([[[1 / 3, 1 / 3, 1 / 3], [-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]])
    return flat_differential(batch, structure, functions, np.array([0.5]))


SHELL_QUAD = ElementKind(
    "shell-quad",
    shell_quad,
    shell_quad_pieces,
    faces=((0, 1, 2, 3),),
    children=QUADRILATERAL_PARTS,
    shell=True,
    differential=quad_differential,
    papers=("dvorkin1984", "pian1984"),
)
SHELL_TRI = ElementKind(
    "shell-tri",
    shell_tri,
    shell_tri_pieces,
    faces=((0, 1, 2, -1),),
    children=TRIANGLE_PARTS,
    shell=True,
    differential=tri_differential,
    papers=("lee2004",),
)
SHELL_ROTATION_TRI = ElementKind(
    "shell-rotation-tri",
    shell_rotation_tri,
    shell_rotation_tri_pieces,
    faces=((0, 1, 2, -1),),
    children=TRIANGLE_PARTS,
    shell=True,
    differential=tri_differential,
    papers=("lee2004", "allman1984"),
)
