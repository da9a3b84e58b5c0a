"""Values of a deck that no structure has are told, each with its card; those of sound decks are not."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from tests.files.nastran.card_samples import SAMPLES, Sample

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.nastran import Deck, build_structure
from femtune.files.nastran.field_units import field_nature

DeckOf = Callable[..., Deck]
CODES = {"deck.negative-value", "deck.damping-doubtful", "deck.large-loss-factor"}
PLATE = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,1.,1.,0.
GRID,4,,0.,1.,0.
CQUAD4,1,1,1,2,3,4
PSHELL,1,1,.01,1,,1
MAT1,1,7.+10,,.3,2700.
"""


def told(deck_of: DeckOf, text: str) -> list[str]:
    return [n.what for n in build_structure(deck_of(text)).notices if n.code in CODES]


def negative_values(sample: Sample) -> list[tuple[str, str]]:
    """The sample with each value in turn below zero that cannot be negative."""
    decks = []
    for name, indices in sample.values.items():
        if not field_nature(FieldRef(sample.card, sample.number, name)).positive:
            continue
        texts = [f.text for f in sample.fields]
        for index in indices:
            texts[index] = f"-{texts[index].lstrip('-') or '1.'}"
        lines = [texts[i : i + 8] for i in range(0, len(texts), 8)]
        card = [",".join((sample.card if i == 0 else "", *line)) for i, line in enumerate(lines)]
        decks.append((name, "\n".join((*sample.context, *card, ""))))
    return decks


@pytest.mark.quick(6)
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
def test_every_value_that_cannot_be_negative(deck_of: DeckOf, sample: Sample) -> None:
    """An error, or a notice that names the field; RHO has a message of its own."""
    for name, text in negative_values(sample):
        try:
            notices = [n.what for n in build_structure(deck_of(text)).notices]
        except FemtuneError:
            continue
        card = f"{sample.card} {sample.number}"
        assert any("negative" in what and card in what for what in notices), name
        assert name == "RHO" or any(f"{card} {name} is negative" in what for what in notices), name


@pytest.mark.quick(3)
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
def test_samples_as_they_are_say_nothing(deck_of: DeckOf, sample: Sample) -> None:
    assert not told(deck_of, sample.deck)


@pytest.mark.parametrize("card", ["NSM1,3,PSHELL,-5.,1", "NSM,3,PSHELL,1,-5.", "NSML1,3,PSHELL,-5.,1"])
def test_negative_nonstructural_mass(deck_of: DeckOf, card: str) -> None:
    head = "SOL 103\nCEND\nNSM = 3\nBEGIN BULK\n"
    (sentence,) = told(deck_of, head + PLATE + card + "\n")
    assert f"the mass of {card.split(',', 1)[0]} 3 is negative (-5)" in sentence
    assert not told(deck_of, head + PLATE + card.replace("-5.", "5.") + "\n")


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        ("TABDMP1,7,CRIT\n,0.,1.5,100.,2.,ENDT\n", "a damping ratio of 200 % (2 of 2 points"),
        ("TABDMP1,7,G\n,0.,.02,100.,.5,ENDT\n", "a damping ratio of 25 % (1 of 2 points"),
        ("TABDMP1,7,CRIT\n,0.,.01,100.,-.01,ENDT\n", "a damping ratio of -1 %"),
        ("TABDMP1,7,Q\n,0.,.02,100.,50.,ENDT\n", "a damping ratio of 2.5e+03 %"),
        ("PARAM,G,1.5\n", "PARAM G = 1.5 gives every mode a damping ratio of 75 %"),
        ("PARAM,G,-.02\n", "PARAM G = -0.02"),
    ],
)
def test_damping_in_percent(deck_of: DeckOf, cards: str, words: str) -> None:
    (sentence,) = told(deck_of, PLATE + cards)
    assert words in sentence or "PARAM G is negative (-0.02)" in sentence


@pytest.mark.parametrize(
    "cards", ["TABDMP1,7,CRIT\n,0.,.01,100.,.12,ENDT\n", "TABDMP1,7,Q\n,0.,50.,100.,20.,ENDT\n", "PARAM,G,.06\n"]
)
def test_damping_of_structures_says_nothing(deck_of: DeckOf, cards: str) -> None:
    assert not told(deck_of, PLATE + cards)
