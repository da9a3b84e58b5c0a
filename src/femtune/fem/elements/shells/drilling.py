"""Drilling of flat shells: a spring at each corner, for its rotation relative to that of the two sides that meet there.

At a corner with the side vectors a and b to the next and to the previous corner, J = |a × b| and f = a × b / J, the
displacements u_a and u_b of their ends relative to the corner turn the plane of the two sides about f by
(b·u_a − a·u_b)/2J, and tilt it. The stiffness is 1e-6 K6ROT G t J; for a parallelogram that is G t times the area at
each corner. Matrices of commercial Nastran show this form to the last digit: docs/evidence/09_element_matrices.md.
"""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals


def drilling_rows(corners: Reals, normals: Reals) -> Reals:
    """(m, n, n, 6) rotations of the corners about their normals less those of the sides, times the root of J.

    Parameters
    ----------
    corners : (m, n, 3) grid points on the axes of the mean plane, flat or warped
    normals : (m, n, 3) unit normals that the element shares with its neighbours

    The rotation of the sides is taken about the shared normal too, so that a rigid-body motion strains no spring.
    """
    m, n, _ = corners.shape
    ahead, behind = (np.roll(corners, -k, axis=1) - corners for k in (1, -1))
    cross = np.cross(ahead, behind)
    size = np.linalg.norm(cross, axis=2)[..., None]
    facet = cross / size
    about, a, b = (np.sum(normals * v, axis=2)[..., None] for v in (facet, ahead, behind))
    # factors of u_a and u_b in the rotation of the facet about the shared normal, times J
    next_by, previous_by = 0.5 * about * behind - b * facet, a * facet - 0.5 * about * ahead
    rows, root = np.zeros((m, n, n, 6)), np.sqrt(size)
    for i in range(n):
        rows[:, i, i, 3:] = normals[:, i] * root[:, i]
        rows[:, i, (i + 1) % n, :3] = -next_by[:, i] / root[:, i]
        rows[:, i, i - 1, :3] = -previous_by[:, i] / root[:, i]
        rows[:, i, i, :3] = (next_by[:, i] + previous_by[:, i]) / root[:, i]
    return rows
