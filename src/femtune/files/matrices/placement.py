"""Rows of matrices on the g-set of a node table that is made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.fem.structure import NodeTable
from femtune.files.matrices.read_matrix import ReadMatrix

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Placement:
    """Nodes and, for each matrix, the g-set DOF of each of its rows."""

    nodes: NodeTable
    dofs: tuple[Integers, ...]
    notices: tuple[Notice, ...] = ()

    @property
    def listed(self) -> Integers:
        """All g-set DOFs that some matrix has."""
        return np.unique(np.concatenate(self.dofs))

    def on_g_set(self, matrix: ReadMatrix, at: int) -> sp.csr_array:
        """Upper triangle of a matrix on the g-set."""
        n, dofs = self.nodes.n_dofs, self.dofs[at]
        coo = sp.coo_array(matrix.upper)
        row, col = dofs[coo.row], dofs[coo.col]
        out = sp.csr_array((coo.data, (np.minimum(row, col), np.maximum(row, col))), shape=(n, n))
        out.sort_indices()
        return out


def place_matrices(matrices: Sequence[ReadMatrix], listed: Integers | None, points: NodeTable | None) -> Placement:
    """Nodes of the matrices, and where their rows lie.

    Rows have the names of the file itself; else those of `listed`; else, where `points` has as many DOFs, those of
    the g-set in ascending order; else they are scalar points 1 to n.

    Parameters
    ----------
    listed : (n, 2) node and component of each row, from a list of DOFs
    points : grid points with coordinates

    Raises
    ------
    FemtuneError : ``matrices.size``, ``matrices.no-coordinates``
    """
    bare = [m for m in matrices if m.rows is None]
    notices: list[Notice] = []
    rows: Integers | None = listed
    if bare and rows is None:
        rows, notices = _unnamed(matrices, bare, points)
    for m in bare:
        assert rows is not None
        if m.size != len(rows):
            raise _size(m, len(rows), "the list of DOFs has" if listed is not None else f"{bare[0].name} has")
    named = [m.rows if m.rows is not None else rows for m in matrices]
    found = [r for r in named if r is not None]
    nodes = _nodes(np.concatenate(found), points)
    return Placement(nodes, tuple(_dofs(nodes, r) for r in found), tuple(notices))


def _unnamed(
    matrices: Sequence[ReadMatrix], bare: Sequence[ReadMatrix], points: NodeTable | None
) -> tuple[Integers, list[Notice]]:
    first = bare[0]
    if len(bare) < len(matrices):
        other = next(m for m in matrices if m.rows is not None)
        raise FemtuneError(
            "matrices.no-dofs",
            f"the rows of {first.name} have no names, and those of {other.name} have",
            where=first.where,
            hint='say which DOFs its rows are: dofs = "list.txt" in [model], one line "node component" a row',
        )
    if points is not None and points.n_dofs == first.size:
        text = f"the {first.size} rows are taken as all DOFs of the grid points in ascending order of their numbers"
        return _g_set(points), [Notice("matrices.rows-as-g-set", text, first.where, "info")]
    if points is not None:
        raise _size(first, points.n_dofs, "the grid points have")
    text = f"the {first.size} rows have no names and are scalar points 1 to {first.size}"
    rows = np.stack([np.arange(1, first.size + 1), np.zeros(first.size, np.int64)], axis=1)
    return rows, [Notice("matrices.no-names", text, first.where, "info")]


def _g_set(points: NodeTable) -> Integers:
    """Node and component of all DOFs, grid and scalar points in one ascending order."""
    grid = np.stack([np.repeat(points.ids, 6), np.tile(np.arange(1, 7), len(points.ids))], axis=1)
    scalar = np.stack([points.scalar_points, np.zeros_like(points.scalar_points)], axis=1)
    every = np.concatenate([grid, scalar])
    return np.asarray(every[np.argsort(every[:, 0], kind="stable")])


def _size(matrix: ReadMatrix, rows: int, what: str) -> FemtuneError:
    return FemtuneError(
        "matrices.size",
        f"{matrix.name} has {matrix.size} rows, and {what} {rows}",
        where=matrix.where,
        hint="take matrices and DOFs of one and the same run and set; a file that was cut lacks its last rows",
    )


def _nodes(rows: Integers, points: NodeTable | None) -> NodeTable:
    grids = np.unique(rows[rows[:, 1] > 0, 0])
    scalars = np.unique(rows[rows[:, 1] == 0, 0])
    both = np.intersect1d(grids, scalars)
    if both.size:
        raise FemtuneError(
            "matrices.dof-list", f"node {both[0]} is a grid point (components 1 to 6) and a scalar point (0)",
            hint="a scalar point has a number of its own",
        )  # fmt: skip
    n = len(grids)
    if points is None:
        return NodeTable(grids, np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), scalars, located=n == 0)
    missing = np.setdiff1d(grids, points.ids)
    if missing.size:
        raise FemtuneError(
            "matrices.no-coordinates",
            f"{missing.size} of the {n} nodes of the matrices are not among the grid points",
            values={"nodes": ", ".join(map(str, missing[:10]))},
            hint="name the file of the mesh that the matrices were made of, or leave grid out",
        )
    at = np.searchsorted(points.ids, grids)
    return NodeTable(grids, points.xyz[at], points.frames[at], scalars)


def _dofs(nodes: NodeTable, rows: Integers) -> Integers:
    """g-set DOFs of named rows."""
    grid = 6 * np.searchsorted(nodes.ids, rows[:, 0]) + rows[:, 1] - 1
    scalar = 6 * len(nodes.ids) + np.searchsorted(nodes.scalar_points, rows[:, 0])
    return np.asarray(np.where(rows[:, 1] > 0, grid, scalar))
