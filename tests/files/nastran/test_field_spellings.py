"""Decks as they come: absent DMAP files, free text, blanks and commas, fields of the card above, nested INCLUDEs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import build_structure, edit_fields, read_deck, write_deck
from femtune.files.nastran.deck import Deck

DeckOf = Callable[..., Deck]
_CONTROL = "SOL 103\ninclude '/nowhere/alter.v9'\nCEND\nSPC = 1\nBEGIN BULK\nGRID,1,,0.,0.,0.\nENDDATA\n"


def test_an_absent_file_of_executive_control_is_a_notice(deck_of: DeckOf) -> None:
    deck = deck_of(_CONTROL)
    assert [(n.code, n.where and n.where.line) for n in deck.notices] == [("deck.missing-include", 2)]
    assert deck.executive.solution_number == 103
    assert [card.name for card in deck.cards] == ["GRID"]


@pytest.mark.parametrize("text", ["INCLUDE 'a.inc'\nGRID,1\n", _CONTROL.replace("GRID", "INCLUDE 'a.inc'\nGRID")])
def test_an_absent_file_of_the_model_is_an_error(deck_of: DeckOf, text: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        deck_of(text)
    assert caught.value.code == "deck.missing-include"


def test_equations_are_free_text(deck_of: DeckOf) -> None:
    deck = deck_of(
        "DEQATN  5       F(A,B,C)=SQRT(A**2,B)+MAX(A,B,C,1.,2.,3.,4.,5.,6.,7.,8.)\n"
        "+       ; G=A,B\n        ,C\nGRID,1,,0.,0.,0.\nDEQATN,7,H(X)=X\nGRID    2\n"
    )
    assert [(card.name, card.text(0)) for card in deck.cards] == [
        ("DEQATN", "5"), ("GRID", "1"), ("DEQATN", "7"), ("GRID", "2")
    ]  # fmt: skip
    assert len(deck.cards[0].lines) == 3


MIXED = "PELAS   1,  500., .01\n"


def test_a_blank_may_stand_after_the_name(deck_of: DeckOf) -> None:
    assert deck_of(MIXED + "GRID,5\n").cards[0].fields == ("1", "500.", ".01")
    large = deck_of("PELAS*  1, 500.\n").cards[0]
    assert (large.fields, large.format) == (("1", "500."), "free")


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({(0, 1): 625.0}, "PELAS   1,  625.0, .01\n"),
        ({(0, 2): 0.02}, "PELAS   1,  500., .02\n"),
        ({(0, 3): 2.0}, "PELAS   1,  500., .01,2.0\n"),
        ({(0, 0): 9}, "PELAS   9,  500., .01\n"),
    ],
)
def test_it_is_written_in_place(deck_of: DeckOf, tmp_path: Path, values: dict, expected: str) -> None:
    written = write_deck(edit_fields(deck_of(MIXED + "GRID,5\n"), values), tmp_path / "run").main
    assert written.read_text().replace("0.02", ".02") == expected + "GRID,5\n"


def test_fields_of_the_card_above(deck_of: DeckOf) -> None:
    deck = deck_of("MAT1,301,2.+11,,.3,7850.,1.-5\nMAT1,302,==\nMAT1,303,7.+10,=,=,2700.\n")
    assert [card.fields for card in deck.cards[1:]] == [
        ("302", "2.+11", "", ".3", "7850.", "1.-5"), ("303", "7.+10", "", ".3", "2700.")
    ]  # fmt: skip
    assert build_structure(deck_of("MAT1,301,2.+11,,.3,7850.\nMAT1,302,==\nGRID,1\n")).structure is not None


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("MAT1           1  2,1+11              ,3   7850.\n", "'2,1+11'"),
        ("GRID           1             0,5      0.      0.\n", "'0,5'"),
        ("MAT1*                  1          2,1E11\n", "'2,1E11'"),
    ],
)
def test_decimal_commas_are_told(deck_of: DeckOf, text: str, shown: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        deck_of(text)
    assert caught.value.code == "deck.decimal-comma"
    assert shown in str(caught.value)


@pytest.mark.slow
def test_includes_that_double_end(tmp_path: Path) -> None:
    for level in range(30):
        (tmp_path / f"{level}.inc").write_text(f"INCLUDE '{level + 1}.inc'\n" * 2)
    (tmp_path / "30.inc").write_text("$\n")
    with pytest.raises(FemtuneError) as caught:
        read_deck(tmp_path / "0.inc")
    assert caught.value.code == "deck.too-many-includes"


@pytest.mark.slow
def test_deep_includes_are_told(tmp_path: Path) -> None:
    for level in range(3000):
        (tmp_path / f"{level}.inc").write_text(f"INCLUDE '{level + 1}.inc'\n")
    (tmp_path / "3000.inc").write_text("GRID,1\n")
    with pytest.raises(FemtuneError) as caught:
        read_deck(tmp_path / "0.inc")
    assert caught.value.code == "deck.too-many-includes"
    assert read_deck(tmp_path / "2950.inc").cards[0].name == "GRID"
