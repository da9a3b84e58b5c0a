"""Shell decks with any field changed at random: a structure, or an error that names the place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.fem.assemble import assemble
from femtune.files.nastran import build_structure, read_deck

from .hostile_fields import VALUES, Changes, Place, changed, check, places

CARDS = (
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
PLACES = places(CARDS)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "deck.bdf"


def test_the_deck_is_sound(path: Path) -> None:
    path.write_text(changed(CARDS, []))
    structure = build_structure(read_deck(path)).structure
    assert [len(batch) for batch in structure.batches] == [2, 1, 1, 1]
    assert np.isfinite(assemble(structure, "stiffness").toarray()).all()


@pytest.mark.quick(0, gate=24)
@pytest.mark.parametrize("place", PLACES)
def test_each_value_in_each_field(path: Path, place: Place) -> None:
    for value in VALUES:
        check(path, changed(CARDS, [(place, value)]))


@pytest.mark.slow
@given(changes=st.lists(st.tuples(st.sampled_from(PLACES), st.sampled_from(VALUES)), min_size=2, max_size=5))
def test_fields_changed_at_random(path: Path, changes: Changes) -> None:
    check(path, changed(CARDS, changes))
