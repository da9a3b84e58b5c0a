"""The pages of what is said about damping show the very message that a user gets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.model import Assignment, parametric_model
from femtune.model.damping import damping_by_mode, damping_table
from femtune.parameters import Parameter, ParameterSet

_BASE = (
    "MAT1,1,2.1+11,,.3,7850.\nPBAR,3,1,1.-3,2.-6,3.-6,4.-6\nPROD,8,1,1.-4\nPBAR,5,1,1.-3,2.-6,3.-6,4.-6\n"
    "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\n"
)
ERRORS = {
    "deck.damping-table": _BASE + "TABDMP1,4,CRIT\n,1.,.02,2.,.03\n",
}
NOTICES = {
    "deck.large-loss-factor": _BASE + "PARAM,G,3.\n",
    "deck.damping-matrix": f"SOL 108\nCEND\nB2PP = EXTRA\nBEGIN BULK\n{_BASE}ENDDATA\n",
    "deck.nonlinear-damper": _BASE + "PBUSH1D,4,1.,2.\n,SHOCKA,TABLE,.5\nCBUSH1D,1,4,1,2\n",
}

pytestmark = pytest.mark.usefixtures("empty_folder")


def _check(error: FemtuneError, code: str) -> None:
    assert error.code == code
    check_shown(code, error)


def _built(text: str) -> BuiltDeck:
    Path("deck.bdf").write_text(text)
    return build_structure(read_deck("deck.bdf"))


@pytest.mark.parametrize("code", ERRORS)
def test_page_shows_the_error_of_a_deck(code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _built(ERRORS[code])
    _check(caught.value, code)


OTHERS: dict[str, Callable[[], object]] = {
    "damping.table": lambda: damping_table([1.0, 3.0, 2.0], [0.1] * 3),
    "damping.quality": lambda: damping_table([1.0, 2.0], [20.0, 10.0], "Q").ratio([4.0]),
    "damping.too-few-modes": lambda: damping_by_mode([0.01, 0.02]).ratio([1.0, 2.0, 3.0]),
    "parameter.whole-model": lambda: parametric_model(
        _built(_BASE + "CROD,1,8,1,2\nCROD,2,8,1,2\nPARAM,G,.02\n").structure,
        ParameterSet((Parameter("p"),)),
        [Assignment("p", FieldRef("PARAM", 0, "G"), elements=frozenset({1}))],
    ),
}


@pytest.mark.parametrize("code", OTHERS)
def test_page_shows_the_error(code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        OTHERS[code]()
    _check(caught.value, code)


@pytest.mark.parametrize("code", NOTICES)
def test_page_shows_the_notice(code: str) -> None:
    notice = _built(NOTICES[code]).notices[-1]
    assert notice.code == code
    check_shown(code, notice)
