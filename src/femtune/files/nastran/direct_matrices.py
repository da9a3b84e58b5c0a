"""Matrices that case control adds to those of the elements: K2GG, M2GG, B2GG, K42GG with their DMIG cards."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.fem import AssembledMatrix, FieldRef
from femtune.fem.contribution import MatrixKind
from femtune.files.matrices.entries import Entries
from femtune.files.matrices.read_matrix import matrix_from
from femtune.files.nastran.building import Building
from femtune.files.nastran.case_control import CaseCommand
from femtune.files.nastran.control import real_param
from femtune.files.nastran.dmig import Dmig, check_one_triangle, dmig_matrix
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.reals import parse_real
from femtune.parameters.jet import Jet

KINDS: dict[str, tuple[MatrixKind, str]] = {
    "K2GG": ("stiffness", "CK2"),
    "M2GG": ("mass", "CM2"),
    "B2GG": ("viscous", "CB2"),
    "K42GG": ("hysteretic", "CK42"),
}
"""Commands with the matrix that they add to and the PARAM that scales them; PARAM WTMASS does not scale M2GG."""

_PART = re.compile(r"(?:([^*,\s]+)\s*\*\s*)?([A-Z][A-Z0-9]{0,7})", re.IGNORECASE)


def read_direct_matrices(building: Building, grids: Grids) -> tuple[AssembledMatrix, ...]:
    """The matrices that case control selects; each has a factor in the value table, ``MATRIX STIFF``."""
    found: list[AssembledMatrix] = []
    commands = {c.name: c for c in building.deck.case_control.others if c.name in KINDS}
    for command in commands.values():
        with building.errors.catch():
            found += [_matrix(building, grids, command, *part) for part in _parts(command)]
    return tuple(found)


def _parts(command: CaseCommand) -> Iterator[tuple[float, str]]:
    """Factor and name of each matrix: ``1.25*KA, KB``."""
    for text in filter(None, (part.strip() for part in command.value.split(","))):
        match = _PART.fullmatch(text)
        factor = 1.0 if match is None or match[1] is None else _number(match[1])
        if match is None or factor is None:
            raise FemtuneError(
                "deck.case-control", f"{command.name} should name matrices, not '{text}'", where=command.where,
                hint=f"write {command.name} = STIFF, or {command.name} = 1.25*STIFF, OTHER",
            )  # fmt: skip
        yield factor, match[2].upper()


def _number(text: str) -> float | None:
    """A real; case control lets whole numbers pass for one."""
    return float(text) if text.lstrip("+-").isdecimal() else parse_real(text)


def _matrix(building: Building, grids: Grids, command: CaseCommand, factor: float, name: str) -> AssembledMatrix:
    kind, param = KINDS[command.name]
    found = dmig_matrix(building.deck, name)
    upper = _upper(found, grids) * real_param(building, param, 1.0)
    position = building.values.add(FieldRef("MATRIX", 0, name), factor)
    return AssembledMatrix(kind, f"{command.name} {name}", upper, {"FACTOR": position}, _factor)


def _upper(found: Dmig, grids: Grids) -> sp.csr_array:
    row, col = _dofs(found, found.row, grids), _dofs(found, found.col, grids)
    check_one_triangle(found, row, col)
    n = grids.table.n_dofs
    names = np.array([[d.node, d.component] for d in map(grids.table.describe, range(n))], np.int64).reshape(-1, 2)
    entries = Entries(row, col, found.value, (n, n), names, lambda i: found.cards[i].where())
    where = Where(found.header.card.where().file, found.header.card.where().line, f"DMIG {found.header.name}")
    return matrix_from(entries, found.header.name, where).upper


def _dofs(found: Dmig, at: NDArray[np.int64], grids: Grids) -> NDArray[np.int64]:
    table = grids.table
    return np.array([table.dof(int(n), int(c), card.where()) for (n, c), card in zip(at, found.cards)], np.int64)


def _factor(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
    return values["FACTOR"]
