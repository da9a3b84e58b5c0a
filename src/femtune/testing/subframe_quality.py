"""Figures of a generated mesh: mass, distortion of its elements, nodes that are free or double."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from femtune.testing.subframe_structure import Elements, MeshedStructure

Reals = NDArray[np.float64]

_NEXT = {3: (1, 2, 0), 4: (1, 2, 3, 0)}
# neighbours of each corner of a hexahedron, right-handed
_CORNER = np.array([[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]])
_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])


@dataclass(frozen=True)
class MeshQuality:
    """The worst of each.

    Parameters
    ----------
    mass : kg, of elements and point masses
    aspect : longest edge over shortest edge of an element
    warp : distance of a quadrilateral's corners from its mean plane over its mean edge
    skew_deg : departure of a shell's corner from 90° (quadrilateral) or 60° (triangle)
    jacobian : smallest over largest corner volume of a hexahedron; 0 or less is collapsed or inverted
    unused_nodes : nodes that neither an element nor a rigid tie uses
    nearest : m, smallest distance of two nodes
    """

    mass: float
    aspect: float
    warp: float
    skew_deg: float
    jacobian: float
    unused_nodes: int
    nearest: float


def mesh_quality(structure: MeshedStructure) -> MeshQuality:
    """Measure a mesh."""
    x = structure.xyz
    shells = [b for b in structure.elements if b.card in ("CQUAD4", "CTRIA3")]
    quads = [b for b in shells if b.card == "CQUAD4"]
    solids = [b for b in structure.elements if b.card == "CHEXA"]
    return MeshQuality(
        mass=sum(batch_masses(structure)) + sum(m.mass for m in structure.masses),
        aspect=max(float(aspect_ratios(x, b).max()) for b in shells + solids),
        warp=max((float(warps(x, b).max()) for b in quads), default=0.0),
        skew_deg=max((float(skews_deg(x, b).max()) for b in shells), default=0.0),
        jacobian=min((float(corner_ratios(x, b).min()) for b in solids), default=1.0),
        unused_nodes=len(x) - len(_used(structure)),
        nearest=_nearest(structure),
    )


def batch_masses(structure: MeshedStructure) -> list[float]:
    """Mass of each batch of elements in kg, without what the point masses add."""
    properties = {p.id: p for p in structure.properties}
    densities = {m.id: m.rho for m in structure.materials}
    out = []
    for batch in structure.elements:
        entry = properties[batch.property]
        section = entry.values[0] if entry.values else 1.0
        out.append(densities[entry.material] * section * float(extents(structure.xyz, batch).sum()))
    return out


def extents(xyz: Reals, batch: Elements) -> Reals:
    """(e,) lengths, areas or volumes; a hexahedron counts as the mean of its corner volumes' trilinear integral."""
    p = xyz[batch.rows]
    if batch.card == "CBAR":
        return np.asarray(np.linalg.norm(p[:, 1] - p[:, 0], axis=1))
    if batch.card == "CHEXA":
        return _hexahedron_volumes(p)
    diagonals = (p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) if p.shape[1] == 3 else (p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    return np.asarray(np.linalg.norm(np.cross(*diagonals), axis=1) / 2.0)


def _hexahedron_volumes(p: Reals) -> Reals:
    """By the divergence theorem: flux of x/3 through two triangles on each side of every diagonal, in the mean."""
    faces = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
    a, b, c, d = (p[:, faces[:, i]] - p[:, :1] for i in range(4))
    triangles = ((a, b, c), (a, c, d), (a, b, d), (b, c, d))
    flux = sum(np.einsum("efi,efi->e", one, np.cross(two, three)) for one, two, three in triangles)
    return np.asarray(flux / 12.0)


def aspect_ratios(xyz: Reals, batch: Elements) -> Reals:
    """(e,) longest over shortest edge."""
    k = batch.rows.shape[1]
    edges = _EDGES if k == 8 else np.array([range(k), _NEXT[k]]).T
    p = xyz[batch.rows]
    length = np.linalg.norm(p[:, edges[:, 0]] - p[:, edges[:, 1]], axis=2)
    return np.asarray(length.max(axis=1) / length.min(axis=1))


def warps(xyz: Reals, batch: Elements) -> Reals:
    """(e,) distance of the corners from the mean plane over the mean edge."""
    p = xyz[batch.rows]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.abs(np.einsum("ei,ei->e", p[:, 1] - p[:, 0] + p[:, 3] - p[:, 2], normal)) / 4.0
    edge = np.linalg.norm(p[:, [1, 2, 3, 0]] - p, axis=2).mean(axis=1)
    return np.asarray(height / edge)


def skews_deg(xyz: Reals, batch: Elements) -> Reals:
    """(e,) largest departure of a corner's angle from that of the regular element."""
    p, k = xyz[batch.rows], batch.rows.shape[1]
    ahead = p[:, list(_NEXT[k])] - p
    behind = -np.roll(ahead, 1, axis=1)
    cosine = np.einsum("eki,eki->ek", ahead, behind)
    cosine /= np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return np.asarray(np.abs(angle - (60.0 if k == 3 else 90.0)).max(axis=1))


def corner_ratios(xyz: Reals, batch: Elements) -> Reals:
    """(e,) smallest over largest of the eight corner volumes of hexahedra."""
    p = xyz[batch.rows]
    edges = p[:, _CORNER] - p[:, :, None]
    volume = np.einsum("eki,eki->ek", np.cross(edges[:, :, 0], edges[:, :, 1]), edges[:, :, 2])
    return np.asarray(volume.min(axis=1) / np.abs(volume).max(axis=1))


def _used(structure: MeshedStructure) -> NDArray[np.int64]:
    parts = [b.rows.ravel() for b in structure.elements] + [tie.rows for tie in structure.rigid]
    return np.unique(np.concatenate([*parts, [tie.centre for tie in structure.rigid]]).astype(np.int64))


def _nearest(structure: MeshedStructure) -> float:
    """Middle nodes of ties may sit anywhere; all others are compared."""
    own = np.delete(structure.xyz, [tie.centre for tie in structure.rigid], axis=0)
    return float(cKDTree(own).query(own, k=2)[0][:, 1].min())
