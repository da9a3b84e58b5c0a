"""Position of a shell: its mean plane, the corners projected on it, their heights, and the material's axes.

Nothing here depends on the number of nodes; the formulation decides how it treats the heights of a warped shape.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.elements.placement import arm_transform
from femtune.fem.structure import ElementBatch, Structure


class PlacedShells(Protocol):
    """m shells with n nodes: the input of their stiffness and mass.

    `frames` (m, n, 3, 3) are the displacement frames of the nodes, `normals` (m, n, 3) the basic directions of
    offsets.
    """

    @property
    def frames(self) -> Reals: ...

    @property
    def normals(self) -> Reals: ...

    def rows(self, offsets: bool, coupling: bool) -> dict[str, Reals]:
        """Strain rows (m, r, 6n) by name on the nodes' displacements, each times the square root of its weight."""

    def shares(self, consistent: bool, point: int | None = None) -> Reals:
        """(m, n, n) integrals of products of the shape functions over the area, or lumped ones; or of one point."""

    def direction(self, number: int, own: NDArray[np.int64]) -> tuple[Reals, Reals]:
        """Cosine and sine of the angle from the material's x axis to a uniaxial row, of some of the shells."""


@dataclass(frozen=True, eq=False)
class ShellPlane:
    """m shells with n corners on their mean planes.

    Parameters
    ----------
    axes : (m, 3, 3) columns x, y, z in the basic frame: x along the projected side 1-2, z the positive normal
    corners : (m, n, 2) x and y of the corners, from the mean of the grid points
    heights : (m, n) distances of the grid points above the plane, along z; zero on a flat element
    normals : (m, n, 3) unit normals on the axes that the element shares with its neighbours at each corner
    carry : (m, n, 6, 6) from a grid point's displacements, in its frame, to (u, v, w, θx, θy, θz) on the axes
    frames : (m, n, 3, 3) displacement frames of the grid points
    material : (m, 2) cosine and sine of the angle from x to the material's x axis, about z
    """

    axes: Reals
    corners: Reals
    heights: Reals
    normals: Reals
    carry: Reals
    frames: Reals
    material: Reals

    def __len__(self) -> int:
        return len(self.axes)


def shell_plane(batch: ElementBatch, structure: Structure, normals: Reals, part: slice) -> ShellPlane:
    """Mean planes of a part of a batch; shapes must have passed ``check_shells``.

    `normals` (e, n, 3) are the shared normals of the whole batch, in the basic frame.
    """
    at = batch.nodes[part]
    xyz, frames = structure.nodes.xyz[at], structure.nodes.frames[at]
    axes, corners, heights = mean_plane(xyz)
    carry = np.zeros((*at.shape, 6, 6))
    carry[..., :3, :3] = carry[..., 3:, 3:] = np.swapaxes(axes, 1, 2)[:, None] @ frames
    material = material_axis(axes, batch.facts["theta"][part], batch.facts["direction"][part])
    return ShellPlane(axes, corners, heights, normals[part] @ axes, carry, frames, material)


def mean_plane(xyz: Reals) -> tuple[Reals, Reals, Reals]:
    """Axes (m, 3, 3), projected corners (m, n, 2) and heights (m, n) of shells with corners `xyz` (m, n, 3)."""
    z = shell_normal(xyz)
    z = z / np.linalg.norm(z, axis=1)[:, None]
    side = xyz[:, 1] - xyz[:, 0]
    x = side - np.sum(side * z, axis=1)[:, None] * z
    x /= np.linalg.norm(x, axis=1)[:, None]
    axes = np.stack([x, np.cross(z, x), z], axis=2)
    local = (xyz - xyz.mean(axis=1)[:, None]) @ axes
    return axes, local[:, :, :2], local[:, :, 2]


def shell_normal(xyz: Reals) -> Reals:
    """(m, 3) positive normals, not of unit length: diagonal 1-3 × diagonal 2-4, or side 1-2 × side 1-3."""
    if xyz.shape[1] == 3:
        return np.cross(xyz[:, 1] - xyz[:, 0], xyz[:, 2] - xyz[:, 0])
    return np.cross(xyz[:, 2] - xyz[:, 0], xyz[:, 3] - xyz[:, 1])


def material_axis(axes: Reals, theta: Reals, direction: Reals) -> Reals:
    """(m, 2) cosine and sine of the material's angle: `theta` from side 1-2, or the projection of a `direction`."""
    out = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    given = direction.any(axis=1)
    flat = np.einsum("mi,mij->mj", direction[given], axes[given])[:, :2]
    out[given] = flat / np.linalg.norm(flat, axis=1)[:, None]
    return out


def offset_arms(normals: Reals, frames: Reals) -> Reals:
    """(m, n, 3, 6) from a node's displacements to the basic ones that a unit offset along its normal (m, n, 3) adds."""
    m, n, _ = normals.shape
    basic = np.broadcast_to(np.eye(3), (m * n, 3, 3))
    lifted = arm_transform(basic, normals.reshape(-1, 3), frames.reshape(-1, 3, 3))[:, :3]
    lifted[:, :, :3] = 0.0
    return lifted.reshape(m, n, 3, 6)
