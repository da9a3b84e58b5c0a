"""Motion of a point of a surface patch: its projection on the patch, its displacement, and the rotation there.

A patch has three or four corners, or six or eight grid points including those at the middle of its sides. The
displacement of a point is interpolated by the shape functions. Its rotations are those of the surface: the slopes of
the normal displacement (Kirchhoff), and about the normal half the difference of the in-plane slopes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.fem.elements import placement
from femtune.fem.elements.shells import quad
from femtune.fem.elements.shells.curved_surface import QUAD8_SHAPE, TRI6_SHAPE

OUTSIDE = 0.02
"""Distance by which a projection may lie outside a patch, as a fraction of the patch.

Projections on the common side of two patches of a curved mesh may miss both by a gap between facets.
"""
_MOST_STEPS = 50
"""Gauss-Newton steps of a projection, after which the last point is taken.

Flat patches need one or two; only points far from a strongly curved patch come near the limit.
"""
_STEP_TOLERANCE = 1e-13
"""Step in the natural coordinates (of size 1) at which a projection has converged to rounding."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Grid points of a patch, corners first.

    Parameters
    ----------
    rows : (n,) rows of the node table; n is 3, 4, 6 or 8
    xyz : (n, 3) places in the basic frame
    """

    rows: Integers
    xyz: Reals

    @property
    def is_triangle(self) -> bool:
        """True for three corners."""
        return len(self.rows) in (3, 6)

    def functions(self, place: Reals) -> Reals:
        """(3, n) shape functions at a place (r, s), and their derivatives along r and s."""
        r, s = place
        if len(self.rows) == 3:
            return np.array([[1.0 - r - s, r, s], [-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
        if len(self.rows) == 4:
            point = (float(r), float(s))
            return np.vstack([quad.functions(point), quad.slopes(point)])
        shape = TRI6_SHAPE if self.is_triangle else QUAD8_SHAPE
        return shape.functions(np.asarray(place)[None])[0]

    def project(self, point: Reals) -> SurfacePoint:
        """The foot of the normal from a point to the surface."""
        place = np.full(2, 1.0 / 3.0 if self.is_triangle else 0.0)
        for _ in range(_MOST_STEPS):
            functions = self.functions(place)
            gap, bases = point - functions[0] @ self.xyz, functions[1:] @ self.xyz
            step = np.linalg.lstsq(bases.T, gap, rcond=None)[0]
            # far away a curved surface may send the step anywhere
            place = np.clip(place + step, -5.0, 5.0)
            if np.abs(step).max() < _STEP_TOLERANCE:
                break
        return SurfacePoint(
            self, place, self.functions(place), float(np.linalg.norm(point - self.functions(place)[0] @ self.xyz))
        )


@dataclass(frozen=True, eq=False)
class SurfacePoint:
    """A point on a patch.

    Parameters
    ----------
    patch : the patch
    place : (2,) natural coordinates r and s
    functions : (3, n) shape functions there, and their derivatives
    distance : distance of the projected point from the surface
    """

    patch: Patch
    place: Reals
    functions: Reals
    distance: float

    @property
    def xyz(self) -> Reals:
        """(3,) place in the basic frame."""
        return np.asarray(self.functions[0] @ self.patch.xyz)

    @property
    def is_inside(self) -> bool:
        """Whether it lies on the patch."""
        r, s = self.place
        if self.patch.is_triangle:
            return bool(min(r, s, 1.0 - r - s) >= -OUTSIDE)
        return bool(max(abs(r), abs(s)) <= 1.0 + 2.0 * OUTSIDE)

    @property
    def axes(self) -> Reals:
        """(3, 3) columns: two directions in the tangent plane, the first along r, and the normal."""
        bases = self.functions[1:] @ self.patch.xyz
        normal = np.cross(bases[0], bases[1])
        x, z = (v / np.linalg.norm(v) for v in (bases[0], normal))
        return np.stack([x, np.cross(z, x), z], axis=1)

    def displacement(self) -> Reals:
        """(3, n, 3) from the translations of the grid points to that of the point, both in the basic frame."""
        return np.asarray(np.einsum("n,ij->inj", self.functions[0], np.eye(3)))

    def rotation(self) -> Reals:
        """(3, n, 3) from the translations of the grid points to the rotation of the surface."""
        bases = self.functions[1:] @ self.patch.xyz
        gradients = self.functions[1:].T @ np.linalg.pinv(bases).T
        x, y, z = self.axes.T
        along_x, along_y = gradients @ x, gradients @ y
        out = np.einsum("n,i,j->inj", along_y, x, z) - np.einsum("n,i,j->inj", along_x, y, z)
        out += 0.5 * (np.einsum("n,i,j->inj", along_x, z, y) - np.einsum("n,i,j->inj", along_y, z, x))
        return np.asarray(out)


@dataclass(frozen=True, eq=False)
class EndMotion:
    """Motion of the end of a connector.

    Parameters
    ----------
    xyz : (3,) position of the end
    normal : (3,) unit normal of the surface there
    rows : (n,) rows of the node table that it follows
    motion : (6, n, 6) from the displacements of these nodes to its translations and rotations, in the basic frame
    """

    xyz: Reals
    normal: Reals
    rows: Integers
    motion: Reals


def on_surface(point: SurfacePoint) -> EndMotion:
    """An end that moves and turns with the surface."""
    motion = np.zeros((6, len(point.patch.rows), 6))
    motion[:3, :, :3], motion[3:, :, :3] = point.displacement(), point.rotation()
    return EndMotion(point.xyz, point.axes[:, 2], point.patch.rows, motion)


def at_grid(row: int, xyz: Reals, normal: Reals) -> EndMotion:
    """An end at a grid point."""
    return EndMotion(xyz, normal, np.array([row]), np.eye(6)[:, None, :])


def on_auxiliary_points(point: SurfacePoint, around: Sequence[SurfacePoint]) -> EndMotion:
    """An end that moves as a rigid body with the mean motion of points around it, as RBE3 with equal weights."""
    arms = np.array([p.xyz for p in around]) - point.xyz
    size = float(np.linalg.norm(arms, axis=1).max())
    unit = np.array([1.0] * 3 + [1.0 / size] * 3)
    rigid = np.concatenate([np.tile(np.eye(3), (len(arms), 1, 1)), -placement.cross_matrix(arms)], axis=2)
    fit = unit[:, None] * np.linalg.pinv((rigid * unit).reshape(-1, 6))
    rows = np.unique(np.concatenate([p.patch.rows for p in around]))
    motion = np.zeros((6, len(rows), 6))
    for k, point_there in enumerate(around):
        at = np.searchsorted(rows, point_there.patch.rows)
        motion[:, at, :3] += np.einsum("ai,inj->anj", fit[:, 3 * k : 3 * k + 3], point_there.displacement())
    return EndMotion(point.xyz, point.axes[:, 2], rows, motion)


def square_around(point: SurfacePoint, side: float) -> Reals:
    """(4, 3) corners of a square in the tangent plane."""
    x, y, _ = point.axes.T
    signs = 0.5 * side * np.column_stack([quad.XI, quad.ETA])
    return np.asarray(point.xyz + signs @ np.stack([x, y]))
