"""Normals that neighbouring shells share at a grid point.

A grid point has almost no stiffness about the normal. If facets that meet at a small angle had separate normals, a part
of a twisting moment across the fold would act on that missing stiffness: the mesh of a curved shell would be too soft,
and the finer the softer. So all corners of shells at a grid point whose normals differ by less than
FOLD use one mean normal (Nastran: PARAM SNORM, 20 degrees from the mean, which for two facets is the same). Corners
that meet at larger angles, as in a box, keep separate normals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.elements.kind import KINDS
from femtune.fem.elements.shells.curved_surface import CurvedNodes, CurvedShape
from femtune.fem.structure import ElementBatch, NodeTable, Structure


def shared_normals(batch: ElementBatch, structure: Structure) -> Reals:
    """(e, n, 3) unit normals at the nodes of a batch of shells, in the basic frame, on its positive side.

    Those of mid-side nodes that are left out are zero.
    """
    shells = [b for b in structure.batches if KINDS[b.kind].shell and b is not batch]
    normals, nodes = zip(*(_of_batch(b, structure) for b in (batch, *shells)))
    given = batch.nodes >= 0
    out = np.zeros((*batch.nodes.shape, 3))
    fold = 2.0 * np.radians(structure.normals_within)
    out[given] = smoothed(np.concatenate(normals), np.concatenate(nodes), fold)[: given.sum()]
    return out


def _of_batch(batch: ElementBatch, structure: Structure) -> tuple[Reals, NDArray[np.int64]]:
    """Normals (c, 3), with the corner's angle as their length, and their grid points."""
    given = batch.nodes >= 0
    xyz = np.where(given[:, :, None], structure.nodes.xyz[batch.nodes], 0.0)
    surface = KINDS[batch.kind].surface
    normals = corner_normals(xyz) if surface is None else _curved_normals(surface, xyz, given)
    return normals[given], batch.nodes[given]


def corner_normals(xyz: Reals) -> Reals:
    """(e, n, 3) normals of the bilinear or flat surface at its corners; their length is the corner's angle in rad."""
    ahead, back = np.roll(xyz, -1, axis=1) - xyz, np.roll(xyz, 1, axis=1) - xyz
    cross = np.cross(ahead, back)
    size = np.linalg.norm(cross, axis=2)
    angle = np.arctan2(size, np.sum(ahead * back, axis=2))
    return np.asarray(np.divide(angle, size, out=np.zeros_like(size), where=size > 0.0)[:, :, None] * cross)


def smoothed(normals: Reals, nodes: NDArray[np.int64], fold: float) -> Reals:
    """(c, 3) unit normals: of each corner, the sum over those at its grid point that differ by less than `fold`.

    The normals of elements with the opposite sense of numbering are reversed.
    """
    one, other = _pairs(nodes)
    size = np.linalg.norm(normals, axis=1)
    unit = normals / np.where(size > 0.0, size, 1.0)[:, None]
    cosine = np.sum(unit[one] * unit[other], axis=1)
    close = (np.abs(cosine) > np.cos(fold)) | (one == other)
    one, added = one[close], normals[other[close]] * np.sign(cosine[close])[:, None]
    out = np.stack([np.bincount(one, added[:, k], len(nodes)) for k in range(3)], axis=1)
    length = np.linalg.norm(out, axis=1)
    return np.asarray(out / np.where(length > 0.0, length, 1.0)[:, None])


def _pairs(nodes: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All ordered pairs of corners at one grid point, including each corner with itself."""
    order = np.argsort(nodes, kind="stable")
    _, start, count = np.unique(nodes[order], return_index=True, return_counts=True)
    each = np.repeat(count, count)
    one = np.repeat(np.arange(len(nodes)), each)
    first = np.repeat(np.repeat(start, count), each)
    local = np.arange(len(one)) - np.repeat(np.cumsum(each) - each, each)
    return order[one], order[first + local]


def _curved_normals(shape: CurvedShape, xyz: Reals, given: NDArray[np.bool_]) -> Reals:
    """Normals of the quadratic surface at its nodes, with the angle between the sides as their length."""
    sides = CurvedNodes(shape, xyz, np.zeros_like(xyz), ~given).sides()
    cross = np.cross(sides[:, :, 0], sides[:, :, 1])
    size = np.linalg.norm(cross, axis=2)
    angle = np.arctan2(size, np.sum(sides[:, :, 0] * sides[:, :, 1], axis=2))
    return np.asarray(np.divide(angle, size, out=np.zeros_like(size), where=size > 0.0)[:, :, None] * cross)


# ----------------------------------------------------------------------------------------------------
# Areas of shells and shear panels, for distributed mass.


def areas(nodes: NodeTable, batch: ElementBatch) -> Reals:
    """(e,) areas of curved surfaces, and of warped quadrilaterals projected on the mean plane."""
    missing = batch.nodes < 0
    xyz = np.where(missing[:, :, None], 0.0, nodes.xyz[batch.nodes])
    shape = KINDS[batch.kind].surface
    if shape is not None:
        surface = CurvedNodes(shape, xyz, np.zeros_like(xyz), missing).surface(shape.points)
        return np.asarray(surface.area @ shape.weights)
    one, other = xyz[:, 2] - xyz[:, 0], xyz[:, -1 if xyz.shape[1] > 3 else 0] - xyz[:, 1]
    return 0.5 * np.asarray(np.linalg.norm(np.cross(one, other), axis=1))
