"""Elements of different groups may have the same number; MAT1 with a ratio that nothing needs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.nastran import build_structure
from femtune.files.nastran.deck import Deck

from .solving import frequencies

DeckOf = Callable[..., Deck]
BASE = """GRID,1,,0.,0.,0.,,123456
GRID,2,,1.,0.,0.
GRID,3,,1.5,0.,0.
MAT1,1,2.1+11,,.3,7850.
PBAR,3,1,1.-3,1.-6,2.-6,2.-6
CBAR,7,3,1,2,0.,1.,0.
"""
SHARED = "CONM2,{0},3,,4.\nRBE2,{1},2,123456,3\nCDAMP2,{2},5.,3,1\nCVISC,{3},9,1,2\nPVISC,9,2.\n"


def test_shared_numbers_change_nothing(deck_of: DeckOf) -> None:
    shared = build_structure(deck_of(BASE + SHARED.format(7, 7, 7, 8)))
    apart = build_structure(deck_of(BASE + SHARED.format(71, 72, 73, 74)))
    np.testing.assert_allclose(frequencies(shared.structure), frequencies(apart.structure), rtol=1e-12)
    assert [n.facts["other"] for n in shared.notices if n.code == "deck.shared-number"] == ["CDAMP2", "CONM2", "RBE2"]
    assert [n for n in apart.notices if n.code == "deck.shared-number"] == []
    assert shared.structure.element_kinds == {7: "CBAR", 8: "CVISC"}
    assert FieldRef("CONM2", 7, "M") in shared.fields


@pytest.mark.parametrize(
    "cards", ["CONM2,9,3,,4.\nCMASS2,9,4.,3,1\n", "CVISC,9,9,1,2\nPVISC,9,2.\nCDAMP2,9,5.,3,1\n", "CROD,7,3,1,2\n"]
)
def test_numbers_are_unique_within_a_group(deck_of: DeckOf, cards: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(BASE + cards))
    assert "deck.duplicate-id" in str(caught.value)


def test_a_ratio_that_bars_do_not_need(deck_of: DeckOf) -> None:
    odd = BASE.replace("2.1+11,,.3", "2.1+11,8.+10,7.5")
    blank = BASE.replace("2.1+11,,.3", "2.1+11,8.+10,")
    found = build_structure(deck_of(odd))
    np.testing.assert_allclose(
        frequencies(found.structure), frequencies(build_structure(deck_of(blank)).structure), rtol=1e-12
    )
    assert "deck.implausible-ratio" in {n.code for n in found.notices}
    for element in (
        "PSHELL,4,1,.1\nCTRIA3,9,4,1,2,4\nGRID,4,,0.,1.,0.\n",
        "PSOLID,4,1\nCTETRA,9,4,1,2,4,5\nGRID,4,,0.,1.,0.\nGRID,5,,0.,0.,1.\n",
    ):
        with pytest.raises(FemtuneError) as caught:
            build_structure(deck_of(odd + element))
        assert caught.value.code == "deck.material"
