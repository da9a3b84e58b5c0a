"""Integration points of solids: places (p, 3) in the coordinates of ``solid_shape`` and weights (p,), all positive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SolidPoints:
    """Places (p, 3) and weights (p,) that sum to the volume of the reference shape."""

    places: Reals
    weights: Reals


def hexahedron_points(n: int) -> SolidPoints:
    """n³ points of Gauss: exact for powers up to 2n − 1 in each coordinate."""
    x, w = np.polynomial.legendre.leggauss(n)
    r, s, t = np.meshgrid(x, x, x, indexing="ij")
    return _points(r, s, t, w[:, None, None] * w[:, None] * w)


def pentahedron_points(n: int) -> SolidPoints:
    """Six points of the triangle (degree 4) times n points of Gauss along t."""
    flat, area = _orbits(((0.44594849091596488632, 0.22338158967801146570), (0.09157621350977074346, _SECOND)), 3)
    x, w = np.polynomial.legendre.leggauss(n)
    r, t = np.meshgrid(flat[:, 0], x, indexing="ij")
    s = np.broadcast_to(flat[:, 1:2], r.shape)
    return _points(r, s, t, 0.5 * area[:, None] * w)


_SECOND = 0.10995174365532186764


def tetrahedron_points() -> SolidPoints:
    """Fourteen points, degree 5: two orbits of four on the lines to the corners, one of six towards the edges."""
    corner = ((0.31088591926330060980, 0.11268792571801585080), (0.09273525031089122640, 0.07349304311636194955))
    places, weights = _orbits(corner, 4)
    a, w = 0.04550370412564964949, 0.04254602077708146644
    edge = sorted(set(permutations((a, a, 0.5 - a, 0.5 - a))))
    return SolidPoints(np.concatenate([places, np.array(edge)[:, :3]]), np.concatenate([weights, np.full(6, w)]) / 6.0)


def four_points() -> SolidPoints:
    """Four points of the tetrahedron, degree 2."""
    places, weights = _orbits((((5.0 - np.sqrt(5.0)) / 20.0, 0.25),), 4)
    return SolidPoints(places, weights / 6.0)


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
    """n² points of Gauss in planes t = const., n planes after Jacobi: exact to degree 2n − 1 for polynomials.

    Exact too for products of the pyramid's functions, which are polynomials of r/(1 − t), s/(1 − t) and t.
    """
    x, w = np.polynomial.legendre.leggauss(n)
    z, v = roots_jacobi(n, 2.0, 0.0)
    height = (1.0 - z) / 2.0
    u, s, t = np.meshgrid(x, x, 1.0 - height, indexing="ij")
    return _points(u * height, s * height, t, w[:, None, None] * w[:, None] * v / 8.0)


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
