"""Number of modes that are solved by default: some elastic ones beside the rigid-body modes."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femtune.fem.checks import rigid_body_modes
from femtune.model.configured import ModelPoint
from femtune.model.linear.symmetric import SymmetricMatrix

ELASTIC_MODES = 10
"""Elastic modes that are solved by default: as many as a modal test of one structure usually identifies."""

MOST_MODES = 200
"""Modes that are solved at most to reach a frequency that the user did not state."""

_UNSTRAINED = 1e-9
"""Strain energy of a rigid-body motion relative to the sum of the magnitudes of its terms: rounding is 1e-16 times the
root of the number of terms, and a spring that holds a structure is far stiffer than this."""


def default_count(point: ModelPoint, elastic: int = ELASTIC_MODES) -> int:
    """Number of modes to solve: `elastic` ones and the free rigid-body motions."""
    return elastic + free_rigid_motions(point)


def free_rigid_motions(point: ModelPoint) -> int:
    """Number of rigid-body motions of the whole structure that strain nothing.

    They are the null space of RᵀKR with R an orthonormal basis of the six motions at the free DOFs. A very soft
    suspension counts as free. Mechanisms and the motions of parts against each other are not among them.
    """
    nodes, free = point.configured.model.structure.nodes, point.configured.free
    motions = rigid_body_modes(nodes, nodes.xyz.mean(axis=0) if len(nodes.xyz) else None)[free]
    if not nodes.has_coordinates:
        motions = motions[:, :3]
    size = np.linalg.norm(motions, axis=0)
    if not size.any():
        return 0
    basis = la.orth(motions[:, size > 0.0] / size[size > 0.0])
    K = point.symmetric_stiffness
    sizes = SymmetricMatrix(np.abs(K.data), K.indices, K.indptr)
    energy, terms = basis.T @ (K @ basis), np.abs(basis).T @ (sizes @ np.abs(basis))
    if not np.isfinite(energy).all() or not np.isfinite(terms).all():
        return 0  # the eigen-solution says what is wrong
    return int((la.eigvalsh(0.5 * (energy + energy.T)) <= _UNSTRAINED * np.diag(terms).max()).sum())
