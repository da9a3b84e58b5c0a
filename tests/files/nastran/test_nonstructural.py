"""Non-structural mass by cards: what each adds, to which elements, and that masses come out as the cards say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError, Where
from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties
from femtune.fem.fields import FieldRef
from femtune.files.nastran import Deck, build_structure
from femtune.files.nastran.build import BuiltDeck
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.parameters import jet

DeckOf = Callable[..., Deck]
# lengths: bars 1 and 2, rod 3, own rod 1.5; areas 6 and 4.5; the bar's property has 0.5 a length, the shell's 2 an area
MODEL = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,3.,0.,0.
GRID,4,,3.,3.,0.
GRID,5,,0.,3.,0.
GRID,6,,3.,4.,0.
GRID,7,,4.5,0.,0.
GRID,8,,0.,0.,2.
GRID,9,,3.,0.,2.
MAT1,1,2.+11,,.3
CBAR,11,1,1,2,0.,1.,0.
CBAR,12,1,2,3,0.,1.,0.
CBEAM,13,2,1,2,0.,1.,0.
CROD,14,3,3,4
CONROD,15,3,7,1,.1
CQUAD4,21,5,1,3,9,8
CTRIA3,22,6,3,4,5
PBAR,1,1,.1,.1,.1,.1,.5
PBARL,7,1,,ROD
,.1,.25
CBAR,16,7,1,2,0.,1.,0.
PBEAML,2,1,,ROD
,.1
PROD,3,1,.1
PSHELL,5,1,.1,1,,1,,2.
PSHELL,6,1,.1,1,,1
"""
# without cards: bars 3 × 0.5 + 1 × 0.25, shell 6 × 2
OWN = 1.5 + 0.25 + 12.0


def built(deck_of: DeckOf, cards: str, case: str = "NSM = 1") -> BuiltDeck:
    return build_structure(deck_of(f"SOL 103\nCEND\n{case}\nBEGIN BULK\n{MODEL}{cards}ENDDATA\n"))


def mass(model: BuiltDeck) -> float:
    return float(mass_properties(model.structure.nodes, assemble(model.structure, "mass")).mass)


TOTAL = {
    "a length, by property": ("NSM,1,PBAR,1,2.\n", 2.0 * 3),
    "two properties on a card": ("NSM,1,PBAR,1,2.,7,10.\n", 2.0 * 3 + 10.0),
    "PBARL counts as PBAR": ("NSM1,1,PBARL,2.,1\n", 2.0 * 3),
    "all of a family": ("NSM1,1,PBAR,2.,ALL\n", 2.0 * 4),
    "beams": ("NSM1,1,PBEAM,2.,ALL\n", 2.0),
    "rods": ("NSM,1,PROD,3,2.\nNSM,1,CONROD,15,4.\n", 2.0 * 3 + 4.0 * 1.5),
    "an area": ("NSM,1,PSHELL,5,3.\n", 3.0 * 6),
    "elements of all kinds": ("NSM1,1,ELEMENT,2.,11,14,21,22\n", 2.0 * (1 + 3 + 6 + 4.5)),
    "a range with gaps": ("NSM1,1,ELEMENT,2.,11,THRU,13,15\n", 2.0 * (1 + 2 + 1 + 1.5)),
    "TO and BY": ("NSM1,1,ELEMENT,2.,11,TO,15,BY,2\n", 2.0 * (1 + 1 + 1.5)),
    "an element named twice": ("NSM1,1,ELEMENT,2.,11,11\n", 2.0 * 2),
    "cards add up": ("NSM1,1,PBAR,2.,1\nNSM1,1,ELEMENT,1.,11\nNSM,1,PBAR,1,.5\n", 2.5 * 3 + 1.0),
    "a total over lengths": ("NSML1,1,PBAR,7.,ALL\n", 7.0),
    "a total over areas": ("NSML1,1,PSHELL,7.,5,6\n", 7.0),
    "a total over elements": ("NSML1,1,ELEMENT,7.,11,THRU,16\n", 7.0),
    "a total over an element named twice": ("NSML1,1,ELEMENT,7.,11,12,11\n", 7.0),
    "totals one by one": ("NSML,1,PSHELL,5,3.,6,4.\n", 7.0),
    "totals on elements": ("NSML,1,ELEMENT,11,3.,21,4.\n", 7.0),
    "sets put together": ("NSMADD,1,3,4\nNSM1,3,PBAR,1.,1\nNSML1,4,PROD,5.,ALL\nNSM1,5,PBAR,100.,1\n", 3.0 + 5.0),
    "other sets do not count": ("NSM1,1,PBAR,1.,1\nNSM1,2,PBAR,100.,1\n", 3.0),
    "mass is taken away": ("NSM1,1,PBAR,-.5,1\n", -1.5),
}


@pytest.mark.quick(7)
@pytest.mark.parametrize("name", TOTAL)
def test_mass_of_the_model(deck_of: DeckOf, name: str) -> None:
    cards, more = TOTAL[name]
    model = built(deck_of, cards)
    assert mass(model) == pytest.approx(OWN + more, rel=1e-12)
    assert [n for n in model.notices if n.code.startswith("deck.nonstructural")] == []


def test_a_total_is_spread_evenly(deck_of: DeckOf) -> None:
    """With nothing else that weighs, the centre of gravity is that of the areas, 6 and 4.5."""
    model = built(deck_of, "NSML1,1,PSHELL,9.,ALL\nNSM1,1,PBAR,-.5,1\nNSM1,1,PBAR,-.25,7\nNSM1,1,PSHELL,-2.,5\n")
    found = mass_properties(model.structure.nodes, assemble(model.structure, "mass"))
    assert found.mass == pytest.approx(9.0)
    np.testing.assert_allclose(found.centre, (6 * np.array([1.5, 0, 1]) + 4.5 * np.array([2, 2, 0])) / 10.5)


