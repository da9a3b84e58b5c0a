"""Masses at grid points: CONM2 (mass, offset, inertia) and CONM1 (a symmetric 6 × 6 matrix)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows, Building
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.record import Record


def read_masses(building: Building, grids: Grids) -> list[ElementBatch]:
    """Batches of CONM2 and of CONM1."""
    found = []
    for card, kind in (("CONM2", "concentrated-mass"), ("CONM1", "general-mass")):
        rows = BatchRows(kind, card)
        for record in building.records(card):
            with building.errors.catch():
                _add(rows, record, building, grids)
        found += rows.batches()
    return found


def _add(rows: BatchRows, record: Record, building: Building, grids: Grids) -> None:
    eid, row = record.integer("EID"), grids.row(record.integer("G"), record)
    roles = {name: building.value(record, eid, name) for name in CATALOGUE[record.name].values}
    facts = _offset(record, grids, row) if record.name == "CONM2" else {"frame": _axes(record, grids, row)}
    rows.add(eid, [row], grids.dofs(row), roles, facts)


def _offset(record: Record, grids: Grids, row: int) -> dict[str, NDArray]:
    """Offset of the centre of gravity and axes of the inertia; with CID −1 it is given as a point in basic."""
    x = np.array(record.reals("X1", "X2", "X3"))
    if record.integer("CID", 0) == -1:
        return {"offset": x - grids.table.xyz[row], "frame": np.eye(3)}
    frame = _axes(record, grids, row)
    return {"offset": frame @ x, "frame": frame}


def _axes(record: Record, grids: Grids, row: int) -> NDArray[np.float64]:
    return grids.systems.get(record.integer("CID", 0), record).frame(grids.table.xyz[row])
