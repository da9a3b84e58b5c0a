"""Shape functions of solids with mid-side nodes, in the order of Nastran's cards.

Each shape is a list of nodes and a list of as many functions r^a s^b t^c / (1 − t)^d; the shape functions are the
combinations that are one at one node and zero at the others. Hexahedron: [−1, 1]³. Pentahedron: the triangle
r, s ≥ 0, r + s ≤ 1 times t in [−1, 1]. Tetrahedron: r, s, t ≥ 0, r + s + t ≤ 1. Pyramid: base [−1, 1]² at t = 0, apex
at t = 1, where the functions that are not polynomials are those of Bedrosian (1992): quadratic on every triangle,
serendipity on the base.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals

Exponents = tuple[int, int, int, int]
Points = list[tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class SolidShape:
    """Nodes, functions and edges of a reference solid.

    Parameters
    ----------
    nodes : (n, 3) positions of the nodes
    functions : n exponents (a, b, c, d) of r^a s^b t^c / (1 − t)^d
    edges : the two corners of each mid-side node, which follow the corners in this order
    """

    nodes: Reals
    functions: tuple[Exponents, ...]
    edges: tuple[tuple[int, int], ...]

    @property
    def corners(self) -> int:
        """Number of corners."""
        return len(self.nodes) - len(self.edges)

    @cached_property
    def _weights(self) -> Reals:
        # all weights are multiples of an eighth, so that rounding removes the errors of the inverse
        at_nodes = _functions(self.functions, self.nodes)
        return np.asarray(np.round(8.0 * np.linalg.inv(at_nodes)) / 8.0)

    def values(self, points: NDArray) -> NDArray:
        """(p, n) shape functions at points (p, 3)."""
        return np.asarray(_functions(self.functions, points) @ self._weights)

    def slopes(self, points: NDArray) -> NDArray:
        """(p, 3, n) derivatives of the shape functions along r, s, t."""
        return np.asarray(np.stack([_derivatives(self.functions, points, k) for k in range(3)], 1) @ self._weights)


def _functions(functions: Iterable[Exponents], points: NDArray) -> NDArray:
    r, s, t = np.asarray(points).T
    return np.stack([r**a * s**b * t**c * _fall(t, d) for a, b, c, d in functions], axis=1)


def _fall(t: NDArray, d: int) -> NDArray:
    # at the apex every numerator vanishes faster than (1 − t)^d
    below = np.where(t == 1.0, 1.0, 1.0 - t)
    return np.asarray(1.0 / below**d)


def _derivatives(functions: Iterable[Exponents], points: NDArray, k: int) -> NDArray:
    """Along the k-th coordinate; that of 1/(1 − t)^d is d/(1 − t)^(d + 1)."""
    columns = []
    for exponents in functions:
        power, lower = exponents[k], list(exponents)
        lower[k] = max(power - 1, 0)
        column = power * _functions([tuple(lower)], points)  # type: ignore[list-item]
        if k == 2 and exponents[3]:
            column = column + exponents[3] * _functions([(*exponents[:3], exponents[3] + 1)], points)
        columns.append(column[:, 0])
    return np.stack(columns, axis=1)


def _shape(corners: Points, edges: Iterable[tuple[int, int]], functions: Iterable[Exponents]) -> SolidShape:
    ends = np.array(corners, float)
    pairs = tuple(edges)
    middles = [(ends[a] + ends[b]) / 2.0 for a, b in pairs]
    return SolidShape(np.array([*ends, *middles]), tuple(functions), pairs)


def _ring(start: int, count: int) -> list[tuple[int, int]]:
    return [(start + i, start + (i + 1) % count) for i in range(count)]


_SQUARE = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
_TRIANGLE = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
_FLAT: list[Exponents] = [(1, 1, 0, 1), (2, 1, 0, 1), (1, 2, 0, 1)]


def _serendipity() -> list[Exponents]:
    # superlinear degree (the sum of the exponents above one) of at most two
    cube = product(range(3), repeat=3)
    return [(a, b, c, 0) for a, b, c in cube if sum(x for x in (a, b, c) if x > 1) <= 2]


def _complete() -> list[Exponents]:
    return [(a, b, c, 0) for a, b, c in product(range(3), repeat=3) if a + b + c <= 2]


def _prismatic() -> list[Exponents]:
    pairs = [(a, b, c) for a, b, c in product(range(3), repeat=3) if a + b <= 2]
    return [(a, b, c, 0) for a, b, c in pairs if c < 2 or a + b <= 1]


HEXA20_SHAPE = _shape(
    [(r, s, t) for t in (-1.0, 1.0) for r, s in _SQUARE],
    [*_ring(0, 4), *((i, i + 4) for i in range(4)), *_ring(4, 4)],
    _serendipity(),
)
PENTA15_SHAPE = _shape(
    [(r, s, t) for t in (-1.0, 1.0) for r, s in _TRIANGLE],
    [*_ring(0, 3), *((i, i + 3) for i in range(3)), *_ring(3, 3)],
    _prismatic(),
)
TETRA10_SHAPE = _shape(
    [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)],
    [*_ring(0, 3), *((i, 3) for i in range(3))],
    _complete(),
)
PYRAM13_SHAPE = _shape(
    [*((r, s, 0.0) for r, s in _SQUARE), (0.0, 0.0, 1.0)],
    [*_ring(0, 4), *((i, 4) for i in range(4))],
    [*_complete(), *_FLAT],
)


# ----------------------------------------------------------------------------------------------------
# Integration points of solids: positions (p, 3) in the coordinates of ``solid_shape`` and weights (p,), all positive.


@dataclass(frozen=True, eq=False)
class SolidPoints:
    """Positions (p, 3) and weights (p,), whose sum is the volume of the reference shape."""

    places: Reals
    weights: Reals


def hexahedron_points(n: int) -> SolidPoints:
    """n³ Gauss points: exact for powers up to 2n − 1 in each coordinate."""
    x, w = np.polynomial.legendre.leggauss(n)
    r, s, t = np.meshgrid(x, x, x, indexing="ij")
    return _points(r, s, t, w[:, None, None] * w[:, None] * w)


def pentahedron_points(n: int) -> SolidPoints:
    """Six points of the triangle (degree 4) times n Gauss points along t."""
    flat, area = _orbits(
        (
            (0.44594849091596488632, 0.22338158967801146570),
            (0.09157621350977074346, 0.10995174365532186764),
        ),
        3,
    )
    x, w = np.polynomial.legendre.leggauss(n)
    r, t = np.meshgrid(flat[:, 0], x, indexing="ij")
    s = np.broadcast_to(flat[:, 1:], r.shape)
    return _points(r, s, t, 0.5 * area[:, None] * w)


def tetrahedron_points() -> SolidPoints:
    """Fourteen points, degree 5: two orbits of four on the lines to the corners, one of six towards the edges."""
    corner = ((0.31088591926330060980, 0.11268792571801585080), (0.09273525031089122640, 0.07349304311636194955))
    places, weights = _orbits(corner, 4)
    a, w = 0.04550370412564964949, 0.04254602077708146644
    edge = sorted(set(permutations((a, a, 0.5 - a, 0.5 - a))))
    return SolidPoints(np.concatenate([places, np.array(edge)[:, :3]]), np.concatenate([weights, np.full(6, w)]) / 6.0)


def eight_points() -> SolidPoints:
    """Eight points of the tetrahedron of equal weight, degree 3: two orbits of four on the lines to the corners.

    With barycentric coordinates ¼ + δ (1, 1, 1, −3), the moments of degree 2 and 3 are δ₁² + δ₂² = 1/40 and
    δ₁³ + δ₂³ = −1/480, which gives δ₁ + δ₂ as the middle root of x³ − 3x/40 − 1/240.
    """
    total = float(np.sort(np.roots([1.0, 0.0, -3.0 / 40.0, -1.0 / 240.0]).real)[1])
    half = np.sqrt(1.0 / 80.0 - total * total / 4.0)
    places, weights = _orbits(tuple((0.25 + total / 2.0 + d, 0.125) for d in (half, -half)), 4)
    return SolidPoints(places, weights / 6.0)


def pyramid_points(n: int) -> SolidPoints:
    """n² Gauss points in each of n Gauss-Jacobi planes t = const.: exact for polynomials to degree 2n − 1.

    Also exact for products of the pyramid's functions, which are polynomials of r/(1 − t), s/(1 − t) and t.
    """
    x, w = np.polynomial.legendre.leggauss(n)
    z, v = gauss_jacobi(n)
    height = (1.0 - z) / 2.0
    u, s, t = np.meshgrid(x, x, 1.0 - height, indexing="ij")
    return _points(u * height, s * height, t, w[:, None, None] * w[:, None] * v / 8.0)


def gauss_jacobi(n: int) -> tuple[Reals, Reals]:
    """Gauss-Jacobi points and weights on [−1, 1] for the weight (1 − z)², exact to degree 2n − 1.

    Eigenvalues of the three-term recurrence (Golub and Welsch, Math. Comp. 23 (1969) 221-230); ``scipy.special`` also
    has them, but takes longer to import than all elements.
    """
    k = np.arange(n, dtype=float)
    # the recurrence of the Jacobi polynomials with α = 2, β = 0, whose weight has the integral 8/3
    middle = -1.0 / ((k + 1.0) * (k + 2.0))
    k = k[1:]
    beside = k * (k + 2.0) / ((k + 1.0) * np.sqrt((2.0 * k + 1.0) * (2.0 * k + 3.0)))
    points, vectors = np.linalg.eigh(np.diag(middle) + np.diag(beside, 1) + np.diag(beside, -1))
    return points, 8.0 / 3.0 * vectors[0] ** 2


def _points(r: Reals, s: Reals, t: Reals, weights: Reals) -> SolidPoints:
    return SolidPoints(np.stack([r, s, t], axis=-1).reshape(-1, 3), weights.ravel())


def _orbits(orbits: Iterable[tuple[float, float]], k: int) -> tuple[Reals, Reals]:
    """Points with k − 1 equal barycentric coordinates and the weight of each; the first k − 1 of them."""
    places, weights = [], []
    for equal, weight in orbits:
        bary = np.full((k, k), equal) + np.eye(k) * (1.0 - k * equal)
        places.append(bary[:, : k - 1])
        weights.append(np.full(k, weight))
    return np.concatenate(places), np.concatenate(weights)


# ----------------------------------------------------------------------------------------------------
# Derivatives of isoparametric shape functions, and mid-side nodes that are left out.
#
# A mid-side node whose position is NaN is left out: the element is linear along that edge, so that half of the
# node's shape function goes to each end of the edge, for the displacements and for the geometry.


@dataclass(frozen=True, eq=False)
class Tabulated:
    """Shape functions (p, n) at points, their derivatives (p, n, 3) along r, s, t, and the weights (p,)."""

    shape: SolidShape
    values: Reals
    slopes: Reals
    weights: Reals


@dataclass(frozen=True, eq=False)
class Gradients:
    """Shape functions of m solids at p points.

    Parameters
    ----------
    along : (m, p, n, 3) derivatives along the basic axes
    volume : (m, p) shares of the volume, weight times determinant
    places : (m, p, 3) positions of the points from the mean of the corners
    """

    along: Reals
    volume: Reals
    places: Reals


def tabulated(shape: SolidShape, rule: SolidPoints) -> Tabulated:
    """The functions of a shape at the points of a rule."""
    slopes = np.ascontiguousarray(np.swapaxes(shape.slopes(rule.places), 1, 2))
    return Tabulated(shape, shape.values(rule.places), slopes, rule.weights)


def gradients(table: Tabulated, xyz: Reals) -> Gradients:
    """Gradients at all points of solids whose nodes are at xyz (m, n, 3)."""
    sides = reference_sides(table, xyz)
    cofactors = np.stack([np.cross(sides[:, :, k - 2], sides[:, :, k - 1]) for k in range(3)], axis=2)
    size = np.einsum("mpi,mpi->mp", sides[:, :, 0], cofactors[:, :, 0])
    along = kept_functions(table.shape, xyz, table.slopes) @ (cofactors / size[:, :, None, None])
    values = kept_functions(table.shape, xyz, table.values)
    return Gradients(along, table.weights * size, values @ _centred(table.shape, xyz))


def reference_sides(table: Tabulated, xyz: Reals) -> Reals:
    """(m, p, 3, 3) derivatives of the position along r, s, t, as rows."""
    slopes = kept_functions(table.shape, xyz, table.slopes)
    flat = np.swapaxes(slopes, 2, 3).reshape(len(slopes), -1, xyz.shape[1])
    return np.asarray((flat @ _centred(table.shape, xyz)).reshape(len(xyz), -1, 3, 3))


def mass_shares(table: Tabulated, xyz: Reals) -> Reals:
    """(m, n, n) integrals of products of the shape functions over the volume."""
    values = kept_functions(table.shape, xyz, table.values)
    volume = table.weights * np.linalg.det(reference_sides(table, xyz))
    out = np.swapaxes(values * volume[:, :, None], 1, 2) @ values
    return np.asarray(0.5 * (out + np.swapaxes(out, 1, 2)))


def _centred(shape: SolidShape, xyz: Reals) -> Reals:
    """Positions of the nodes from the mean of the corners, zero for those left out."""
    centre = xyz[:, : shape.corners].mean(axis=1, keepdims=True)
    return np.where(np.isnan(xyz), 0.0, xyz - centre)


def kept_functions(shape: SolidShape, xyz: Reals, functions: Reals) -> Reals:
    """Functions (p, n, …) of the nodes as (m, p, n, …), half of a missing node's to each end of its edge.

    m is 1 if no element lacks a node.
    """
    missing = np.isnan(xyz[:, shape.corners :, 0])
    if not missing.any():
        return functions[None]
    out = np.repeat(functions[None], len(xyz), axis=0)
    for node, (a, b) in enumerate(shape.edges, start=shape.corners):
        lacks = missing[:, node - shape.corners]
        for end in (a, b):
            out[lacks, :, end] += 0.5 * functions[:, node]
        out[lacks, :, node] = 0.0
    return out


HEXAHEDRON_SIDES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
PENTAHEDRON_SIDES = ((0, 2, 1, -1), (3, 4, 5, -1), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
TETRAHEDRON_SIDES = ((0, 2, 1, -1), (0, 1, 3, -1), (1, 2, 3, -1), (2, 0, 3, -1))
PYRAMID_SIDES = ((0, 3, 2, 1), (0, 1, 4, -1), (1, 2, 4, -1), (2, 3, 4, -1), (3, 0, 4, -1))
"""Faces of each shape by its corners, which are its first grid points; −1 for the fourth corner of a triangle."""
