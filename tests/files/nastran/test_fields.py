"""Fields of cards: small, large, free, tabs, continuations, replication, accessors."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Card, Deck

DeckOf = Callable[..., Deck]
MAT1 = ("1", "2.1+5", "", ".3", "7.85-9")


def _card(deck_of: DeckOf, text: str) -> Card:
    (only,) = deck_of(text).cards
    return only


@pytest.mark.parametrize(
    ("text", "layout"),
    [
        ("MAT1           1   2.1+5              .3  7.85-9\n", "small"),
        ("MAT1    1       2.1+5           .3      7.85-9\r\n", "small"),
        ("mat1\t1\t2.1+5\t\t.3\t7.85-9", "small"),
        ("MAT1,1,2.1+5,,.3,7.85-9 $ steel\n", "free"),
        ("MAT1 , 1 , 2.1+5 , , .3 , 7.85-9 , , ,\n", "free"),
        (
            "MAT1*                  1           2.1+5                              .3\n*                 7.85-9\n",
            "large",
        ),
        ("MAT1*   1               2.1+5                           .3              *M1\n*M1     7.85-9\n", "large"),
        ("MAT1*\t1\t\t2.1+5\t\t\t\t.3\n*\t7.85-9\n", "large"),
        ("MAT1*,1,2.1+5,,.3\n*,7.85-9\n", "free"),
        ("MAT1*,1,2.1+5,,.3,*M\n$ between\n\n*M,7.85-9\n", "free"),
    ],
)
def test_formats_give_the_same_fields(deck_of: DeckOf, text: str, layout: str) -> None:
    card = _card(deck_of, text)
    assert card.name == "MAT1"
    assert card.format == layout
    assert card.fields == MAT1
    assert card.real(1) == 2.1e5


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("PBAR    1       2       3.      4.      5.      6.                              ", "        1.      2.\n"),
        ("PBAR    1       2       3.      4.      5.      6.                      +C1", "+C1     1.      2.\n"),
        ("PBAR    1       2       3.      4.      5.      6.                      KC1", "+C1     1.      2.\n"),
        ("PBAR    1       2       3.      4.      5.      6.                      +", "+       1.      2.\n"),
        ("PBAR    1       2       3.      4.      5.      6.", ",1.,2.\n"),
        ("PBAR,1,2,3.,4.,5.,6.", ",1.,2.\n"),
        ("PBAR,1,2,3.,4.,5.,6.,,,+C1", "+C1,1.,2.\n"),
        ("PBAR,1,2,3.,4.,5.,6.", "+       1.      2.\n"),
        ("PBAR,1,2,3.,4.,5.,6.", "*       1.              2.\n"),
        ("PBAR*,1,2,3.,4.\n*,5.,6.", "+,1.,2.\n"),
        (
            "PBAR*   1               2               3.              4.\n*       5.              6.",
            "        1.      2.\n",
        ),
    ],
)
def test_continuations_of_all_kinds_mix(deck_of: DeckOf, first: str, second: str) -> None:
    card = _card(deck_of, first + "\n$ a comment\n\n" + second)
    assert card.fields == ("1", "2", "3.", "4.", "5.", "6.", "", "", "1.", "2.")
    assert card.where(9).line == card.lines[-1].number == first.count("\n") + 4


def test_small_line_after_half_a_large_line_starts_the_next_eight(deck_of: DeckOf) -> None:
    card = _card(deck_of, "PBAR*   1               2               3.              4.\n        1.      2.\n")
    assert card.fields == ("1", "2", "3.", "4.", "", "", "", "", "1.", "2.")


def test_name_and_number_run_together(deck_of: DeckOf) -> None:
    text = "EIGRL        1030.100000 2000.               0\nPARAM   COUPMASS1\nGRID         999     0.0\n"
    eigrl, param, grid = deck_of(text).cards
    assert eigrl.fields == ("103", "0.100000", "2000.", "", "0")
    assert param.fields == ("COUPMASS", "1")
    assert grid.integer(0) == 999


def test_replication(deck_of: DeckOf) -> None:
    deck = deck_of("GRID,101,17,1.0,10.5,,17,3456\n=,*(1),=,*(0.2),==$\n=(3)\nGRID,1\n")
    assert [card.integer(0) for card in deck.cards] == [101, 102, 103, 104, 105, 1]
    assert [card.real(2) for card in deck.cards[:5]] == pytest.approx([1.0, 1.2, 1.4, 1.6, 1.8])
    assert all(card.fields[3:] == ("10.5", "", "17", "3456") for card in deck.cards[:5])
    assert [card.position for card in deck.cards] == list(range(6))


def test_accessors(deck_of: DeckOf) -> None:
    card = _card(deck_of, "cbar,12,7,1,2,0.,0.,1.,ggg\n,12 3,456,0\n")
    assert card.record == "CBAR 12"
    assert card.integer(0) == 12
    assert card.real(6) == 1.0
    assert card.text(7) == "GGG"
    assert (card.component(8), card.component(9), card.component(10)) == ("123", "456", "0")
    assert (card.real(11, 2.5), card.integer(30, 4), card.real(30, None), card.text(30, "X")) == (2.5, 4, None, "X")
    assert card.is_integer(2)
    assert card.is_real(4)
    assert not card.is_real(2)
    assert card.blank(11)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("+       1.0\n", "deck.continuation"),
        ("PBAR,1,2,,,,,,,+A\n+B,1.\n", "deck.continuation"),
        ("PBAR,1,2,,,,,,,+A\n", "deck.truncated"),
        ("GRID,1,2,3.,4.,5.,6,7,8,+A,10\n", "deck.too-many-fields"),
        ("GRID*,1,2,3.,4.,+,6\n", "deck.too-many-fields"),
        ("this is no card at all\n", "deck.card-name"),
        ("=,*(1)\n", "deck.replication"),
        ("GRID,1,,0.\n=(3)\n", "deck.replication"),
        ("GRID,1,,x.\n=,*(1),,*(1.),==\n", "deck.replication"),
        ("PBAR,1,2\n,1.\n=,*(1),==\n", "deck.replication"),
    ],
)
def test_lines_that_cannot_be_read(deck_of: DeckOf, text: str, code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        deck_of(text)
    assert caught.value.code == code


def test_several_errors_are_shown_together(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError, match="2 problems") as caught:
        deck_of("+,1.\nGRID,1,2,3.,4.,5.,6,7,8,+A,10\n")
    assert "deck.continuation" in str(caught.value)
    assert "deck.too-many-fields" in str(caught.value)


def test_dangling_continuation_and_long_lines_are_noticed(deck_of: DeckOf) -> None:
    long = "GRID           1       0     0.0     0.0     0.0".ljust(82) + "lost\n"
    deck = deck_of("PBAR,1,2,,,,,,,+A\nGRID,1\n" + long)
    assert [notice.code for notice in deck.notices] == ["deck.beyond-column-80", "deck.dangling-continuation"]