def test_offsets_count_in_the_length(deck_of: DeckOf) -> None:
    text = MODEL.replace("CBAR,11,1,1,2,0.,1.,0.\n", "CBAR,11,1,1,2,0.,1.,0.\n,,,,,,3.\n")
    assert text != MODEL
    model = build_structure(deck_of(f"SOL 103\nCEND\nNSM=1\nBEGIN BULK\n{text}NSML1,1,ELEMENT,7.,11\nENDDATA\n"))
    bare = build_structure(deck_of(f"SOL 103\nCEND\nBEGIN BULK\n{text}ENDDATA\n"))
    assert mass(model) - mass(bare) == pytest.approx(7.0, rel=1e-12)


def test_the_property_keeps_its_own_value_as_a_parameter(deck_of: DeckOf) -> None:
    model = built(deck_of, "NSM1,1,ELEMENT,2.,11\n")
    where = Where("study.toml", 1)
    values = model.structure.values
    at = resolve(model, parse_field_ref("PBAR 1 NSM", where), where)
    index = values.index(FieldRef("PBAR", 1, "NSM"))
    assert at is not None
    assert index is not None
    assert model.structure.users(index).tolist() == [11, 12]
    moved = values.evaluate({index: jet.constant(np.array(0.75), 0)}, 0).value
    (bars,) = [b for b in model.structure.batches if b.card == "CBAR"]
    np.testing.assert_allclose(moved[bars.roles["NSM"]], [2.75, 0.75, 0.25])


def test_what_has_no_effect_is_told(deck_of: DeckOf) -> None:
    def told(cards: str, case: str = "NSM=1") -> list[str]:
        return [n.what for n in built(deck_of, cards, case).notices if n.code == "deck.nonstructural-unused"]

    for cards, subject in (
        ("NSM1,1,ELEMENT,2.,11,77", "NSM1 gives to ELEMENT 77"),
        ("NSM,1,PBAR,2,1.", "NSM gives to PBAR 2"),
        ("NSML1,1,ELEMENT,2.,70,THRU,90", "NSML1 gives to ELEMENT that it lists"),
    ):
        (unused,) = told(f"{cards}\n")
        assert unused.endswith(subject)
    empty = build_structure(deck_of("SOL 103\nCEND\nNSM=1\nBEGIN BULK\nGRID,1\nNSM1,1,PBAR,1.,ALL\nENDDATA\n"))
    assert "deck.nonstructural-unused" in [n.code for n in empty.notices]
    (unselected,) = told("NSM1,1,ELEMENT,2.,11\n", "ECHO = NONE")
    assert "case control selects none" in unselected
    assert mass(built(deck_of, "NSM1,1,ELEMENT,2.,11\n", "ECHO = NONE")) == pytest.approx(OWN)


REFUSED = {
    "NSM1,1,PCONEAX,2.,ALL\n": ("deck.nonstructural-mass", "PCONEAX is not read"),
    "NSM1,1,,2.,ALL\n": ("deck.nonstructural-mass", "no type"),
    "NSML1,1,ELEMENT,2.,11,21\n": ("deck.nonstructural-mass", "lengths and areas together"),
    "NSM1,1,PBAR,,1\n": ("deck.blank-field", "real number"),
    "NSM,1,PBAR,1\n": ("deck.blank-field", "real number"),
    "NSM1,1,PBAR,2.,1,THRU\n": ("deck.list", "end of the list"),
    "NSML,1,PBAR,1,2.\n,DISTR,MASS\n": ("deck.not-a-real", "text = 'MASS'"),
    "NSM1,2,PBAR,1.,1\n": ("deck.missing-set", "NSM = 1"),
    "NSMADD,1,3\nNSM1,2,PBAR,1.,1\n": ("deck.missing-set", "set 3"),
}


@pytest.mark.parametrize("cards", REFUSED)
def test_refusals(deck_of: DeckOf, cards: str) -> None:
    code, says = REFUSED[cards]
    with pytest.raises(FemtuneError, match=says) as caught:
        built(deck_of, cards)
    assert caught.value.code == code


TAPERED = """PBEAM,2,1,.1,.1,.1,,.1,1.
,,,,,,,,
,YES,1.,.2,.2,.2,,.2,3.
"""
COMPOSITE = "PBCOMP,2,1,.1,.1,.1,,.1,2.\n"


@pytest.mark.parametrize("section", [TAPERED, COMPOSITE])
def test_tapered_and_composite_beams_take_it_too(deck_of: DeckOf, section: str) -> None:
    """The beam's own mass is 2 a length in the mean; cards add theirs at every station."""
    text = MODEL.replace("PBEAML,2,1,,ROD\n,.1\n", section)
    assert text != MODEL
    found = []
    for cards in ("", "NSM1,1,PBEAM,5.,2\nNSML1,1,PBEAML,3.,ALL\n"):
        case = "NSM=1" if cards else "ECHO=NONE"
        found.append(mass(build_structure(deck_of(f"SOL 103\nCEND\n{case}\nBEGIN BULK\n{text}{cards}ENDDATA\n"))))
    np.testing.assert_allclose(found, [OWN + 2.0, OWN + 2.0 + 5.0 + 3.0], rtol=1e-12)
