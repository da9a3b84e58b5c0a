"""Results as tables and JSON, from files to the terminal."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from pydantic import BaseModel

from femtune.cli.output import as_text

# a beam of two bars, 2 m, clamped; node 4 stands alone
DECK = """SOL 103
CEND
METHOD = 1
SPC = 1
BEGIN BULK
EIGRL,1,,,3
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.,0.,0.
GRID,4,,5.,0.,0.
CBAR,1,1,1,2,0.,1.,0.
CBAR,2,1,2,3,0.,1.,0.
PBAR,1,1,1.-2,1.-5,2.-5,1.-5
MAT1,1,2.+11,,.3,7800.
SPC1,1,123456,1
PLOTEL,9,1,2
PARAM,POST,-1
ENDDATA
"""

Invoke = Callable[..., Result]


class _Row(BaseModel):
    name: str
    value: float | None = None


def test_json_of_one_and_of_several() -> None:
    assert json.loads(as_text(_Row(name="a"))) == {"name": "a", "value": None}
    assert [row["name"] for row in json.loads(as_text((_Row(name="a"), _Row(name="b"))))] == ["a", "b"]


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    """A deck alone."""
    (tmp_path / "beam.bdf").write_text(DECK)
    return tmp_path / "beam.bdf"


def _lines(result: Result) -> list[str]:
    assert result.exit_code == 0
    return [line.rstrip() for line in result.stdout.splitlines()]


def test_info_of_a_deck(invoke: Invoke, deck: Path) -> None:
    lines = _lines(invoke("info", deck, env={"COLUMNS": "100"}))
    assert lines[:2] == ["beam.bdf", "Rigid-body check: passed."]
    # 2 m of 0.01 m² of 7800 kg/m³, whose middle is at 1 m
    in_words = [" ".join(line.split()) for line in lines]
    assert "Mass 156, not measured" in in_words
    assert "Centre of gravity 1, 0, 0" in in_words
    assert any(line.startswith("PLOTEL      1  beam.bdf:16") for line in lines)
    assert any("PARAM ignored" in line and "POST=-1" in line for line in lines)
    assert any("X Y Z RX RY RZ of 1 point, 4" in line for line in lines)
    assert not any("e-1" in line or "e−1" in line for line in lines)
    assert max(map(len, lines)) <= 100


@pytest.mark.slow
def test_modes_of_a_deck(invoke: Invoke, deck: Path) -> None:
    lines = _lines(invoke("modes", deck, env={"COLUMNS": "100"}))
    assert lines[1] == "No mode was missed: the Sturm counts agree."
    solved = json.loads(invoke("modes", deck, "--json").stdout)[0]["freq_hz"]
    numbers = [float(line.split()[1]) for line in lines if line.split()[0].isdigit()]
    assert numbers == pytest.approx(solved, abs=0.06)


@pytest.mark.parametrize("command", ["info", "modes"])
def test_hostile_names_do_not_steer_the_terminal(invoke: Invoke, deck: Path, command: str) -> None:
    hostile = deck.with_name("[bold]\x1b[2J.bdf")
    deck.rename(hostile)
    text = invoke(command, hostile).stdout
    assert "\x1b" not in text
    assert "[bold]" in text
