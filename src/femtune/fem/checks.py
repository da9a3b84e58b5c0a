"""Checks of a structure before it is solved: rigid-body motions, mass properties, strain-free motion, grounding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.dofs import DIRECTIONS, Dof
from femtune.fem.assemble import nominal_matrices
from femtune.fem.elements import pieces
from femtune.fem.elements.placement import arm_transform
from femtune.fem.structure import NodeTable, Structure

STRAIN_FREE = 1e-8
"""Largest force that a strain-free rigid-body motion leaves at a DOF, relative to the forces that cancel there.

Half of the digits of a double, so that neither rounding of many terms fails the check nor a weak spring to ground
passes it.
"""
_LEAST_FORCE_SCALE = 1e-4
"""Smallest scale of the forces at a DOF, as a fraction of the bound that the diagonal stiffness sets.

Entries that cancel when elements are added leave rounding errors of the size of the diagonal. Without this lower limit
a row of such remainders would be compared with itself.
"""


def rigid_body_modes(nodes: NodeTable, about: Reals | None = None) -> Reals:
    """(n_g, 6) displacements of unit translations and rotations about a point, in the displacement frames.

    Scalar points do not move.
    """
    point = np.zeros(3) if about is None else np.asarray(about, float)
    out = np.zeros((nodes.n_dofs, 6))
    n = len(nodes.ids)
    basic = np.tile(np.eye(3), (n, 1, 1))
    out[: 6 * n] = arm_transform(nodes.frames, nodes.xyz - point, basic).reshape(6 * n, 6)
    return out


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass properties of a structure (what PARAM GRDPNT asks for), in the basic frame.

    Parameters
    ----------
    about : (3,) the point of reference
    mass : mean of the masses felt in the three directions
    directional_mass : (3,) mass felt in x, y and z; they differ where scalar masses act in some directions only
    centre : (3,) centre of gravity
    inertia : (3, 3) inertia tensor about `about`
    central_inertia : (3, 3) inertia tensor about the centre of gravity
    matrix : (6, 6) rigid-body mass matrix about `about`
    """

    about: Reals
    mass: float
    directional_mass: Reals
    centre: Reals
    inertia: Reals
    central_inertia: Reals
    matrix: Reals


def mass_properties(nodes: NodeTable, mass: sp.csr_array, about: Reals | None = None) -> MassProperties:
    """Mass, centre of gravity and inertia from the g-set mass matrix (n_g, n_g) and six rigid motions."""
    point = np.zeros(3) if about is None else np.asarray(about, float)
    motions = rigid_body_modes(nodes, point)
    return mass_properties_of(motions.T @ (mass @ motions), point)


def mass_properties_of(matrix: Reals, about: Reals) -> MassProperties:
    """Mass properties from the (6, 6) mass matrix of the rigid motions about a point."""
    point, matrix = about, 0.5 * (matrix + matrix.T)
    directional = np.diag(matrix)[:3].copy()
    shift = _centre(matrix)
    move = arm_transform(np.eye(3)[None], -shift[None], np.eye(3)[None])[0]
    central = (move.T @ matrix @ move)[3:, 3:]
    return MassProperties(
        point, float(directional.mean()), directional, point + shift, matrix[3:, 3:].copy(), central, matrix
    )


def _centre(matrix: Reals) -> Reals:
    """Centre of gravity from the static moments; each coordinate is seen by the two masses across it."""
    out = np.zeros(3)
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        # mass along j times its arm about k, and mass along k times its arm about j
        moment, mass = matrix[j, 3 + k] - matrix[k, 3 + j], matrix[j, j] + matrix[k, k]
        out[axis] = moment / mass if mass else 0.0
    return out


