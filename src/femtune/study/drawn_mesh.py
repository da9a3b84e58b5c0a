"""What pictures of a model show: lines, shells, the outside of solids; large meshes with fewer points."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from femtune.fem.elements import KINDS

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.fem import ConstraintRows, ElementBatch, NodeTable, Structure

Rows = NDArray[np.int64]

MOST_LINES = 4000
"""Lines of a drawing; larger meshes are simplified, so that files stay small and views turn smoothly."""
MOST_FACES = 30_000
"""Faces of a drawing; meshes with more are simplified."""
ELEMENT = 0
"""Kind of a line that is an element."""
RIGID = 1
"""Kind of a line that is an arm of a rigid element."""
_FIRST_CELLS = 400.0
"""Cells along the diagonal of the model in the first simplification: about as fine as a drawing can show."""
_CELL_GROWTH = 1.25
"""Factor by which cells grow until the mesh is small enough: smaller ones keep more of the mesh and take more tries."""


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """Rows of the grid points: `lines` (l, 2) with their `kinds` (l,), `faces` (f, 4), −1 for the fourth of a triangle.

    `sentence` says what was left out; "" if nothing was.
    """

    lines: Rows
    kinds: Rows
    faces: Rows
    sentence: str = ""

    @property
    def used(self) -> Rows:
        """Rows of the grid points of all lines and faces."""
        rows = np.unique(np.concatenate([self.lines.ravel(), self.faces.ravel()]))
        return rows[rows >= 0]

    def counted_from(self, rows: Rows) -> DrawnMesh:
        """The same with positions in `rows` (ascending) in place of the rows themselves."""
        faces = np.where(self.faces < 0, -1, np.searchsorted(rows, self.faces))
        return DrawnMesh(np.searchsorted(rows, self.lines), self.kinds, faces, self.sentence)

    def line_of(self, ends: Rows) -> Rows:
        """(l,) the line of elements between two `ends` (l, 2), in any order; −1 if none is drawn."""
        of_elements = np.flatnonzero(self.kinds == ELEMENT)
        if not len(of_elements):
            return np.full(len(ends), -1)
        count = 1 + max(int(self.lines.max()), int(ends.max(initial=0)))
        drawn, wanted = (np.sort(part, axis=1) @ (count, 1) for part in (self.lines[of_elements], ends))
        order = np.argsort(drawn)
        at = order[np.minimum(np.searchsorted(drawn, wanted, sorter=order), len(order) - 1)]
        return np.where((drawn[at] == wanted) & (ends >= 0).all(axis=1), of_elements[at], -1)


def whole_mesh(structure: Structure, off: Collection[int] = ()) -> DrawnMesh:
    """All that can be drawn of a structure, without elements that are switched off."""
    return DrawnMesh(*active_lines(structure, off), active_faces(structure, off))


def mesh_beside(structure: Structure, nodes: NodeTable) -> DrawnMesh:
    """The mesh of a structure on other grid points of the same numbers, without parts that lack a point there."""
    mesh, order = whole_mesh(structure), np.argsort(nodes.ids)
    at = np.minimum(np.searchsorted(nodes.ids[order], structure.nodes.ids), len(order) - 1)
    row = np.append(np.where(nodes.ids[order][at] == structure.nodes.ids, order[at], -2), -1)
    lines, faces = row[mesh.lines], row[mesh.faces]
    there, whole = (lines >= 0).all(axis=1), (faces >= -1).all(axis=1)
    return thinned(nodes.xyz, DrawnMesh(lines[there], mesh.kinds[there], faces[whole]))


def elements_at(structure: Structure, off: Collection[int], mesh: DrawnMesh) -> tuple[Rows, Rows]:
    """(l,) and (f,) number of the element that each line and face of a mesh is of, by the nearest middle of an active
    element; 0 for rigid elements, and where there is none."""
    batches, xyz = structure.batches, structure.nodes.xyz
    lines = _nearest(xyz, [b for b in batches if KINDS[b.kind].line], off, mesh.lines)
    faces = _nearest(xyz, [b for b in batches if KINDS[b.kind].faces or KINDS[b.kind].sides], off, mesh.faces)
    return np.where(mesh.kinds == ELEMENT, lines, 0), faces


def _nearest(xyz: Reals, batches: Sequence[ElementBatch], off: Collection[int], rows: Rows) -> Rows:
    """(r,) numbers of the elements whose middles are nearest to those of rows of grid points (r, k), −1 for none."""
    middles = [_middles(xyz, b.nodes[_active(b, off)]) for b in batches]
    numbers = [b.ids[_active(b, off)] for b in batches]
    known = np.concatenate([np.zeros((0, 3)), *middles])
    sizes = [np.ptp(_places(xyz, b.nodes[_active(b, off)]), axis=1).max(axis=1) for b in batches]
    # what has no size is not drawn
    inside = np.concatenate([np.zeros(0), *sizes]) > 0.0
    if not inside.any() or not len(rows):
        return np.zeros(len(rows), np.int64)
    at = cKDTree(known[inside]).query(_middles(xyz, rows))[1]
    return np.asarray(np.concatenate(numbers)[inside][at])


def _places(xyz: Reals, nodes: Rows) -> Reals:
    """(n, k, 3) places of rows of grid points; that of the first for those that are none (−1, scalar points)."""
    there = (nodes >= 0) & (nodes < len(xyz))
    return np.asarray(xyz[np.where(there, nodes, np.where(there[:, :1], nodes[:, :1], 0))])


def _middles(xyz: Reals, nodes: Rows) -> Reals:
    """(n, 3) means over the grid points of rows."""
    there = ((nodes >= 0) & (nodes < len(xyz)))[..., None]
    return np.asarray((_places(xyz, nodes) * there).sum(axis=1) / np.maximum(there.sum(axis=1), 1))


def active_lines(structure: Structure, off: Collection[int]) -> tuple[Rows, Rows]:
    """Rows of the grid points at both ends, (lines, 2), and the kind of each line, without elements that are `off`."""
    elements = [_batch_lines(b, off) for b in structure.batches if KINDS[b.kind].line]
    rigid = structure.rigid.keep(~np.isin(structure.rigid.owner, list(off)))
    first = _drawable(structure, np.concatenate([np.zeros((0, 2), np.int64), *elements]))
    second = _drawable(structure, _rigid_lines(rigid, len(structure.nodes.ids)))
    kinds = np.repeat([ELEMENT, RIGID], [len(first), len(second)])
    return np.concatenate([first, second]), kinds


def active_faces(structure: Structure, off: Collection[int]) -> Rows:
    """Rows of the grid points at the corners of active shells and of the outside of active solids, (faces, 4).

    −1 stands for the fourth corner of a triangle. A shell with mid-side grid points has some faces, with the corners
    alone where one of these is left out.
    """
    batches = structure.batches
    shells = [_batch_faces(b, off) for b in batches if KINDS[b.kind].faces]
    solids = outer_faces([(b, _active(b, off)) for b in batches])
    return np.concatenate([np.zeros((0, 4), np.int64), *shells, solids])


def _active(batch: ElementBatch, off: Collection[int]) -> NDArray[np.bool_]:
    return ~np.isin(batch.ids, list(off))


def _batch_faces(batch: ElementBatch, off: Collection[int]) -> Rows:
    nodes = batch.nodes[_active(batch, off)]
    lacking = (nodes < 0).any(axis=1)
    corners = nodes[lacking, : nodes.shape[1] // 2]
    # the place −1 is the column after the last
    whole = np.pad(nodes[~lacking], ((0, 0), (0, 1)), constant_values=-1)
    faces = whole[:, np.array(KINDS[batch.kind].faces)].reshape(-1, 4)
    return np.concatenate([faces, np.pad(corners, ((0, 0), (0, 4 - corners.shape[1])), constant_values=-1)])


def _batch_lines(batch: ElementBatch, off: Collection[int]) -> Rows:
    return batch.nodes[_active(batch, off), :2] if batch.nodes.shape[1] >= 2 else np.zeros((0, 2), np.int64)


def _rigid_lines(rigid: ConstraintRows, n_grids: int) -> Rows:
    """From the grid point of each eliminated DOF to the others of its equation."""
    grid = np.where(rigid.dof < 6 * n_grids, rigid.dof // 6, -1)
    dependent = rigid.dependent[rigid.row]
    return np.column_stack([np.where(dependent < 6 * n_grids, dependent // 6, -1), grid])


def _drawable(structure: Structure, lines: Rows) -> Rows:
    """Each line once, without lines to ground, to scalar points, or of zero length."""
    xyz = structure.nodes.xyz
    lines = np.unique(np.sort(lines, axis=1), axis=0)
    lines = lines[(lines >= 0).all(axis=1) & (lines < len(xyz)).all(axis=1)]
    return lines[np.linalg.norm(xyz[lines[:, 1]] - xyz[lines[:, 0]], axis=1) > 0.0]


def outer_faces(batches: list[tuple[ElementBatch, NDArray[np.bool_]]]) -> Rows:
    """(faces, 4) sides of solids that no two of them share; each batch with its active elements."""
    solids = [(batch, active) for batch, active in batches if KINDS[batch.kind].sides]
    sides = [_sides(batch.nodes[active], KINDS[batch.kind].sides) for batch, active in solids]
    faces = np.concatenate([np.zeros((0, 4), np.int64), *sides])
    if not len(faces):
        return faces
    _, which, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(faces[count[which.ravel()] == 1])


def _sides(nodes: Rows, sides: tuple[tuple[int, ...], ...]) -> Rows:
    corners = np.array(sides)
    return np.where(corners < 0, -1, nodes[:, corners]).reshape(-1, 4)


def thinned(points: Reals, mesh: DrawnMesh, most_lines: int = MOST_LINES, most_faces: int = MOST_FACES) -> DrawnMesh:
    """A mesh with at most so many lines and faces: points (n, 3) in one cell of a grid are drawn as one. The cells are
    enlarged until the limits are met.
    """
    if len(mesh.lines) <= most_lines and len(mesh.faces) <= most_faces:
        return mesh
    size = float(np.linalg.norm(np.ptp(points[mesh.used], axis=0))) / _FIRST_CELLS
    fewer = _in_cells(points, mesh, size)
    while len(fewer.lines) > most_lines or len(fewer.faces) > most_faces:
        size *= _CELL_GROWTH
        fewer = _in_cells(points, mesh, size)
    return DrawnMesh(fewer.lines, fewer.kinds, fewer.faces, _sentence(mesh, fewer))


def _sentence(mesh: DrawnMesh, fewer: DrawnMesh) -> str:
    parts = [(len(mesh.faces), len(fewer.faces), "faces"), (len(mesh.lines), len(fewer.lines), "lines")]
    told = " and ".join(f"{few} {name} instead of {many}" for many, few, name in parts if many)
    return f"the mesh is simplified in the drawing: {told}"


def _in_cells(points: Reals, mesh: DrawnMesh, size: float) -> DrawnMesh:
    """The mesh with one point per cell, without degenerate and duplicate lines and faces."""
    used = mesh.used
    cells = np.floor((points[used] - points[used].min(axis=0)) / size).astype(np.int64)
    _, first, which = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    stands_for = np.full(len(points) + 1, -1, np.int64)
    stands_for[used] = used[first[which.ravel()]]
    lines, kinds = _different_lines(stands_for[mesh.lines], mesh.kinds)
    return DrawnMesh(lines, kinds, _different_faces(stands_for[mesh.faces]))


def _different_lines(lines: Rows, kinds: Rows) -> tuple[Rows, Rows]:
    some = lines[:, 0] != lines[:, 1]
    distinct = np.unique(np.column_stack([np.sort(lines[some], axis=1), kinds[some]]), axis=0)
    return distinct[:, :2], distinct[:, 2]


def _different_faces(faces: Rows) -> Rows:
    """Faces of three or four different corners, each once; quadrilaterals that lost a corner are triangles."""
    following = np.roll(np.where(faces < 0, faces[:, [2]], faces), -1, axis=1)
    lost = (faces == following) | (faces < 0)
    # the remaining corners in their order, then the lost ones
    order = np.argsort(lost, axis=1, kind="stable")
    kept = np.where(np.take_along_axis(lost, order, axis=1), -1, np.take_along_axis(faces, order, axis=1))
    kept = kept[(kept[:, 2] >= 0) & (kept[:, 0] != kept[:, 2]) & ((kept[:, 3] < 0) | (kept[:, 1] != kept[:, 3]))]
    _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    return np.asarray(kept[np.sort(first)])
