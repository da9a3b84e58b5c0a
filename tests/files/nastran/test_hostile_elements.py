"""Decks of shells, solids and shear panels with any field changed: a structure, or an error that names the place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.fem.assemble import assemble
from femtune.files.nastran import build_structure, read_deck

from .hostile_fields import VALUES, Changes, Place, changed, check, places

SHELLS = (
    "CORD2C,5,,0.,0.,0.,0.,0.,1.",
    ",1.,0.,0.",
    "GRID,1,,0.,0.,0.",
    "GRID,2,,1.,0.,0.",
    "GRID,3,,1.,1.,.1",
    "GRID,4,,0.,1.,0.,5",
    "MAT1,1,2.+5,,.25,3.,,,.01",
    "MAT2,2,2.,.5,,3.,,1.,7.",
    "MAT8,3,140.,10.,.3,5.,4.,3.,2.",
    "PSHELL,11,1,.1,2,1.1,3,.8,.5",
    "PSHELL,12,1,,1,,1",
    "CQUAD4,21,11,1,2,3,4,5,.01,+",
    "+,,1,.1,.11,,.13",
    "CQUAD4,22,11,1,2,3,4,30.",
    "CTRIA3,23,12,1,2,3,,-.02",
    ",,,.1,.11,.12",
    "GRID,5,,.5,0.,0.",
    "GRID,6,,1.,.5,.04",
    "CQUAD8,24,11,1,2,3,4,5,6",
    ",,,.1,.11,,.13,5,.01",
    ",1",
    "CTRIA6,25,12,1,2,3,5,6",
    ",30.,-.02,.1,.11,.12",
    "PARAM,K6ROT,100.",
)
SOLIDS = (
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
DECKS = {"shells": SHELLS, "solids": SOLIDS}
PLACES = {name: places(cards) for name, cards in DECKS.items()}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "deck.bdf"


def test_the_decks_are_sound(path: Path) -> None:
    path.write_text(changed(SHELLS, []))
    structure = build_structure(read_deck(path)).structure
    assert [len(batch) for batch in structure.batches] == [2, 1, 1, 1]
    assert np.isfinite(assemble(structure, "stiffness").toarray()).all()
    path.write_text(changed(SOLIDS, []))
    structure = build_structure(read_deck(path)).structure
    assert [batch.kind for batch in structure.batches] == [
        "shear-panel", "hexa8", "penta6", "tetra10", "pyram5"
    ]  # fmt: skip
    assert all(len(batch) == 1 for batch in structure.batches)


@pytest.mark.quick(0, gate=48)
@pytest.mark.parametrize(("deck", "place"), [(deck, place) for deck in DECKS for place in PLACES[deck]])
def test_each_value_in_each_field(path: Path, deck: str, place: Place) -> None:
    for value in VALUES:
        check(path, changed(DECKS[deck], [(place, value)]))


@pytest.mark.slow
@pytest.mark.parametrize("deck", DECKS)
@given(data=st.data())
def test_fields_changed_at_random(path: Path, deck: str, data: st.DataObject) -> None:
    change = st.tuples(st.sampled_from(PLACES[deck]), st.sampled_from(VALUES))
    changes: Changes = data.draw(st.lists(change, min_size=2, max_size=5))
    check(path, changed(DECKS[deck], changes))
