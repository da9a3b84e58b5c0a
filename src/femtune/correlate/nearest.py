"""The model's node nearest to a point, and what a test's coordinates look like when none is near."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from femtune.fem.structure import NodeTable

Reals = NDArray[np.float64]

_TIE = 1e-6
"""Distances that differ by less than this fraction of the tolerance are equal."""

_FACTORS = {
    1.0: "",
    0.001: "millimetres where the model has metres",
    1000.0: "metres where the model has millimetres",
    0.01: "centimetres where the model has metres",
    100.0: "metres where the model has centimetres",
    10.0: "centimetres where the model has millimetres",
    0.1: "millimetres where the model has centimetres",
    25.4: "inches where the model has millimetres",
    1.0 / 25.4: "millimetres where the model has inches",
    0.0254: "inches where the model has metres",
    1.0 / 0.0254: "metres where the model has inches",
    0.3048: "feet where the model has metres",
    1.0 / 0.3048: "metres where the model has feet",
    12.0: "feet where the model has inches",
    1.0 / 12.0: "inches where the model has feet",
}


@dataclass(frozen=True)
class Near:
    """The node nearest to a point, its distance, and other nodes at the same distance."""

    node: int
    distance: float
    others: tuple[int, ...] = ()


class NodeSearch:
    """Nearest grid points of a model."""

    def __init__(self, nodes: NodeTable, tolerance: float) -> None:
        self._ids, self._xyz, self._tolerance = nodes.ids, nodes.xyz, tolerance
        self._tree = cKDTree(nodes.xyz) if len(nodes.ids) else None

    def near(self, point: Reals) -> Near:
        """Nearest node; the lowest number among equally near ones. Node 0 at infinity for a model without nodes."""
        if self._tree is None:
            return Near(0, np.inf)
        distance, _ = self._tree.query(point)
        at = self._tree.query_ball_point(point, distance + _TIE * self._tolerance)
        ids = sorted(int(self._ids[i]) for i in at)
        return Near(ids[0], float(distance), tuple(ids[1:]))

    def looks_like(self, points: Reals) -> str:
        """Which unit or order of axes would put every point on a node of its own; "" if none would."""
        different = np.unique(points, axis=0)
        if self._tree is None or len(different) < 2:
            return ""
        for (factor, words), (axes, matrix) in itertools.product(_FACTORS.items(), _axes()):
            distance, at = self._tree.query(factor * different @ matrix.T)
            if (distance <= self._tolerance).all() and len(set(at)) == len(different):
                return _in_words(words, factor, axes)
        return ""


def _axes() -> Iterator[tuple[str, Reals]]:
    """The 48 ways to exchange and turn round axes, the identity first."""
    for order, signs in itertools.product(itertools.permutations(range(3)), itertools.product((1, -1), repeat=3)):
        matrix = np.zeros((3, 3))
        matrix[range(3), order] = signs
        yield ", ".join(f"{'-' if s < 0 else ''}{'XYZ'[i]}" for i, s in zip(order, signs)), matrix


def _in_words(words: str, factor: float, axes: str) -> str:
    parts = []
    if words:
        parts.append(f"the test's coordinates look like {words} (factor {factor:.6g})")
    if axes != "X, Y, Z":
        parts.append(f"the model's X, Y, Z look like the test's {axes}")
    return " and ".join(parts)
