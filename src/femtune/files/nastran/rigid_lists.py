"""Rigid elements whose cards hold lists of any length: RBE1 and RBE3."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from femtune.fem.constraints import rigid_body_rows
from femtune.fem.constraints_average import WeightedPoints, average_rows
from femtune.fem.structure import ConstraintRows
from femtune.files.nastran.building import listed_numbers
from femtune.files.nastran.card import Card
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.lists import read_list
from femtune.files.nastran.record import Record

_WORDS = ("UM", "ALPHA")
Pairs = list[tuple[int, list[int]]]


@dataclass
class _Fields:
    """The filled fields of a card one after the other, from a position; blank ones are passed over."""

    card: Card
    at: int

    def next(self) -> int | None:
        """Position of the next filled field, or None at the end."""
        while self.at < len(self.card.fields) and self.card.blank(self.at):
            self.at += 1
        return self.at if self.at < len(self.card.fields) else None

    def take(self) -> int:
        """Position of the field that must stand next."""
        at = self.next()
        if at is None:
            return self.at
        self.at = at + 1
        return at

    def until_real(self) -> list[str]:
        """Texts up to the next real number or word, which is left."""
        texts = []
        while (at := self.next()) is not None and not self.card.is_real(at) and self.card.text(at) not in _WORDS:
            texts.append(self.card.text(self.take()))
        return texts


def body_rows(record: Record, grids: Grids) -> ConstraintRows:
    """RBE1: independent components GNi, CNi; dependent ones after UM."""
    fields = _Fields(record.card, 1)
    independent = _pairs(fields)
    dependent = _after_words(fields).get("UM", [])
    if not dependent:
        raise record.error("deck.field-value", "RBE1 names no dependent components",
                           hint="write UM, then grid points with their components")  # fmt: skip
    _check_points(record, grids, [n for n, _ in (*independent, *dependent)])
    return rigid_body_rows(grids.table, independent, dependent, record.integer("EID"))


def averaging_rows(record: Record, grids: Grids) -> ConstraintRows:
    """RBE3: groups WT, C, G; other dependent components after UM; ALPHA has no meaning without temperatures."""
    fields = _Fields(record.card, 4)
    groups = [_group(record, fields)]
    while (at := fields.next()) is not None and record.card.text(at) not in _WORDS:
        groups.append(_group(record, fields))
    dependent = _after_words(fields).get("UM", [])
    reference, components = record.integer("REFGRID"), _digits(record.card, 3)
    _check_points(record, grids, [reference, *(n for g in groups for n in g.numbers), *(n for n, _ in dependent)])
    return average_rows(grids.table, reference, components, groups, record.integer("EID"), dependent)


def _group(record: Record, fields: _Fields) -> WeightedPoints:
    weight = record.card.real(fields.take())
    components = _digits(record.card, fields.at)
    fields.at += 1
    at = fields.at
    numbers = _numbers(record, fields.until_real())
    if not numbers:
        raise record.card.error("deck.field-value", "this weight has no grid points", index=at,
                                hint="list the grid points after the components")  # fmt: skip
    return WeightedPoints(weight, components, numbers)


def _numbers(record: Record, texts: list[str]) -> list[int]:
    """A list with THRU written out; a number that is named twice stands there twice."""
    named = Counter(read_list(texts, record.where).singles)
    return listed_numbers(record, texts) + [n for n, times in named.items() if times > 1]


def _after_words(fields: _Fields) -> dict[str, Pairs]:
    """What stands after UM; the numbers after ALPHA are checked to be numbers."""
    found: dict[str, Pairs] = {}
    while (at := fields.next()) is not None:
        word = fields.card.text(fields.take())
        if word == "UM":
            found.setdefault("UM", []).extend(_pairs(fields))
        elif word == "ALPHA" or fields.card.is_real(at):
            fields.card.real(fields.take() if word == "ALPHA" else at)
        else:
            raise fields.card.error("deck.field-value", "UM, ALPHA or a real number should stand here", index=at,
                                    hint="a weight has a decimal point: 1.0")  # fmt: skip
    return found


def _pairs(fields: _Fields) -> Pairs:
    """Grid points, each with its components, up to a word or a real number."""
    pairs: Pairs = []
    card = fields.card
    while (at := fields.next()) is not None and card.text(at) not in _WORDS and not card.is_real(at):
        number = card.integer(fields.take())
        pairs.append((number, _digits(card, fields.at)))
        fields.at += 1
    return pairs


def _digits(card: Card, at: int) -> list[int]:
    """Components of a grid point; they must be there (error ``deck.field-value``)."""
    text = card.component(at)
    if text in ("", "0"):
        raise card.error("deck.field-value", "no components are given", index=at,
                         hint="write digits from 1 to 6, as in 123")  # fmt: skip
    return [int(c) for c in text]


def _check_points(record: Record, grids: Grids, numbers: list[int]) -> None:
    for number in numbers:
        grids.row(number, record)
