"""`femtune modes` with a number of modes or an upper frequency of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from femtune.cli.commands import main

_DECK = """SOL 103
CEND
METHOD = 1
BEGIN BULK
EIGRL,1,,,3
GRID,1,,0.,0.,0.,,123456
GRID,2,,1.,0.,0.,,4
GRID,3,,2.,0.,0.,,4
PBAR,1,1,1.-3,2.-7,5.-7,4.-7
MAT1,1,2.1+11,,.3,7850.
CBAR,1,1,1,2,0.,1.,0.
CBAR,2,1,2,3,0.,1.,0.
ENDDATA
"""


def _modes(folder: Path, *options: str) -> tuple[int, str, str]:
    (folder / "a.bdf").write_text(_DECK)
    result = CliRunner().invoke(main, ["modes", str(folder / "a.bdf"), "--json", "--quiet", *options])
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.slow
def test_a_count_and_a_frequency_in_place_of_the_decks(tmp_path: Path) -> None:
    def found(*options: str) -> list[float]:
        return json.loads(_modes(tmp_path, *options)[1])[0]["freq_hz"]

    four = found("--count", "4")
    assert (len(found()), len(four)) == (3, 4)
    top = 0.5 * (four[1] + four[2])
    assert found("--max-hz", str(top)) == pytest.approx(four[:2])


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (("--count", "0"), "study."),
        (("--max-hz", "-1"), "study."),
        (("--max-hz", "nan"), "study."),
        (("--count", "2", "--max-hz", "9"), "study.modes-both"),
    ],
)
def test_bad_values_are_told(tmp_path: Path, options: tuple[str, ...], code: str) -> None:
    exit_code, _, told = _modes(tmp_path, *options)
    assert exit_code == 2
    assert f"[{code}" in told
    assert "option or argument" in told


def test_python_dash_m_is_the_command() -> None:
    told = subprocess.run(
        [sys.executable, "-m", "femtune", "modes", "--help"], capture_output=True, text=True, check=True
    )
    assert told.stdout.startswith("Usage: femtune modes [OPTIONS] PATH")
