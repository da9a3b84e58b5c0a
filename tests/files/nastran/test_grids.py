"""Grid points, scalar points and supports."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck
from femtune.files.nastran.build import BuiltDeck, build_structure

DeckOf = Callable[..., Deck]
POINTS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,2.,0.,0.\n"


def built(deck: Deck) -> BuiltDeck:
    return build_structure(deck)


def names(model: BuiltDeck, dofs: np.ndarray) -> list[str]:
    return [str(model.structure.nodes.describe(int(d))).rstrip("+") for d in dofs]


def test_grdset_fills_blank_fields_only(deck_of: DeckOf) -> None:
    text = "GRDSET,,7,,,,7,1345\nCORD2R,7,,1.,0.,0.,1.,0.,1.\n,2.,0.,0.\nGRID,1,,1.,0.,0.\nGRID,2,0,1.,0.,0.,0,2\n"
    model = built(deck_of(text))
    np.testing.assert_allclose(model.structure.nodes.xyz, [[2, 0, 0], [1, 0, 0]])
    assert names(model, model.structure.permanent) == ["1X", "1Z", "1RX", "1RY", "2Y"]


def test_numbers_are_sorted_and_scalar_points_come_last(deck_of: DeckOf) -> None:
    model = built(deck_of("GRID,9,,0.,0.,0.\nGRID,2,,1.,0.,0.\nSPOINT,20,THRU,22\nSPOINT,5\n"))
    assert model.structure.nodes.ids.tolist() == [2, 9]
    assert model.structure.nodes.scalar_points.tolist() == [5, 20, 21, 22]


def test_scalar_points_that_only_springs_name(deck_of: DeckOf) -> None:
    model = built(deck_of("CELAS2,1,5.,101,,102\n"))
    assert model.structure.nodes.scalar_points.tolist() == [101, 102]


def test_same_point_twice_is_a_notice_and_another_one_an_error(deck_of: DeckOf) -> None:
    model = built(deck_of("GRID,1,,0.,0.,0.\nGRID,1,0,0.0,0.,0.,0\n"))
    assert [n.code for n in model.notices] == ["deck.repeated-grid"]
    with pytest.raises(FemtuneError) as error:
        built(deck_of("GRID,1,,0.,0.,0.\nGRID,1,,0.,0.,1.\n"))
    assert error.value.code == "deck.duplicate-id"


def test_supports_of_all_cards(deck_of: DeckOf) -> None:
    text = POINTS + "SPC,1,1,123,0.,2,3\nSPC1,1,4,3\nSPC1,2,12,1,THRU,3\nSPC1,3,6,1,THRU,99\nSPCADD,10,1,2\n"
    model = built(deck_of(text))
    sets = model.structure.support_sets
    assert names(model, sets[1]) == ["1X", "1Y", "1Z", "2Z", "3RX"]
    assert names(model, sets[2]) == ["1X", "1Y", "2X", "2Y", "3X", "3Y"]
    assert names(model, sets[3]) == ["1RZ", "2RZ", "3RZ"]
    assert set(sets[10]) == set(sets[1]) | set(sets[2])


def test_case_control_selects(deck_of: DeckOf) -> None:
    text = f"SOL 103\nCEND\nSPC=10\nMETHOD=4\nBEGIN BULK\n{POINTS}SPC1,1,1,1\nSPCADD,10,1\nEIGRL,4,,200.,6\nENDDATA\n"
    model = built(deck_of(text))
    assert model.structure.default_support_set == 10
    method = model.eigen_method
    assert method is not None
    assert (method.lower_hz, method.upper_hz, method.wanted) == (None, 200.0, 6)


def test_enforced_displacement_is_a_notice(deck_of: DeckOf) -> None:
    model = built(deck_of(POINTS + "SPC,1,2,3,0.5\n"))
    assert [n.code for n in model.notices] == ["deck.inactive-set", "deck.enforced-displacement"]
    assert names(model, model.structure.support_sets[1]) == ["2Z"]


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("SPC,1,7,3\n", "deck.unknown-grid"),
        ("SPC1,1,3,7\n", "deck.unknown-grid"),
        ("SPC1,1,,2\n", "deck.field-value"),
        ("MPCADD,10,5\n", "deck.missing-set"),
        ("GRID,-4,,0.,0.,0.\n", "deck.field-value"),
        ("SPOINT,2\n", "deck.duplicate-id"),
        ("GRID,8,,0.,0.,0.,-1\n", "deck.fluid-point"),
    ],
)
def test_errors(deck_of: DeckOf, line: str, code: str) -> None:
    with pytest.raises(FemtuneError) as error:
        built(deck_of(POINTS + line))
    assert error.value.code == code
    assert error.value.where is not None
    assert error.value.where.line == 4


@pytest.mark.parametrize("selection", ["SPC=3", "METHOD=3"])
def test_selected_sets_must_exist(deck_of: DeckOf, selection: str) -> None:
    with pytest.raises(FemtuneError) as error:
        built(deck_of(f"SOL 103\nCEND\n{selection}\nBEGIN BULK\n{POINTS}MPC,1,1,1,1.,2,1,1.\nENDDATA\n"))
    assert error.value.code == "deck.missing-set"


def test_a_deck_without_equations_may_select_some(deck_of: DeckOf) -> None:
    """Commercial Nastran solved such a deck (random_test_bar_plus_tri)."""
    model = built(deck_of(f"SOL 103\nCEND\nMPC=3\nBEGIN BULK\n{POINTS}ENDDATA\n"))
    assert model.structure.default_multipoint_set is None
    assert [n.code for n in model.notices] == ["deck.missing-set"]


@pytest.mark.parametrize(
    ("case", "bulk", "held"),
    [("", "", True), ("", "PARAM,AUTOSPC,NO", False), ("AUTOSPC=NO", "", False),
     ("AUTOSPC=YES", "PARAM,AUTOSPC,NO", True)],
)  # fmt: skip
def test_autospc(deck_of: DeckOf, case: str, bulk: str, held: bool) -> None:
    model = built(deck_of(f"SOL 103\nCEND\n{case}\nBEGIN BULK\n{POINTS}{bulk}\nENDDATA\n"))
    assert model.structure.hold_singular is held


def test_params(deck_of: DeckOf) -> None:
    model = built(deck_of(POINTS + "PARAM,WTMASS,.00259\nPARAM,COUPMASS,1\nPARAM,GRDPNT,0\nPARAM,POST,-1\n"))
    assert (model.structure.mass_factor, model.structure.consistent_mass) == (0.00259, True)
    assert model.mass_reference == 0
    assert [n.what for n in model.notices] == ["PARAM POST = -1 is ignored"]
    with pytest.raises(FemtuneError) as error:
        built(deck_of(POINTS + "PARAM,COUPMASS,MAYBE\n"))
    assert error.value.code == "deck.param"
