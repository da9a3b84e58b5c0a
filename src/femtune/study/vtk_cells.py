"""Elements of a model as cells of the Visualization Toolkit, in its order of the corners."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.fem.elements import KINDS

if TYPE_CHECKING:
    from femtune.arrays import Integers
    from femtune.fem import ElementBatch, Structure

_SHELLS = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}
"""Names of shells by their number of nodes."""
_SOLIDS = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra10",
    13: "pyramid13",
    15: "wedge15",
    20: "hexahedron20",
}
"""Names of solids by their number of nodes."""
_CORNERS = {"triangle6": 3, "quad8": 4, "tetra10": 4, "pyramid13": 5, "wedge15": 6, "hexahedron20": 8}
"""Number of corners of elements with mid-side nodes."""
_ORDER = {
    "wedge15": (*range(9), 12, 13, 14, 9, 10, 11),
    "hexahedron20": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15),
}
"""Order of the nodes: Nastran counts the vertical edges before those of the second face, VTK after them."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of one kind: name of the kind, (c, k) rows of the grid points, (c,) numbers of the elements."""

    kind: str
    nodes: Integers
    elements: Integers


def vtk_cells(structure: Structure, off: Collection[int] = ()) -> list[Cells]:
    """Lines, shells, solids and concentrated masses of a structure, without elements that are switched off.

    An element that lacks a mid-side grid point is shown with its corners only. Elements to ground or scalar points are
    left out.
    """
    return [cells for batch in structure.batches for cells in _of_batch(batch, structure, off) if len(cells.elements)]


def _of_batch(batch: ElementBatch, structure: Structure, off: Collection[int]) -> list[Cells]:
    kind = _kind(batch)
    active = ~np.isin(batch.ids, list(off))
    nodes, ids = batch.nodes[active], batch.ids[active]
    if kind == "line":
        nodes = nodes[:, :2]
    grids = len(structure.nodes.ids)
    corners = _CORNERS[kind] if kind in _CORNERS else nodes.shape[1]
    there = np.all((nodes[:, :corners] >= 0) & (nodes[:, :corners] < grids), axis=1)
    nodes, ids = nodes[there], ids[there]
    if kind not in _CORNERS:
        return [Cells(kind, nodes, ids)] if kind else []
    whole = (nodes >= 0).all(axis=1)
    plain = (_SOLIDS if kind in _SOLIDS.values() else _SHELLS)[corners]
    order = list(_ORDER.get(kind, range(nodes.shape[1])))
    return [Cells(kind, nodes[whole][:, order], ids[whole]), Cells(plain, nodes[~whole][:, :corners], ids[~whole])]


def _kind(batch: ElementBatch) -> str:
    """Name of the cells of a batch; "" if it cannot be shown."""
    kind, count = KINDS[batch.kind], batch.nodes.shape[1]
    if kind.sides:
        return _SOLIDS[count]
    if kind.faces:
        return _SHELLS[count]
    if count == 1:
        return "vertex"
    return "line" if kind.line else ""
