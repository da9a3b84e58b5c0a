"""Rows of matrices on the g-set of a node table that is made of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Integers
from femtune.errors import FemtuneError, Notice, Where
from femtune.fem.structure import NodeTable
from femtune.files.matrices.read_matrix import ReadMatrix
from femtune.files.matrices.text_blocks import line_blocks
from femtune.files.nastran.build import raise_distinct
from femtune.files.nastran.building import Building
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.grids import read_grids


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
            code = "matrices.size/list" if listed is not None else "matrices.size/other-matrix"
            raise _size(code, m, len(rows), other=bare[0].name)
    named = [m.rows if m.rows is not None else rows for m in matrices]
    dof_lists = [r for r in named if r is not None]
    nodes = _nodes(np.concatenate(dof_lists), points)
    return Placement(nodes, tuple(_dofs(nodes, r) for r in dof_lists), tuple(notices))


def _unnamed(
    matrices: Sequence[ReadMatrix], bare: Sequence[ReadMatrix], points: NodeTable | None
) -> tuple[Integers, list[Notice]]:
    first = bare[0]
    if len(bare) < len(matrices):
        other = next(m for m in matrices if m.rows is not None)
        raise FemtuneError("matrices.no-dofs", where=first.where, first_name=first.name, other_name=other.name)
    if points is not None and points.n_dofs == first.size:
        return _g_set(points), [Notice("matrices.rows-as-g-set", where=first.where, level="info", rows=first.size)]
    if points is not None:
        raise _size("matrices.size", first, points.n_dofs)
    rows = np.stack([np.arange(1, first.size + 1), np.zeros(first.size, np.int64)], axis=1)
    return rows, [Notice("matrices.no-names", where=first.where, level="info", rows=first.size)]


def _g_set(points: NodeTable) -> Integers:
    """Node and component of all DOFs, grid and scalar points in one ascending order."""
    grid = np.stack([np.repeat(points.ids, 6), np.tile(np.arange(1, 7), len(points.ids))], axis=1)
    scalar = np.stack([points.scalar_points, np.zeros_like(points.scalar_points)], axis=1)
    every = np.concatenate([grid, scalar])
    return np.asarray(every[np.argsort(every[:, 0], kind="stable")])


def _size(code: str, matrix: ReadMatrix, expected: int, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=matrix.where, matrix=matrix.name, rows=matrix.size, expected=expected, **facts)


def _nodes(rows: Integers, points: NodeTable | None) -> NodeTable:
    grids = np.unique(rows[rows[:, 1] > 0, 0])
    scalars = np.unique(rows[rows[:, 1] == 0, 0])
    both = np.intersect1d(grids, scalars)
    if both.size:
        raise FemtuneError("matrices.dof-list", node=both[0])
    n = len(grids)
    if points is None:
        return NodeTable(grids, np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), scalars, has_coordinates=n == 0)
    missing = np.setdiff1d(grids, points.ids)
    if missing.size:
        raise FemtuneError(
            "matrices.no-coordinates",
            values={"nodes": ", ".join(map(str, missing[:10]))},
            n_missing=missing.size,
            n=n,
        )
    at = np.searchsorted(points.ids, grids)
    return NodeTable(grids, points.xyz[at], points.frames[at], scalars)


def _dofs(nodes: NodeTable, rows: Integers) -> Integers:
    """g-set DOFs of named rows."""
    grid = 6 * np.searchsorted(nodes.ids, rows[:, 0]) + rows[:, 1] - 1
    scalar = 6 * len(nodes.ids) + np.searchsorted(nodes.scalar_points, rows[:, 0])
    return np.asarray(np.where(rows[:, 1] > 0, grid, scalar))


# ----------------------------------------------------------------------------------------------------
# Coordinates of grid points for matrices: from a Nastran deck, or the *NODE blocks of an Abaqus or CalculiX file.


_NODE = re.compile(rb"\s*\*NODE\s*(,|$)", re.IGNORECASE)
INPUT_SUFFIXES = (".inp", ".msh")


def read_points(path: Path) -> NodeTable:
    """Grid points (with displacement frames, where the file is a deck) and scalar points.

    Raises
    ------
    FemtuneError : ``matrices.points``, and ``deck.*`` for a deck
    """
    if path.suffix.lower() in INPUT_SUFFIXES:
        return _of_input(path)
    building = Building(read_deck(path))
    table = read_grids(building).table
    raise_distinct(building.errors)
    return table


def _of_input(path: Path) -> NodeTable:
    ids: list[int] = []
    xyz: list[list[float]] = []
    inside, number = False, 0
    for block in line_blocks(path):
        for text in block.content.splitlines():
            number += 1
            if text.startswith(b"**") or not text.strip():
                continue
            if text.lstrip().startswith(b"*"):
                inside = _NODE.match(text) is not None
            elif inside:
                node, place = _node(path, number, text)
                ids.append(node)
                xyz.append(place)
    return _table(path, np.array(ids, np.int64), np.array(xyz, float).reshape(-1, 3))


def _node(path: Path, line: int, text: bytes) -> tuple[int, list[float]]:
    try:
        node, *place = text.replace(b",", b" ").split()
        values = [float(x) for x in place[:3]]
        return int(node), [*values, *([0.0] * (3 - len(values)))]
    except ValueError as error:
        shown = {"line": f"'{text[:60].decode('latin-1')}'"}
        raise _error(path, line, "matrices.points/not-a-node", shown) from error


def _table(path: Path, ids: NDArray[np.int64], xyz: NDArray[np.float64]) -> NodeTable:
    if not len(ids):
        raise _error(path, None, "matrices.points", {})
    order = np.argsort(ids, kind="stable")
    ids, xyz = ids[order], xyz[order]
    twice = np.flatnonzero(np.diff(ids) == 0)
    if twice.size:
        raise _error(path, None, "matrices.points/repeated-node", {}, node=ids[twice[0]])
    return NodeTable(ids, xyz, np.tile(np.eye(3), (len(ids), 1, 1)))


def _error(path: Path, line: int | None, code: str, values: dict[str, str], **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), values=values, **facts)
