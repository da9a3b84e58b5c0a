"""Messages of rigid elements, degree-of-freedom sets and non-structural mass: each is the example of its page."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import BuiltDeck, build_structure

_POINTS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,2.,0.,0.\nGRID,4,,2.,1.,0.\n"

DECKS = {
    "constraint.weight": _POINTS + "RBE3,9,,4,123,0.,123,1,2\n",
    "constraint.undetermined-motion": _POINTS + "RBE3,9,,4,123456,1.,123,1\n",
    "constraint.dependent-choice": _POINTS + "RBE3,9,,4,125,1.,123,1,2\n,3,UM,4,1,1,2\n",
    "deck.nonstructural-mass": ("SOL 103\nCEND\nNSM = 3\nBEGIN BULK\n" + _POINTS + "NSM1,3,PAXI,.067,ALL\nENDDATA\n"),
    "constraint.rod-component": _POINTS + "RROD,9,1,2,3\n",
}
NOTICES = {
    "deck.rigid-expansion": _POINTS + "RBAR,9,1,2,123456,,,,1.2-5\n",
    "deck.nonstructural-unused": (
        "SOL 103\nCEND\nNSM = 3\nBEGIN BULK\nCBAR,7,1,1,2,0.,1.,0.\nPBAR,1,1,1.,1.,1.,1.\nMAT1,1,2.+11,,.3\n"
        + _POINTS
        + "NSM1,3,PBAR,.067,12\nENDDATA\n"
    ),
    "deck.dof-set": _POINTS + "SUPORT,1,123456\n",
    "deck.dof-set-overlap": _POINTS + "OMIT,1,12\nASET,1,1\n",
}

pytestmark = pytest.mark.usefixtures("empty_folder")


def _built(text: str) -> BuiltDeck:
    Path("deck.bdf").write_text(text)
    return build_structure(read_deck("deck.bdf"))


@pytest.mark.parametrize("code", DECKS)
def test_page_shows_the_error(code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _built(DECKS[code])
    assert caught.value.code == code
    check_shown(code, caught.value)


@pytest.mark.parametrize("code", NOTICES)
def test_page_shows_the_notice(code: str) -> None:
    notice = next(n for n in _built(NOTICES[code]).notices if n.code == code)
    check_shown(code, notice)
