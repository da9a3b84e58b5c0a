"""Messages about the static preload of a deck."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.fem.offsets import with_offsets
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.deck import read_deck
from femtune.model import Configuration, configure, parametric_model
from femtune.model.over_frequency import frequency_table
from femtune.model.parametric import Assignment
from femtune.model.reduce.components import Components, divide
from femtune.parameters import Parameter, ParameterSet

CASE = (
    "SOL 103\nCEND\nSUBCASE 1\nSPC=1\nLOAD=3\nSUBCASE 2\nSPC=1\nMETHOD=5\nSTATSUB(PRELOAD)=1\nBEGIN BULK\nEIGRL,5,,,3\n"
)
BARS = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.,0.,0.
CBAR,1,1,1,2,0.,1.,0.
,,,0.,.1,0.,0.,.1,0.
CBAR,2,1,2,3,0.,1.,0.
PBAR,1,1,1.-3,1.-6,1.-6,1.-6
MAT1,1,2.1+11,,.3,7850.
"""
FORCE = "FORCE,3,3,,100.,1.,0.,0.\n"
HELD = "SPC1,1,123456,1\n"

pytestmark = pytest.mark.usefixtures("empty_folder")


def _built(cards: str) -> BuiltDeck:
    Path("deck.bdf").write_text(CASE + BARS + cards + "ENDDATA\n")
    return build_structure(read_deck("deck.bdf"))


NOTICES = {
    "deck.preload-solved": HELD + FORCE,
    "deck.following-load": HELD + "FORCE1,3,3,100.,2,3\n",
    "deck.no-differential": HELD + FORCE + "CSHEAR,9,9,1,2,3,4\nPSHEAR,9,1,.001\nGRID,4,,1.,1.,0.\n",
}


@pytest.mark.parametrize("code", NOTICES)
def test_page_shows_the_notice(code: str) -> None:
    check_shown(code, next(n for n in _built(NOTICES[code]).notices if n.code == code))


def _configured(code: str) -> None:
    cards = FORCE + ("SPC1,1,23456,1\n" if code.endswith("not-held") else HELD)
    parameters, assignments, tables = ParameterSet(()), [], []
    if code.endswith("offsets"):
        parameters = ParameterSet((Parameter("offset", lower=0.5, upper=2.0),))
        assignments = [Assignment("offset", FieldRef("CBAR", 1, "W2A"))]
    if code.endswith("tables"):
        tables = [frequency_table([FieldRef("MAT1", 1, "E")], [0.0, 100.0], [1.0, 2.0])]
    structure = _built(cards).structure
    if code.endswith("offsets"):
        structure = with_offsets(structure, [1])
    model = parametric_model(structure, parameters, assignments, tables)
    configured = configure(model, Configuration())
    divide(configured, Components({"first": frozenset({1}), "second": frozenset({2})}))


@pytest.mark.parametrize("problem", ["not-held", "offsets", "tables", "components"])
@pytest.mark.quick(2)
def test_page_shows_the_error(problem: str) -> None:
    code = f"configuration.preload-{problem}"
    with pytest.raises(FemtuneError) as caught:
        _configured(code)
    assert caught.value.code == code
    check_shown(code, caught.value)
