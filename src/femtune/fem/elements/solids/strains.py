"""Interface between a shape of solid and the parts common to all solids: strain rows, mass shares, Jacobians.

A formulation gives rows, each multiplied by the square root of its integration weight, so that energies are sums of
squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.fem.structure import ElementBatch, Structure

Rows = dict[str, Reals]

KEPT = {"full": (0, 1, 2, 3, 4, 5), "plane": (0, 1, 3), "transverse": (4, 5), "uniaxial": (0,)}
"""Strains of a law, of xx, yy, zz, xy, yz, zx along a frame; the other stresses are zero."""


def grid_points(batch: ElementBatch, structure: Structure, part: slice) -> Reals:
    """(m, n, 3) positions of the nodes of a part of a batch; NaN for a mid-side node that is left out."""
    at = batch.nodes[part]
    xyz = structure.nodes.xyz[at]
    return np.where((at < 0)[:, :, None], np.nan, xyz) if (at < 0).any() else xyz


@dataclass(frozen=True, eq=False)
class SolidPlaces:
    """Positions of m solids with n nodes.

    Parameters
    ----------
    xyz : (m, n, 3) grid points in the basic frame, in the card's order; NaN for a mid-side node that is left out
    poisson : (m,) Poisson's ratio at the deck's values (of the isotropic mean of an anisotropic law), for choices that
        are made once, not for coefficients
    """

    xyz: Reals
    poisson: Reals


@dataclass(frozen=True, eq=False)
class StrainGroup:
    """Strains of m solids with one law, on the displacements of their n nodes along the basic axes.

    Parameters
    ----------
    rows : (m, r, c, n, 3) strains at r points or of r modes, times the square root of the weight; the c strains are
        those of ``KEPT``, with engineering shears
    frame : (m, 3, 3) columns: the axes x, y, z along which the strains are; None for the basic ones ("full")
    """

    rows: Reals
    frame: Reals | None = None


@dataclass(frozen=True)
class SolidFormulation:
    """The parts of a solid that depend on its shape.

    Parameters
    ----------
    laws : law of each group of strains, keys of ``KEPT``
    strains : places -> the groups, in the order of `laws`
    shares : grid points (m, n, 3) -> (m, n, n) integrals of products of the shape functions over the volume
    jacobians : grid points (m, n, 3) -> (m, k, 3, 3), columns are derivatives of the position by ξ, η, ζ: first at
        the corners in order, then elsewhere; elements that are not right-handed there are refused
    order : order of the corners on the card, for the hint of an error
    corners : number of nodes that are corners; None if all are
    squares : places -> (m, 3n, 3n) of the rows "trace" and "shear" of isotropic solids with displacements along the
        basic axes, if there is a shorter way to them than the strains
    """

    laws: tuple[str, ...]
    strains: Callable[[SolidPlaces], list[StrainGroup]]
    shares: Callable[[Reals], Reals]
    jacobians: Callable[[Reals], Reals]
    order: str
    corners: int | None = None
    squares: Callable[[SolidPlaces], Rows] | None = None
