"""Named sets of degrees of freedom: read, counted, told of, and without effect on the model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, build_structure, read_deck
from femtune.files.nastran.build import BuiltDeck

DeckOf = Callable[..., Deck]
POINTS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,2.,0.,0.\nGRID,5,,3.,1.,0.\nSPOINT,101,102\n"


def names(model: BuiltDeck) -> dict[str, set[str]]:
    table = model.structure.nodes
    return {n: {str(table.describe(int(d))) for d in dofs} for n, dofs in model.structure.dof_sets.items()}


CASES = {
    "ASET,1,12,3,6,5,4,101,0\nASET,2,1\n": {"ASET": {"1X+", "1Y+", "3RZ+", "5RX+", "101S+", "2X+"}},
    "ASET1,3,1,THRU,5\n": {"ASET": {"1Z+", "2Z+", "3Z+", "5Z+"}},
    "OMIT,1,12\nOMIT1,45,2,3\n": {"OMIT": {"1X+", "1Y+", "2RX+", "2RY+", "3RX+", "3RY+"}},
    "QSET,101,0,102,0\n": {"QSET": {"101S+", "102S+"}},
    "QSET1,0,101,THRU,102\n": {"QSET": {"101S+", "102S+"}},
    "QSET1,,101,102\n": {"QSET": {"101S+", "102S+"}},
    "BSET,1,1\nBNDFIX,2,2\nBSET1,3,3\nBNDFIX1,4,5\n": {"BSET": {"1X+", "2Y+", "3Z+", "5RX+"}},
    "CSET,1,1\nBNDFREE,2,2\nCSET1,3,3\nBNDFRE1,4,5\n": {"CSET": {"1X+", "2Y+", "3Z+", "5RX+"}},
    "SUPORT,1,123,,,3,23\n,5,3\n": {"SUPORT": {"1X+", "1Y+", "1Z+", "3Y+", "3Z+", "5Z+"}},
    "SUPORT1,7,1,12,3,2\nSUPORT1,8,1,1\n": {"SUPORT1 7": {"1X+", "1Y+", "3Y+"}, "SUPORT1 8": {"1X+"}},
    "USET,U1,1,12,3,3,2,1\nUSET1,U2,45,1,THRU,2\n": {
        "USET U1": {"1X+", "1Y+", "3Z+", "2X+"},
        "USET U2": {"1RX+", "1RY+", "2RX+", "2RY+"},
    },
    "USET,O,1,1\nOMIT,2,1\n": {"OMIT": {"1X+", "2X+"}},
}


@pytest.mark.parametrize("cards", CASES)
def test_sets_and_their_dofs(deck_of: DeckOf, cards: str) -> None:
    assert names(build_structure(deck_of(POINTS + cards))) == CASES[cards]


def test_notices_say_what_the_sets_do(deck_of: DeckOf) -> None:
    model = build_structure(deck_of(POINTS + "SUPORT,1,123456\nASET1,3,1,2\nUSET,U3,1,1\n"))
    assert {(n.code, n.level, n.what.partition(":")[0]) for n in model.notices} == {
        ("deck.dof-set", "info", "SUPORT names 6 DOFs"),
        ("deck.dof-set", "warning", "ASET names 2 DOFs"),
        ("deck.dof-set", "info", "USET U3 names 1 DOF"),
    }
    assert not {c.name for c in model.cards if c.use != "read"}


def test_sets_hold_nothing(deck_of: DeckOf) -> None:
    frame = POINTS + "CELAS2,9,1.+3,1,1,2,1\nCMASS2,8,2.,1,1\nCMASS2,7,2.,2,1\n"
    cards = "SUPORT,1,1\nASET,2,1\nUSET,U1,1,1\nOMIT1,23456,1,2,3,5\n"
    plain, named = (build_structure(deck_of(frame + more)).structure for more in ("", cards))
    assert named.support_sets == plain.support_sets == {}
    np.testing.assert_array_equal(named.permanent, plain.permanent)
    assert len(named.rigid) == 0


def test_omitted_and_kept_is_told(deck_of: DeckOf) -> None:
    model = build_structure(deck_of(POINTS + "OMIT1,12,1,2\nASET,2,23\n"))
    (notice,) = [n for n in model.notices if n.code == "deck.dof-set-overlap"]
    assert notice.level == "warning"
    assert "component 2 of grid point 2 " in notice.what


REFUSED = {
    "ASET,1,12,9,1\n": ("deck.unknown-grid", "grid point 9"),
    "ASET1,12,1,9\n": ("deck.unknown-grid", "grid point 9"),
    "ASET,1\n": ("deck.field-value", "no components"),
    "ASET,1,17\n": ("deck.not-a-component", "list of components"),
    "ASET,,12\n": ("deck.field-value", "components have no grid point"),
    "SUPORT1,,1,1\n": ("deck.blank-field", "integer"),
    "USET,SB,1,1\n": ("deck.field-value", "the set 'SB'"),
    "USET1,U7,1,1\n": ("deck.field-value", "the set 'U7'"),
    "QSET,101,3\n": ("deck.unknown-grid", "grid point 101"),
}


@pytest.mark.parametrize("card", REFUSED)
def test_refusals(deck_of: DeckOf, card: str) -> None:
    code, says = REFUSED[card]
    with pytest.raises(FemtuneError, match=says) as caught:
        build_structure(deck_of(POINTS + card))
    assert caught.value.code == code
    assert "deck.bdf:6" in str(caught.value)


def test_decks_of_others(nastran_decks: Path) -> None:
    """A set of 3 DOFs in each of two decks, and the kept end of a cantilever with three generalised coordinates."""
    for name, expected in (
        ("beam_modes.dat", {"USET U2": 3}),
        ("satk.dat", {"USET U2": 3}),
        ("cantilever_bar_reduction/no_super/dynamicReduction.dat", {"ASET": 2, "QSET": 3}),
    ):
        model = build_structure(read_deck(nastran_decks / name), allow_missing=True)
        assert {n: len(d) for n, d in model.structure.dof_sets.items()} == expected
