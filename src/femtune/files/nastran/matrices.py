"""DMIG cards: entries of a matrix by grid point and component."""

from __future__ import annotations

import cmath
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice, Where
from femtune.fem import AssembledMatrix, FieldRef
from femtune.fem.fields import MatrixKind
from femtune.files.matrices.read_matrix import Entries, matrix_from, no_such_matrix
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import Card
from femtune.files.nastran.case_control import CaseCommand
from femtune.files.nastran.control import real_param
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.lines import parse_number
from femtune.parameters.jet import Jet

# IFO: form of a DMIG matrix
_SQUARE = 1
_SYMMETRIC = 6
# TIN: complex in single and in double precision
_COMPLEX = (3, 4)
_FIRST_ENTRY = 4
_FIELDS_PER_ENTRY = 4
"""Index of the first entry on a column card, and fields of each entry: G, C, A and B."""


@dataclass(frozen=True)
class DmigHeader:
    """Form (1 square, 6 symmetric, 2 and 9 rectangular), type of the numbers, polar or not, number of columns."""

    name: str
    form: int
    type: int
    polar: bool
    columns: int | None
    card: Card


@dataclass(frozen=True, eq=False)
class Dmig:
    """Entries of one DMIG matrix: `row` and `col` (m, 2) node and component, `cards` (m,) the card of each."""

    header: DmigHeader
    row: NDArray[np.int64]
    col: NDArray[np.int64]
    value: NDArray
    cards: tuple[Card, ...]


def dmig_names(deck: Deck) -> list[str]:
    """Names of all matrices of a deck, in order."""
    return [card.text(0) for card in deck.by_name("DMIG") if card.integer(1) == 0]


def dmig_matrix(deck: Deck, name: str | None) -> Dmig:
    """Entries of a DMIG matrix of a deck; of the first one without a name.

    Raises
    ------
    FemtuneError : ``matrices.no-such-matrix``, ``matrices.dmig``, ``matrices.not-square``, ``deck.*``
    """
    names = dmig_names(deck)
    wanted = (name or (names[0] if names else "")).upper()
    if wanted not in names:
        raise no_such_matrix(deck.path, name, names)
    cards = [card for card in deck.by_name("DMIG") if card.text(0) == wanted]
    headers = [card for card in cards if card.integer(1) == 0]
    if len(headers) > 1:
        raise _error(headers[1], "matrices.dmig", name=wanted, place=headers[0].where())
    header = _header(headers[0])
    return _entries(header, [card for card in cards if card.integer(1) != 0])


def _header(card: Card) -> DmigHeader:
    form, kind = card.integer(2), card.integer(3)
    if form not in (1, 2, 6, 9) or kind not in (1, 2, 3, 4):
        raise _error(card, "matrices.dmig/header", form=form, kind=kind)
    if form not in (_SQUARE, _SYMMETRIC):
        raise FemtuneError("matrices.not-square", where=card.where(), name=card.text(0), form=form)
    return DmigHeader(card.text(0), form, kind, card.integer(5, 0) == 1, card.integer(7, None), card)


def _entries(header: DmigHeader, cards: list[Card]) -> Dmig:
    row, col, value, owners = [], [], [], []
    for card in cards:
        column = _dof(card, 1)
        for at in range(_FIRST_ENTRY, len(card.fields), _FIELDS_PER_ENTRY):
            if not card.blank(at):
                row.append(_dof(card, at))
                col.append(column)
                value.append(_value(header, card, at + 2))
                owners.append(card)
    if not value:
        raise _error(header.card, "matrices.dmig/no-columns", header_name=header.name)
    _check_columns(header, col)
    return Dmig(header, np.array(row), np.array(col), np.array(value), tuple(owners))


def _dof(card: Card, at: int) -> tuple[int, int]:
    return card.integer(at), card.integer(at + 1, 0)


def _value(header: DmigHeader, card: Card, at: int) -> complex | float:
    real = card.real(at)
    if header.type not in _COMPLEX:
        return real
    other = card.real(at + 1, 0.0)
    return cmath.rect(real, np.radians(other)) if header.polar else complex(real, other)


def _check_columns(header: DmigHeader, col: list[tuple[int, int]]) -> None:
    if header.columns is not None and len(set(col)) > header.columns:
        raise _error(
            header.card,
            "matrices.dmig/column-count",
            header_name=header.name,
            n_columns=len(set(col)),
            stated_columns=header.columns,
        )


