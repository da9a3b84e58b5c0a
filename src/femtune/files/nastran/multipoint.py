"""Multipoint constraints: MPC and MPCADD as sets of equations, the first DOF of each dependent."""

from __future__ import annotations

import numpy as np

from femtune.fem.structure import ConstraintRows, join_constraints
from femtune.files.nastran.building import Building
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.record import Record
from femtune.files.nastran.supports import read_unions

# what follows from it, squared and times a stiffness, stays a number
_LARGEST_RATIO = 1e30


def read_multipoint_sets(building: Building, grids: Grids) -> dict[int, ConstraintRows]:
    """Equations of each MPC set, those of MPCADD included."""
    parts: dict[int, list[ConstraintRows]] = {}
    for record in building.records("MPC"):
        with building.errors.catch():
            parts.setdefault(record.integer("SID"), []).append(_equation(record, grids))
    for number, members in read_unions(building, "MPCADD", set(parts)).items():
        parts[number] = [rows for member in members for rows in parts[member]]
    return {number: join_constraints(rows) for number, rows in parts.items()}


def _equation(record: Record, grids: Grids) -> ConstraintRows:
    terms = _terms(record, grids)
    if not terms or terms[0][1] == 0.0:
        raise record.error("deck.field-value", "the first coefficient of an MPC is its dependent DOF's and not zero",
                           hint="fill G1, C1 and A1")  # fmt: skip
    if max(abs(a) for _, a in terms) > _LARGEST_RATIO * abs(terms[0][1]):
        raise record.error("deck.field-value", "a coefficient of an MPC is beyond all sizes beside the first one",
                           hint="correct its exponent, or that of the first coefficient")  # fmt: skip
    dofs = np.array([dof for dof, _ in terms], dtype=np.int64)
    coefficients = np.array([a for _, a in terms])
    rows, owner = np.zeros(len(terms), np.int64), np.zeros(1, np.int64)
    return ConstraintRows(dofs[:1], rows, dofs, coefficients, owner)


def _terms(record: Record, grids: Grids) -> list[tuple[int, float]]:
    """DOF and coefficient of each term: two a line, in fields 3 to 8."""
    card, terms = record.card, []
    for line in range(0, len(card.fields), 8):
        for at in (line + 1, line + 4):
            number = card.integer(at, 0)
            if number:
                component = card.component(at + 1, "0")
                if len(component) != 1:
                    raise card.error("deck.field-value", "a term of an MPC has one component", index=at + 1,
                                     hint="write one digit from 1 to 6 (0 for a scalar point)")  # fmt: skip
                terms.append((grids.dof(number, int(component), record), card.real(at + 2, 0.0)))
    return terms
