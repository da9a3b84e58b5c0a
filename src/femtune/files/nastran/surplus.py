"""Filled fields that a card does not have: beyond its last field, between its fields, or in field 10 of a line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from femtune.errors import Notice, Where
from femtune.files.nastran.card import Card
from femtune.files.nastran.catalogue import CATALOGUE, CardKind
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.lines import parse_number, split_line
from femtune.files.nastran.sections import SHAPES

_MOST_SHOWN = 5
"""Number of cards of one name, and of fields of a card, that are shown; more have the same cause."""
_FIELDS_PER_LINE = 8
_FIELD_WIDTH = 8
_DATA_START = 8
_DATA_END = 72
"""Columns before the first data field and before field 10 of a line in small field."""


def surplus_fields(deck: Deck) -> list[Notice]:
    """A warning for each card with such fields; of many cards of one name, the first few and the number of others."""
    notices = []
    for name, cards in deck.names.items():
        kind = CATALOGUE.get(name)
        if kind is None:
            continue
        surplus = list(_of_cards(kind, cards))
        notices += [surplus_notice(card, indices) for card, indices in surplus[:_MOST_SHOWN]]
        if len(surplus) > _MOST_SHOWN:
            rest = len(surplus) - _MOST_SHOWN
            notices.append(
                Notice("deck.surplus-field/more", where=surplus[_MOST_SHOWN][0].where(), rest=rest, name=name)
            )
        notices += _of_tails(cards)
    return notices


def _of_cards(kind: CardKind, cards: Sequence[Card]) -> Iterator[tuple[Card, list[int]]]:
    blanks = kind.blanks
    for card in cards:
        length = _length(kind, card)
        filled = [i for i in _candidates(kind, card, length, blanks) if _is_filled(card, i)]
        if filled:
            yield card, filled


def _length(kind: CardKind, card: Card) -> int | None:
    if kind.name != "PBARL":
        return kind.length
    shape = SHAPES.get(card.text(3))
    # the dimensions and NSM are on the continuations
    return None if shape is None else _FIELDS_PER_LINE + len(shape.dimensions) + 1


def _candidates(kind: CardKind, card: Card, length: int | None, blanks: tuple[int, ...]) -> Iterable[int]:
    """Positions that must be blank."""
    count = _FIELDS_PER_LINE * len(card.lines) if card.plain else len(card.fields)
    if kind.name == "MPC":
        # terms are in pairs; the last field of a line and the first of the next are blank
        return [i for i in range(7, count) if i % _FIELDS_PER_LINE in (0, 7)]
    beyond = () if length is None else range(length, count)
    return [*(i for i in blanks if i < count), *beyond] if blanks else beyond


def _is_filled(card: Card, index: int) -> bool:
    if not card.plain:
        return not card.blank(index)
    # most cards of a large deck are never split
    line, slot = divmod(index, _FIELDS_PER_LINE)
    start = _DATA_START + _FIELD_WIDTH * slot
    return not (text := card.lines[line].text[start : start + _FIELD_WIDTH]).isspace() and bool(text)


def surplus_notice(card: Card, indices: Sequence[int]) -> Notice:
    """A warning of filled fields that a card does not have."""
    shown = ", ".join(f"{card.field_name(i)} = '{card.text(i)}'" for i in indices[:_MOST_SHOWN])
    more = f" and {len(indices) - _MOST_SHOWN} more" if len(indices) > _MOST_SHOWN else ""
    return Notice("deck.surplus-field", where=card.where(indices[0]), card=card.record, fields=shown + more)


def _of_tails(cards: Sequence[Card]) -> Iterator[Notice]:
    """Numbers in field 10, which names continuations: with a decimal point, or at the end of a free-field card."""
    for card in cards:
        for line in () if card.plain or card.replicated else card.lines:
            if len(line.text) <= _DATA_END and "," not in line.text and "\t" not in line.text:
                continue
            tail = split_line(line, line.body).tail
            number = not tail.startswith("+") and parse_number(tail) is not None
            if number and ("." in tail or ("," in line.text and line is card.lines[-1])):
                where = Where(line.file, line.number, card.record)
                yield Notice("deck.surplus-field", where=where, card=card.record, fields=f"field 10 = '{tail}'")
