"""SPC, SPC1, MPC and their unions: every form of the cards, and what is told of those without effect."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, build_structure
from femtune.files.nastran.build import BuiltDeck

DeckOf = Callable[..., Deck]
POINTS = "".join(f"GRID,{n},,{n}.,0.,0.\n" for n in (1, 2, 3, 5, 8)) + "SPOINT,101,102\n"


def held(model: BuiltDeck, number: int) -> set[str]:
    table = model.structure.nodes
    return {str(table.describe(int(d))) for d in model.structure.support_sets[number]}


SUPPORTS = {
    "SPC1,1,3,2,THRU,6\n": {"2Z+", "3Z+", "5Z+"},
    "SPC1,1,3,1,2,8\n": {"1Z+", "2Z+", "8Z+"},
    "SPC1,1,12,5,THRU,5\n": {"5X+", "5Y+"},
    "SPC1,1,3,1,THRU,8,EXCEPT,2\n,5\n": {"1Z+", "3Z+", "8Z+"},
    "SPC1,1,0,101,THRU,200\n": {"101S+", "102S+"},
    "SPC,1,1,12,,3,3\nSPC,1,101\n": {"1X+", "1Y+", "3Z+", "101S+"},
    "SPC1,2,1,1\nSPC1,3,2,1\nSPC1,4,3,1\nSPCADD,1,2,4\n": {"1X+", "1Z+"},
}


@pytest.mark.parametrize("cards", SUPPORTS)
def test_held_dofs(deck_of: DeckOf, cards: str) -> None:
    assert held(build_structure(deck_of(POINTS + cards)), 1) == SUPPORTS[cards]


def test_permanent_constraints_of_the_default_card(deck_of: DeckOf) -> None:
    """A blank PS takes that of GRDSET; a PS of its own stands in its place, and 0 takes it away."""
    text = "GRDSET,,,,,,,345\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.,,12\nGRID,3,,2.,0.,0.,,0\n"
    structure = build_structure(deck_of(text)).structure
    assert [str(structure.nodes.describe(int(d))) for d in structure.permanent] == [
        "1Z+", "1RX+", "1RY+", "2X+", "2Y+",
    ]  # fmt: skip


def test_equations_of_unions_and_blank_coefficients(deck_of: DeckOf) -> None:
    cards = (
        "MPC,4,1,1,1.,2,1,-.5\n,,3,1\nMPC,6,5,2,2.,8,2,1.\nMPC,7,5,3,2.,8,3,1.\nMPCADD,9,4,6\n"
    )  # fmt: skip
    sets = build_structure(deck_of(POINTS + cards)).structure.multipoint_sets
    assert {n: len(rows) for n, rows in sets.items()} == {4: 1, 6: 1, 7: 1, 9: 2}
    # Ai is 0 where it is blank, but for the first
    np.testing.assert_array_equal(sets[4].coefficient, [1.0, -0.5, 0.0])


def test_cards_without_effect_are_told(deck_of: DeckOf) -> None:
    model = build_structure(deck_of(POINTS + "SPCD,1,1,1,.5\nSPCOFF1,3,1,2\nSPC,1,2,3,.1\n"))
    assert [(n.code, n.level) for n in model.notices] == [
        ("deck.ignored-cards", "info"), ("deck.ignored-cards", "warning"), ("deck.inactive-set", "warning"),
        ("deck.enforced-displacement", "warning"),
    ]  # fmt: skip
    assert "degrees of freedom without stiffness are constrained nevertheless" in model.notices[1].what


_SELECTED = "SOL 103\nCEND\nSPC = 4\nBEGIN BULK\n"
REFUSED = {
    _SELECTED + "SPC1,2,1,1\nSPCADD,3,2\nSPCADD,4,3\n": (
        "deck.missing-set",
        "SPCADD 4 refers to set 3, which is another SPCADD",
    ),
    "MPC,2,1,1,1.,2,1,1.\nMPCADD,3,2\nMPCADD,4,3\n": ("deck.missing-set", "set 3, which is another MPCADD"),
    _SELECTED + "SPC1,2,1,1\nSPCADD,4,3\n": ("deck.missing-set", "set 3, which has no cards"),
    "SPC1,1,3,2,THRU\n": ("deck.list", "end of the list"),
    "SPC1,1,3,4\n": ("deck.unknown-grid", "grid point 4"),
    "SPC1,1,,1\n": ("deck.field-value", "no components"),
    "MPC,2,1,1,,2,1,1.\n": ("deck.field-value", "nonzero coefficient"),
    "MPC,2,1,12,1.,2,1,1.\n": ("deck.field-value", "one component"),
}


@pytest.mark.parametrize("cards", REFUSED)
def test_refusals(deck_of: DeckOf, cards: str) -> None:
    code, says = REFUSED[cards]
    with pytest.raises(FemtuneError, match=says) as caught:
        build_structure(deck_of(cards + POINTS))
    assert caught.value.code == code


@pytest.mark.parametrize("cards", [cards for cards in REFUSED if cards.startswith(_SELECTED)])
def test_unions_that_are_not_selected_are_not_read(deck_of: DeckOf, cards: str) -> None:
    model = build_structure(deck_of(cards.removeprefix(_SELECTED) + POINTS))
    assert 4 not in model.structure.support_sets
    assert [n.code for n in model.notices] == ["deck.inactive-set"]
