"""Filled fields that a card does not have, and numbers that must be positive."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from femtune.errors import FemtuneErrors
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.surplus import surplus_fields

DeckOf = Callable[..., Deck]

SURPLUS = {
    "GRID,1,,0.,0.,0.\n+,7.\n": (2, "GRID 1", "field 2 of continuation 1 = '7.'"),
    "PBAR,1,1,.01,1.-6,1.-6,1.-6,,5.\n": (1, "PBAR 1", "field 9 = '5.'"),
    "PBAR           1       1     .01    1.-6    1.-6    1.-6              5.\n": (1, "PBAR 1", "field 9 = '5.'"),
    "PBAR,1,1,.01,1.-6\n,,,,,,,,\n,1.,1.,,7.\n": (3, "PBAR 1", "field 5 of continuation 2 = '7.'"),
    "CONM2,7,2,,3.\n,1.,,1.,,,1.,8.\n": (2, "CONM2 7", "field 8 of continuation 1 = '8.'"),
    "CONM2          7       2              3.\n+             1.              1.                      1.      8.\n":
        (2, "CONM2 7", "field 8 of continuation 1 = '8.'"),
    "MAT1    1       2.1+11          .3      7850.                           1.5\n": (1, "MAT1 1", "field 10 = '1.5'"),
    "MPC,1,1,1,1.,2,1,-1.,3\n,,3,1,.5\n": (1, "MPC 1", "field 9 = '3'"),
    "MPC,1,1,1,1.,2,1,-1.\n,3,2,1,.5\n": (2, "MPC 1", "field 2 of continuation 1 = '3'"),
    "PBARL,5,1,,BAR\n,1.,2.,0.,5.\n": (2, "PBARL 5", "field 5 of continuation 1 = '5.'"),
    "CELAS1,1,2,3,1,4,1,9\n": (1, "CELAS1 1", "field 8 = '9'"),
    "CQUAD4,1,1,1,2,3,4,0.,0.\n,1.\n": (2, "CQUAD4 1", "field 2 of continuation 1 = '1.'"),
}  # fmt: skip


@pytest.mark.parametrize("text", SURPLUS)
def test_fields_that_a_card_does_not_have_are_warned_of(deck_of: DeckOf, text: str) -> None:
    line, card, fields = SURPLUS[text]
    (notice,) = surplus_fields(deck_of(text))
    assert (notice.code, notice.level) == ("deck.surplus-field", "warning")
    assert notice.what.startswith(f"{card} has values ")
    assert notice.what.endswith(f": {fields}")
    assert notice.where is not None
    assert notice.where.line == line


@pytest.mark.parametrize(
    "text",
    ["MAT1,1,2.1+11,,.3,7850.,1.-5,20.,.01\n,2.+8,2.+8,2.+8,4\n", "SPC1,1,123,1,2,3,4,5,6\n,7,8,9\n",
     "EIGR,1,MGIV,0.,100.,5,5,,1.-4\n,MAX\n", "PBAR,1,1,.01,1.-6,1.-6,1.-6\n,1.,1.,1.,1.,1.,1.,1.,1.\n,.8,.8,0.\n",
     "PELAS,1,2.,,,2,3.\n", "PARAM,GRDPNT,0\n", "CORD2R,1,0,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n",
     "PSHELL,1,1,.1,1,,1,,0.\n,1.,2.,1\n",
     "CHEXA,1,1,1,2,3,4,5,6\n,7,8,9,10,11,12,13,14\n,15,16,17,18,19,20\n", "FORCE,1,2,3,4.,5.,6.,7.,8\n,9\n",
     "MPC,1,1,1,1.,2,1,-1.\n,,3,1,.5\n", "PBARL,5,1,,BAR\n,1.,2.,5.\n",
     "GRID           1              0.      0.      0.                        00000010\n"],
)  # fmt: skip
def test_complete_cards_are_not_warned_of(deck_of: DeckOf, text: str) -> None:
    assert surplus_fields(deck_of(text)) == []


def test_many_such_cards_are_counted(deck_of: DeckOf) -> None:
    notices = surplus_fields(deck_of("".join(f"CROD,{i},1,1,2,5\n" for i in range(1, 13))))
    assert len(notices) == 6
    assert notices[-1].what.startswith("7 more CROD cards ")


BAR = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nPBAR,1,1,.01,1.-6,1.-6,1.-6\nMAT1,1,2.1+11,,.3,7850.\n"


@pytest.mark.parametrize(
    ("card", "what"),
    [("CBAR,-3,1,1,2,0.,1.,0.\n", "an element"),
     ("CBAR,0,1,1,2,0.,1.,0.\n", "an element"),
     ("RBE2,0,1,123,2\n", "an element"),
     ("CONM2,-1,1,,2.\n", "an element"),
     ("MAT1,-2,2.1+11,,.3\n", "(material)"),
     ("PBAR,0,1,.01\n", "(property)"),
     ("CORD2R,0,0,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n", "(coordinate system)")],
)  # fmt: skip
def test_numbers_that_are_not_positive(deck_of: DeckOf, card: str, what: str) -> None:
    with pytest.raises(Exception) as caught:
        build_structure(deck_of(BAR + card))
    (error,) = caught.value.errors if isinstance(caught.value, FemtuneErrors) else [caught.value]
    assert error.code == "deck.field-value"
    assert f"{what} must be positive" in error.what


def test_many_elements_with_one_of_number_zero(deck_of: DeckOf) -> None:
    text = BAR + "".join(f"CBAR    {i:8d}       1       1       2      0.      1.      0.\n" for i in range(150))
    with pytest.raises(Exception, match="an element must be positive"):
        build_structure(deck_of(text))
