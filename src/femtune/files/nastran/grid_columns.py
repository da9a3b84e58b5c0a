"""GRID cards of a large deck, read by whole columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.files.nastran.card import Card
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.columns import Columns, columns_of
from femtune.files.nastran.record import Record

_CP, _X, _CD, _PS = 1, 2, 5, 6


@dataclass(frozen=True, eq=False)
class CardRecords(Mapping[int, Record]):
    """Records by number, each made when it is asked for."""

    cards: Mapping[int, Card]

    def __getitem__(self, number: int) -> Record:
        card = self.cards[number]
        return Record(card, CATALOGUE[card.name].fields)

    def __iter__(self) -> Iterator[int]:
        return iter(self.cards)

    def __len__(self) -> int:
        return len(self.cards)

    def __contains__(self, number: object) -> bool:
        return number in self.cards


@dataclass(frozen=True, eq=False)
class PlainGrids:
    """Grid points of plain columns, in ascending order of their numbers.

    Parameters
    ----------
    records : their cards by number
    xyz : (n, 3) coordinates, for those that are `simple`
    simple : (n,) coordinates and displacements are in the basic frame, and plainly spelled
    supported : (n,) field PS is filled
    """

    records: CardRecords
    xyz: NDArray[np.float64]
    simple: NDArray[np.bool_]
    supported: NDArray[np.bool_]


def plain_grids(cards: tuple[Card, ...]) -> PlainGrids | None:
    """Columns of GRID cards; None where a number is not plain or stands twice."""
    columns = columns_of(cards)
    if columns is None:
        return None
    numbers, plain = columns.integers(0)
    order = np.argsort(numbers, kind="stable")
    ascending = numbers[order]
    if not plain.all() or ascending[0] <= 0 or not (np.diff(ascending) > 0).all():
        return None
    simple = _basic(columns, _CP) & _basic(columns, _CD)
    xyz = np.empty((len(cards), 3))
    for i in range(3):
        xyz[:, i], given = columns.reals(_X + i)
        simple &= given
    records = CardRecords(dict(zip(ascending.tolist(), (cards[i] for i in order.tolist()))))
    return PlainGrids(records, xyz[order], simple[order], ~columns.blank(_PS)[order])


def _basic(columns: Columns, index: int) -> NDArray[np.bool_]:
    system, plain = columns.integers(index)
    return np.asarray(columns.blank(index) | (plain & (system == 0)))
