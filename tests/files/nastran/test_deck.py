"""Whole decks: sections, INCLUDEs, case control, parameters, and decks that other programs wrote."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, edit_fields, read_deck, write_deck

DeckOf = Callable[..., Deck]
REAL_DECKS = (
    "001_ten_bar_truss/modes.dat",
    "001_ten_bar_truss/static.dat",
    "001_ten_bar_truss/tenBar.bdf",
    "002_svanberg_beam/modes.dat",
    "003_svanberg_bar/barmat.dat",
    "003_svanberg_bar/barmat.pch",
    "003_svanberg_bar/modes.dat",
    "004_72_bar_truss/modes.dat",
    "004_72_bar_truss/static.dat",
    "actuator_tf_modeling.bdf",
    "beam_modes.dat",
    "cantilever_bar_reduction/no_super/dynamicReduction.dat",
    "cantilever_bar_reduction/no_super/guyanReduction.dat",
    "cantilever_bar_reduction/no_super/noReduction.dat",
    "cantilever_bar_reduction/part_super_cb/cbSuper1Mode.dat",
    "cantilever_bar_reduction/part_super_cb/cbSuper3Modes.dat",
    "cantilever_bar_reduction/part_super_guyan/guyanSuper.dat",
    "cbarao_cbeam.blk",
    "cbush.dat",
    "plate_py.dat",
    "pt145.bdf",
    "random_test_bar_plus_tri.bdf",
    "satk.dat",
    "solid_shell_bar/mode_solid_shell_bar.bdf",
    "solid_shell_bar/static_solid_shell_bar_kelm.bdf",
    "tet10.bdf",
    "trunc_cyl_shell.nas",
)


@pytest.mark.parametrize("name", REAL_DECKS)
def test_real_deck_goes_back_byte_for_byte(nastran_decks: Path, tmp_path: Path, name: str) -> None:
    deck = read_deck(nastran_decks / name)
    for file in deck.files:
        assert file.text.encode("latin-1") == Path(file.file).read_bytes()
    written = write_deck(edit_fields(deck, {}), tmp_path / "run")
    again = read_deck(written.main)
    assert [(card.name, card.fields) for card in again.cards] == [(card.name, card.fields) for card in deck.cards]
    if not deck.source.includes:
        assert written.main.read_bytes() == (nastran_decks / name).read_bytes()
    assert len(written.files) == 1


@pytest.mark.parametrize("name", REAL_DECKS)
def test_real_deck_has_all_its_cards(nastran_decks: Path, name: str) -> None:
    found = Counter(card.name for card in read_deck(nastran_decks / name).cards)
    assert found == _plain_count(nastran_decks / name)


def _plain_count(path: Path) -> Counter[str]:
    """Cards counted by a few regular expressions, apart from the reader."""
    text = _with_includes(path)
    text = re.split(r"(?m)^BEGIN\s+BULK.*$", text)[-1]
    text = re.split(r"(?mi)^ENDDATA", text)[0]
    names = re.findall(r"(?mi)^(?!BEGIN\b)([A-Z][A-Z0-9]{1,7}?)(?=[ ,*\t]|$|(?<=^.{8}))", text)
    return Counter(name.upper() for name in names)


def _with_includes(path: Path) -> str:
    text = path.read_bytes().decode("latin-1").replace("\r\n", "\n")
    return re.sub(
        r"(?m)^INCLUDE '(.*)'.*$", lambda m: _with_includes(path.parent / m[1].replace("\\", "/")) + "\n", text
    )


@pytest.mark.parametrize(
    ("name", "solution", "spc", "mpc", "method"),
    [
        ("satk.dat", 103, 100, None, 103),
        ("pt145.bdf", 145, 1, None, 10),
        ("beam_modes.dat", 103, 1, None, 1),
        ("random_test_bar_plus_tri.bdf", 111, 1, 1, 1),
        ("actuator_tf_modeling.bdf", 110, None, 100, 301),
        ("trunc_cyl_shell.nas", None, None, None, None),
    ],
)
def test_real_case_control(
    nastran_decks: Path, name: str, solution: int | None, spc: int | None, mpc: int | None, method: int | None
) -> None:
    deck = read_deck(nastran_decks / name)
    case = deck.case_control
    assert (deck.executive.solution_number, case.spc, case.mpc, case.method) == (solution, spc, mpc, method)


def test_real_deck_without_its_includes(nastran_decks: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        read_deck(nastran_decks / "bah_plane.bdf")
    assert caught.value.code == "deck.missing-include"
    assert caught.value.where is not None
    assert caught.value.where.line == 29
    assert caught.value.values["looked for"].endswith("nastran_decks/structure_bah.inc")


def test_all_cards_of_an_included_file_take_its_place(deck_of: DeckOf) -> None:
    deck = deck_of("GRID,1\nINCLUDE 'part.bdf' $ here\nGRID,4\n", part="include more.bdf\nGRID,3\n", more="GRID,2")
    assert [card.integer(0) for card in deck.cards] == [1, 2, 3, 4]
    assert [Path(file.file).name for file in deck.files] == ["deck.bdf", "part.bdf", "more.bdf"]


@pytest.mark.parametrize(
    "statement",
    ["INCLUDE 'part.bdf'", 'include "part.bdf"', "INCLUDE part.bdf $ x", "INCLUDE='part.bdf'", "INCLUDE 'pa\n  rt.bdf'",
     "INCLUDE '.\\part.bdf'", "INCLUDE ./,\n part.bdf"],
)  # fmt: skip
def test_spellings_of_include(deck_of: DeckOf, statement: str) -> None:
    deck = deck_of(f"GRID,1\n{statement}\nGRID,3\n", part="GRID,2\n")
    assert [card.integer(0) for card in deck.cards] == [1, 2, 3]


def test_includes_in_executive_and_case_control(deck_of: DeckOf) -> None:
    deck = deck_of("INCLUDE 'a.bdf'\nCEND\nINCLUDE 'b.bdf'\nBEGIN BULK\nGRID,1\nENDDATA\n", a="SOL 103\n", b="SPC=4\n")
    assert deck.executive.solution_number == 103
    assert deck.case_control.spc == 4


def test_what_follows_enddata_is_kept_and_not_read(deck_of: DeckOf) -> None:
    deck = deck_of("SOL 103\nCEND\nBEGIN BULK\nGRID,1\nenddata 57f630d0\nGRID,2\nINCLUDE 'nowhere'\n")
    assert [card.integer(0) for card in deck.cards] == [1]
    assert deck.files[0].text.endswith("INCLUDE 'nowhere'\n")


def test_first_subcase_over_global_level(deck_of: DeckOf) -> None:
    text = """SOL SEMODES $ modes
