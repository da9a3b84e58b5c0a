"""DMIG cards: entries of a matrix by grid point and component."""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.files.matrices.missing import no_such_matrix
from femtune.files.nastran.card import Card
from femtune.files.nastran.deck import Deck

_SQUARE, _SYMMETRIC = 1, 6
_COMPLEX = (3, 4)
_FIRST, _GROUP = 4, 4


@dataclass(frozen=True)
class DmigHeader:
    """Form (1 square, 6 symmetric, 2 and 9 rectangular), type of the numbers, magnitude and phase or not, columns."""

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
    """Entries of a DMIG matrix of a deck; the first one where no name is asked for.

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
        raise _error(headers[1], f"a second header of {wanted}; the first stands at {headers[0].where()}", "remove one")
    header = _header(headers[0])
    return _entries(header, [card for card in cards if card.integer(1) != 0])


def _header(card: Card) -> DmigHeader:
    form, kind = card.integer(2), card.integer(3)
    if form not in (1, 2, 6, 9) or kind not in (1, 2, 3, 4):
        hint = "form is 1, 2, 6 or 9 and type 1 to 4"
        raise _error(card, f"a header with form {form} and type {kind}", hint)
    if form not in (_SQUARE, _SYMMETRIC):
        raise FemtuneError(
            "matrices.not-square", f"DMIG {card.text(0)} is declared rectangular (form {form})", where=card.where(),
            hint="name a stiffness or mass matrix: they have form 6, or 1",
        )  # fmt: skip
    return DmigHeader(card.text(0), form, kind, card.integer(5, 0) == 1, card.integer(7, None), card)


def _entries(header: DmigHeader, cards: list[Card]) -> Dmig:
    row, col, value, owners = [], [], [], []
    for card in cards:
        column = _dof(card, 1)
        for at in range(_FIRST, len(card.fields), _GROUP):
            if not card.blank(at):
                row.append(_dof(card, at))
                col.append(column)
                value.append(_value(header, card, at + 2))
                owners.append(card)
    if not value:
        raise _error(header.card, f"{header.name} has a header and no columns", "the file may have been cut")
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
        raise _error(header.card, f"{header.name} has {len(set(col))} columns, and its header says {header.columns}",
                     "correct NCOL, or remove what does not belong to it")  # fmt: skip


def check_one_triangle(found: Dmig, row: NDArray, col: NDArray) -> None:
    """A symmetric DMIG gives each pair once, in either order."""
    if found.header.form != _SYMMETRIC:
        return
    low, high = np.minimum(row, col), np.maximum(row, col)
    _, first, count = np.unique(low * (row.max(initial=0) + col.max(initial=0) + 1) + high, return_index=True,
                                return_counts=True)  # fmt: skip
    if (count > 1).any():
        card = found.cards[int(first[int(np.argmax(count > 1))])]
        raise FemtuneError(
            "matrices.duplicate", f"the symmetric matrix {found.header.name} gives a pair of degrees of freedom twice",
            where=card.where(), values={"pairs": int((count > 1).sum())},
            hint="keep one triangle, or declare the matrix square (form 1)",
        )  # fmt: skip


def _error(card: Card, what: str, hint: str) -> FemtuneError:
    return FemtuneError("matrices.dmig", what, where=card.where(), hint=hint)