def check_one_triangle(matrix: Dmig, row: NDArray, col: NDArray) -> None:
    """Check that a symmetric DMIG has each pair once, in either order."""
    if matrix.header.form != _SYMMETRIC:
        return
    low, high = np.minimum(row, col), np.maximum(row, col)
    _, first, count = np.unique(low * (row.max(initial=0) + col.max(initial=0) + 1) + high, return_index=True,
                                return_counts=True)  # fmt: skip
    if (count > 1).any():
        card = matrix.cards[int(first[int(np.argmax(count > 1))])]
        raise FemtuneError(
            "matrices.duplicate",
            where=card.where(),
            values={"pairs": int((count > 1).sum())},
            header_name=matrix.header.name,
        )


def _error(card: Card, code: str, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=card.where(), **facts)


# ----------------------------------------------------------------------------------------------------
# Matrices that case control adds to those of the elements: K2GG, M2GG, B2GG, K42GG with their DMIG cards.


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
    matrices: list[AssembledMatrix] = []
    commands = {c.name: c for c in building.deck.case_control.effective if c.name in KINDS}
    elsewhere = _in_other_parts(building.deck)
    for command in commands.values():
        with building.errors.catch():
            parts = [part for part in _parts(command) if part[1] not in elsewhere]
            matrices += [one for part in parts for one in _matrices(building, grids, command, *part)]
    return tuple(matrices)


def _in_other_parts(deck: Deck) -> set[str]:
    """Names of matrices that have DMIG cards only in other superelements, to which a selection may apply."""
    if deck.section is None:
        return set()
    return {c.text(0) for cards in deck.sections.values() for c in cards.get("DMIG", ())} - set(dmig_names(deck))


def _parts(command: CaseCommand) -> Iterator[tuple[float, str]]:
    """Factor and name of each matrix: ``1.25*KA, KB``."""
    for text in filter(None, (part.strip() for part in command.value.split(","))):
        match = _PART.fullmatch(text)
        factor = 1.0 if match is None or match[1] is None else parse_number(match[1])
        if match is None or factor is None:
            raise FemtuneError("deck.case-control/parts", where=command.where, command_name=command.name, text=text)
        yield factor, match[2].upper()


def _matrices(
    building: Building, grids: Grids, command: CaseCommand, factor: float, name: str
) -> list[AssembledMatrix]:
    """The matrix; of a complex stiffness the real part, and the imaginary part as structural damping."""
    kind, param = KINDS[command.name]
    upper = dmig_upper(building.deck, name, grids) * real_param(building, param, 1.0)
    label = f"{command.name} {name}"
    parts = [scaled_matrix(building, kind, label, sp.csr_array(upper.real), name, factor)]
    imaginary = sp.csr_array(upper.imag)
    if np.any(imaginary.data):
        if kind != "stiffness":
            raise FemtuneError("deck.complex-matrix", where=command.where, command=command.name, matrix=name)
        imaginary.eliminate_zeros()
        parts.append(replace(parts[0], kind="hysteretic", upper=imaginary))
        building.notices.append(Notice("deck.complex-matrix/damping", where=command.where, matrix=name))
    return parts


def scaled_matrix(
    building: Building, kind: MatrixKind, label: str, upper: sp.csr_array, name: str, factor: float = 1.0
) -> AssembledMatrix:
    """A matrix with a factor in the value table, ``MATRIX KAAX``; `upper` is its upper triangle on the g-set."""
    position = building.values.add(FieldRef("MATRIX", 0, name), factor)
    return AssembledMatrix(kind, label, upper, {"FACTOR": position}, _factor)


def dmig_upper(deck: Deck, name: str, grids: Grids) -> sp.csr_array:
    """Upper triangle of a DMIG matrix on the g-set (errors of `dmig_matrix`)."""
    return _upper(dmig_matrix(deck, name), grids)


def _upper(matrix: Dmig, grids: Grids) -> sp.csr_array:
    row, col = _dofs(matrix, matrix.row, grids), _dofs(matrix, matrix.col, grids)
    check_one_triangle(matrix, row, col)
    n = grids.table.n_dofs
    names = np.array([[d.node, d.component] for d in map(grids.table.describe, range(n))], np.int64).reshape(-1, 2)
    entries = Entries(row, col, matrix.value, (n, n), names, lambda i: matrix.cards[i].where())
    where = Where(matrix.header.card.where().file, matrix.header.card.where().line, f"DMIG {matrix.header.name}")
    return matrix_from(entries, matrix.header.name, where).upper


def _dofs(matrix: Dmig, at: NDArray[np.int64], grids: Grids) -> NDArray[np.int64]:
    table = grids.table
    return np.array([table.dof(int(n), int(c), card.where()) for (n, c), card in zip(at, matrix.cards)], np.int64)


def _factor(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
    return values["FACTOR"]
