"""Planar bushes: CBUSH2D with PBUSH2D."""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.discrete import BUSH
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import BatchRows
from femtune.files.nastran.materials import read_properties
from femtune.files.nastran.reading import ElementReading

_PLANES = ("XY", "YZ", "ZX")


def read_planar_bushes(reading: ElementReading) -> list[ElementBatch]:
    """Batch of CBUSH2D: K1 and K2 along the axes of its plane."""
    building, grids = reading.building, reading.grids
    properties, rows = read_properties(building, "CBUSH2D"), BatchRows(BUSH.key, "CBUSH2D")
    for record in building.records("CBUSH2D"):
        with building.errors.catch():
            pid = record.integer("PID", record.integer("EID"))
            source = properties.find(pid, record)
            none = building.values.add(FieldRef("PBUSH2D", pid, "none"), 0.0)
            roles = {f"{value}{i}": none for value in ("K", "GE") for i in range(1, 7)}
            roles |= {name: building.value(source, pid, name) for name in ("K1", "K2")}
            a, b = grids.row(record.integer("GA"), record), grids.row(record.integer("GB"), record)
            frame = np.roll(np.eye(3), -_PLANES.index(record.text("PLANE", "XY")), axis=1)
            facts = {"frame": frame, "arm_a": np.zeros(3), "arm_b": np.zeros(3)}
            rows.add(record.integer("EID"), [a, b], grids.dofs(a) + grids.dofs(b), roles, facts)
    return rows.batches()
