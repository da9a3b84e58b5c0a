"""CSHEAR and PSHEAR as a batch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck
from femtune.files.nastran.build import BuiltDeck, build_structure

DeckOf = Callable[..., Deck]
POINTS = "GRID,1,,0.,0.,0.\nGRID,2,,2.,0.,0.\nGRID,3,,2.,1.,0.\nGRID,4,,0.,1.,0.\nMAT1,1,2.,,.25,3.,,,.01\n"
PANEL = "PSHEAR,9,1,.1,.5,.9,30.\nCSHEAR,20,9,1,2,3,4\n"


def built(deck_of: DeckOf, text: str) -> BuiltDeck:
    return build_structure(deck_of(POINTS + text))


def test_values(deck_of: DeckOf) -> None:
    model = built(deck_of, PANEL)
    (one,) = model.structure.batches
    found = {role: float(model.structure.values.values[at[0]]) for role, at in one.roles.items()}
    assert (one.kind, one.card, one.ids.tolist()) == ("shear-panel", "CSHEAR", [20])
    assert found == {"E": 2.0, "G": 0.8, "rho": 3.0, "GE": 0.01, "t": 0.1, "NSM": 0.5, "F1": 0.9, "F2": 30.0}
    assert one.dofs[0].tolist() == [0, 1, 2, 6, 7, 8, 12, 13, 14, 18, 19, 20]


def test_defaults(deck_of: DeckOf) -> None:
    model = built(deck_of, "PSHEAR,20,1,.1\nCSHEAR,20,,1,2,3,4\n")
    (one,) = model.structure.batches
    assert [model.structure.values.values[one.roles[n][0]] for n in ("NSM", "F1", "F2")] == [0.0] * 3


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("PSHEAR,9,1,0.\nCSHEAR,20,9,1,2,3,4\n", "deck.shell-section"),
        ("PSHEAR,9,1\nCSHEAR,20,9,1,2,3,4\n", "deck.blank-field"),
        ("PSHEAR,9,1,.1,,-1.\nCSHEAR,20,9,1,2,3,4\n", "deck.shell-section"),
        ("MAT1,2,1.\nPSHEAR,9,2,.1\nCSHEAR,20,9,1,2,3,4\n", "deck.shell-section"),
        ("MAT8,2,2.,2.,.3,1.\nPSHEAR,9,2,.1\nCSHEAR,20,9,1,2,3,4\n", "deck.material-type"),
        ("PSHEAR,9,1,.1\nCSHEAR,20,9,1,2,3\n", "deck.blank-field"),
        ("PSHEAR,9,1,.1\nCSHEAR,20,9,1,2,3,3\n", "deck.shell-corners"),
        ("PSHEAR,9,1,.1\nCSHEAR,20,9,1,2,3,5\n", "deck.unknown-grid"),
        ("PSHELL,9,1,.1\nCSHEAR,20,9,1,2,3,4\n", "deck.property-type"),
    ],
)
def test_what_is_refused(deck_of: DeckOf, text: str, code: str) -> None:
    with pytest.raises(FemtuneError) as error:
        built(deck_of, text)
    assert error.value.code == code


def test_non_structural_mass_of_panels(deck_of: DeckOf) -> None:
    case = "SOL 103\nCEND\nNSM = 3\nBEGIN BULK\n"
    text = case + POINTS + PANEL + "NSM,3,PSHEAR,9,.25\nNSML,3,PSHEAR,9,4.\nENDDATA\n"
    model = build_structure(deck_of(text))
    (one,) = model.structure.batches
    # 0.5 of the card, 0.25 more, and 4 over an area of 2
    np.testing.assert_allclose(model.structure.values.values[one.roles["NSM"]], [2.75])
