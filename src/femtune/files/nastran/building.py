"""Data that are gathered while a structure is built from cards."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from femtune.errors import ErrorCollector, FemtuneError, Notice
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.fem.values import ValueTableBuilder
from femtune.files.nastran.card import Card, CardEntry, records_of
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.coordinates import BASIC, CoordinateSystem
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.lists import read_list

T = TypeVar("T")

LARGEST_VALUE = 1e60
"""Largest magnitude of a field; products and third powers of values do not overflow (1e308)."""
_SMALLEST_VALUE = 1e-50
"""Smallest nonzero magnitude of a field; third powers do not underflow, and inverses of products do not overflow."""


@dataclass(frozen=True)
class FieldPlace:
    """Place of a value: index of the card in `Deck.cards` and indices of the fields (all hold the same value).

    `flag` is index and text of a field that must be written with it if the card lacks the line for the value.
    """

    card: int
    fields: tuple[int, ...]
    flag: tuple[int, str] | None = None

    def beside(self, taken: Mapping[int, object]) -> FieldPlace:
        """The place moved down by the lines that other new lines occupy: `taken` are texts of the card by index."""
        if self.flag is None or taken.get(self.flag[0]) in (None, "", self.flag[1]):
            return self
        fields = tuple(index + 8 for index in self.fields)
        return replace(self, fields=fields, flag=(self.flag[0] + 8, self.flag[1])).beside(taken)


@dataclass
class Building:
    """Deck, value table, places of the values, errors and notices of one build.

    `basic` is the basic system of the deck; that of a superelement may be moved by SELOC.
    """

    deck: Deck
    values: ValueTableBuilder = field(default_factory=ValueTableBuilder)
    places: dict[FieldRef, FieldPlace] = field(default_factory=dict)
    errors: ErrorCollector = field(default_factory=ErrorCollector)
    notices: list[Notice] = field(default_factory=list)
    basic: CoordinateSystem = BASIC

    def records(self, *names: str, defaults: CardEntry | None = None) -> list[CardEntry]:
        """All entries of the cards of some names."""
        return [record for name in names for card in self.deck.by_name(name) for record in records_of(card, defaults)]

    def defaults(self, name: str) -> CardEntry | None:
        """The GRDSET, BAROR or BEAMOR card; the deck may hold one of each."""
        cards = self.deck.by_name(name)
        if len(cards) > 1:
            with self.errors.catch():
                raise duplicate(cards[1], f"a second {name} card", cards[0])
        return CardEntry(cards[0], CATALOGUE[name].fields) if cards else None

    def value(
        self, record: CardEntry, id: int, name: str, default: float = 0.0, also: tuple[int, ...] = (),
        flag: tuple[int, str] | None = None,
    ) -> int:  # fmt: skip
        """Position in the value table of a field of a card; a blank field is an entry with the default."""
        ref = FieldRef(record.name, id, name)
        if ref not in self.places:
            self.places[ref] = FieldPlace(record.card.position, (record.at(name), *also), flag)
        value = record.real(name, default)
        if abs(value) > LARGEST_VALUE or 0.0 < abs(value) < _SMALLEST_VALUE:
            raise record.error("deck.field-value", at=name)
        return self.values.add(ref, value)

    def by_number(self, records: list[CardEntry], what: str) -> dict[int, CardEntry]:
        """Records by their number, the first field; a repeated number is an error."""
        records_by_number: dict[int, CardEntry] = {}
        for record in records:
            with self.errors.catch():
                number = record.card.integer(record.start)
                if number < 1:
                    raise record.card.error("deck.field-value/number", index=record.start, kind=what)
                if number in records_by_number:
                    raise duplicate(record.card, f"{what} {number}", records_by_number[number].card)
                records_by_number[number] = record
        return records_by_number


def duplicate(card: Card, what: str, first: Card) -> FemtuneError:
    """Error for a number that was given before."""
    return card.error("deck.duplicate-id", defined=what, place=first.where())


def listed_numbers(record: CardEntry, fields: Sequence[str]) -> list[int]:
    """All numbers of a list with THRU (error ``deck.field-value`` if it is too long)."""
    try:
        return list(read_list(fields, record.where).expand())
    except ValueError as error:
        raise record.error("deck.field-value/listed-numbers", record_name=record.name) from error


@dataclass
class Library(Generic[T]):
    """Results by number, each computed on first use; a failure is repeated with the same error."""

    make: Callable[[int, CardEntry], T]
    _known: dict[int, T | FemtuneError] = field(default_factory=dict)

    def get(self, number: int, user: CardEntry) -> T:
        """The result of a number that a card refers to."""
        if number not in self._known:
            try:
                self._known[number] = self.make(number, user)
            except FemtuneError as error:
                self._known[number] = error
        result = self._known[number]
        if isinstance(result, FemtuneError):
            # otherwise the traceback would grow with each card that refers to it
            raise result.with_traceback(None)
        return result


@dataclass
class BatchRows:
    """Elements of one batch, row by row."""

    kind: str
    card: str
    ids: list[int] = field(default_factory=list)
    nodes: list[list[int]] = field(default_factory=list)
    dofs: list[list[int]] = field(default_factory=list)
    roles: dict[str, list[int]] = field(default_factory=dict)
    facts: dict[str, list[NDArray]] = field(default_factory=dict)

    def add(
        self, id: int, nodes: list[int], dofs: list[int], roles: Mapping[str, int], facts: Mapping[str, NDArray]
    ) -> None:  # fmt: skip
        """Add an element."""
        self.ids.append(id)
        self.nodes.append(nodes)
        self.dofs.append(dofs)
        for name, position in roles.items():
            self.roles.setdefault(name, []).append(position)
        for name, fact in facts.items():
            self.facts.setdefault(name, []).append(fact)

    def batches(self) -> list[ElementBatch]:
        """The batch, or an empty list if no element was added."""
        if not self.ids:
            return []
        ids, nodes, dofs = (np.array(x, dtype=np.int64) for x in (self.ids, self.nodes, self.dofs))
        roles = {name: np.array(at, dtype=np.int64) for name, at in self.roles.items()}
        facts = {name: np.array(rows) for name, rows in self.facts.items()}
        return [ElementBatch(self.kind, self.card, ids, nodes, dofs, roles, facts)]
