"""Every card is read, or named with its count and line."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.inventory import IGNORED, MISSING, NOT_NEEDED, READ, use_of

DeckOf = Callable[..., Deck]
POINTS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,2.,0.,0.\nGRID,4,,2.,1.,0.\n"


@pytest.mark.parametrize(
    ("name", "use"),
    [
        ("GRID", READ), ("BAROR", READ), ("FORCE", NOT_NEEDED), ("CAERO1", NOT_NEEDED), ("CBARAO", NOT_NEEDED),
        ("CDAMP5", NOT_NEEDED), ("RLOAD1", NOT_NEEDED), ("CTRAX3", MISSING), ("CTETRA", READ), ("RBE3", READ),
        ("RSSCON", MISSING), ("CTRIAX6", MISSING), ("RBE2GS", MISSING), ("CQUAD4N", MISSING), ("RJOINT", MISSING),
        ("CORD3G", IGNORED), ("MATT1", IGNORED), ("DMIG", IGNORED), ("ASET1", READ), ("SUPORT", READ),
        ("SPCOFF", IGNORED), ("WHATEVER", IGNORED), ("CNEWONE", IGNORED),
    ],
)  # fmt: skip
def test_use(name: str, use: str) -> None:
    assert use_of(name) == use


def test_missing_elements_are_an_error_with_count_and_first_line(deck_of: DeckOf) -> None:
    deck = deck_of(POINTS + "CTRIAX6,1,1,1,2,3,4\nCTRIAX6,2,1,1,2,3,4\nRSSCON,3,.1,1,2,123456,3\n")
    with pytest.raises(FemtuneError) as error:
        build_structure(deck)
    text = str(error.value)
    assert "2 CTRIAX6 cards " in text
    assert "deck.bdf:5 (CTRIAX6 1)" in text
    assert "1 RSSCON card is not supported" in text
    model = build_structure(deck, allow_missing=True)
    found = [(n.level, n.what.split(" left")[0]) for n in model.notices if n.code == "deck.unsupported-element"]
    assert found == [("warning", "2 CTRIAX6 cards are"), ("warning", "1 RSSCON card is")]


def test_ignored_cards_are_notices(deck_of: DeckOf) -> None:
    model = build_structure(deck_of(POINTS + "FORCE,1,1,,1.,1.\nFORCE,1,2,,1.,1.\nMATT1,1,4\nODDITY,1\n"))
    assert [(n.level, n.what.partition(":")[0]) for n in model.notices] == [
        ("info", "2 FORCE cards are ignored"),
        ("warning", "1 MATT1 card is ignored"),
        ("warning", "1 ODDITY card is ignored"),
    ]
    assert [(c.name, c.count, c.where.line, c.use) for c in model.cards][:2] == [
        ("GRID", 4, 1, READ), ("FORCE", 2, 5, NOT_NEEDED),
    ]  # fmt: skip


def test_catalogue_names_each_field_once() -> None:
    for kind in CATALOGUE.values():
        named = [name for name in kind.fields if name != "-"]
        assert len(named) == len(set(named)), kind.name
