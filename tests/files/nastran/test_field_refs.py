"""Fields that a study names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError, Where
from femtune.fem.fields import FieldRef
from femtune.files.nastran import Deck, edit_fields, read_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.parameters import jet

DeckOf = Callable[..., Deck]
TEXT = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
MAT1,1,2.+11,,.25,7800.
MAT1,2,2.+11,8.+10
PBAR,3,1,1.-3,2.-6,3.-6,4.-6
PBAR,5,1,1.-3,2.-6,3.-6,4.-6
PBARL,1,2,,ROD
,.1
PBEAM,4,1,1.,2.,3.
PBUSH,2,K,5.
PELAS,3,10.,,,4,20.
PMASS,110,2.588
PROD,1,1,2.
CBAR,1,3,1,2,0.,1.,0.
CBAR,2,1,1,2,0.,1.,0.
CBEAM,3,4,1,2,0.,1.,0.
CBUSH,4,2,1,2,,,,0
CELAS1,5,4,1,1
CMASS1,6,110,1,1
CONROD,7,1,2,1,.5
CROD,8,1,1,2
CONM2,11,1,,5.
CELAS2,21,3.,1,1
"""
UPDATABLE = {
    "PBAR 3 I1": 2e-6, "MAT1 1 E": 2e11, "CONM2 11 M": 5.0, "CELAS2 21 K": 3.0, "PBUSH 2 K1": 5.0, "PELAS 4 K": 20.0,
    "PMASS 110 M": 2.588, "CONROD 7 A": 0.5, "PROD 1 A": 2.0, "PBEAM 4 I1": 2.0, "PBARL 1 DIM1": 0.1,
    "MAT1 2 G": 8e10, "MAT1 1 NU": 0.25, "PBAR 3 NSM": 0.0, "CONM2 11 I11": 0.0, "MAT1 1 RHO": 7800.0,
    "MAT1 1 GE": 0.0,
}  # fmt: skip


@pytest.fixture
def built(deck_of: DeckOf) -> BuiltDeck:
    return build_structure(deck_of(TEXT))


@pytest.mark.parametrize("text", UPDATABLE)
def test_value_and_its_place_in_the_deck(built: BuiltDeck, text: str, tmp_path: Path) -> None:
    ref = parse_field_ref(text)
    assert str(ref) == text
    index = resolve(built, ref)
    assert built.structure.values.values[index] == pytest.approx(UPDATABLE[text])
    # a value written at the field's place is read back as that value, and nothing else changes
    place = built.fields[ref]
    edited = edit_fields(built.deck, {(place.card, at): 0.125 for at in place.fields})
    (tmp_path / "new.bdf").write_text(next(iter(edited.texts.values())))
    again = build_structure(read_deck(tmp_path / "new.bdf")).structure.values
    assert again.refs == built.structure.values.refs
    expected = built.structure.values.evaluate({index: jet.constant(0.125, 0)}, 0)
    np.testing.assert_allclose(again.values, expected.value, rtol=1e-12)


def test_elements_that_use_a_value(built: BuiltDeck) -> None:
    users = {t: built.structure.users(resolve(built, parse_field_ref(t))).tolist() for t in UPDATABLE}
    assert users["PBAR 3 I1"] == [1]
    assert users["MAT1 1 E"] == [1, 3, 7, 8]
    assert users["MAT1 1 NU"] == [1, 3, 7, 8]
    assert users["PBARL 1 DIM1"] == [2]
    assert users["CONM2 11 M"] == [11]


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("PBAR 3", "study.unknown-field", "write card, number and field"),
        ("PBAR I1 3", "study.unknown-field", "write card, number and field"),
        ("PBAAR 3 I1", "study.unknown-field", "did you mean 'PBAR'?"),
        ("CBAR 1 PID", "study.unknown-field", "CBAR has no field 'PID' that can be updated"),
        ("CROD 1 PID", "study.unknown-field", "'CROD' is not a card with fields that can be updated"),
        ("MAT1 1 RH0", "study.unknown-field", "did you mean 'RHO'?"),
        ("CONM2 11 MASS", "study.unknown-field", "has no field 'MASS'"),
        ("PBARL 1 A", "parameter.derived-field", "update DIM1"),
        ("PBAR 33 I1", "study.unknown-field", "the deck has no PBAR 33"),
        ("CONM1 1 M11", "study.unknown-field", "the deck has no CONM1 card"),
        ("PBAR 5 I1", "parameter.touches-nothing", "depends on PBAR 5 I1"),
        ("PELAS 3 K", "parameter.touches-nothing", "depends on PELAS 3 K"),
        ("MAT1 1 G", "parameter.derived-field", "follows from E and NU"),
        ("MAT1 2 NU", "parameter.derived-field", "update E and G"),
        ("PBARL 1 DIM2", "study.unknown-field", "has no DIM2"),
    ],
)
def test_errors(built: BuiltDeck, text: str, code: str, message: str) -> None:
    where = Where("study.toml", 12, "parameter")
    with pytest.raises(FemtuneError) as error:
        resolve(built, parse_field_ref(text, where), where)
    assert error.value.code == code
    assert message in str(error.value)
    assert error.value.where == where


def test_reference_is_read_in_any_case() -> None:
    assert parse_field_ref(" pbar  3 i1 ") == FieldRef("PBAR", 3, "I1")
