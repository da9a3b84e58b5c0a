"""Derivatives of isoparametric shape functions, and mid-side nodes that are left out.

A mid-side node whose place is not a number is left out: the element is linear along that edge, so that half of the
node's shape function goes to each end of the edge, for the displacements and for the geometry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.fem.elements.solid_points import SolidPoints
from femtune.fem.elements.solid_shape import SolidShape
from femtune.fem.elements.solid_strains import Reals


@dataclass(frozen=True, eq=False)
class Tabulated:
    """Shape functions (p, n) at points, their derivatives (p, n, 3) along r, s, t, and the weights (p,)."""

    shape: SolidShape
    values: Reals
    slopes: Reals
    weights: Reals


@dataclass(frozen=True, eq=False)
class Gradients:
    """Shape functions of m solids at p points.

    Parameters
    ----------
    along : (m, p, n, 3) derivatives along the basic axes
    volume : (m, p) shares of the volume, weight times determinant
    places : (m, p, 3) the points themselves, from the mean of the corners
    """

    along: Reals
    volume: Reals
    places: Reals


def tabulated(shape: SolidShape, rule: SolidPoints) -> Tabulated:
    """The functions of a shape at the points of a rule."""
    slopes = np.ascontiguousarray(np.swapaxes(shape.slopes(rule.places), 1, 2))
    return Tabulated(shape, shape.values(rule.places), slopes, rule.weights)


def gradients(table: Tabulated, xyz: Reals) -> Gradients:
    """Gradients at all points of solids whose nodes are at xyz (m, n, 3)."""
    sides = reference_sides(table, xyz)
    cofactors = np.stack([np.cross(sides[:, :, k - 2], sides[:, :, k - 1]) for k in range(3)], axis=2)
    size = np.einsum("mpi,mpi->mp", sides[:, :, 0], cofactors[:, :, 0])
    along = _folded(table.shape, xyz, table.slopes) @ (cofactors / size[:, :, None, None])
    values = _folded(table.shape, xyz, table.values)
    return Gradients(along, table.weights * size, values @ _centred(table.shape, xyz))


def reference_sides(table: Tabulated, xyz: Reals) -> Reals:
    """(m, p, 3, 3) derivatives of the place along r, s, t, a row each."""
    slopes = _folded(table.shape, xyz, table.slopes)
    flat = np.swapaxes(slopes, 2, 3).reshape(len(slopes), -1, xyz.shape[1])
    return np.asarray((flat @ _centred(table.shape, xyz)).reshape(len(xyz), -1, 3, 3))


def mass_shares(table: Tabulated, xyz: Reals) -> Reals:
    """(m, n, n) integrals of products of the shape functions over the volume."""
    values = _folded(table.shape, xyz, table.values)
    volume = table.weights * np.linalg.det(reference_sides(table, xyz))
    out = np.swapaxes(values * volume[:, :, None], 1, 2) @ values
    return np.asarray(0.5 * (out + np.swapaxes(out, 1, 2)))


def _centred(shape: SolidShape, xyz: Reals) -> Reals:
    """Places of the nodes from the mean of the corners, zero for those left out."""
    centre = xyz[:, : shape.corners].mean(axis=1, keepdims=True)
    return np.where(np.isnan(xyz), 0.0, xyz - centre)


def _folded(shape: SolidShape, xyz: Reals, functions: Reals) -> Reals:
    """Functions (p, n, …) of the nodes as (m, p, n, …), half of a missing node's to each end of its edge.

    Where no element lacks a node m is 1.
    """
    missing = np.isnan(xyz[:, shape.corners :, 0])
    if not missing.any():
        return functions[None]
    out = np.repeat(functions[None], len(xyz), axis=0)
    for node, (a, b) in enumerate(shape.edges, start=shape.corners):
        lacks = missing[:, node - shape.corners]
        for end in (a, b):
            out[lacks, :, end] += 0.5 * functions[:, node]
        out[lacks, :, node] = 0.0
    return out
