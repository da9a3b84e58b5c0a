"""Whole columns of many cards at once, for cards of which a large deck has a hundred thousand.

Only simple spellings are converted here: integers of digits, and reals, those without an exponent all at once. All
other fields are marked, so that their cards are read one by one, with a message for each error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.files.nastran.card import Card
from femtune.files.nastran.lines import parse_real

Bytes = NDArray[np.uint8]
Mask = NDArray[np.bool_]

_SMALL_WIDTH = 8
_LARGE_WIDTH = 16
"""Characters of a field in small and in large field format."""
_DATA_START = 8
_DATA_END = 72
"""Columns before the first data field, and up to the end of the last one, of a line in small field."""
_FIELDS_PER_LINE = 8
"""Data fields of a line in small field."""
FEWEST_CARDS = 100
"""Number of cards below which reading them one by one is as fast as setting up arrays."""
_UNREADABLE = "?"
"""Fills a field that is too long, so that it is not read as a number."""
_BLANK = ord(" ")
_POINT = ord(".")
_ZERO = ord("0")


@dataclass(frozen=True, eq=False)
class Columns:
    """Fields of n cards: `text` is (n, fields, 8) characters, or 16 if some field is longer."""

    text: Bytes

    def blank(self, start: int, stop: int | None = None) -> Mask:
        """(n,) whether field `start`, or all fields from it up to `stop`, are blank."""
        part = self.text[:, start : start + 1 if stop is None else stop]
        return np.asarray((part == _BLANK).all(axis=(1, 2)))

    def integers(self, index: int) -> tuple[NDArray[np.int64], Mask]:
        """(n,) integers of a field, and True where the spelling is simple; 0 elsewhere."""
        field = self._field(index)
        if field is None:
            return np.zeros(len(self.text), np.int64), np.zeros(len(self.text), bool)
        digit = (field >= _ZERO) & (field <= _ZERO + 9)
        value = np.zeros(len(field), np.int64)
        for column in range(field.shape[1]):
            value = np.where(digit[:, column], 10 * value + field[:, column] - _ZERO, value)
        plain = digit.any(axis=1) & _together(field != _BLANK, digit)
        return np.where(plain, value, 0), plain

    def reals(self, index: int) -> tuple[NDArray[np.float64], Mask]:
        """(n,) reals of a field, and True where the spelling is simple; 0 for blank fields and elsewhere."""
        field = self._field(index)
        if field is None:
            return np.zeros(len(self.text)), np.ones(len(self.text), bool)
        digit = (field >= _ZERO) & (field <= _ZERO + 9)
        point, given = field == _POINT, field != _BLANK
        first = given & ~np.pad(given, ((0, 0), (1, 0)))[:, :-1]
        sign = first & ((field == ord("-")) | (field == ord("+")))
        plain = digit.any(axis=1) & (point.sum(axis=1) == 1) & _together(given, digit | point | sign)
        out = np.zeros(len(field))
        out[plain] = _texts(field[plain]).astype(float)
        other = np.flatnonzero(given.any(axis=1) & ~plain)
        for i, text in zip(other.tolist(), _texts(field[other]).tolist()):
            value = parse_real(text.decode("latin-1").strip())
            out[i], plain[i] = 0.0 if value is None else value, value is not None
        return out, plain | ~given.any(axis=1)

    def _field(self, index: int) -> Bytes | None:
        return self.text[:, index] if index < self.text.shape[1] else None


def _texts(field: Bytes) -> NDArray[np.bytes_]:
    return np.ascontiguousarray(field).view(f"S{field.shape[1]}")[:, 0]


def _together(given: Mask, allowed: Mask) -> Mask:
    """(n,) True if all given characters are allowed and have no blank between them."""
    starts = given[:, 0].astype(int) + (given[:, 1:] & ~given[:, :-1]).sum(axis=1)
    return np.asarray((starts <= 1) & (~given | allowed).all(axis=1))


def columns_of(cards: Sequence[Card]) -> Columns | None:
    """Columns of cards of one name; None if there are few."""
    if len(cards) < FEWEST_CARDS:
        return None
    most = max(_lines(card) for card in cards)
    wide = np.array([not card.plain and any(len(field) > _SMALL_WIDTH for field in card.fields) for card in cards])
    small = _text(
        "".join([_data(card, most) for card, large in zip(cards, wide.tolist()) if not large]), most, _SMALL_WIDTH
    )
    if not wide.any():
        return Columns(small)
    text = np.full((len(cards), most * _FIELDS_PER_LINE, _LARGE_WIDTH), _BLANK, np.uint8)
    text[~wide, :, :_SMALL_WIDTH] = small
    long = [_fields(card, most, _LARGE_WIDTH) for card, large in zip(cards, wide.tolist()) if large]
    text[wide] = _text("".join(long), most, _LARGE_WIDTH)
    return Columns(text)


def _text(text: str, lines: int, width: int) -> Bytes:
    return np.frombuffer(text.encode("latin-1"), np.uint8).reshape(-1, lines * _FIELDS_PER_LINE, width)


def _lines(card: Card) -> int:
    return len(card.lines) if card.plain else max(-(-len(card.fields) // _FIELDS_PER_LINE), 1)


def _data(card: Card, lines: int) -> str:
    """Columns 9 to 72 of all lines of a card, filled up with blank lines."""
    if not card.plain:
        return _fields(card, lines, _SMALL_WIDTH)
    width = _DATA_END - _DATA_START
    data = [line[2][_DATA_START:_DATA_END].rstrip("\r\n").ljust(width) for line in card.lines]
    return "".join(data).ljust(lines * width)


def _fields(card: Card, lines: int, width: int) -> str:
    """All fields of a card at a given width, filled up with blank lines."""
    fields = [field.ljust(width) if len(field) <= width else width * _UNREADABLE for field in card.fields]
    return "".join(fields).ljust(lines * _FIELDS_PER_LINE * width)


def plain_numbers(cards: Sequence[Card]) -> list[int] | None:
    """The numbers in the first fields of cards; None if some spelling is not simple or a number is repeated."""
    columns = columns_of(cards)
    if columns is None:
        return None
    numbers, plain = columns.integers(0)
    return numbers.tolist() if plain.all() and len(np.unique(numbers)) == len(numbers) else None
