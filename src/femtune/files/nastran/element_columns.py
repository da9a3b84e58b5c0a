"""Element cards of a large deck (number, property, grid points and nothing else), read by whole columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.columns import columns_of
from femtune.files.nastran.grids import Grids

Section = TypeVar("Section")
_PROPERTY_FIELD = 1
_FIRST_NODE_FIELD = 2
"""Indices of the property number and of the first grid point on an element card."""


def read_elements(
    building: Building,
    grids: Grids,
    name: str,
    sizes: Sequence[int],
    section: Callable[[int, CardEntry], Section],
    plain: Callable[[int, Section, list[int]], bool],
    other: Callable[[CardEntry], None],
) -> None:
    """Read the elements of one card: those that are plain by whole columns, the others one by one, in deck order.

    Parameters
    ----------
    sizes : numbers of grid points that a plain card may have
    section : section of a property number, for a card that refers to it
    plain : takes number, section and rows of the node table of a plain element; returns False if it cannot
    other : takes the record of any other element, and raises its errors
    """
    cards = building.deck.by_name(name)
    plain_elements = _plain_elements(cards, sizes, grids)
    sections = _Sections(section)
    for at, card in enumerate(cards):
        element = plain_elements.get(at)
        known = sections.get(element[1], card) if element else None
        if element is None or known is None or not plain(element[0], known, element[2]):
            with building.errors.catch():
                other(_record(card))


@dataclass
class _Sections(Generic[Section]):
    """Sections by number; None for an invalid one, whose error each user raises."""

    make: Callable[[int, CardEntry], Section]
    known: dict[int, Section | None] = field(default_factory=dict)

    def get(self, number: int, user: Card) -> Section | None:
        """The section that a card refers to."""
        if number not in self.known:
            try:
                self.known[number] = self.make(number, _record(user))
            except FemtuneError:
                self.known[number] = None
        return self.known[number]


def _record(card: Card) -> CardEntry:
    return CardEntry(card, CATALOGUE[card.name].fields)


def _plain_elements(cards: Sequence[Card], sizes: Sequence[int], grids: Grids) -> dict[int, tuple[int, int, list[int]]]:
    """Number, property and rows of the node table of plain cards, by index in the list."""
    columns = columns_of(cards)
    if columns is None:
        return {}
    eids, plain = columns.integers(0)
    pids, given = columns.integers(_PROPERTY_FIELD)
    plain &= given
    out: dict[int, tuple[int, int, list[int]]] = {}
    left = plain
    numbers = np.empty((len(cards), max(sizes)), np.int64)
    for i in range(max(sizes)):
        numbers[:, i], given = columns.integers(_FIRST_NODE_FIELD + i)
        left = left & (given | (i >= min(sizes)))
    for size in sizes:
        rows = np.flatnonzero(left & columns.blank(_FIRST_NODE_FIELD + size, columns.text.shape[1]))
        rows = rows[(numbers[rows, :size] > 0).all(axis=1) & _distinct(numbers[rows, :size])]
        nodes = grids.rows(numbers[rows, :size])
        sound = (nodes >= 0).all(axis=1)
        known = zip(eids[rows[sound]].tolist(), pids[rows[sound]].tolist(), nodes[sound].tolist())
        out.update(zip(rows[sound].tolist(), known))
    return out


def _distinct(numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
    return np.asarray((np.diff(np.sort(numbers, axis=1), axis=1) > 0).all(axis=1))
