"""Values of a deck that no structure has: negative masses, thicknesses and stiffnesses, and damping in percent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from femtune.errors import Notice, Where
from femtune.fem.fields import FieldRef
from femtune.fem.values import ValueTable
from femtune.files.nastran.building import FieldPlace
from femtune.files.nastran.card import Card
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.field_units import field_nature
from femtune.modal.plausible_damping import doubtful_ratios
from femtune.model.damping import ModalDamping

_NONSTRUCTURAL = ("NSM", "NSM1", "NSML", "NSML1")
"""Cards of non-structural mass, whose values are not in the table of values."""
_OWN_MESSAGE = frozenset({"RHO"})
"""Fields whose negative values have a message of their own."""


def value_notices(
    deck: Deck, table: ValueTable, places: Mapping[FieldRef, FieldPlace], tables: Mapping[int, ModalDamping]
) -> list[Notice]:
    """Notices of values that must be positive and are negative, and of damping that no structure has.

    Parameters
    ----------
    places : where the values are in the deck
    tables : tables of modal damping by number
    """
    return [*_negative(deck, table, places), *_negative_nonstructural(deck), *_overall_loss(deck, table, places),
            *_damping_tables(deck, tables)]  # fmt: skip


def _negative(deck: Deck, table: ValueTable, places: Mapping[FieldRef, FieldPlace]) -> Iterator[Notice]:
    """One notice for each field name of a card, with the first value and the number of the others."""
    groups: dict[tuple[str, str], list[tuple[FieldRef, float]]] = {}
    for i in np.flatnonzero(table.values < 0.0):
        ref = table.refs[int(i)]
        if ref in places and not ref.region and field_nature(ref).positive and ref.name not in _OWN_MESSAGE:
            groups.setdefault((ref.card, ref.name), []).append((ref, float(table.values[i])))
    for group in groups.values():
        ref, value = group[0]
        place = places[ref]
        yield Notice(
            "deck.negative-value", where=deck.cards[place.card].where(place.fields[0]), field=ref, value=value,
            more=_more(len(group)), effect=_effect(ref),
        )  # fmt: skip


def _effect(ref: FieldRef) -> str:
    if "NSM" in ref.name:
        return "this non-structural mass takes mass away"
    letters = field_nature(ref).unit
    if ref.name.startswith("GE") or ref.card in ("PARAM", "PDAMP") or ref.card.startswith("CDAMP") or "s" in letters:
        return "it supplies energy"
    if ref.card.startswith(("CMASS", "PMASS", "CONM")) or letters.startswith("M"):
        return "it takes mass away"
    return "it takes stiffness away"


def _more(count: int) -> str:
    return f" (and {count - 1} more)" if count > 1 else ""


class _NegativeMass(NamedTuple):
    card: Card
    value: float


def _negative_nonstructural(deck: Deck) -> Iterator[Notice]:
    """Negative values of NSM, NSM1, NSML and NSML1."""
    negative = [_NegativeMass(card, v) for name in _NONSTRUCTURAL for card in deck.by_name(name) for v in _masses(card)]
    if negative:
        first = negative[0]
        yield Notice(
            "deck.negative-value", where=first.card.where(), value=first.value, more=_more(len(negative)),
            field=f"the mass of {first.card.record}", effect="this non-structural mass takes mass away",
        )  # fmt: skip


def _masses(card: Card) -> list[float]:
    """The negative values of a card; fields that are no numbers are errors elsewhere."""
    positions: Sequence[int] = (2,) if card.name.endswith("1") else range(3, len(card.fields), 2)
    values = [card.real(at) for at in positions if not card.blank(at) and card.is_real(at)]
    return [value for value in values if value < 0.0]


def _overall_loss(deck: Deck, table: ValueTable, places: Mapping[FieldRef, FieldPlace]) -> Iterator[Notice]:
    """PARAM G: twice the damping ratio that all modes get."""
    ref = FieldRef("PARAM", 0, "G")
    at = table.index(ref)
    if at is not None and table.values[at] > 0.0 and len(doubtful_ratios(0.5 * table.values[at])):
        where = deck.cards[places[ref].card].where() if ref in places else Where(str(deck.path))
        value = float(table.values[at])
        yield Notice(
            "deck.large-loss-factor/overall", where=where, value=value, ratio=50.0 * value, meant=value / 100.0
        )


def _damping_tables(deck: Deck, tables: Mapping[int, ModalDamping]) -> Iterator[Notice]:
    cards = {card.integer(0): card for card in deck.by_name("TABDMP1") if card.is_integer(0)}
    for number, table in tables.items():
        values = np.asarray(table.values, float)
        with np.errstate(divide="ignore"):
            ratios = {"CRIT": values, "G": 0.5 * values, "Q": 0.5 / values}[table.unit]
        doubtful = doubtful_ratios(ratios)
        if len(doubtful):
            worst = max(doubtful, key=lambda i: abs(ratios[i]))
            where = cards[number].where() if number in cards else Where(str(deck.path))
            yield Notice(
                "deck.damping-doubtful", where=where, number=number, value=float(values[worst]), unit=table.unit,
                ratio=100.0 * float(ratios[worst]), count=len(doubtful), points=len(values),
            )  # fmt: skip
