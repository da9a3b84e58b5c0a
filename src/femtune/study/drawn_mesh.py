"""What pictures of a model show: lines, shells, the outside of solids; large meshes with fewer points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.fem import ElementBatch

Rows = NDArray[np.int64]
Reals = NDArray[np.float64]

MOST_LINES, MOST_FACES = 4000, 30_000
_FIRST_CELLS, _COARSER = 400.0, 1.25
"""Cells along the diagonal of the model at first, and how much larger they become each time."""

_HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_WEDGE = ((0, 2, 1, -1), (3, 4, 5, -1), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_TETRAHEDRON = ((0, 2, 1, -1), (0, 1, 3, -1), (1, 2, 3, -1), (2, 0, 3, -1))
_PYRAMID = ((0, 3, 2, 1), (0, 1, 4, -1), (1, 2, 4, -1), (2, 3, 4, -1), (3, 0, 4, -1))
_SIDES = {
    "hexa8": _HEXAHEDRON, "hexa20": _HEXAHEDRON, "penta6": _WEDGE, "penta15": _WEDGE,
    "tetra4": _TETRAHEDRON, "tetra10": _TETRAHEDRON, "pyram5": _PYRAMID, "pyram13": _PYRAMID,
}  # fmt: skip
"""Faces of each kind of solid by its corners, which are its first grid points; −1 for the fourth of a triangle."""


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """Rows of the grid points: `lines` (l, 2) with their `kinds` (l,), `faces` (f, 4), −1 for the fourth of a triangle.

    `sentence` says what was left out; "" where all is there.
    """

    lines: Rows
    kinds: Rows
    faces: Rows
    sentence: str = ""

    @property
    def used(self) -> Rows:
        """Rows of the grid points that something is drawn at."""
        found = np.unique(np.concatenate([self.lines.ravel(), self.faces.ravel()]))
        return found[found >= 0]

    def counted_from(self, rows: Rows) -> DrawnMesh:
        """The same with positions in `rows` (ascending) in place of the rows themselves."""
        faces = np.where(self.faces < 0, -1, np.searchsorted(rows, self.faces))
        return DrawnMesh(np.searchsorted(rows, self.lines), self.kinds, faces, self.sentence)


def outer_faces(batches: list[tuple[ElementBatch, NDArray[np.bool_]]]) -> Rows:
    """(faces, 4) sides of solids that no two of them share; each batch with its active elements."""
    found = [_sides(batch.nodes[active], _SIDES[batch.kind]) for batch, active in batches if batch.kind in _SIDES]
    faces = np.concatenate([np.zeros((0, 4), np.int64), *found])
    if not len(faces):
        return faces
    _, which, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(faces[count[which.ravel()] == 1])


def _sides(nodes: Rows, sides: tuple[tuple[int, ...], ...]) -> Rows:
    corners = np.array(sides)
    return np.where(corners < 0, -1, nodes[:, corners]).reshape(-1, 4)


def thinned(points: Reals, mesh: DrawnMesh, most_lines: int = MOST_LINES, most_faces: int = MOST_FACES) -> DrawnMesh:
    """A mesh of no more lines and faces than that: points (n, 3) in one cell of a grid are drawn as one of them.

    Lines go down to the limit by the longest where cells alone do not do it.
    """
    if len(mesh.lines) <= most_lines and len(mesh.faces) <= most_faces:
        return mesh
    size = float(np.linalg.norm(np.ptp(points[mesh.used], axis=0))) / _FIRST_CELLS
    fewer = _in_cells(points, mesh, size)
    while len(fewer.lines) > most_lines or len(fewer.faces) > most_faces:
        size *= _COARSER
        fewer = _in_cells(points, mesh, size)
    return DrawnMesh(fewer.lines, fewer.kinds, fewer.faces, _sentence(mesh, fewer))


def _sentence(mesh: DrawnMesh, fewer: DrawnMesh) -> str:
    parts = [(len(mesh.faces), len(fewer.faces), "faces"), (len(mesh.lines), len(fewer.lines), "lines")]
    told = " and ".join(f"{few} {name} in place of {many}" for many, few, name in parts if many)
    return f"the mesh is drawn coarser than it is: {told}"


def _in_cells(points: Reals, mesh: DrawnMesh, size: float) -> DrawnMesh:
    """The mesh with one point for all of a cell; what has shrunk to nothing, or is there twice, is left out."""
    used = mesh.used
    cells = np.floor((points[used] - points[used].min(axis=0)) / size).astype(np.int64)
    _, first, which = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    stands_for = np.full(len(points) + 1, -1, np.int64)
    stands_for[used] = used[first[which.ravel()]]
    lines, kinds = _different_lines(stands_for[mesh.lines], mesh.kinds)
    return DrawnMesh(lines, kinds, _different_faces(stands_for[mesh.faces]))


def _different_lines(lines: Rows, kinds: Rows) -> tuple[Rows, Rows]:
    some = lines[:, 0] != lines[:, 1]
    found = np.unique(np.column_stack([np.sort(lines[some], axis=1), kinds[some]]), axis=0)
    return found[:, :2], found[:, 2]


def _different_faces(faces: Rows) -> Rows:
    """Faces of three or four different corners, each once; quadrilaterals that lost a corner are triangles."""
    following = np.roll(np.where(faces < 0, faces[:, [2]], faces), -1, axis=1)
    lost = (faces == following) | (faces < 0)
    # the corners that are left, in their order, before those that are lost
    order = np.argsort(lost, axis=1, kind="stable")
    kept = np.where(np.take_along_axis(lost, order, axis=1), -1, np.take_along_axis(faces, order, axis=1))
    kept = kept[(kept[:, 2] >= 0) & (kept[:, 0] != kept[:, 2]) & ((kept[:, 3] < 0) | (kept[:, 1] != kept[:, 3]))]
    _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    return np.asarray(kept[np.sort(first)])
