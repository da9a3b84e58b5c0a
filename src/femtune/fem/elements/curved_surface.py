"""Where a curved shell sits: base vectors and normals of its surface at points, and axes on the tangent planes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.fem.elements.curved_shape import CurvedShape, Reals, centre_shares, square_bubble
from femtune.fem.elements.placement import cross_matrix
from femtune.fem.elements.shell_placement import mean_plane


@dataclass(frozen=True, eq=False)
class CurvedNodes:
    """m curved shells with n nodes.

    Parameters
    ----------
    shape : the reference shape
    xyz : (m, n, 3) places in the basic frame, zero for a mid-side node that is left out
    normals : (m, n, 3) unit normals that the nodes share with the neighbours, zero likewise
    missing : (m, n) True for a mid-side node that is left out
    """

    shape: CurvedShape
    xyz: Reals
    normals: Reals
    missing: NDArray[np.bool_]

    @cached_property
    def axes(self) -> Reals:
        """(m, 3, 3) axes of the mean plane of the corners, as columns."""
        return mean_plane(self.xyz[:, : self.shape.corners])[0]

    @cached_property
    def _shares(self) -> Reals | None:
        if self.shape.corners == 3:
            return None
        whole = ~np.any(self.missing, axis=1)
        return centre_shares(mean_plane(self.xyz[:, :4])[1]) * whole[:, None]

    def functions(self, points: Reals) -> Reals:
        """(m, p, 3, n) shape functions at points (p, 2), and their derivatives along r and s; m may be 1.

        A mid-side node that is left out gives half of its function to each end of its side.
        """
        out = self.shape.functions(points)[None]
        if self._shares is not None:
            out = out + square_bubble(points)[None, :, :, None] * self._shares[:, None, None]
        if not self.missing.any():
            return np.asarray(out)
        corners = self.shape.corners
        out = np.repeat(out, len(self.xyz) // len(out), axis=0)
        given = out[..., corners:] * self.missing[:, None, None, corners:]
        out[..., :corners] += 0.5 * (given + np.roll(given, 1, axis=3))
        out[..., corners:] -= given
        return np.asarray(out)

    def sides(self) -> Reals:
        """(m, n, 2, 3) tangents at the nodes: along the side ahead and the side behind, from corners outwards.

        At the middle of a side, along it and from it into the element.
        """
        bases = (self.functions(self.shape.nodes) @ self.xyz[:, None])[:, :, 1:]
        return np.asarray(np.einsum("nkl,mnli->mnki", self.shape.side_directions, bases))

    def surface(self, points: Reals) -> Surface:
        """The surface at points."""
        functions = self.functions(points)
        place, normal = functions @ self.xyz[:, None], functions @ self.normals[:, None]
        functions = np.broadcast_to(functions, (len(place), *functions.shape[1:]))
        return Surface(functions, place[:, :, 1:], normal, self.normals)


@dataclass(frozen=True, eq=False)
class Surface:
    """Curved shells at p points.

    Parameters
    ----------
    functions : (m, p, 3, n) shape functions and their derivatives along r and s
    bases : (m, p, 2, 3) base vectors, derivatives of the place along r and s
    director : (m, p, 3, 3) interpolated normal and its derivatives along r and s
    normals : (m, n, 3) unit normals of the nodes
    """

    functions: Reals
    bases: Reals
    director: Reals
    normals: Reals

    @cached_property
    def cross(self) -> Reals:
        """(m, p, 3) product of the base vectors: normal to the surface, as long as the area for a unit of r s."""
        return np.cross(self.bases[:, :, 0], self.bases[:, :, 1])

    @cached_property
    def area(self) -> Reals:
        """(m, p) area for a unit of r s."""
        return np.linalg.norm(self.cross, axis=2)

    def frames(self, axes: Reals) -> Reals:
        """(m, p, 3, 3) axes as rows, the third normal: those of the mean plane (m, 3, 3), turned the shortest way."""
        flat, normal = np.swapaxes(axes, 1, 2)[:, None], self.cross / self.area[:, :, None]
        z = np.broadcast_to(flat[:, :, 2], normal.shape)
        turn = cross_matrix(np.cross(z, normal).reshape(-1, 3)).reshape(*normal.shape, 3)
        cosine = np.einsum("mpi,mpi->mp", z, normal)[:, :, None, None]
        rotation = np.eye(3) + turn + turn @ turn / (1.0 + cosine)
        return np.asarray(flat @ np.swapaxes(rotation, 2, 3))

    def along(self, frames: Reals) -> Reals:
        """(m, p, 2, 2) derivatives of r and s (columns) by x and y (rows) of frames."""
        local = self.bases @ np.swapaxes(frames[:, :, :2], 2, 3)
        return np.asarray(np.linalg.inv(local))
