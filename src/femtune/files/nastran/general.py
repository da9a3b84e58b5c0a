"""GENEL: a stiffness or flexibility matrix between components of grid points and scalar points.

With components UI and supports UD, the forces are K (u_i − S u_d). S follows from rigid-body motion if the card has
none. The matrix is constant: its entries cannot be parameters.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.fem.assembled import AssembledMatrix
from femtune.fem.checks import rigid_body_modes
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.grids import Grids

_WORDS = ("UD", "K", "Z", "S")
_LARGEST_CONDITION = 1e12
"""Largest condition number of a flexibility or of six supports; four of the sixteen digits of a double are left."""


def read_general_elements(building: Building, grids: Grids) -> list[AssembledMatrix]:
    """The matrix of each GENEL card."""
    matrices = []
    for record in building.records("GENEL"):
        with building.errors.catch():
            matrices.append(_matrix(record, grids))
    return matrices


def _matrix(record: CardEntry, grids: Grids) -> AssembledMatrix:
    card = record.card
    parts = _parts(card)
    independent = _dofs(record, grids, parts.get("UI", []))
    supports = _dofs(record, grids, parts.get("UD", []))
    if not independent or ("K" in parts) == ("Z" in parts):
        raise _error(card, "it has no components UI, or not one of K and Z")
    m, n = len(independent), len(supports)
    stiffness: NDArray = _triangle(card, parts["K" if "K" in parts else "Z"], m)
    if "Z" in parts:
        if np.linalg.cond(stiffness) > _LARGEST_CONDITION:
            raise _error(card, "its flexibility Z is singular")
        stiffness = np.linalg.inv(stiffness)
        stiffness = 0.5 * (stiffness + stiffness.T)
    if "S" in parts:
        moves = _values(card, parts["S"], m * n).reshape(m, n)
    else:
        moves = _rigid(card, grids, independent, supports)
    rows = np.hstack([np.eye(m), -moves])
    whole = rows.T @ stiffness @ rows
    at = np.array([*independent, *supports], np.int64)
    size = grids.table.n_dofs
    entries = sp.coo_array((whole.ravel(), (np.repeat(at, len(at)), np.tile(at, len(at)))), shape=(size, size))
    upper = sp.csr_array(sp.triu(entries.tocsr()))
    return AssembledMatrix("stiffness", record.card.record, upper)


def _parts(card: Card) -> dict[str, list[int]]:
    """Positions of the fields that belong to each word; those of UI are first, without the word."""
    fields: dict[str, list[int]] = {"UI": []}
    word = "UI"
    for at in range(2, len(card.fields)):
        text = card.text(at)
        if text in _WORDS:
            word = text
            fields[word] = []
        else:
            fields[word].append(at)
    return fields


def _dofs(record: CardEntry, grids: Grids, fields: list[int]) -> list[int]:
    """DOFs of pairs of point and component."""
    card = record.card
    filled = [at for at in fields if not card.blank(at)]
    if len(filled) % 2:
        raise _error(card, "a grid point has no component")
    out = []
    for point, component in zip(filled[::2], filled[1::2]):
        out.append(grids.dof(card.integer(point), card.integer(component), record))
    if len(set(out)) != len(out):
        raise _error(card, "a component stands there twice")
    return out


def _triangle(card: Card, fields: list[int], m: int) -> Reals:
    """(m, m) symmetric matrix from the columns of its lower triangle."""
    values, out = _values(card, fields, m * (m + 1) // 2), np.zeros((m, m))
    column, row = np.triu_indices(m)
    out[row, column] = out[column, row] = values
    return out


def _values(card: Card, fields: list[int], count: int) -> NDArray[np.float64]:
    given = [card.real(at, 0.0) for at in fields]
    # blank fields between values are zero; after the last value they only fill the line
    while given and card.blank(fields[len(given) - 1]):
        given.pop()
    if len(given) != count:
        raise _error(card, f"{count} values are needed, {len(given)} are given; write zeros at the end as 0.")
    return np.array(given)


def _rigid(card: Card, grids: Grids, independent: list[int], supports: list[int]) -> Reals:
    """S from the six supports that determine the rigid-body motion."""
    if not supports:
        return np.zeros((len(independent), 0))
    modes = rigid_body_modes(grids.table)
    if len(supports) != 6 or np.linalg.cond(modes[supports]) > _LARGEST_CONDITION:
        raise _error(card, "S is missing, and UD are not six components that determine a rigid-body motion")
    return np.asarray(modes[independent] @ np.linalg.inv(modes[supports]))


def _error(card: Card, what: str) -> FemtuneError:
    return card.error("deck.field-value/general-element", problem=what)
