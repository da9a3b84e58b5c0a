"""Strain energy of the drilling stiffness of shells, by grid point."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from femtune.arrays import Reals
from femtune.fem.elements.placement import ELEMENTS_PER_CHUNK, nominal
from femtune.fem.elements.shells.curved import QUAD8, SHELL_QUAD8, SHELL_TRI6, TRI6, curved_shells
from femtune.fem.elements.shells.drilling import drilling_rows
from femtune.fem.elements.shells.flat import DRILLING_SCALE, SHELL_QUAD, SHELL_TRI
from femtune.fem.elements.shells.normals import shared_normals
from femtune.fem.elements.shells.placement import shell_plane
from femtune.fem.structure import ElementBatch, Structure

_FLAT = (SHELL_QUAD.key, SHELL_TRI.key)
_CURVED = {SHELL_QUAD8.key: QUAD8, SHELL_TRI6.key: TRI6}


def drilling_energies(structure: Structure, displacements: Reals, absent: Collection[int] = ()) -> Reals:
    """(n_nodes, k) part of uᵀKu due to the drilling stiffness of shells, at the values of the deck.

    The corners of CQUAD4 and CTRIA3 have separate energies; the energy of an integration point of CQUAD8 and CTRIA6 is
    shared among the grid points according to their rotations there.

    Parameters
    ----------
    displacements : (n_g, k)
    absent : numbers of elements that are left out
    """
    out = np.zeros((len(structure.nodes.ids), displacements.shape[1]))
    for batch in structure.batches:
        if batch.kind in _FLAT or batch.kind in _CURVED:
            _add(out, batch, structure, displacements, absent)
    return out


def _add(out: Reals, batch: ElementBatch, structure: Structure, u: Reals, absent: Collection[int]) -> None:
    stiffness = DRILLING_SCALE * structure.drilling * nominal(batch, structure, "M33") * nominal(batch, structure, "t")
    stiffness = stiffness * (batch.facts["has_membrane"] & ~np.isin(batch.ids, list(absent)))
    if "STIFFNESS" in batch.roles:
        stiffness = stiffness * nominal(batch, structure, "STIFFNESS")
    normals, squares = shared_normals(batch, structure), _of_curved if batch.kind in _CURVED else _of_flat
    for start in range(0, len(batch), ELEMENTS_PER_CHUNK):
        part = slice(start, start + ELEMENTS_PER_CHUNK)
        dofs, nodes = batch.dofs[part], batch.nodes[part]
        moved = np.where((dofs >= 0)[:, :, None], u[dofs], 0.0)
        energy = stiffness[part, None, None] * squares(batch, structure, normals, part, moved)
        given = nodes >= 0
        np.add.at(out, nodes[given], energy[given])


def _of_flat(batch: ElementBatch, structure: Structure, normals: Reals, part: slice, moved: Reals) -> Reals:
    """(m, n, k) squared differences of the corners' rotations and those of the sides, from displacements (m, 6n, k)."""
    plane = shell_plane(batch, structure, normals, part)
    rows = drilling_rows(np.concatenate([plane.corners, plane.heights[:, :, None]], axis=2), plane.normals)
    m, n = rows.shape[:2]
    flat = plane.carry @ moved.reshape(m, n, 6, -1)
    # the mid-surface, where the membrane is, lies at the offset z0
    z0 = nominal(batch, structure, "z0")[part, None, None]
    flat[:, :, 0] += z0 * flat[:, :, 4]
    flat[:, :, 1] -= z0 * flat[:, :, 3]
    return np.asarray((rows.reshape(m, n, 6 * n) @ flat.reshape(m, 6 * n, -1)) ** 2)


def _of_curved(batch: ElementBatch, structure: Structure, normals: Reals, part: slice, moved: Reals) -> Reals:
    """The same for curved shells, where the grid points rotate about the normal, whatever the offset."""
    rows = curved_shells(batch, structure, _CURVED[batch.kind], normals, part).rows(offsets=False, coupling=False)
    drill = rows["drill"]
    turns = (drill.reshape(*drill.shape[:2], -1, 6)[..., 3:] ** 2).sum(axis=3)
    shares = turns / turns.sum(axis=2, keepdims=True)
    return np.asarray(np.swapaxes(shares, 1, 2) @ (drill @ moved) ** 2)
