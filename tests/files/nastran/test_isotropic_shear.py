"""G of a MAT1 that gives E, G and NU: it follows E and NU where the three agree."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.fem.fields import FieldRef
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.field_refs import resolve
from femtune.model import Assignment, parametric_model
from femtune.parameters import Parameter, ParameterSet

DeckOf = Callable[..., Deck]

FRAME = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,1.,1.,0.
CBAR,1,1,1,2,0.,0.,1.
CBAR,2,1,2,3,0.,0.,1.
PBAR,1,1,.01,1.-6,2.-6,1.-6
CONM2,5,3,,10.
SPC1,1,123456,1
"""
HEAD = "SOL 103\nCEND\nSPC=1\nMETHOD=1\nBEGIN BULK\nEIGRL,1,,,3\n"
E, G, NU = (FieldRef("MAT1", 1, name) for name in ("E", "G", "NU"))


def _built(deck_of: DeckOf, material: str) -> BuiltDeck:
    return build_structure(deck_of(FRAME + material))


def _values(built: BuiltDeck, changes: dict[FieldRef, float]) -> dict[str, float]:
    """E, G and NU after parameters have multiplied some of them."""
    parameters = ParameterSet(tuple(Parameter(ref.name, 1.0, 0.1, 9.0) for ref in changes))
    model = parametric_model(built.structure, parameters, [Assignment(ref.name, ref, True) for ref in changes])
    table, values = model.structure.values, model.table(np.array(list(changes.values())) - 1.0).value
    return {ref.name: float(values[table.index(ref)]) for ref in (E, G, NU)}  # type: ignore[index]


def test_g_follows_e_and_nu_in_the_ratio_of_the_card(deck_of: DeckOf) -> None:
    built = _built(deck_of, "MAT1,1,2.1+11,8.08+10,.3,7850.\n")
    assert [n for n in built.notices if n.code == "deck.inconsistent-shear"] == []
    assert _values(built, {E: 1.0})["G"] == pytest.approx(8.08e10, rel=1e-14)
    assert _values(built, {E: 1.2})["G"] == pytest.approx(1.2 * 8.08e10, rel=1e-14)
    assert _values(built, {NU: 0.8})["G"] == pytest.approx(8.08e10 * 1.3 / 1.24, rel=1e-14)


def test_the_slope_of_g_by_complex_step(deck_of: DeckOf) -> None:
    built = _built(deck_of, "MAT1,1,2.1+11,8.08+10,.3,7850.\n")
    parameters = ParameterSet((Parameter("e", 1.0, 0.5, 2.0), Parameter("n", 1.0, 0.5, 1.5)))
    model = parametric_model(built.structure, parameters, [Assignment("e", E, True), Assignment("n", NU, True)])
    at, x = model.structure.values.index(G), np.array([0.1, -0.2])
    slopes = model.table(x)[at].grad  # type: ignore[index]
    for k in range(2):
        step = x + 1e-30j * np.eye(2)[k]
        assert slopes[k] == pytest.approx(model.table(step).value[at].imag / 1e-30, rel=1e-12)


def test_a_parameter_of_g_makes_it_a_value_of_its_own(deck_of: DeckOf) -> None:
    built = _built(deck_of, "MAT1,1,2.1+11,8.08+10,.3,7850.\n")
    assert resolve(built, G) == built.structure.values.index(G)
    assert _values(built, {G: 1.1}) == pytest.approx({"E": 2.1e11, "G": 1.1 * 8.08e10, "NU": 0.3}, rel=1e-14)
    assert _values(built, {E: 1.2, G: 1.1})["G"] == pytest.approx(1.1 * 8.08e10, rel=1e-14)


@pytest.mark.parametrize(("shear", "percent"), [("8.3+10", "+2.76 %"), ("7.9+10", "-2.19 %"), ("0.", "-100 %")])
def test_values_that_contradict_are_warned_of_and_independent(deck_of: DeckOf, shear: str, percent: str) -> None:
    built = _built(deck_of, f"MAT1,1,2.1+11,{shear},.3,7850.\n")
    (notice,) = [n for n in built.notices if n.code == "deck.inconsistent-shear"]
    assert notice.level == "warning"
    assert percent in notice.what
    assert _values(built, {E: 1.2})["G"] == built.structure.values.values[built.structure.values.index(G)]  # type: ignore[index]


@pytest.mark.parametrize("shear", ["8.1+10", "8.0769+10", "8.0+10"])
def test_rounded_values_are_isotropic(deck_of: DeckOf, shear: str) -> None:
    built = _built(deck_of, f"MAT1,1,2.1+11,{shear},.3,7850.\n")
    assert [n for n in built.notices if n.code == "deck.inconsistent-shear"] == []


def test_a_region_of_elements(deck_of: DeckOf) -> None:
    """E of one bar, and G of it: as for a card with E and G alone."""
    for material in ("MAT1,1,2.1+11,8.08+10,.3,7850.\n", "MAT1,1,2.1+11,8.08+10,,7850.\n"):
        built = _built(deck_of, material)
        parameters = ParameterSet((Parameter("p", 1.0, 0.5, 2.0),))
        of_bar = [Assignment("p", ref, True, frozenset({2})) for ref in (E, G)]
        model = parametric_model(built.structure, parameters, of_bar)
        values = {str(r): v for r, v in model.field_values(np.array([0.2])).items()}
        assert sorted(values.values()) == pytest.approx([1.2 * 8.08e10, 1.2 * 2.1e11])


def test_both_are_written(tmp_path: Path) -> None:
    """E a fifth higher raises every frequency by the root of 1.2, of the deck that is written too."""
    path = tmp_path / "frame.bdf"
    path.write_text(HEAD + FRAME + "MAT1,1,2.1+11,8.08+10,.3\nENDDATA\n")
    stiffer = ft.write_deck(path, {"MAT1 1 E": 1.2 * 2.1e11}, tmp_path / "stiffer.bdf")
    assert "MAT1,1,2.52+11,9.696+10,.3" in stiffer.read_text()
    ratio = ft.modes(stiffer).freq_hz / ft.modes(path).freq_hz
    assert ratio == pytest.approx(np.full(3, np.sqrt(1.2)), rel=1e-9)
    own = ft.write_deck(path, {"MAT1 1 E": 1.2 * 2.1e11, "MAT1 1 G": 9.9e10}, tmp_path / "own.bdf")
    assert "MAT1,1,2.52+11,9.9+10,.3" in own.read_text()


@pytest.mark.parametrize(("shear", "told"), [("2.7+10", False), ("2.3+10", True)])
def test_a_ratio_above_one_half_that_e_and_g_imply_is_told_for_shells(deck_of: DeckOf, shear: str, told: bool) -> None:
    """E/2G − 1 = 0.30 and 0.52."""
    material = f"MAT1,1,7.+10,{shear},,2700.\n"
    shell = "GRID,11,,0.,0.,0.\nGRID,12,,1.,0.,0.\nGRID,13,,0.,1.,0.\nCTRIA3,31,12,11,12,13\nPSHELL,12,1,.01,1,,1\n"
    built = build_structure(deck_of(material + shell))
    found = [n for n in built.notices if n.code == "deck.inconsistent-shear"]
    assert [n.level for n in found] == ["warning"] * told
    assert all("0.522" in n.what for n in found)
