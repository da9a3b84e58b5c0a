"""Sets of cards that case control selects: one rule for supports, equations, eigenvalue methods and damping tables.

A set acts only if case control selects it. Sets that no subcase selects get a notice of their kind: a warning where the
structure changes and nothing of the kind is selected, otherwise a remark, because many decks keep sets for other runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from femtune.errors import Notice
from femtune.files.nastran.card import Card
from femtune.files.nastran.case_control import CaseControl
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.lists import read_list

_MOST_SHOWN = 10
"""Numbers of sets that a notice lists."""


@dataclass(frozen=True)
class _Kind:
    """A command of case control, the cards of its sets, and the card that unites sets."""

    command: str
    cards: tuple[str, ...]
    union: str = ""
    changes_model: bool = False


_KINDS = (
    _Kind("SPC", ("SPC", "SPC1"), "SPCADD", changes_model=True),
    _Kind("MPC", ("MPC",), "MPCADD", changes_model=True),
    _Kind("METHOD", ("EIGR", "EIGRL")),
    _Kind("SDAMPING", ("TABDMP1",)),
)


def unselected_notices(deck: Deck) -> list[Notice]:
    """A notice for each kind of sets that has some that no subcase selects."""
    return [notice for kind in _KINDS for notice in _of_kind(deck, kind)]


def selected_numbers(case: CaseControl, command: str) -> set[int]:
    """Numbers of the sets that any subcase selects."""
    return set(case.selected.get(command, ()))


def _of_kind(deck: Deck, kind: _Kind) -> Iterator[Notice]:
    first: dict[int, Card] = {}
    for name in (*kind.cards, *filter(None, [kind.union])):
        for card in deck.by_name(name):
            if card.is_integer(0):
                first.setdefault(card.integer(0), card)
    # the subcases of other parts select nothing here
    case = deck.case_control
    selected_id = {"SPC": case.spc, "MPC": case.mpc, "METHOD": case.method, "SDAMPING": case.damping}[kind.command]
    selected = set() if deck.section else selected_numbers(case, kind.command)
    selected |= set() if selected_id is None else {selected_id}
    acting = selected | {n for card in deck.by_name(kind.union) if _number(card) in selected for n in _members(card)}
    # parts of a union are named by it alone
    parts = {n for card in deck.by_name(kind.union) if _number(card) not in acting for n in _members(card)}
    left = sorted(set(first) - acting - parts)
    if not left:
        return
    shown = ", ".join(map(str, left[:_MOST_SHOWN])) + (", …" if len(left) > _MOST_SHOWN else "")
    none_acts = kind.changes_model and not acting & set(first)
    yield Notice(
        "deck.inactive-set/none" if none_acts else "deck.inactive-set/some",
        where=first[left[0]].where(),
        level="warning" if none_acts else "info",
        command=kind.command,
        sets="set" if len(left) == 1 else "sets",
        numbers=shown,
        has="has" if len(left) == 1 else "have",
        is_are="is" if len(left) == 1 else "are",
    )


def _number(card: Card) -> int:
    return card.integer(0) if card.is_integer(0) else 0


def _members(card: Card) -> set[int]:
    texts = [text for text in card.fields[1:] if text]
    return set(read_list(texts, card.where()).singles) if all(t.isdecimal() for t in texts) else set()
