"""Shape functions of solids with mid-side nodes, in the order of Nastran's cards.

Each shape is a list of nodes and a list of functions r^a s^b t^c / (1 − t)^d as many as nodes; the shape functions are
the combinations that are one at one node and zero at the others. Hexahedron: [−1, 1]³. Pentahedron: the triangle
r, s ≥ 0, r + s ≤ 1 times t in [−1, 1]. Tetrahedron: r, s, t ≥ 0, r + s + t ≤ 1. Pyramid: base [−1, 1]² at t = 0, apex
at t = 1, where the functions that are not polynomials are those of Bedrosian (1992): quadratic on every triangle,
serendipity on the base.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Exponents = tuple[int, int, int, int]
Points = list[tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class SolidShape:
    """Nodes, functions and edges of a reference solid.

    Parameters
    ----------
    nodes : (n, 3) places of the nodes
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
        # all weights are eighths, so that rounding them takes away the errors of the inverse
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
    # at the apex every numerator of ours vanishes faster than (1 − t)^d
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
    # superlinear degree two at most: the sum of the exponents above one
    cube = product(range(3), repeat=3)
    return [(a, b, c, 0) for a, b, c in cube if sum(x for x in (a, b, c) if x > 1) <= 2]


def _complete() -> list[Exponents]:
    return [(a, b, c, 0) for a, b, c in product(range(3), repeat=3) if a + b + c <= 2]


def _prismatic() -> list[Exponents]:
    pairs = [(a, b, c) for a, b, c in product(range(3), repeat=3) if a + b <= 2]
    return [(a, b, c, 0) for a, b, c in pairs if c < 2 or a + b <= 1]


HEXA20 = _shape(
    [(r, s, t) for t in (-1.0, 1.0) for r, s in _SQUARE],
    [*_ring(0, 4), *((i, i + 4) for i in range(4)), *_ring(4, 4)],
    _serendipity(),
)
PENTA15 = _shape(
    [(r, s, t) for t in (-1.0, 1.0) for r, s in _TRIANGLE],
    [*_ring(0, 3), *((i, i + 3) for i in range(3)), *_ring(3, 3)],
    _prismatic(),
)
TETRA10 = _shape(
    [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)],
    [*_ring(0, 3), *((i, 3) for i in range(3))],
    _complete(),
)
PYRAM13 = _shape(
    [*((r, s, 0.0) for r, s in _SQUARE), (0.0, 0.0, 1.0)],
    [*_ring(0, 4), *((i, 4) for i in range(4))],
    [*_complete(), *_FLAT],
)