@dataclass(frozen=True, eq=False)
class RigidMotionCheck:
    """Strain energy and residual forces of one rigid-body motion.

    Parameters
    ----------
    motion : "X" to "RZ"
    energy : ½ rᵀKr for a unit motion
    relative_energy : the energy divided by the sum of the magnitudes of its terms
    relative_force : largest force left at a DOF, divided by the sum of the magnitudes that cancel there; this sum is
        taken as at least 1e-4 of its upper bound from the diagonal stiffness
    worst : at most ten DOFs with the largest relative forces above the threshold, and these forces
    """

    motion: str
    energy: float
    relative_energy: float
    relative_force: float
    worst: tuple[tuple[Dof, float], ...]

    @property
    def passed(self) -> bool:
        """True where the motion is strain-free: relative force not above STRAIN_FREE."""
        return self.relative_force <= STRAIN_FREE


def rigid_motion_checks(
    nodes: NodeTable, stiffness: sp.csr_array, about: Reals | None = None
) -> tuple[RigidMotionCheck, ...]:
    """Strain energy and residual forces of the six rigid motions of the unconstrained structure (n_g, n_g)."""
    motions = rigid_body_modes(nodes, about)
    forces, sizes = stiffness @ motions, _force_sizes(stiffness, np.abs(motions))
    return tuple(_motion_check(nodes, i, motions[:, i], forces[:, i], sizes[:, i]) for i in range(6))


def _force_sizes(stiffness: sp.csr_array, motions: Reals) -> Reals:
    """(n_g, 6) Σ_j |K_ij| |r_j|, but at least a small fraction of its upper bound Σ_j √(K_ii K_jj) |r_j|."""
    root = np.sqrt(np.maximum(stiffness.diagonal(), 0.0))[:, None]
    pattern = sp.csr_array((np.ones(stiffness.nnz), stiffness.indices, stiffness.indptr), shape=stiffness.shape)
    return np.maximum(abs(stiffness) @ motions, _LEAST_FORCE_SCALE * root * (pattern @ (root * motions)))


def _motion_check(nodes: NodeTable, i: int, r: Reals, force: Reals, size: Reals) -> RigidMotionCheck:
    relative = np.divide(np.abs(force), size, out=np.zeros_like(force), where=size > 0.0)
    energy, scale = 0.5 * float(r @ force), 0.5 * float(np.abs(r) @ size)
    order = np.argsort(-relative, kind="stable")[:10]
    worst = tuple((nodes.describe(int(k)), float(relative[k])) for k in order if relative[k] > STRAIN_FREE)
    largest = float(relative.max(initial=0.0))
    return RigidMotionCheck(DIRECTIONS[1 + i], energy, energy / scale if scale else 0.0, largest, worst)


@dataclass(frozen=True)
class GroundingElement:
    """An element that a rigid motion strains: its energy for a unit motion, absolute and relative to its terms."""

    card: str
    id: int
    motion: str
    energy: float
    relative_energy: float


def grounding_elements(structure: Structure, about: Reals | None = None) -> tuple[GroundingElement, ...]:
    """Elements that rigid motions strain (springs to ground, bushes and springs across a gap), largest energy first."""
    motions = rigid_body_modes(structure.nodes, about)
    elements = []
    for batch in structure.batches:
        known = np.where(batch.dofs[:, :, None] >= 0, motions[batch.dofs], 0.0)
        energy, scale = np.zeros((2, len(batch), 6))
        for term in (part for piece in pieces(batch, structure) for part in piece):
            if term.matrix == "stiffness":
                m, r = nominal_matrices(batch, structure, term), known[term.at]
                energy[term.at] += 0.5 * np.einsum("eim,eim->em", r, m @ r)
                scale[term.at] += 0.5 * np.einsum("eim,eim->em", np.abs(r), np.abs(m) @ np.abs(r))
        relative = np.divide(energy, scale, out=np.zeros_like(energy), where=scale > 0.0)
        elements += [
            GroundingElement(
                batch.card, int(batch.ids[e]), DIRECTIONS[1 + i], float(energy[e, i]), float(relative[e, i])
            )
            for e, i in np.argwhere(relative > STRAIN_FREE)
        ]
    return tuple(sorted(elements, key=lambda g: -g.energy))
