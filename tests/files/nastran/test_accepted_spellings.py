"""Numbers, lines and files that commercial programs accept although manuals describe them otherwise."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, build_structure, read_deck
from femtune.files.nastran.edit import edit_fields
from femtune.files.nastran.inventory import IGNORED, MISSING, take_inventory, use_of
from femtune.files.nastran.lines import parse_number, parse_real
from femtune.files.study_file.reading import is_deck

from .solving import frequencies

DeckOf = Callable[..., Deck]
HEAD = "SOL 103\nCEND\nSPC = 1\nMETHOD = 1\nBEGIN BULK\nEIGRL,1,,,3\n"
BAR = (
    "GRID,1,,0.,0.,0.\nGRID,2,,2.,0.,0.\nCBAR,1,1,1,2,0.,1.,0.\nPBAR,1,1,1.-4,1.-8,2.-8,2.-8\nMAT1,1,70.+9,,.3,2700.\n"
    "SPC1,1,123456,1\n"
)
DECK = HEAD + BAR + "ENDDATA\n"


@pytest.mark.parametrize(
    ("text", "value"),
    [("0", 0.0), ("2e+11", 2e11), ("70E6", 70e6), ("-3D2", -300.0), ("5", 5.0), ("2+3", 2000.0), ("1.5-3", 1.5e-3)],
)
def test_numbers_without_decimal_point(text: str, value: float) -> None:
    assert parse_number(text) == value
    assert (parse_real(text) is None) == ("." not in text)


@pytest.mark.parametrize("text", ["", "E5", "1E", "GA", "1e400", "--5", "1 5"])
def test_texts_that_are_no_numbers(text: str) -> None:
    assert parse_number(text) is None


def test_a_deck_with_such_numbers_has_one_notice(deck_of: DeckOf) -> None:
    right = build_structure(deck_of(DECK))
    spelled = DECK.replace("70.+9", "70E9").replace("2.,0.,0.", "2.,0,0").replace("2700.", "2700")
    read = build_structure(deck_of(spelled))
    np.testing.assert_array_equal(frequencies(read.structure), frequencies(right.structure))
    (notice,) = [n for n in read.notices if n.code == "deck.without-point"]
    # that of a grid point with zeros is not the one that is shown
    assert "70E9 in field 3 of MAT1 1" in notice.what or "2700 in field 6 of MAT1 1" in notice.what
    assert "2 cards" in notice.what
    assert not [n for n in right.notices if n.code == "deck.without-point"]


def test_a_zero_alone_is_a_remark_and_an_integer_a_warning(deck_of: DeckOf) -> None:
    levels = {}
    for text in ("0", "2"):
        model = build_structure(deck_of(DECK.replace("GRID,2,,2.,0.", f"GRID,2,,2.,{text}")))
        levels[text] = [n.level for n in model.notices if n.code == "deck.without-point"]
    assert levels == {"0": ["info"], "2": ["warning"]}


def test_large_decks_read_numbers_without_point_by_columns(deck_of: DeckOf) -> None:
    grids = "".join(f"GRID    {i:8d}        {i:<8d}0       0       \n" for i in range(1, 202))
    nodes = build_structure(deck_of(grids)).structure.nodes
    np.testing.assert_array_equal(nodes.xyz[:, 0], np.arange(1.0, 202.0))


POINTS = "".join(f"GRID,{i},,{i}.,0.,0.\n" for i in range(1, 12))


@pytest.mark.parametrize("name", ["+000001", "+A", "0000017", "*X", "A1"])
def test_names_of_continuations_in_columns_74_to_80(deck_of: DeckOf, name: str) -> None:
    first = f"{'SPC1    1       123     1       2       3       4       5       6':<73}{name}\n"
    for marked in (f"+{name}", f"+{name[1:]}"):
        held = build_structure(deck_of(POINTS + first + f"{marked:<8}7       8\n")).structure.support_sets[1]
        assert len(held) == 3 * 8


def test_a_continuation_of_such_a_name_may_be_elsewhere(deck_of: DeckOf) -> None:
    first = f"{'SPC1    1       123     1       2       3       4       5       6':<73}+12\n"
    deck = deck_of(first + POINTS + f"{'++12':<8}7\n")
    assert len(build_structure(deck).structure.support_sets[1]) == 3 * 7


def test_free_field_lines_continue_after_nine_fields(deck_of: DeckOf) -> None:
    """The example of the manual: SPC1,100,12456,1,2,3,4,5,6,7,8,9,10."""
    deck = deck_of(POINTS + "SPC1,100,12456,1,2,3,4,5,6,7,8,9,10\n")
    assert len(build_structure(deck).structure.support_sets[100]) == 5 * 10
    (card,) = deck.by_name("SPC1")
    assert card.field_name(8) == "field 2 of continuation 1"
    assert card.where(11).line == 12


def test_long_free_field_lines_in_large_field(deck_of: DeckOf) -> None:
    (card,) = deck_of("MAT1*,1,2.+11,,.3,7800.,1.-5,20.,.01,1.+8\n").cards
    assert card.fields == ("1", "2.+11", "", ".3", "7800.", "1.-5", "20.", ".01", "1.+8")


@pytest.mark.parametrize(("index", "value"), [(1, 2.5e11), (4, 7801.0), (8, 1 / 3), (10, 6e7)])
@pytest.mark.parametrize("wide", [False, True])
def test_long_free_field_lines_are_written_back(deck_of: DeckOf, index: int, value: float, wide: bool) -> None:
    deck = deck_of("MAT1,1,2.+11,,.3,7800.,1.-5,20.,.01,1.+8,1.+8,5.+7\n")
    edited = edit_fields(deck, {(0, index): value}, wide=wide)
    (text,) = edited.texts.values()
    (before,), (after,) = deck.cards, deck_of(text).cards
    assert after.real(index) == pytest.approx(value, rel=1e-15 if wide else 1e-6)
    others = [i for i in range(len(before.fields)) if i not in (index, 2)]
    assert [after.real(i) if i else 1.0 for i in others] == [before.real(i) if i else 1.0 for i in others]


def test_a_tenth_field_that_is_a_number_is_told(deck_of: DeckOf) -> None:
    """It is the name of a continuation, so that a point is lost."""
    model = build_structure(deck_of(POINTS + "SPC1,1,123,1,2,3,4,5,6,7\n"))
    assert len(model.structure.support_sets[1]) == 3 * 6
    assert any(n.code == "deck.surplus-field" and "field 10 = '7'" in n.what for n in model.notices)


@pytest.mark.parametrize("end", ["ENDDATA", "", "\n"])
def test_the_end_of_a_deck(deck_of: DeckOf, end: str) -> None:
    """Without a line end, without ENDDATA, without both."""
    text = HEAD + BAR + end if end else (HEAD + BAR).rstrip("\n")
    model = build_structure(deck_of(text))
    np.testing.assert_array_equal(frequencies(model.structure), frequencies(build_structure(deck_of(DECK)).structure))
    notices = [n for n in model.notices if n.code == "deck.no-enddata"]
    assert len(notices) == (end != "ENDDATA")
    assert all(("no line end" in n.what) == (end == "") for n in notices)


@pytest.mark.parametrize("suffix", ["inp", "fem", "blk", "txt", ""])
def test_decks_are_recognised_by_their_content(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"model.{suffix}".rstrip(".")
    path.write_text("$ a comment\n" * 30 + DECK)
    assert is_deck(path)
    path.write_text(BAR)
    assert is_deck(path)


@pytest.mark.parametrize(
    "text", ["[study]\ntitle = 'a'\n", "    -1\n   151\n a\n    -1\n", "freq,value\n1.0,2.0\n", "", "a b c\n"]
)
def test_other_files_are_not(tmp_path: Path, text: str) -> None:
    path = tmp_path / "model.inp"
    path.write_text(text)
    assert not is_deck(path)
    assert not is_deck(tmp_path / "absent.inp")
    assert not is_deck(tmp_path)


FOREIGN = {
    "CalculiX": "**\n** a beam\n*HEADING\nModel\n*NODE,NSET=NALL\n1,0.,0.,0.\n",
    "Abaqus": "*Heading\n** Job name: a\n*Part, name=PART-1\n",
    "Ansys": "/COM,ANSYS RELEASE 2019 R2\n/PREP7\nET,1,186\n",
    "Ansys commands": "! a plate\nET,1,SHELL181\nMP,EX,1,2e11\n",
}


@pytest.mark.parametrize("text", FOREIGN.values(), ids=FOREIGN)
@pytest.mark.parametrize("suffix", ["inp", "dat", "cdb"])
def test_inputs_of_other_programs_are_told(tmp_path: Path, text: str, suffix: str) -> None:
    path = tmp_path / f"model.{suffix}"
    path.write_text(text)
    with pytest.raises(FemtuneError, match="Abaqus, CalculiX or Ansys") as caught:
        ft.info(path)
    assert caught.value.code == "deck.other-program"
    assert "[[matrix]]" in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["EIGRL,1,,,250000", "EIGR,1,LAN,,,,250000", "EIGRL,1,,1.+30", "EIGRL,1,,,-4"])
def test_more_modes_than_there_can_be(tmp_path: Path, method: str) -> None:
    path = tmp_path / "deck.bdf"
    path.write_text(DECK.replace("EIGRL,1,,,3", method))
    assert len(ft.modes(path).frequencies) >= 3


def test_a_complex_stiffness_is_stiffness_and_structural_damping(deck_of: DeckOf) -> None:
    joint = "DMIG,JOINT,0,6,3,0\nDMIG,JOINT,2,3,,2,3,1.+5,2.+4\n"
    complex_deck = DECK.replace("SPC = 1\n", "SPC = 1\nK2GG = 2.0*JOINT\n").replace("ENDDATA\n", joint + "ENDDATA\n")
    model = build_structure(deck_of(complex_deck))
    (stiffness, damping) = model.structure.assembled
    assert (stiffness.kind, damping.kind) == ("stiffness", "hysteretic")
    assert (stiffness.upper.sum(), damping.upper.sum()) == (1e5, 2e4)
    real = joint.replace("6,3,0", "6,1,0").replace(",2.+4", "")
    other = build_structure(deck_of(complex_deck.replace(joint, real)))
    np.testing.assert_array_equal(frequencies(model.structure), frequencies(other.structure))
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(complex_deck.replace("K2GG", "M2GG")))
    assert caught.value.code == "deck.complex-matrix"


@pytest.mark.parametrize("name", ["CNGRNT", "CAERO7", "CORD3G", "CSCHD", "CONTRLT", "CYJOIN", "COMPUDS", "CTABLE"])
def test_cards_that_begin_with_c_and_are_no_elements(name: str) -> None:
    assert use_of(name) == IGNORED


@pytest.mark.parametrize("name", ["CTRIAX6", "CQUADX4", "CHACAB", "CSEAM", "CBEAM3", "CRAC2D"])
def test_elements_that_are_not_read(name: str) -> None:
    assert use_of(name) == MISSING


@pytest.mark.parametrize(
    ("card", "element"),
    [("CABC,91,1,1,2", True), ("CABC,91,1,1,91", False), ("CQAUD4,91,1,1,2,3,1", True), ("CONTOPT,1,2,3,4", False)],
)
def test_an_unknown_card_is_an_element_if_it_refers_to_grid_points(deck_of: DeckOf, card: str, element: bool) -> None:
    (use,) = (
        u.use
        for u in take_inventory(deck_of(DECK.replace("ENDDATA", f"{card}\nENDDATA")))
        if u.name == card.partition(",")[0]
    )
    assert (use == MISSING) is element


def test_cyclic_symmetry_is_told(deck_of: DeckOf) -> None:
    """A segment is not the whole structure."""
    model = build_structure(deck_of(DECK.replace("ENDDATA", "CYJOIN,1,,1\nCYJOIN,2,,2\nENDDATA")))
    (notice,) = [n for n in model.notices if n.code == "deck.ignored-cards"]
    assert notice.level == "warning"
    assert "one segment, whose sides are free" in notice.what


def test_a_restart_has_no_model(tmp_path: Path) -> None:
    path = tmp_path / "deck.bdf"
    path.write_text(
        "RESTART VERSION=1,KEEP\nASSIGN MASTER='run.MASTER'\nSOL 103\nCEND\nMETHOD=2\nBEGIN BULK\nEIGRL,2\nENDDATA\n"
    )
    with pytest.raises(FemtuneError) as caught:
        ft.modes(path)
    assert caught.value.code == "deck.no-points"


@pytest.mark.parametrize("solution", ["SOL 3", "SOL 3,0", "SOL 24", "APP DISP\nSOL 25,1", "SOL 3\nALTER 9 $\nENDALTER"])
def test_old_rigid_formats(deck_of: DeckOf, solution: str) -> None:
    old = "ID A,B\nTIME 5\n" + DECK.replace("SOL 103", solution).replace("EIGRL,1,,,3", "EIGR,1,INV,0.,1.+4,3,3")
    model = build_structure(deck_of(old))
    np.testing.assert_array_equal(frequencies(model.structure), frequencies(build_structure(deck_of(DECK)).structure))


def test_cards_after_the_end_of_an_include(deck_of: DeckOf) -> None:
    main = HEAD + BAR.replace("SPC1", "INCLUDE 'more.bdf'\nSPC1") + "ENDDATA\n"
    deck = deck_of(main, more="$ masses\nCONM2,7,2,,1.\nENDDATA\nCONM2,8,2,,2.\n")
    (notice,) = [n for n in deck.notices if n.code == "deck.after-enddata"]
    assert "2 lines after ENDDATA in more.bdf, line 3, are not read" in notice.what
    assert notice.level == "warning"
    assert notice.where is not None
    assert notice.where.line == 4
    deck = deck_of(main, more="CONM2,7,2,,1.\n")
    assert [n.code for n in deck.notices] == []
    assert read_deck(deck.path).source.unread == ()
