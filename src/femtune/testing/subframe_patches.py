"""Patches of structured mesh in a reference space of straight boxes, welded where their points coincide.

Members are drawn as axis-parallel sheets and rings; two patches that use the same breaks have the same points on
their common edge, so welding them is merging equal points. A smooth map bends the welded mesh afterwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

# Points closer than this (metres) are one; the odd offset keeps the round coordinates of a drawing off the edges
# between two cells of the rounding grid.
_QUANTUM, _OFFSET, _REACH = 1e-6, 1.0 + 0.3718e-6, 2_097_152

_FINE = 0.065
"""Intervals at least this long (metres) have two cells or more."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Points (n, 3) and the cells (e, k) of one group: k = 3 or 4 for shells, 8 for solids, 2 for bars."""

    group: str
    points: Reals
    cells: Integers


def ticks(breaks: Sequence[float], size: float | Sequence[float]) -> Reals:
    """Ascending coordinates that hit all breaks, with cells of about `size` (or one an interval) between them.

    The number of cells follows from the length of the interval and the size alone: equal intervals agree everywhere.
    """
    ordered = sorted(breaks)
    sizes = np.broadcast_to(size, len(ordered) - 1)
    spans = zip(ordered, ordered[1:], sizes, strict=False)
    parts = [np.linspace(a, b, cells_along(b - a, h), endpoint=False) for a, b, h in spans]
    return np.append(np.concatenate(parts), ordered[-1])


def cells_along(length: float, size: float) -> int:
    """Number of cells along an interval."""
    return max(2 if length > _FINE else 1, round(round(length, 9) / size))


def grid_rows(*counts: int) -> Integers:
    """Rows of the points of a grid with `counts` points along its axes."""
    return np.arange(int(np.prod(counts)), dtype=np.int64).reshape(counts)


def sheet(group: str, x: ArrayLike, y: ArrayLike, z: ArrayLike, outward: int = 1) -> Patch:
    """A flat sheet of quadrilaterals: one of x, y, z is a number, the others ticks; normal along ± that axis."""
    points, axes = _flat_grid(x, y, z)
    rows = grid_rows(*axes)
    return Patch(group, points, _turned(points, _quads(rows), outward))


def triangle_sheet(group: str, x: ArrayLike, y: ArrayLike, z: ArrayLike, outward: int = 1) -> tuple[Patch, Patch]:
    """Half of a square sheet with its right angle at the first ticks: quadrilaterals, and triangles on the slope.

    Both ticks hold the same number of cells; they may descend.
    """
    points, (n, _) = _flat_grid(x, y, z)
    rows, (i, j) = grid_rows(n, n), np.indices((n - 1, n - 1))
    whole, slope = (i + j < n - 2).ravel(), (i + j == n - 2).ravel()
    quads, tris = _quads(rows)[whole], _quads(rows)[slope][:, [0, 1, 3]]
    return (
        Patch(group, points, _turned(points, quads, outward)),
        Patch(group, points, _turned(points, tris, outward)),
    )


def _flat_grid(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> tuple[Reals, list[int]]:
    grids = np.meshgrid(*(np.atleast_1d(np.asarray(c, float)) for c in (x, y, z)), indexing="ij")
    axes = [n for n in grids[0].shape if n > 1]
    return np.stack(grids, axis=-1).reshape(-1, 3), axes


def _quads(rows: Integers) -> Integers:
    return np.stack([rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]], axis=-1).reshape(-1, 4)


def _turned(points: Reals, cells: Integers, outward: int) -> Integers:
    """Cells of a flat sheet, reversed where their normal does not point along `outward` times its axis."""
    if not len(cells):
        return cells
    a, b, c = points[cells[0, 0]], points[cells[0, 1]], points[cells[0, -1]]
    return cells if np.cross(b - a, c - a).sum() * outward > 0 else cells[:, ::-1].copy()


@dataclass(frozen=True, eq=False)
class Hole:
    """A vertical round hole in the middle of a rectangle of ticks: the directions of its rim follow the rectangle."""

    x: Reals
    y: Reals
    radius: float

    @property
    def centre(self) -> Reals:
        """(2,) the middle."""
        return np.array([self.x[0] + self.x[-1], self.y[0] + self.y[-1]]) / 2.0

    @property
    def outline(self) -> Reals:
        """(m, 2) points of the rectangle, counter-clockwise from its first corner."""
        x, y = self.x, self.y
        sides = [
            (x[:-1], np.full(len(x) - 1, y[0])),
            (np.full(len(y) - 1, x[-1]), y[:-1]),
            (x[:0:-1], np.full(len(x) - 1, y[-1])),
            (np.full(len(y) - 1, x[0]), y[:0:-1]),
        ]
        return np.concatenate([np.stack(side, axis=-1) for side in sides])

    def ring(self, radius: float) -> Reals:
        """(m, 2) points of a circle about the middle, one opposite each point of the outline."""
        counts = np.array([len(self.x) - 1, len(self.y) - 1] * 2)
        quarter = np.concatenate([q + np.arange(n) / n for q, n in enumerate(counts)])
        angle = (quarter - 1.5) * np.pi / 2.0
        return np.asarray(self.centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1))

    def layers(self) -> Reals:
        """Fractions from rim to outline whose cells grow like their distance from the middle."""
        ratio = 0.565 * (np.ptp(self.x) + np.ptp(self.y)) / 2.0 / self.radius
        count = max(1, round(np.log(ratio) * len(self.outline) / (2.0 * np.pi)))
        return np.asarray((ratio ** (np.arange(count + 1) / count) - 1.0) / (ratio - 1.0))

    def rims(self) -> Reals:
        """(layers + 1, m, 2) closed lines from the rim to the outline."""
        s = self.layers()[:, None, None]
        return np.asarray((1.0 - s) * self.ring(self.radius) + s * self.outline)


