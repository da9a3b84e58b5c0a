"""Continuations are found by their name, wherever they stand, as in Nastran."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.edit import edit_fields

DeckOf = Callable[..., Deck]

FIRST = "PBAR    1       2       3.      4.      5.      6.                      "
BAR = ("1", "2", "3.", "4.", "5.", "6.", "", "", "1.", "2.")

PLACES = {
    "after another card": FIRST + "+C1\nPROD,7,2,1.\n+C1     1.      2.\n",
    "before its card": "+C1     1.      2.\n" + FIRST + "+C1\nPROD,7,2,1.\n",
    "in free field": FIRST + "+C1\nPROD,7,2,1.\n+C1,1.,2.\n",
    "first character of field 10": FIRST + "XC1\nPROD,7,2,1.\n+C1     1.      2.\n",
    "large field": "PBAR*   1               2               3.              4.              *A\nPROD,7,2,1.\n"
    "*A      5.              6.                                              *B\nGRID,4\n*B,1.,2.\n",
    "below the same name of another card": FIRST + "+C1\nPROD,7,2,1.,,,,,,+C2\n+C2\n+C1     1.      2.\n",
}


@pytest.mark.parametrize("name", PLACES)
def test_a_continuation_is_found_by_its_name(deck_of: DeckOf, name: str) -> None:
    deck = deck_of(PLACES[name])
    (card,) = deck.by_name("PBAR")
    assert card.fields == BAR
    assert deck.by_name("PROD")[0].fields == ("7", "2", "1.")
    assert [c.position for c in deck.cards] == list(range(len(deck.cards)))
    assert [n.code for n in deck.notices] == []


def test_a_chain_out_of_order(deck_of: DeckOf) -> None:
    text = "+B,9.,10.\n,17.\nPBAR,1,2,,,,,,,+A\nGRID,4\n+A,1.,2.,,,,,,,+B\nGRID,5\n"
    (card,) = deck_of(text).by_name("PBAR")
    assert (card.text(8), card.text(16), card.text(24)) == ("1.", "9.", "17.")
    assert [line.number for line in card.lines] == [3, 5, 1, 2]
    assert [card.where(at).line for at in (0, 8, 16, 24)] == [3, 5, 1, 2]


def test_the_same_name_again_belongs_to_the_card_above(deck_of: DeckOf) -> None:
    one, two = deck_of("PBAR,1,2,,,,,,,+A\n+A,1.\nPBAR,2,2,,,,,,,+A\n+A,2.\n").cards
    assert (one.text(8), two.text(8)) == ("1.", "2.")


def test_a_field_of_such_a_continuation_is_edited_in_its_line(deck_of: DeckOf) -> None:
    deck = deck_of(PLACES["after another card"])
    edited = edit_fields(deck, {(0, 9): 2.5})
    assert list(edited.replacements.values()) == ["+C1     1.      2.5\n"]


WRONG = {
    "of no card": ("PBAR,1,2\n+A,1.\n", 2, "no line has the continuation 'A' in field 10; the card above it is PBAR 1"),
    "in place of another": ("PBAR,1,2,,,,,,,+A\n+B,1.\nGRID,1\n", 2, "no line has the continuation 'B'"),
    "first of all": ("+A,1.\nGRID,1\n", 1, "no card stands above it"),
    "twice": ("PBAR,1,2,,,,,,,+A\nGRID,1\n+A,1.\nGRID,2\n+A,1.\n", 5, "two continuations 'A'"),
    "of two cards": ("PBAR,1,2,,,,,,,+A\nPBAR,2,2,,,,,,,+A\nGRID,1\n+A,1.\n", 4, "in field 10 of several lines"),
    "in a circle": ("GRID,1\n+A,1.,,,,,,,,+B\nGRID,2\n+B,1.,,,,,,,,+A\n", 2, "no line has the continuation 'A'"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_continuation_without_its_card_is_an_error(deck_of: DeckOf, name: str) -> None:
    text, line, what = WRONG[name]
    with pytest.raises(FemtuneError) as caught:
        deck_of(text)
    error = caught.value
    assert error.code == "deck.continuation"
    assert what in error.what
    assert error.where is not None
    assert error.where.line == line


def test_a_replicated_card_may_not_have_a_continuation_elsewhere(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError) as caught:
        deck_of("PBAR,1,2,,,,,,,+A\n=,*(1),==\nGRID,1\n+A,1.\n")
    assert caught.value.code == "deck.replication"
