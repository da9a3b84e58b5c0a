"""The pages of errors found while a structure is built from a deck show the very message that a user gets."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, Notice, Where
from femtune.fem.fields import FieldRef
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.files.nastran.write import plan_edits

_BASE = (
    "MAT1,1,2.1+11,,.3,7850.\nPBAR,3,1,1.-3,2.-6,3.-6,4.-6\nPROD,8,1,1.-4\nPBAR,5,1,1.-3,2.-6,3.-6,4.-6\n"
    "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\n"
)
_BAR = "CBAR,7,3,1,2,0.,1.,0.\n"

_SOLID = _BASE + "GRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\nCTETRA,31,12,1,2,3,4\n"

_PLATE = _BASE + "GRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\nPSHELL,12,1,.1,1\nCQUAD4,31,12,1,2,3,4\n"
_TWO_PLATES = (
    "SOL 103\nCEND\nSPC = 1\nBEGIN BULK\nSPC1,1,123456,1,4\n"
    + _PLATE
    + "GRID,12,,1.,0.,0.\nGRID,13,,1.,1.,0.\nGRID,15,,2.,0.,0.\nGRID,16,,2.,1.,0.\nCQUAD4,32,12,12,15,16,13\nENDDATA\n"
)
_COMPLEX = "DMIG,JOINT,0,6,3,0\nDMIG,JOINT,2,3,,2,3,1.+5,2.+4\n"

DECKS = {
    "deck.complex-matrix": "SOL 103\nCEND\nM2GG = JOINT\nBEGIN BULK\n" + _BASE + _COMPLEX + "ENDDATA\n",
    "deck.superelement, itself": _BASE + "SECONCT,4,4\n,1,2\nBEGIN SUPER=4\n" + _BASE,
    "deck.unknown-grid": _BASE + "CBAR,7,3,1,22,0.,1.,0.\n",
    "deck.unknown-property": _BASE + "CBAR,7,4,1,2,0.,1.,0.\n",
    "deck.unknown-material": _BASE + "PBAR,12,11,1.-3\nCBAR,7,12,1,2,0.,1.,0.\n",
    "deck.unknown-coordinate-system": "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,1,6,0.,0.,0.\n",
    "deck.circular-coordinates": ("CORD2R,5,6,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nCORD2R,6,5,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"),
    "deck.degenerate-coordinates": "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,0.,0.,2.\n",
    "deck.duplicate-id": _BASE + _BAR + "CBAR,7,3,2,1,0.,1.,0.\n",
    "deck.superelement": _BASE + "SEMPLN,4,PLANE,1,2,3\n",
    "deck.superelement, type": _BASE + "SEBULK,4,EXTOP2,,MANUAL\n",
    "deck.superelement, no part": _BASE + "SEBULK,4,PRIMARY\n",
    "deck.superelement, number": _BASE + "BEGIN SUPER=two\n" + _BASE,
    "deck.superelement, not joined": _BASE
    + "BEGIN SUPER=4\n"
    + _BASE.replace(",0.,0.,0.", ",9.,0.,0.").replace(",1.,", ",8.,"),
    "deck.preload": "SOL 103\nCEND\nSUBCASE 1\nTEMP(LOAD) = 3\nSUBCASE 2\nMETHOD = 1\nSTATSUB(PRELOAD) = 1\n"
    "BEGIN BULK\nEIGRL,1,,,3\n" + _BASE + "ENDDATA\n",
    "deck.property-type": _BASE + "CBAR,7,8,1,2,0.,1.,0.\n",
    "deck.zero-length": _BASE + "CBAR,7,3,1,1,0.,1.,0.\n",
    "deck.orientation": _BASE + "CBAR,7,3,1,2,1.,0.,0.\n",
    "deck.material": _BASE.replace("2.1+11", "-2.1+11") + _BAR,
    "deck.section": _BASE + "PBARL,4,1,,DBOX\n,1.,2.,3.,4.\nCBAR,7,4,1,2,0.,1.,0.\n",
    "deck.missing-set": "SOL 103\nCEND\nSPC = 3\nBEGIN BULK\nGRID,1,,0.,0.,0.\nSPC1,1,123456,1\nENDDATA\n",
    "deck.unsupported-element": _BASE + "CTRIAX6,21,9,1,2,3,4,5,6\nCTRIAX6,22,9,1,2,3,4,5,6\n",
    "deck.connector": _BASE + "PWELD,9,1,.1\nCWELD,21,9,1,ELEMID\n,31,32\n",
    "deck.field-value": _BASE + "CELAS2,9,1.+5,1,12\n",
    "deck.fluid-point": "GRID,1,,0.,0.,0.,-1\n",
    "deck.offset-frame": _BASE + "CBAR,7,3,1,2,0.,1.,0.,EEG\n",
    "deck.shell-section": _BASE + "PSHELL,12,1,.1,-1\nCTRIA3,32,12,1,2,3\n",
    "deck.shell-corners": _BASE + "CQUAD4,31,12,1,2,3,2\nPSHELL,12,1,.1\n",
    "deck.solid-nodes": _BASE + "CHEXA,31,12,1,2,3,3,5,6\n,7,7\n",
    "deck.solid-section": _BASE + "PSOLID,12,1,,,,,PFLUID\nCTETRA,31,12,1,2,3,4\n",
    "deck.material-type": _BASE + "MAT8,2,2.,2.,.3,1.\nPROD,9,2,1.\nCROD,3,9,1,2\n",
    "deck.param": _BASE + "PARAM,COUPMASS,MAYBE\n",
}
NOTICES = {
    "deck.ignored-cards": _BASE + "FORCE,1,1,,10.,0.,0.,1.\nFORCE,1,2,,10.,0.,0.,1.\n",
    "deck.ignored-param": _BASE + "PARAM,POST,-1\n",
    "deck.repeated-grid": _BASE + "GRID,2,,1.,0.,0.\n",
    "deck.missing-set, 2": "SOL 103\nCEND\nMPC = 1\nBEGIN BULK\nGRID,1,,0.,0.,0.\nENDDATA\n",
    "deck.uneven-thickness": _BASE + "CTRIA3,32,12,1,2,3\n,,,.1,.2,.3\nPSHELL,12,1,,1\nGRID,3,,0.,1.,0.\n",
    "deck.no-warping": _BASE + "PBEAM,4,1,1.-3,2.-6,3.-6\n,,,,,,,,\n,,,,,,,1.-9\nCBEAM,7,4,1,2,0.,1.,0.\n",
    "deck.solid-integration": _SOLID + "PSOLID,12,1,,TWO\n",
    "deck.stiff-tetrahedra": _SOLID + "PSOLID,12,1\n",
    "deck.inconsistent-shear": _BASE.replace("2.1+11,,.3", "2.1+11,8.5+10,.3") + _BAR,
    "deck.inconsistent-shear, implied": _BASE.replace("2.1+11,,.3", "2.1+11,6.8+10,")
    + "CTRIA3,32,12,1,2,3\nPSHELL,12,1,.1,1,,1\nGRID,3,,0.,1.,0.\n",
    "deck.shared-number": _BASE + _BAR + "CONM2,7,2,,3.\n",
    "deck.implausible-ratio": _BASE.replace("2.1+11,,.3", "2.1+11,8.+10,3.") + _BAR,
    "deck.superelement, parts": _BASE + _BAR + "BEGIN SUPER=4\n" + _BASE + _BAR,
    "deck.superelement, again": _BASE + _BAR + "BEGIN SUPER=4\n" + _BASE + "BEGIN SUPER=4\n" + _BAR,
    "deck.other-section": _BASE + "BEGIN MASSID=4\nCONM2,9,2,,4.\n",
    "deck.unselected-set": _BASE + "MPC,7,99,1,1.,2,1,-1.\n",
    "deck.superelement, 2": _BASE + "SESET,1,1,2\n",
    "deck.linear-gap": _BASE + "PGAP,12,,,1.+6\nCGAP,7,12,1,2,0.,1.,0.\n",
    "deck.quad-rotations": _BASE + "CQUADR,31,12,1,2,3,4\nPSHELL,12,1,.1\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\n",
    "deck.surplus-field": _BASE + "CONM2,7,2,,3.,,,,5.\n",
    "deck.left-out": "SOL 103\nCEND\nSUBCASE 1\nLOAD = 3\nTEMP(LOAD) = 4\nSUBCASE 2\nMETHOD = 1\nSTATSUB(PRELOAD) = 1\n"
    "BEGIN BULK\nEIGRL,1,,,3\n" + _BASE + "ENDDATA\n",
    "deck.left-out, nonlinear": "SOL 106\nCEND\nMETHOD = 1\nPARAM,NMLOOP,1\nBEGIN BULK\nEIGRL,1,,,3\n"
    + _BASE
    + "ENDDATA\n",
    "deck.without-point": _BASE.replace("2.1+11", "21E10") + _BAR,
    "deck.turned-solids": _SOLID.replace("1,2,3,4", "1,3,2,4") + "PSOLID,12,1\n",
    "deck.coincident-points": _TWO_PLATES,
    "deck.free-part": _TWO_PLATES,
    "deck.repeated-elements": _PLATE + "CQUAD4,33,12,1,2,3,4\n",
    "deck.alternating-normals": _PLATE.replace("1,2,3,4", "1,2,3,4,,.1")
    + "GRID,5,,2.,0.,0.\nGRID,6,,2.,1.,0.\nCQUAD4,33,12,2,3,6,5,,.1\n",
    "deck.inactive-set": _BASE + "SPC1,7,123456,1\n",
    "deck.after-enddata": "SOL 103\nCEND\nBEGIN BULK\n" + _BASE + "ENDDATA\nCONM2,9,2,,4.\n",
    "deck.complex-matrix, damping": "SOL 103\nCEND\nK2GG = JOINT\nBEGIN BULK\n" + _BASE + _COMPLEX + "ENDDATA\n",
    "deck.superelement, near miss": _BASE + _BAR + "BEGIN SUPER=4\n" + _BASE.replace("1.,0.,0.", "1.,1.-3,0.") + _BAR,
    "deck.far-ends": _PLATE + "GRID,91,,9.,0.,0.\nCELAS2,33,1000.,2,3,91,3\n",
    "deck.negative-value": _BASE + "CONM2,9,2,,-4.\n",
    "deck.damping-doubtful": _BASE + "TABDMP1,4,CRIT\n,1.,1.,100.,2.,ENDT\n",
    "deck.enforced-displacement": _BASE + "SPC,1,2,3,.01\n",
}
_W = Where("study.toml", 31, "parameter[2]")

pytestmark = pytest.mark.usefixtures("empty_folder")


def _built(text: str, allow_missing: bool = False) -> BuiltDeck:
    Path("deck.bdf").write_text(text)
    return build_structure(read_deck("deck.bdf"), allow_missing, preloaded=not allow_missing)


def _check(error: FemtuneError, code: str) -> None:
    assert error.code == code
    check_shown(code, error)


@pytest.mark.parametrize("name", DECKS)
def test_page_shows_the_error(name: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _built(DECKS[name])
    assert caught.value.code == name.partition(",")[0]
    check_shown(name, caught.value)


def test_page_shows_the_rest_of_many_errors() -> None:
    with pytest.raises(FemtuneError) as caught:
        _built(_BASE + "".join(f"CBAR,{i},3,1,{i},0.,1.,0.\n" for i in range(100, 150)))
    _check(caught.value.errors[-1], "deck.more-problems")  # type: ignore[attr-defined]


def test_page_shows_a_check_that_failed() -> None:
    check_shown("deck.health-unknown", Notice("deck.health-unknown", where=Where("deck.bdf"), problem="ValueError"))


@pytest.mark.parametrize("name", NOTICES)
def test_page_shows_the_notice(name: str) -> None:
    code = name.partition(",")[0]
    notices = [n for n in _built(NOTICES[name], allow_missing=True).notices if n.code == code]
    notice = next(n for n in notices if "near miss" not in name or "just miss" in n.what)
    check_shown(name, notice)


@pytest.mark.parametrize(
    ("code", "text"),
    [
        ("study.unknown-field", "PBAR 3 I11"),
        ("parameter.derived-field", "MAT1 1 G"),
        ("parameter.touches-nothing", "PBAR 5 I1"),
    ],
)
def test_page_shows_the_error_of_a_field(code: str, text: str) -> None:
    built = _built(_BASE + _BAR)
    with pytest.raises(FemtuneError) as caught:
        resolve(built, parse_field_ref(text, _W), _W)
    _check(caught.value, code)


@pytest.mark.parametrize(
    ("code", "ref"),
    [("write.no-field", FieldRef("MAT1", 1, "G")), ("write.unknown-region", FieldRef("PBAR", 3, "I1", "legs"))],
)
def test_page_shows_the_error_of_writing(code: str, ref: FieldRef) -> None:
    built = _built(_BASE + _BAR)
    with pytest.raises(FemtuneError) as caught:
        plan_edits(built, {ref: 1.0}, {"legs": [7, 8]})
    _check(caught.value, code)


def test_page_shows_the_error_of_writing_in_a_part() -> None:
    built = _built(_BASE + _BAR + "BEGIN SUPER=4\n" + _BASE + _BAR)
    with pytest.raises(FemtuneError) as caught:
        plan_edits(built, {FieldRef("PBAR", 43, "I1", "legs"): 1.0}, {"legs": [47]})
    _check(caught.value, "write.superelement")


@pytest.mark.parametrize("value", ["0.0", "-1.0"])
def test_masses_are_not_multiplied_by_nothing(tmp_path: Path, value: str) -> None:
    (tmp_path / "deck.bdf").write_text(_BASE + _BAR + f"PARAM,WTMASS,{value}\n")
    with pytest.raises(FemtuneError) as caught:
        build_structure(read_deck(tmp_path / "deck.bdf"))
    assert caught.value.code == "deck.param"
    assert "above zero" in caught.value.what