def holed_sheet(group: str, hole: Hole, z: float, outward: int = 1) -> Patch:
    """The rectangle around a hole as a sheet at height z."""
    flat = hole.rims()
    points = lifted(flat.reshape(-1, 2), z)
    return Patch(group, points, _turned(points, _quads(_closed(grid_rows(*flat.shape[:2]))), outward))


def washer(group: str, hole: Hole, inner: float, z: float, outward: int = 1) -> Patch:
    """Rings of cells that narrow a hole to the radius `inner`."""
    ratio = hole.radius / inner
    count = max(1, int(0.5 * np.log(ratio) * len(hole.outline) / (2.0 * np.pi)))
    flat = np.array([hole.ring(inner * ratio ** (i / count)) for i in range(count)] + [hole.ring(hole.radius)])
    points = np.concatenate([lifted(ring, z) for ring in flat])
    return Patch(group, points, _turned(points, _quads(_closed(grid_rows(*flat.shape[:2]))), outward))


def lifted(flat: Reals, z: float) -> Reals:
    """Points (m, 2) at the height z."""
    return np.column_stack([flat, np.full(len(flat), z)])


def tube(group: str, ring: Reals, z: Reals) -> Patch:
    """A vertical tube through the points of a ring, normals outward."""
    points = _stacked(ring[None], z)
    cells = _quads(_closed(grid_rows(len(ring), len(z)).T).T)
    return Patch(group, points, cells)


def solid_ring(group: str, rings: Reals, z: Reals) -> Patch:
    """Hexahedra between closed lines (layers + 1, m, 2), from the inner to the outer, over the heights z."""
    layers, m, _ = rings.shape
    rows = grid_rows(layers, m, len(z))
    return Patch(group, _stacked(rings, z), hexahedra(np.concatenate([rows, rows[:, :1]], axis=1)))


def hexahedra(rows: Integers) -> Integers:
    """Cells (e, 8) of a grid of points (i, j, k) whose axes are right-handed."""
    low, up = slice(None, -1), slice(1, None)
    base = [(low, low), (up, low), (up, up), (low, up)]
    corners = [rows[i, j, k] for k in (low, up) for i, j in base]
    return np.stack(corners, axis=-1).reshape(-1, 8)


def _stacked(rings: Reals, z: Reals) -> Reals:
    layers, m, _ = rings.shape
    flat = np.broadcast_to(rings[:, :, None, :], (layers, m, len(z), 2))
    height = np.broadcast_to(z[:, None], (layers, m, len(z), 1))
    return np.concatenate([flat, height], axis=-1).reshape(-1, 3)


def _closed(rows: Integers) -> Integers:
    return np.concatenate([rows, rows[:, :1]], axis=1)


@dataclass(frozen=True, eq=False)
class Weld:
    """The joined mesh: points (n, 3) that cells use, and cells as rows of them by (group, corners)."""

    points: Reals
    cells: dict[tuple[str, int], Integers]
    keys: Integers

    def rows(self, points: Reals) -> Integers:
        """Rows of the mesh's points at the given places (m, 3).

        Raises
        ------
        ValueError : where the mesh has no such point: the drawing contradicts itself
        """
        wanted = _keys(points)
        found = np.minimum(np.searchsorted(self.keys, wanted), len(self.keys) - 1)
        if not np.array_equal(self.keys[found], wanted):
            raise ValueError(f"no mesh point at {points[self.keys[found] != wanted][0]}")
        return found


def weld(patches: Iterable[Patch]) -> Weld:
    """One mesh out of patches: points at the same place become one, points without cells are dropped."""
    patches = [patch for patch in patches if len(patch.cells)]
    starts = np.cumsum([0] + [len(patch.points) for patch in patches])
    used = np.zeros(starts[-1], bool)
    for patch, start in zip(patches, starts, strict=False):
        used[start + np.unique(patch.cells)] = True
    points = np.concatenate([patch.points for patch in patches])
    keys, first, row = np.unique(_keys(points[used]), return_index=True, return_inverse=True)
    rows = np.full(len(points), -1)
    rows[used] = row
    return Weld(points[used][first], _by_group(patches, starts, rows), keys)


def _by_group(patches: list[Patch], starts: NDArray, rows: Integers) -> dict[tuple[str, int], Integers]:
    gathered: dict[tuple[str, int], list[Integers]] = {}
    for patch, start in zip(patches, starts, strict=False):
        key = (patch.group, patch.cells.shape[1])
        gathered.setdefault(key, []).append(rows[patch.cells + start])
    return {key: np.concatenate(cells) for key, cells in gathered.items()}


def _keys(points: Reals) -> Integers:
    cell = np.floor((np.asarray(points) + _OFFSET) / _QUANTUM).astype(np.int64)
    if cell.min() < 0 or cell.max() >= _REACH:
        raise ValueError("a drawing lies within one metre of its origin along each axis")
    return np.asarray((cell[:, 0] * _REACH + cell[:, 1]) * _REACH + cell[:, 2])
