"""Whatever stands in a file: a deck, or an error that names the place; never anything else."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from femtune.errors import FemtuneError
from femtune.files.nastran import edit_fields, read_deck

DECK = b"""SOL 103
CEND
SPC = 1
SET 4 = 1 THRU 9 EXCEPT 5
SUBCASE 1
BEGIN BULK
GRID,1,,0.,0.,0.
=,*(1),=,*(.5),==
=(2)
MAT1*   1               2.1+5                           .3
*       7.85-9
PBAR           1       1    100.    200.    300.                        +A
+A           1.5
INCLUDE 'part.bdf'
ENDDATA
"""
CHARACTERS = b" ,+*=$\n\r\t\"'A1.-(\xe9\xb2\x00"


def _read_and_edit(path: Path) -> None:
    with contextlib.suppress(FemtuneError):
        deck = read_deck(path)
        assert deck.files[0].text.encode("latin-1") == path.read_bytes()
        edit_fields(deck, {(card.position, 9): 0.125 for card in deck.cards if not card.replicated})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "part.bdf").write_text("CBAR,1,1,1,2,0.,0.,1.\n")
    return tmp_path


def test_the_deck_is_sound(folder: Path) -> None:
    (folder / "deck.bdf").write_bytes(DECK)
    assert len(read_deck(folder / "deck.bdf").cards) == 7


@pytest.mark.slow
def test_cut_at_every_byte(folder: Path) -> None:
    for length in range(len(DECK)):
        (folder / "deck.bdf").write_bytes(DECK[:length])
        _read_and_edit(folder / "deck.bdf")


@pytest.mark.slow
def test_a_cut_behind_begin_bulk_is_never_silent(folder: Path) -> None:
    for length in range(DECK.index(b"GRID"), DECK.index(b"ENDDATA") + 6):
        (folder / "deck.bdf").write_bytes(DECK[:length])
        try:
            codes = [notice.code for notice in read_deck(folder / "deck.bdf").notices]
        except FemtuneError:
            continue
        assert "deck.no-enddata" in codes


@given(changes=st.lists(st.tuples(st.integers(0, len(DECK) - 1), st.sampled_from(CHARACTERS)), max_size=6))
@example(changes=[(4, 0xB2)])
def test_bytes_changed_at_random(folder: Path, changes: list[tuple[int, int]]) -> None:
    raw = bytearray(DECK)
    for at, byte in changes:
        raw[at] = byte
    (folder / "deck.bdf").write_bytes(raw)
    _read_and_edit(folder / "deck.bdf")


@pytest.mark.parametrize(
    "text",
    [
        "SOL " + "9" * 5000 + "\nCEND\nSPC = " + "9" * 5000 + "\nBEGIN BULK\nENDDATA\n",
        "BEGIN SUPER=" + "9" * 5000 + "\nGRID," + "9" * 5000 + "\n",
        "SOL 1\nCEND\nSET " + "9" * 5000 + " = 1\nBEGIN BULK\nENDDATA\n",
        "INCLUDE '" + "x" * 5000 + "'\n",
        "INCLUDE '" + "../" * 2000 + "x'\n",
        "GRID,1,," + "1" * 400 + ".\n=,*(1),,*(1.),==\n",
    ],
)
def test_numbers_and_paths_beyond_all_measure(folder: Path, text: str) -> None:
    (folder / "deck.bdf").write_text(text)
    _read_and_edit(folder / "deck.bdf")


def test_begin_alone_starts_the_bulk_data(folder: Path) -> None:
    (folder / "deck.bdf").write_text("SOL 103\nCEND\nBEGIN\nGRID,1\nENDDATA\n")
    assert [card.name for card in read_deck(folder / "deck.bdf").cards] == ["GRID"]
