"""Structured quadrilateral meshes of three structures, with the mid-side nodes that quadratic elements need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Place = Callable[[float, float], tuple[float, float, float]]

MERGE = 1e-7
"""Points nearer than this (m) are one node."""


@dataclass
class Mesh:
    """Quadrilaterals by group, corners first and mid-sides after them; `groups` tell thickness in m."""

    xyz: list[tuple[float, float, float]] = field(default_factory=list)
    quads: list[tuple[int, ...]] = field(default_factory=list)
    group_of: list[str] = field(default_factory=list)
    groups: dict[str, float] = field(default_factory=dict)
    _known: dict[tuple[int, ...], int] = field(default_factory=dict)

    def node(self, point: tuple[float, float, float]) -> int:
        """Number (from 1) of the node at a point, new or known."""
        key = tuple(round(c / MERGE) for c in point)
        if key not in self._known:
            self.xyz.append(point)
            self._known[key] = len(self.xyz)
        return self._known[key]

    def patch(self, group: str, thickness: float, nu: int, nv: int, place: Place) -> None:
        """nu × nv elements of the image of the unit square."""
        self.groups[group] = thickness
        for j in range(nv):
            for i in range(nu):
                corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                middles = [(i + 0.5, j), (i + 1, j + 0.5), (i + 0.5, j + 1), (i, j + 0.5)]
                self.quads.append(tuple(self.node(place(a / nu, b / nv)) for a, b in corners + middles))
                self.group_of.append(group)

    def corners(self) -> list[int]:
        """Nodes that linear elements use, ascending."""
        return sorted({n for quad in self.quads for n in quad[:4]})

    def where(self, chosen: Callable[[NDArray], bool]) -> list[int]:
        """All nodes at which a condition on the coordinates holds."""
        return [i + 1 for i, point in enumerate(self.xyz) if chosen(np.array(point))]


def stiffened_panel(n: int) -> tuple[Mesh, list[int]]:
    """A plate 600 × 400 × 3 mm with three blades 30 × 2 mm along it, clamped at one short side."""
    mesh = Mesh()
    mesh.patch("plate", 0.003, 12 * n, 8 * n, lambda u, v: (0.6 * u, 0.4 * v, 0.0))
    for y in (0.1, 0.2, 0.3):
        mesh.patch("blade", 0.002, 12 * n, n, lambda u, v, y=y: (0.6 * u, y, 0.03 * v))  # type: ignore[misc]
    return mesh, mesh.where(lambda p: p[0] < MERGE)


def box_beam(n: int) -> tuple[Mesh, list[int]]:
    """A beam 400 mm long, section 100 × 60 mm, walls 3 and 2 mm, a diaphragm at the free end, clamped at the other."""
    mesh, length, w, h = Mesh(), 0.4, 0.1, 0.06
    for z in (0.0, h):
        mesh.patch("flange", 0.003, 10 * n, 4 * n, lambda u, v, z=z: (length * u, w * v, z))  # type: ignore[misc]
    for y in (0.0, w):
        mesh.patch("web", 0.002, 10 * n, 3 * n, lambda u, v, y=y: (length * u, y, h * v))  # type: ignore[misc]
    mesh.patch("diaphragm", 0.002, 4 * n, 3 * n, lambda u, v: (length, w * u, h * v))
    return mesh, mesh.where(lambda p: p[0] < MERGE)


def bracket(n: int) -> tuple[Mesh, list[int]]:
    """Two plates 80 × 60 × 4 mm at right angles with two trapezoidal gussets of 3 mm, its foot clamped at the toe."""
    mesh, a, b = Mesh(), 0.08, 0.06
    mesh.patch("foot", 0.004, 8 * n, 6 * n, lambda u, v: (a * u, b * v, 0.0))
    mesh.patch("wall", 0.004, 8 * n, 6 * n, lambda u, v: (0.0, b * v, a * u))
    for y in (0.0, b):
        # the gusset's two outer corners lie 50 mm along foot and wall, its inner quadrilateral reaches the bend
        mesh.patch("gusset", 0.003, 5 * n, 5 * n, lambda u, v, y=y: _gusset(u, v, y))  # type: ignore[misc]
    return mesh, mesh.where(lambda p: p[0] > a - MERGE)


def _gusset(u: float, v: float, y: float) -> tuple[float, float, float]:
    """Quadrilateral (0,0) (50,0) (30,30) (0,50) mm of the plane y."""
    corners = np.array([[0.0, 0.0], [0.05, 0.0], [0.03, 0.03], [0.0, 0.05]])
    weights = np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
    x, z = weights @ corners
    return float(x), y, float(z)
