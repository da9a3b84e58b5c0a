"""Bars and beams: orientation, offsets, pin flags, sections, and values as they enter the table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran import Deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.parameters import jet

DeckOf = Callable[..., Deck]
MAT = "MAT1,1,2.+11,,.25,7800.\n"
PBAR = "PBAR,3,1,1.-3,2.-6,3.-6,4.-6,.5\n,,,,,,,,\n,.8,.7,1.-7\n"
# displacement frame of point 2: x along basic y, y along basic z
TURNED = "CORD2R,5,,0.,0.,0.,1.,0.,0.\n,0.,1.,0.\nGRID,1,,0.,0.,0.\nGRID,2,,2.,0.,0.,5\nGRID,3,,2.,2.,0.,5\n"
BASE = MAT + PBAR + TURNED


def batch(deck: Deck) -> tuple[BuiltDeck, ElementBatch]:
    model = build_structure(deck)
    return model, model.structure.batches[0]


def values(model: BuiltDeck, one: ElementBatch, i: int = 0) -> dict[str, float]:
    return {role: float(model.structure.values.values[at[i]]) for role, at in one.roles.items()}


def code(deck: Deck) -> str:
    with pytest.raises(FemtuneError) as error:
        build_structure(deck)
    return error.value.code


def test_values_of_a_bar(deck_of: DeckOf) -> None:
    model, one = batch(deck_of(BASE + "CBAR,7,3,1,2,0.,1.,0.\n"))
    assert values(model, one) == pytest.approx(
        {"E": 2e11, "G": 8e10, "rho": 7800, "A": 1e-3, "I1": 2e-6, "I2": 3e-6, "I12": 1e-7, "J": 4e-6,
         "K1": 0.8, "K2": 0.7, "NSM": 0.5, "GE": 0.0}
    )  # fmt: skip
    assert (one.kind, one.card, one.ids.tolist(), one.nodes.tolist()) == ("bar", "CBAR", [7], [[0, 1]])
    assert one.dofs.tolist() == [list(range(12))]


def test_g_is_derived_from_e_and_nu_with_its_derivatives(deck_of: DeckOf) -> None:
    model, _ = batch(deck_of(BASE + "CBAR,7,3,1,2,0.,1.,0.\n"))
    table = model.structure.values
    e, nu, g = (table.index(FieldRef("MAT1", 1, name)) for name in ("E", "NU", "G"))
    assert e is not None
    assert nu is not None
    assert g is not None
    x = jet.variables(np.array([2.1e11, 0.3]))
    out = table.evaluate({e: x[0], nu: x[1]}, 2)[g]
    assert out.value == pytest.approx(2.1e11 / 2.6)
    np.testing.assert_allclose(out.grad, [1 / 2.6, -2.1e11 / (2 * 1.3**2)], rtol=1e-12)


@pytest.mark.parametrize(
    ("fields", "e", "g"),
    [("2.6,1.,,", 2.6, 1.0), (",1.,.3,", 2.6, 1.0), ("2.6,,.3,", 2.6, 1.0), ("2.6,1.1,.3,", 2.6, 1.1),
     ("2.6,,,", 2.6, 0.0)],
)  # fmt: skip
def test_any_two_of_e_g_nu(deck_of: DeckOf, fields: str, e: float, g: float) -> None:
    model, one = batch(deck_of(f"MAT1,1,{fields}\n{PBAR}{TURNED}CBAR,7,3,1,2,0.,1.,0.\n"))
    found = values(model, one)
    assert (found["E"], found["G"], found["rho"]) == pytest.approx((e, g, 0.0))
    # no shear modulus, no shear flexibility
    assert found["K1"] == (0.8 if g else 0.0)


@pytest.mark.parametrize("fields", [",,,", ",,.3,", ",1.,,", "-2.,,.3,", "0.,,.3,", "2.,-1.,,", "2.,,.6,", "2.,,-1.,"])
def test_bad_materials(deck_of: DeckOf, fields: str) -> None:
    assert code(deck_of(f"MAT1,1,{fields}\n{PBAR}{TURNED}CBAR,7,3,1,2,0.,1.,0.\n")) == "deck.material"


def test_orientation_in_the_displacement_frame_of_end_a(deck_of: DeckOf) -> None:
    text = BASE + "CBAR,7,3,1,2,0.,1.,0.\nCBAR,8,3,2,1,1.,2.,0.\nCBAR,9,3,2,1,1.,2.,0.,BGG\nCBAR,10,3,1,2,3\n"
    _, one = batch(deck_of(text))
    np.testing.assert_allclose(one.facts["orientation"], [[0, 1, 0], [0, 1, 2], [1, 2, 0], [2, 2, 0]], atol=1e-15)


def test_old_flag_in_the_place_of_offt(deck_of: DeckOf) -> None:
    _, one = batch(deck_of(BASE + "CBAR,7,3,1,2,0.,1.,0.,1\nCBAR,8,3,1,2,3,,,2\n"))
    np.testing.assert_allclose(one.facts["orientation"], [[0, 1, 0], [2, 2, 0]])


def test_offsets_in_the_frames_of_the_ends(deck_of: DeckOf) -> None:
    line = "CBAR,7,3,1,2,0.,1.,0.,{}\n,,,.1,.2,.3,.1,.2,.3\n"
    _, one = batch(deck_of(BASE + line.format("GGG")))
    np.testing.assert_allclose(one.facts["offset_a"], [[0.1, 0.2, 0.3]])
    # x of point 2 is basic y, y is basic z, z is basic x
    np.testing.assert_allclose(one.facts["offset_b"], [[0.3, 0.1, 0.2]])
    _, one = batch(deck_of(BASE + line.format("GGO")))
    np.testing.assert_allclose(one.facts["offset_b"], [[0.1, 0.2, 0.3]], atol=1e-15)
    text = BASE + "CBAR,7,3,1,3,0.,1.,0.,GOO\n,,,1.,0.,0.,0.,1.,0.\n"
    _, one = batch(deck_of(text))
    h = np.sqrt(0.5)
    np.testing.assert_allclose(one.facts["offset_a"], [[h, h, 0]])
    np.testing.assert_allclose(one.facts["offset_b"], [[-h, h, 0]], atol=1e-15)


def test_pins(deck_of: DeckOf) -> None:
    _, one = batch(deck_of(BASE + "CBAR,7,3,1,2,0.,1.,0.\n,56,4\n"))
    assert np.flatnonzero(one.facts["pins"][0]).tolist() == [4, 5, 9]


def test_defaults_of_baror_and_of_the_property_number(deck_of: DeckOf) -> None:
    text = BASE + "BAROR,,3,,,0.,0.,1.\nCBAR,7,,1,2\nCBAR,8,3,1,2,0.,1.,0.\n"
    _, one = batch(deck_of(text))
    np.testing.assert_allclose(one.facts["orientation"], [[0, 0, 1], [0, 1, 0]])
    model, one = batch(deck_of(BASE + "CBAR,3,,1,2,0.,1.,0.\n"))
    assert values(model, one)["A"] == 1e-3


def test_beam_with_and_without_stations(deck_of: DeckOf) -> None:
    head = MAT + TURNED + "CBEAM,7,3,1,2,0.,1.,0.\n"
    plain = "PBEAM,3,1,1.,2.,3.,.1,4.,.5\n"
    expected = {"A": 1.0, "I1": 2.0, "I2": 3.0, "I12": 0.1, "J": 4.0, "NSM": 0.5, "K1": 1.0, "K2": 1.0}
    full = plain + ",1.,1.,1.,1.,1.,1.,1.,1.\n,YES,1.,1.,,3.\n,1.,1.,1.,1.,1.,1.,1.,1.\n,.8,.7\n"
    short = plain + ",NO,1.,1.,2.,3.,.1,4.,.5\n,.8,.7\n"
    for text, k in ((plain, (1.0, 1.0)), (full, (0.8, 0.7)), (short, (0.8, 0.7))):
        model, one = batch(deck_of(head + text))
        assert one.card == "CBEAM"
        assert expected.items() - {("K1", 1.0), ("K2", 1.0)} <= values(model, one).items()
        assert (values(model, one)["K1"], values(model, one)["K2"]) == k
    model, _ = batch(deck_of(head + full))
    assert model.fields[FieldRef("PBEAM", 3, "A")].fields == (2, 18)
    assert model.fields[FieldRef("PBEAM", 3, "I1")].fields == (3,)
    assert model.fields[FieldRef("PBEAM", 3, "K2")].fields == (33,)


@pytest.mark.parametrize(
    "text",
    [
        "PBEAM,3,1,1.,2.,3.,.1,4.,.5\n,NO,1.,1.,2.,3.,9.\n",
        "PBEAM,3,1,1.,2.,3.,.1,4.,.5\n,NO,.5,1.,2.,3.,.1\n",
        "PBEAM,3,1,1.,2.,3.,.1,4.,.5\n,NO,1.5,1.,2.,3.,.1\n",
        "PBEAM,3,1,1.,2.,3.,.1,4.,.5\n,NO,1.,1.\n,NO,1.,1.\n",
        "PBEAM,3,1,1.,2.,3.,.1,4.,.5\n,,,,,,,,\n,,,.5\n",
        "PBEAML,3,1,,ROD\n,1.,,YES,1.,-2.\n",
        "PBEAML,3,1,,ROD\n,1.,,2.,1.,2.\n",
        "PBEAML,3,1,,HAT\n,1.,2.,3.,4.\n",
        "PBEAML,3,1,,DBOX\n,1.,2.,3.,4.\n",
        "PBCOMP,3,1,1.,2.,3.\n,,,,,,,6\n",
        "PBCOMP,3,1,1.\n,,,,,,,1\n,0.,1.,-.2\n",
        "PBEAML,3,1,,HEXA\n,1.+50,1.+52,1.+50\n",
        "PBCOMP,3,1,1.\n,,,,,,,0\n,0.,1.,.2\n,0.,2.,.2\n",
        "PBEAML,3,1,,TUBE\n,1.,2.\n",
        "PBEAML,3,1,,BOX\n,1.,2.,.5,.5\n",
    ],
)
def test_sections_that_are_refused(deck_of: DeckOf, text: str) -> None:
    assert code(deck_of(MAT + TURNED + "CBEAM,7,3,1,2,0.,1.,0.\n" + text)) == "deck.section"


def test_shaped_beam_with_stations(deck_of: DeckOf) -> None:
    text = "CBEAM,7,3,1,2,0.,1.,0.\nPBEAML,3,1,,BAR\n,.1,.2,.5,YES,1.,.1,.2,.5\n"
    model, one = batch(deck_of(MAT + TURNED + text))
    assert values(model, one)["A"] == pytest.approx(0.02)
    assert values(model, one)["NSM"] == 0.5
    assert model.fields[FieldRef("PBEAML", 3, "DIM2")].fields == (9, 14)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("CBAR,7,3,1,2,1.,0.,0.\n", "deck.orientation"),
        ("CBAR,7,3,1,2\n", "deck.orientation"),
        ("CBAR,7,3,1,1,0.,1.,0.\n", "deck.zero-length"),
        ("CBAR,7,3,1,2,0.,1.,0.\n,,,2.\n", "deck.zero-length"),
        ("CBAR,7,3,1,9,0.,1.,0.\n", "deck.unknown-grid"),
        ("CBAR,7,3,1,2,9\n", "deck.unknown-grid"),
        ("CBAR,7,4,1,2,0.,1.,0.\n", "deck.unknown-property"),
        ("CBAR,7,3,1,2,0.,1.,0.,GGE\n", "deck.offset-frame"),
        ("CBAR,7,3,1,2,0.,1.,0.\nPBARL,3,1,,ROD\n,1.\n", "deck.duplicate-id"),
        ("CBAR,7,3,1,2,0.,1.,0.\nCBAR,7,3,1,2,0.,1.,0.\n", "deck.duplicate-id"),
        ("CBEAM,7,3,1,2,0.,1.,0.\n", "deck.property-type"),
        ("CROD,7,3,1,2\n", "deck.property-type"),
        ("CBAR,7,5,1,2,0.,1.,0.\nPBAR,5,8,1.\n", "deck.unknown-material"),
    ],
)
def test_errors(deck_of: DeckOf, line: str, expected: str) -> None:
    assert code(deck_of(BASE + line)) == expected


def test_a_bad_property_is_reported_once(deck_of: DeckOf) -> None:
    text = MAT.replace("2.+11", "-2.") + PBAR + TURNED + "".join(f"CBAR,{i},3,1,2,0.,1.,0.\n" for i in range(1, 9))
    with pytest.raises(FemtuneError) as error:
        build_structure(deck_of(text))
    assert error.value.code == "deck.material"
    assert not hasattr(error.value, "errors")


def test_many_errors_are_cut_to_twenty(deck_of: DeckOf) -> None:
    text = BASE + "".join(f"CBAR,{i},3,1,{i},0.,1.,0.\n" for i in range(100, 150))
    with pytest.raises(FemtuneError) as error:
        build_structure(deck_of(text))
    assert "30 more problems" in str(error.value)
    assert str(error.value).count("deck.unknown-grid") == 20


@pytest.mark.parametrize(("value", "level"), [("0", "info"), ("1", "warning")])
def test_inertia_of_bars_that_is_asked_for_is_told(deck_of: DeckOf, value: str, level: str):
    model = build_structure(deck_of(f"SOL 103\nCEND\nBEGIN BULK\nPARAM,BARMASS,{value}\nGRID,1,,0.,0.,0.\nENDDATA\n"))
    (notice,) = [n for n in model.notices if n.code == "deck.ignored-param"]
    assert notice.level == level
    assert "no torsional and rotary inertia" in notice.what
