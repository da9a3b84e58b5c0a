"""Every card of the catalogue through every command: a result or a message, never an internal error."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.files.nastran.every_card import DECKS
from tests.files.nastran.whole_decks import DECKS as WHOLE_DECKS

from femtune.cli import main
from femtune.files.nastran.catalogue import CATALOGUE


def test_the_decks_have_every_card() -> None:
    text = "\n".join(content for files in DECKS.values() for content in files.values())
    assert [name for name in CATALOGUE if not re.search(rf"^{name}\b", text, re.MULTILINE)] == []


def _command(*words: str) -> int:
    """Exit code of a command."""
    try:
        return int(main([*words, "--quiet"]) or 0)
    except SystemExit as end:
        return int(end.code or 0)


@pytest.mark.quick(0, gate=5)
@pytest.mark.parametrize("name", [*WHOLE_DECKS, "general element", "sample PBEAML", "sample PBCOMP"])
def test_first_commands(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for file, content in DECKS[name].items():
        Path(file).write_text(content, encoding="latin-1")
    assert [_command(word, "deck.bdf") for word in ("info", "check", "modes")] == [0, 0, 0]


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("name", DECKS)
def test_commands_on_every_card(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for file, content in DECKS[name].items():
        Path(file).write_text(content, encoding="latin-1")
    sensors = [word for n in (2, 3, 4) for word in ("--sensor", f"{n}:123")]
    span = ["--from", "1", "--to", "50", "--lines", "3"]
    codes = {
        "info": _command("info", "deck.bdf"),
        "check": _command("check", "deck.bdf"),
        "modes": _command("modes", "deck.bdf"),
        "respond": _command("respond", "deck.bdf", "--input", "2Z+", "--output", "2Z+", *span),
        # a sensor that no mode moves cannot be written
        "test": _command("modes", "deck.bdf", "--uff", "test.uff", "--units", "m-kg-s", *sensors),
    }
    if Path("test.uff").exists():
        codes["init"] = _command("init", "deck.bdf", "test.uff", "--units", "m-kg-s")
    if Path("study.toml").exists():
        codes["check study"] = _command("check", "study.toml")
        codes["run"] = _command("run", "study.toml")
    assert {step: code for step, code in codes.items() if code >= 70} == {}
    # a sample without mass, or that cannot move, has no modes
    assert (codes["info"], codes["check"]) == (0, 0)
