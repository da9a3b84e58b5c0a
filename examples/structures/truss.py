"""Pin-jointed truss of five bays of the handbook chapter (Fig. 16)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.fem import FieldRef
from femtune.fem.assembled import AssembledMatrix
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from structures.frames import make_structure, rods

Reals = NDArray[np.float64]

BAYS, TRUE = 5, (3, 7, 11, 15, 19)
"""Number of bays, and the bars that vary: the diagonals."""


def bars() -> dict[int, tuple[int, int]]:
    """Ends of every bar, from 0: nodes 0 to 5 below, 6 to 11 above."""
    found = {4 * BAYS + 1: (5, 11)}
    for i in range(BAYS):
        found |= {4 * i + 1: (i, 6 + i), 4 * i + 2: (i, i + 1), 4 * i + 3: (i, 7 + i), 4 * i + 4: (6 + i, 7 + i)}
    return dict(sorted(found.items()))


def mass(xyz: Reals) -> AssembledMatrix:
    """Unit mass a length, consistent along and across each bar (a rod of a deck is so along itself only)."""
    found = np.zeros((6 * len(xyz), 6 * len(xyz)))
    for p, q in bars().values():
        length = float(np.linalg.norm(xyz[q] - xyz[p]))
        at = [6 * p, 6 * p + 1, 6 * q, 6 * q + 1]
        found[np.ix_(at, at)] += length / 6.0 * np.kron([[2.0, 1.0], [1.0, 2.0]], np.eye(2))
    return AssembledMatrix("mass", "bars", sp.csr_array(np.triu(found)))


def truss(pinned: bool) -> ConfiguredModel:
    """Bars of unit EA in a plane; the left end pinned, or all free."""
    xyz = np.array([(i, y, 0.0) for y in (0.0, 1.0) for i in range(BAYS + 1)])
    section = {"E": 1.0, "A": 1.0, "G": 0.0, "J": 0.0, "rho": 0.0}
    held = [6 * node + d for node in range(12) for d in (2, 3, 4, 5)]
    held += [6 * node + d for node in (0, 6) for d in (0, 1)] if pinned else []
    structure = make_structure(
        xyz, [rods(list(bars().values()), section)], permanent=np.array(sorted(held)), assembled=(mass(xyz),)
    )
    parameters = ParameterSet(tuple(Parameter(f"b{n}", 1.0, 0.1, 3.0) for n in bars()))
    fields = [Assignment(f"b{n}", FieldRef("CROD", n, "E")) for n in bars()]
    return configure(parametric_model(structure, parameters, fields), Configuration())
