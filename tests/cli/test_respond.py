"""The command respond, on a real deck."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from femtune.cli import main
from femtune.files.uff import read_uff
from femtune.units import unit_system

_DECK = """SOL 111
CEND
BEGIN BULK
GRID,7,,0.,0.,0.
CELAS2,1,1000.,7,3
CONM2,2,7,,.0025
CDAMP2,3,.004,7,3
SPC1,1,12456,7
ENDDATA
"""
_ASKED = ("--input", "7Z-", "--from", "50", "--to", "150", "--step", "0.5", "--method", "direct")


@pytest.fixture
def deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An oscillator of 100.66 Hz."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "one.bdf"
    path.write_text(_DECK.replace("CEND", "CEND\nSPC = 1"))
    return path


def _run(*words: str) -> Result:
    return CliRunner().invoke(main, ["respond", *words])


@pytest.mark.slow
def test_tables_page_and_universal_file(deck: Path) -> None:
    files = ("--uff", "out.uff", "--units", "mm-t-s", "--report", "page.html")
    result = _run(str(deck), *_ASKED, *files, "--kind", "mobility")
    assert result.exit_code == 0, result.output
    assert "Mobility, computed directly. Damping: dashpots of the deck." in result.output
    assert "100.50" in result.output
    assert "mm/s/N" in result.output
    assert f"report: {deck.parent / 'page.html'}" in result.output
    frfs = read_uff(deck.parent / "out.uff", units=unit_system("mm-t-s")).test.frfs
    assert frfs is not None
    assert (frfs.kind, len(frfs.freq_hz), frfs.references.labels()) == ("mobility", 201, ["7Z-"])
    page = (deck.parent / "page.html").read_text()
    assert "Frequency responses" in page
    assert page.count("<img ") == 1


@pytest.mark.slow
def test_json(deck: Path) -> None:
    (direct,) = json.loads(_run(str(deck), *_ASKED, "--json").stdout)
    assert direct["poles"] == []
    result = _run(str(deck), *_ASKED, "--json", "--method", "complex modes")
    (record,) = json.loads(result.stdout)
    assert record["frfs"]["pairs"][0]["driving_point"] is True
    assert record["poles"][0]["damping_ratio"] == pytest.approx(0.004 / (2 * (1000 * 0.0025) ** 0.5), rel=1e-9)


def test_errors_are_messages(deck: Path) -> None:
    assert _run(str(deck)).exit_code == 2
    result = _run(str(deck), "--input", "7Z", "--from", "1", "--to", "2", "--step", "1")
    assert result.exit_code == 2
    assert "[dof.syntax]" in result.stderr
    assert "option or argument" in result.stderr
    nowhere = _run(str(deck), *_ASKED, "--report", "no/folder/page.html")
    assert "[run.unwritable]" in nowhere.stderr