CEND
TITLE = One, two,
SUBT = below
SPC = 1
METHOD(STRUCTURE) = 10
SET 5 = 1, 2,
   10 THRU 12
OUTPUT(PLOT)
SET 6 = AERO1
SPC = 99
SUBCASE 7
  SPC = 2
  MPC 3
  DISP(PLOT) = ALL
SUBCASE 8
  SPC = 4
  METHOD = 11
BEGIN BULK
ENDDATA"""
    case = deck_of(text).case_control
    assert (case.spc, case.mpc, case.method) == (2, 3, 10)
    assert (case.title, case.subtitle) == ("One, two,", "below")
    assert case.sets[5].expand() == (1, 2, 10, 11, 12)
    assert (case.subcases, case.used) == ((7, 8), 7)
    assert Counter(command.name for command in case.others) == {"OUTPUT": 1, "SET": 1, "SPC": 1, "DISP": 1}
    assert [notice.code for notice in case.notices] == ["deck.several-subcases"]


def test_params_last_one_counts_and_case_control_before_bulk(deck_of: DeckOf) -> None:
    head = "SOL 103\nCEND\nPARAM,WTMASS,.5\nBEGIN BULK\n"
    deck = deck_of(head + "PARAM,GRDPNT,0\nPARAM,WTMASS,1.\nPARAM   GRDPNT         5\nENDDATA\n")
    assert (deck.params["GRDPNT"].value, deck.params["WTMASS"].value) == ("5", ".5")
    assert [notice.code for notice in deck.notices] == ["deck.repeated-param", "deck.repeated-param"]
    assert deck.params["GRDPNT"].card.where().line == 7


def test_superelements_are_marked(deck_of: DeckOf) -> None:
    deck = deck_of("BEGIN BULK\nGRID,1\nBEGIN SUPER=3\nGRID,1\nBEGIN BULK\nGRID,2\nENDDATA\n")
    assert [card.superelement for card in deck.cards] == [0, 3, 0]
    assert deck.notices == ()


@pytest.mark.parametrize("line", ["BEGIN BULK SUPER=3", "begin bulk super = 3 ", "BEGIN BULK,SUPER=3", "BEGIN SUPER 3"])
def test_superelements_in_the_form_with_bulk(deck_of: DeckOf, line: str) -> None:
    deck = deck_of(f"BEGIN BULK\nGRID,1\n{line}\nGRID,1\nBEGIN BULK SUPER=0\nGRID,2\nENDDATA\n")
    assert [card.superelement for card in deck.cards] == [0, 3, 0]


@pytest.mark.parametrize("line", ["BEGIN SUPER=3 MASSID=300", "BEGIN MASSID=2", "BEGIN AUXMODEL=3"])
def test_sections_that_are_no_part_of_the_model(deck_of: DeckOf, line: str) -> None:
    deck = deck_of(f"BEGIN BULK\nGRID,1\n{line}\nGRID,1\nBEGIN BULK SUPER=0\nGRID,2\nENDDATA\n")
    assert [card.text(0) for card in deck.by_name("GRID")] == ["1", "2"]
    assert (deck.parts, [line.number for line in deck.aside]) == ({}, [3])


def test_deck_without_cend(deck_of: DeckOf) -> None:
    deck = deck_of("SOL 103\nSPC = 3\nBEGIN BULK\nGRID,1\nENDDATA\n")
    assert (deck.executive.solution_number, deck.case_control.spc) == (103, 3)


def test_missing_enddata_is_noticed(deck_of: DeckOf) -> None:
    assert [notice.code for notice in deck_of("BEGIN BULK\nGRID,1\n").notices] == ["deck.no-enddata"]
    assert deck_of("GRID,1\n").notices == ()
    assert deck_of("").cards == ()


def test_byte_order_mark_is_kept_and_not_read(deck_of: DeckOf) -> None:
    deck = deck_of("\u00ef\u00bb\u00bfGRID,1\n$ caf\u00e9\n")
    assert deck.cards[0].name == "GRID"
    assert deck.files[0].text.startswith("\u00ef\u00bb\u00bfGRID")
