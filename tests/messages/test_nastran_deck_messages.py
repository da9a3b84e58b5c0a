"""What a user reads when a deck cannot be read or written: the place, the values and the fix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import edit_fields, read_deck, write_deck

_FULL = "SOL 103\nCEND\nBEGIN BULK\n"


def _message(action: Callable[[], object], folder: Path) -> str:
    with pytest.raises(FemtuneError) as caught:
        action()
    return str(caught.value).replace(f"{folder}/", "")


def _deck(folder: Path, content: str | bytes) -> Path:
    path = folder / "deck.bdf"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("latin-1"))
    return path


READING = {
    "deck.missing-include": (
        "GRID,1\nINCLUDE 'plate.inc'\n",
        "[deck.missing-include] the included file 'plate.inc' is not there\n"
        "  at deck.bdf:2 (INCLUDE)\n"
        "  looked for = plate.inc\n\n"
        "hint: put the file there, or correct the path (it is relative to the file that includes it)",
    ),
    "deck.circular-include": (
        "INCLUDE 'deck.bdf'\n",
        "[deck.circular-include] 'deck.bdf' includes itself\n"
        "  at deck.bdf:1 (INCLUDE)\n"
        "  chain = deck.bdf -> deck.bdf\n\n"
        "hint: remove this INCLUDE",
    ),
    "deck.truncated, no closing quote": (
        "GRID,1\nINCLUDE 'plate",
        "[deck.truncated] the INCLUDE has no closing quote\n"
        "  at deck.bdf:2 (INCLUDE)\n\n"
        "hint: write INCLUDE 'path' with both quotes; the file may have been cut here",
    ),
    "deck.truncated, no BEGIN BULK": (
        "SOL 103\nCEND\nSPC = 1\n",
        "[deck.truncated] the deck has executive control but no BEGIN BULK\n"
        "  at deck.bdf:1 (SOL 103)\n\n"
        "hint: the file may have been cut; bulk data start after a line BEGIN BULK",
    ),
    "deck.truncated, in the middle of a line": (
        _FULL + "GRID,1,,0.,0.,0.\nGRID,2,,1.",
        "[deck.truncated] the deck ends in the middle of a line, without ENDDATA\n"
        "  at deck.bdf:5\n\n"
        "hint: the file may have been cut here; if it is complete, add a line ENDDATA",
    ),
    "deck.truncated, in the middle of a card": (
        "PBAR,1,2,3.,4.,5.,6.,,,+A",
        "[deck.truncated] the deck ends in the middle of a card: its continuation '+A' is not there\n"
        "  at deck.bdf:1 (PBAR)\n\n"
        "hint: the file may have been cut here; if the card is complete, remove its last field (columns 73-80)",
    ),
    "deck.continuation": (
        "+,1.\n",
        "[deck.continuation] this continuation has no card above it\n"
        "  at deck.bdf:1 (+)\n\n"
        "hint: add the card's first line",
    ),
    "deck.continuation, another name": (
        "PBAR,1,2,,,,,,,+A\n+B,1.\n",
        "[deck.continuation] the card above asks for continuation 'A', but 'B' follows\n"
        "  at deck.bdf:2 (+B)\n\n"
        "hint: put a card's continuations right below it, in order",
    ),
    "deck.card-name": (
        "Dear reader\n",
        "[deck.card-name] 'DEAR REA' is not the name of a card\n"
        "  at deck.bdf:1\n\n"
        "hint: a name starts with a letter and has 8 letters or digits at most; a comment starts with $",
    ),
    "deck.too-many-fields": (
        "GRID,1,2,3.,4.,5.,6,7,8,9,10\n",
        "[deck.too-many-fields] a free-field line has 11 fields, but 10 is the most that one line holds\n"
        "  at deck.bdf:1 (GRID)\n\n"
        "hint: go on in a new line that starts with a comma after 9 fields",
    ),
    "deck.replication": (
        "=,*(1)\n",
        "[deck.replication] no card stands above it\n  at deck.bdf:1 (=)\n\nhint: write these cards out",
    ),
    "deck.case-control": (
        "SOL 103\nCEND\nSPC = one\nBEGIN BULK\nENDDATA\n",
        "[deck.case-control] SPC should select a set by its number, not 'one'\n"
        "  at deck.bdf:3 (SPC)\n\n"
        "hint: write SPC = 1",
    ),
    "deck.list": (
        "SOL 103\nCEND\nSET 1 = 5 THRU 3\nBEGIN BULK\nENDDATA\n",
        "[deck.list] '5 THRU 3 BY 1' does not ascend\n"
        "  at deck.bdf:3 (SET)\n"
        "  list = 5 THRU 3\n\n"
        "hint: write numbers, 'first THRU last', 'BY step' and 'EXCEPT numbers'",
    ),
    "deck.not-text": (
        b"GRID\x00\x00\x07,1",
        "[deck.not-text] this is not a text file\n"
        "  at deck.bdf\n"
        "  control characters = 2\n\n"
        "hint: name the bulk data deck (.bdf, .dat, .nas), saved as plain ASCII, Latin-1 or UTF-8 text",
    ),
}


@pytest.mark.parametrize("case", READING)
def test_reading(tmp_path: Path, case: str) -> None:
    content, message = READING[case]
    path = _deck(tmp_path, content)
    assert message.startswith(f"[{case.partition(',')[0]}]")
    assert _message(lambda: read_deck(path), tmp_path) == message


def test_no_such_deck(tmp_path: Path) -> None:
    assert _message(lambda: read_deck(tmp_path / "deck.bdf"), tmp_path) == (
        "[deck.not-found] there is no such deck\n  at deck.bdf\n\nhint: check the path"
    )


def test_a_folder_is_no_deck(tmp_path: Path) -> None:
    (tmp_path / "deck.bdf").mkdir()
    assert _message(lambda: read_deck(tmp_path / "deck.bdf"), tmp_path) == (
        "[deck.unreadable] the file cannot be read: Is a directory\n"
        "  at deck.bdf\n\n"
        "hint: name a text file that you may read"
    )


def test_misspelt_include(tmp_path: Path) -> None:
    (tmp_path / "Plate.INC").write_text("GRID,1\n")
    path = _deck(tmp_path, "INCLUDE 'plate.inc'\n")
    assert "hint: did you mean 'Plate.INC'?" in _message(lambda: read_deck(path), tmp_path)


FIELDS = {
    "deck.not-an-integer": (
        lambda card: card.integer(2),
        "[deck.not-an-integer] this field should hold an integer\n"
        "  at deck.bdf:1 (CBAR 12)\n"
        "  field = 4\n"
        "  text = '1.'\n\n"
        "hint: write it without a decimal point",
    ),
    "deck.not-a-real": (
        lambda card: card.real(9),
        "[deck.not-a-real] this field should hold a real number\n"
        "  at deck.bdf:2 (CBAR 12)\n"
        "  field = 3 of continuation 1\n"
        "  text = '45'\n\n"
        "hint: a real has a decimal point: 1.5, 2.-3",
    ),
    "deck.not-a-component": (
        lambda card: card.component(10),
        "[deck.not-a-component] this field should hold a list of components\n"
        "  at deck.bdf:2 (CBAR 12)\n"
        "  field = 4 of continuation 1\n"
        "  text = '127'\n\n"
        "hint: write digits 1 to 6: 123",
    ),
    "deck.blank-field": (
        lambda card: card.real(3),
        "[deck.blank-field] this field should hold a real number\n"
        "  at deck.bdf:1 (CBAR 12)\n"
        "  field = 5\n"
        "  text = ''\n\n"
        "hint: CBAR has no default here: fill the field",
    ),
}


@pytest.mark.parametrize("code", FIELDS)
def test_fields(tmp_path: Path, code: str) -> None:
    read, message = FIELDS[code]
    (card,) = read_deck(_deck(tmp_path, "CBAR,12,7,1.\n,3,45,127\n")).cards
    assert _message(lambda: read(card), tmp_path) == message


WRITING = {
    "write.too-wide": (
        "CBAR,1,2\n",
        {(0, 1): 123456789},
        "[write.too-wide] '123456789' does not fit in a field of 8 characters\n"
        "  at deck.bdf:1 (CBAR 1)\n\n"
        "hint: give it a shorter name or number, or write the card in large field",
    ),
    "write.not-finite": (
        "MAT1,1,2.\n",
        {(0, 1): float("nan")},
        "[write.not-finite] a deck holds finite numbers only\n"
        "  at deck.bdf:1 (MAT1 1)\n"
        "  value = nan\n\n"
        "hint: find out why this value is not a number before it is written",
    ),
    "write.replicated": (
        "GRID,1,,0.\n=,*(1),,*(1.),==\n",
        {(1, 2): 5.0},
        "[write.replicated] this card and others are made from one line by replication, "
        "so it cannot be changed alone\n"
        "  at deck.bdf:2 (GRID 2)\n\n"
        "hint: write these cards out, one line each",
    ),
    "write.included-twice": (
        "INCLUDE 'p.bdf'\nINCLUDE 'p.bdf'\n",
        {(0, 1): 5.0},
        "[write.included-twice] the file of this card is included more than once, "
        "so a change would count more than once\n"
        "  at p.bdf:1 (MAT1 1)\n\n"
        "hint: give each INCLUDE a file of its own",
    ),
    "write.not-read-back": (
        "PBAR*   1               2\n+       1.      2.\n",
        {(0, 5): 1.0},
        "[write.not-read-back] the changed card would not be read back as intended\n"
        "  at deck.bdf:1 (PBAR 1)\n\n"
        "hint: write this card out plainly, in small or large field, eight fields a line",
    ),
}


@pytest.mark.parametrize("code", WRITING)
def test_writing(tmp_path: Path, code: str) -> None:
    text, edits, message = WRITING[code]
    (tmp_path / "p.bdf").write_text("MAT1,1,2.\n")
    deck = read_deck(_deck(tmp_path, text))
    assert _message(lambda: edit_fields(deck, edits), tmp_path) == message


def test_run_folder(tmp_path: Path) -> None:
    deck = read_deck(_deck(tmp_path, "GRID,1\n"))
    edited = edit_fields(deck, {})
    assert _message(lambda: write_deck(edited, tmp_path, "deck.bdf"), tmp_path) == (
        "[write.overwrites-input] the updated deck would overwrite a file of the deck that was read\n"
        "  at deck.bdf\n\n"
        "hint: choose another folder for the run"
    )
    assert _message(lambda: write_deck(edited, tmp_path / "deck.bdf" / "run"), tmp_path) == (
        "[run.unwritable] the run folder cannot be written: Not a directory\n"
        "  at deck.bdf/run\n\n"
        "hint: choose a folder that you may write to, with space left on its disk"
    )


def test_notices(tmp_path: Path) -> None:
    text = (
        "SOL 103\nCEND\nSUBCASE 1\nSUBCASE 2\nBEGIN BULK\nPARAM,POST,0\nPARAM,POST,-1\nPBAR,1,2,,,,,,,+A\n"
        + "GRID           1".ljust(81)
        + "x\nBEGIN SUPER=4\n"
    )
    notices = [str(notice).replace(f"{tmp_path}/", "") for notice in read_deck(_deck(tmp_path, text)).notices]
    assert notices == [
        "[deck.several-subcases] of the subcases 1, 2 the first, 1, is used at deck.bdf:3 (SUBCASE)",
        "[deck.beyond-column-80] text after column 80 is not read at deck.bdf:9 (GRID)",
        "[deck.dangling-continuation] the continuation '+A' that this card asks for does not follow "
        "at deck.bdf:8 (PBAR)",
        "[deck.superelement] the cards that follow belong to superelement 4 at deck.bdf:10 (BEGIN SUPER)",
        "[deck.repeated-param] PARAM POST is given again: -1 counts, 0 does not at deck.bdf:7 (PARAM POST)",
        "[deck.no-enddata] the deck has no ENDDATA: is it complete? at deck.bdf:10",
    ]
