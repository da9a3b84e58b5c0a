"""Decks of solids and shear panels with any field changed at random: a structure, or an error that names the place."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.files.nastran import build_structure, read_deck

from .hostile_fields import VALUES, Changes, Place, changed, check, places

CARDS = (
    "CORD2C,5,,0.,0.,0.,0.,0.,1.",
    ",1.,0.,0.",
    "GRID,1,,0.,0.,0.",
    "GRID,2,,1.,0.,0.",
    "GRID,3,,1.,1.,0.",
    "GRID,4,,0.,1.,0.,5",
    "GRID,5,,0.,0.,1.",
    "GRID,6,,1.,0.,1.",
    "GRID,7,,1.,1.,1.",
    "GRID,8,,0.,1.,1.",
    "GRID,9,,.5,.5,2.",
    "MAT1,1,2.+5,,.25,3.,,,.01",
    "MAT9,2,9.,1.,1.,,,,9.",
    ",1.,,,,9.,,,",
    ",4.,,,4.,,4.,7.",
    "MAT11,3,140.,10.,12.,.3,.25,.2,5.",
    ",4.,3.,2.,,,,,.02",
    "PSOLID,11,1",
    "PSOLID,12,2,5,TWO,GRID,FULL,SMECH",
    "PSOLID,13,3,-1",
    "PSHEAR,14,1,.1,.5,.9,30.",
    "CHEXA,21,13,1,2,3,4,5,6",
    ",7,8",
    "CPENTA,22,12,1,2,3,5,6,7",
    "CPYRAM,23,11,5,6,7,8,9",
    "CTETRA,24,12,1,2,4,5,,9",
    "CSHEAR,25,14,1,2,3,4",
)
PLACES = places(CARDS)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "deck.bdf"


def test_the_deck_is_sound(path: Path) -> None:
    path.write_text(changed(CARDS, []))
    structure = build_structure(read_deck(path)).structure
    assert [batch.kind for batch in structure.batches] == [
        "shear-panel", "hexa8", "penta6", "tetra10", "pyram5"
    ]  # fmt: skip
    assert all(len(batch) == 1 for batch in structure.batches)


@pytest.mark.quick(0, gate=24)
@pytest.mark.parametrize("place", PLACES)
def test_each_value_in_each_field(path: Path, place: Place) -> None:
    for value in VALUES:
        check(path, changed(CARDS, [(place, value)]))


@pytest.mark.slow
@given(changes=st.lists(st.tuples(st.sampled_from(PLACES), st.sampled_from(VALUES)), min_size=2, max_size=5))
def test_fields_changed_at_random(path: Path, changes: Changes) -> None:
    check(path, changed(CARDS, changes))
