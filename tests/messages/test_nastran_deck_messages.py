"""What a user reads when a deck cannot be read or written: the place, the values and the fix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.files.nastran import edit_fields, read_deck, write_deck


def _message(action: Callable[[], object], folder: Path) -> str:
    with pytest.raises(FemtuneError) as caught:
        action()
    return str(caught.value).replace(f"{folder}/", "")


def _deck(folder: Path, content: str | bytes) -> Path:
    path = folder / "deck.bdf"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("latin-1"))
    return path


READING = {
    "deck.missing-include": "GRID,1\nINCLUDE 'plate.inc'\n",
    "deck.circular-include": "INCLUDE 'deck.bdf'\n",
    "deck.truncated, no closing quote": "GRID,1\nINCLUDE 'plate",
    "deck.truncated, no BEGIN BULK": "SOL 103\nCEND\nSPC = 1\n",
    "deck.truncated, in the middle of a card": "PBAR,1,2,3.,4.,5.,6.,,,+A",
    "deck.continuation": "+,1.\n",
    "deck.continuation, another name": "PBAR,1,2,,,,,,,+A\n+B,1.\n",
    "deck.continuation, repeated": "PBAR,1,2,,,,,,,+A\n+A,1.\n+A,2.\n",
    "deck.continuation, two of a name": "PBAR,1,2,,,,,,,+A\nPROD,1,2\n+A,1.\n+A,2.\n",
    "deck.continuation, ambiguous": "PBAR,1,2,,,,,,,+A\nPBAR,2,2,,,,,,,+A\nPROD,1,2\n+A,1.\n",
    "deck.card-name": "Dear reader\n",
    "deck.too-many-fields": "GRID,1,2,3.,4.,5.,6,7,8,+A,10\n",
    "deck.replication": "=,*(1)\n",
    "deck.decimal-comma": "MAT1           1  2,1+11             0,3   7850.\n",
    "deck.case-control": "SOL 103\nCEND\nSPC = one\nBEGIN BULK\nENDDATA\n",
    "deck.list": "SOL 103\nCEND\nSET 1 = 5 THRU 3\nBEGIN BULK\nENDDATA\n",
    "deck.other-program": "** a beam\n*NODE, NSET=NALL\n1, 0., 0., 0.\n",
    "deck.not-text": b"GRID\x00\x00\x07,1",
}


@pytest.mark.parametrize("case", READING)
def test_reading(tmp_path: Path, case: str) -> None:
    path = _deck(tmp_path, READING[case])
    message = _message(lambda: read_deck(path), tmp_path)
    assert message.startswith(f"[{case.partition(',')[0]}]")
    check_shown(case, message)


def test_includes_without_end(tmp_path: Path) -> None:
    for level in range(102):
        (tmp_path / f"{level}.inc").write_text(f"INCLUDE '{level + 1}.inc'\n")
    check_shown("deck.too-many-includes", _message(lambda: read_deck(tmp_path / "0.inc"), tmp_path))


def test_no_such_deck(tmp_path: Path) -> None:
    check_shown("deck.not-found", _message(lambda: read_deck(tmp_path / "deck.bdf"), tmp_path))


def test_a_folder_is_no_deck(tmp_path: Path) -> None:
    (tmp_path / "deck.bdf").mkdir()
    check_shown("deck.unreadable", _message(lambda: read_deck(tmp_path / "deck.bdf"), tmp_path))


def test_misspelt_include(tmp_path: Path) -> None:
    (tmp_path / "Plate.INC").write_text("GRID,1\n")
    path = _deck(tmp_path, "INCLUDE 'plate.inc'\n")
    assert "hint: did you mean 'Plate.INC'?" in _message(lambda: read_deck(path), tmp_path)


FIELDS = {
    "deck.not-an-integer": lambda card: card.integer(2),
    "deck.not-a-real": lambda card: card.real(9),
    "deck.not-a-component": lambda card: card.component(10),
    "deck.blank-field": lambda card: card.real(3),
}


@pytest.mark.parametrize("code", FIELDS)
def test_fields(tmp_path: Path, code: str) -> None:
    (card,) = read_deck(_deck(tmp_path, "CBAR,12,7,1.\n,3,GA,127\n")).cards
    check_shown(code, _message(lambda: FIELDS[code](card), tmp_path))


WRITING = {
    "write.too-wide": ("CBAR,1,2\n", {(0, 1): 123456789}),
    "write.not-finite": ("MAT1,1,2.\n", {(0, 1): float("nan")}),
    "write.replicated": ("GRID,1,,0.\n=,*(1),,*(1.),==\n", {(1, 2): 5.0}),
    "write.included-twice": ("INCLUDE 'p.bdf'\nINCLUDE 'p.bdf'\n", {(0, 1): 5.0}),
    "write.not-read-back": ("PBAR*   1               2\n+       1.      2.\n", {(0, 5): 1.0}),
}


@pytest.mark.parametrize("code", WRITING)
def test_writing(tmp_path: Path, code: str) -> None:
    text, edits = WRITING[code]
    (tmp_path / "p.bdf").write_text("MAT1,1,2.\n")
    deck = read_deck(_deck(tmp_path, text))
    check_shown(code, _message(lambda: edit_fields(deck, edits), tmp_path))


def test_run_folder(tmp_path: Path) -> None:
    deck = read_deck(_deck(tmp_path, "GRID,1\n"))
    edited = edit_fields(deck, {})
    check_shown("write.overwrites-input", _message(lambda: write_deck(edited, tmp_path, "deck.bdf"), tmp_path))
    check_shown(
        "run.unwritable, run folder", _message(lambda: write_deck(edited, tmp_path / "deck.bdf" / "run"), tmp_path)
    )


def test_notices(tmp_path: Path) -> None:
    text = (
        "SOL 103\nCEND\nSUBCASE 1\nSUBCASE 2\nBEGIN BULK\nPARAM,POST,0\nPARAM,POST,-1\nPBAR,1,2,,,,,,,+A\n"
        + "GRID           1".ljust(81)
        + "x\n"
    )
    notices = read_deck(_deck(tmp_path, text)).notices
    assert [notice.code for notice in notices] == [
        "deck.several-subcases",
        "deck.beyond-column-80",
        "deck.dangling-continuation",
        "deck.repeated-param",
        "deck.no-enddata",
    ]
    for notice in notices:
        check_shown(notice.code, str(notice).replace(f"{tmp_path}/", ""))
