"""Geometry of curved shells: base vectors and normals of the surface at points, and axes on the tangent planes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.elements.placement import cross_matrix
from femtune.fem.elements.shells.placement import mean_plane

# ----------------------------------------------------------------------------------------------------
# Shape functions of shells with mid-side nodes, in the order of Nastran's cards.
#
# Quadrilateral: [−1, 1]², the eight serendipity functions. Triangle: r, s ≥ 0, r + s ≤ 1, the six quadratic functions.
# On a quadrilateral whose corners do not form a parallelogram, serendipity functions lack a quadratic function of
# position. A share δᵢ of the bubble (1 − r²)(1 − s²) is added to each function, the smallest shares that restore it
# (MacNeal and Harder, Int. J. Numer. Meth. Engng 33 (1992) 1049-1058).


@dataclass(frozen=True, eq=False)
class CurvedShape:
    """A reference shell.

    Parameters
    ----------
    nodes : (n, 2) positions of the nodes, corners first, then the middles of the sides 1-2, 2-3, …
    exponents : n pairs (a, b): the functions are combinations of r^a s^b
    points, weights : (p, 2) and (p,) rule of integration, the points nearest to the corners first
    """

    nodes: Reals
    exponents: tuple[tuple[int, int], ...]
    points: Reals
    weights: Reals

    @property
    def corners(self) -> int:
        """Number of corners."""
        return len(self.nodes) // 2

    @cached_property
    def _weights(self) -> Reals:
        # all weights are multiples of a quarter, so that rounding removes the errors of the inverse
        return np.asarray(np.round(4.0 * np.linalg.inv(self._powers(self.nodes))) / 4.0)

    @cached_property
    def side_directions(self) -> Reals:
        """(n, 2, 2) directions on the reference shape from each corner to the next and to the one before.

        At the middle of a side: along it and inwards, at an angle of 180 degrees where angles are used as weights.
        """
        corners = self.nodes[: self.corners]
        ahead, back = (np.roll(corners, k, axis=0) - corners for k in (-1, 1))
        # a tiny inward component: it defines the plane, and the angle is nearly straight
        inside = -ahead + 1e-3 * (corners.mean(axis=0) - self.nodes[self.corners :])
        return np.concatenate([np.stack([ahead, back], axis=1), np.stack([ahead, inside], axis=1)])

    @cached_property
    def corner_shares(self) -> Reals:
        """(p, c) linear interpolation between the corners, at the points of the rule."""
        r, s = self.points.T[:, :, None]
        if self.corners == 3:
            return np.concatenate([1.0 - r - s, r, s], axis=1)
        x, y = self.nodes[:4].T
        return np.asarray(0.25 * (1.0 + r * x) * (1.0 + s * y))

    def functions(self, points: Reals) -> Reals:
        """(p, 3, n) functions at points (p, 2), and their derivatives along r and s."""
        return np.stack([self._powers(points, *by) for by in ((0, 0), (1, 0), (0, 1))], axis=1) @ self._weights

    def _powers(self, points: Reals, by_r: int = 0, by_s: int = 0) -> Reals:
        r, s = points.T
        return np.stack([_power(r, a, by_r) * _power(s, b, by_s) for a, b in self.exponents], axis=1)


def _power(x: Reals, n: int, derivative: int) -> Reals:
    """x^n or its derivative."""
    return np.asarray(n * x ** max(n - 1, 0) if derivative else x**n)


def square_bubble(points: Reals) -> Reals:
    """(p, 3) (1 − r²)(1 − s²) at points (p, 2), and its derivatives along r and s."""
    r, s = points.T
    return np.stack([(1 - r * r) * (1 - s * s), -2 * r * (1 - s * s), -2 * s * (1 - r * r)], axis=1)


def triangle_bubble(points: Reals) -> Reals:
    """(p, 3) r s (1 − r − s) at points (p, 2), and its derivatives along r and s."""
    r, s = points.T
    return np.stack([r * s * (1 - r - s), s * (1 - 2 * r - s), r * (1 - r - 2 * s)], axis=1)


def centre_shares(corners: Reals) -> Reals:
    """(m, 8) shares δ of the bubble for quadrilaterals with corners (m, 4, 2); zero for parallelograms.

    The shares reproduce at the centre the quadratic functions of position given at the corners and mid-side nodes.
    """
    size = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    flat = (corners - corners.mean(axis=1, keepdims=True)) / size[:, None, None]
    xy = np.concatenate([flat, 0.5 * (flat + np.roll(flat, -1, axis=1))], axis=1)
    x, y = np.moveaxis(xy, 2, 0)
    known = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    # with straight sides the centre is the mean of the corners, the origin: all functions but the constant vanish there
    wanted = -(known @ _SERENDIPITY_CENTRE)
    wanted[:, 0] = 0.0
    square = known @ np.swapaxes(known, 1, 2)
    return np.asarray(np.einsum("mki,mk->mi", known, np.linalg.solve(square, wanted[:, :, None])[:, :, 0]))


_SERENDIPITY_CENTRE = np.array([-0.25] * 4 + [0.5] * 4)


def _square_rule() -> tuple[Reals, Reals]:
    ends, whole = np.sqrt(0.6), {-1: 5 / 9, 0: 8 / 9, 1: 5 / 9}
    places = [(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0), (0, 0)]
    return ends * np.array(places, float), np.array([whole[r] * whole[s] for r, s in places])


def _triangle_rule() -> tuple[Reals, Reals]:
    """Seven points, exact for polynomials of degree five (Radon 1948)."""
    root = np.sqrt(15.0)
    near, far = (6.0 - root) / 21.0, (6.0 + root) / 21.0
    places = [_corner_point(a, k) for a in (near, far) for k in range(3)]
    weights = [(155.0 - root) / 2400.0] * 3 + [(155.0 + root) / 2400.0] * 3
    return np.array([*places, (1 / 3, 1 / 3)]), np.array([*weights, 9.0 / 80.0])


def _corner_point(a: float, k: int) -> tuple[float, float]:
    """The point whose area coordinates are a except for corner k."""
    area = [a, a, a]
    area[k] = 1.0 - 2.0 * a
    return area[1], area[2]


QUAD8_SHAPE = CurvedShape(
    np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)], float),
    ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (2, 1), (1, 2)),
    *_square_rule(),
)
TRI6_SHAPE = CurvedShape(
    np.array([(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)]),
    ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)),
    *_triangle_rule(),
)


@dataclass(frozen=True, eq=False)
class CurvedNodes:
    """m curved shells with n nodes.

    Parameters
    ----------
    shape : the reference shape
    xyz : (m, n, 3) positions in the basic frame, zero for a mid-side node that is left out
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
    bases : (m, p, 2, 3) base vectors, derivatives of the position along r and s
    director : (m, p, 3, 3) interpolated normal and its derivatives along r and s
    normals : (m, n, 3) unit normals of the nodes
    """

    functions: Reals
    bases: Reals
    director: Reals
    normals: Reals

    @cached_property
    def cross(self) -> Reals:
        """(m, p, 3) product of the base vectors: normal to the surface, of the length of the area per unit of r s."""
        return np.cross(self.bases[:, :, 0], self.bases[:, :, 1])

    @cached_property
    def area(self) -> Reals:
        """(m, p) area per unit of r s."""
        return np.linalg.norm(self.cross, axis=2)

    def frames(self, axes: Reals) -> Reals:
        """(m, p, 3, 3) axes as rows, the third normal: the mean plane's (m, 3, 3), rotated by the smallest angle."""
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
