"""Study files, decks and tests with strange names and texts; alerts about decks that are merely odd."""

from __future__ import annotations

import pytest
from tests.messages.shown import check_shown

import femtune as ft

from .cantilever import Bench


@pytest.mark.slow
def test_mass_that_autospc_holds_is_an_alert(beam: Bench) -> None:
    point = "GRID    6               2.0     0.0     0.0\n"
    beam.write("beam.bdf", beam.text.replace("CONM2   9       5 ", f"{point}CONM2   9       6 "))
    (modes,) = ft.modes(beam.folder / "beam.bdf").records
    assert any(a.code == "model.held-mass" and "6X, 6Y, 6Z" in a.sentence for a in modes.alerts)
    alerts = ft.update(beam.study("[correlate]\nfrequency_gate = 0.6\n" + beam.parameters)).results.alerts
    assert any(a.code == "model.held-mass" and "6X, 6Y, 6Z" in a.sentence for a in alerts)


@pytest.mark.slow
def test_dofs_held_although_autospc_is_off_are_an_alert(beam: Bench) -> None:
    beam.write("beam.bdf", beam.text.replace("ENDDATA", "GRID,6,,2.,0.,0.\nPARAM,AUTOSPC,NO\nENDDATA"))
    (modes,) = ft.modes(beam.folder / "beam.bdf").records
    (told,) = (a for a in modes.alerts if a.code == "model.held-without-autospc")
    assert "6X, 6Y, 6Z" in told.sentence
    check_shown("model.held-without-autospc", f"[{told.code}] {told.sentence}")


def test_preload_and_modes_beyond_the_count_are_told(beam: Bench) -> None:
    case = "SUBCASE 1\nSPC = 1\nLOAD = 7\nSUBCASE 2\nSTATSUB(PRELOAD) = 1"
    text = beam.text.replace("SPC = 1\nMETHOD = 1", f"METHOD = 1\n{case}", 1)
    beam.write("beam.bdf", text.replace("ENDDATA", "FORCE,7,5,,1.,1.,0.,0.\nENDDATA"))
    (modes,) = ft.modes(beam.folder / "beam.bdf", count=2).records
    told = {a.code: f"[{a.code}] {a.sentence}" for a in modes.alerts}
    assert modes.rigid_body_modes > 2
    for code in ("model.preload", "eigen.whole-group"):
        check_shown(code, told[code])


@pytest.mark.slow
def test_missing_enddata_is_an_alert(beam: Bench) -> None:
    beam.write("beam.bdf", beam.text.replace("ENDDATA\n", ""))
    assert any(a.code == "deck.no-enddata" for a in ft.update(beam.study()).results.alerts)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bläu & co", "two words", "it's", 'say "x"', "<b>", "a;b$(c)", "ß=1"])
def test_strange_names_of_files_and_folders(beam: Bench, name: str) -> None:
    head, grids, tail = beam.text.partition("GRID    3               0.5     0.0     0.0\n")
    assert grids
    quote = '"' if "'" in name else "'"
    beam.write(f"{name}/{name}.inc", grids)
    beam.write(f"{name}/{name}.bdf", f"{head}INCLUDE {quote}{name}.inc{quote}\n{tail}")
    (beam.folder / "beam.uff").rename(beam.folder / name / f"{name}.uff")
    toml = name.replace('"', '\\"')
    study = beam.study(deck=f"{toml}/{toml}.bdf", test=f"{toml}/{toml}.uff")
    run = ft.update(study, output=beam.folder / f"run {name}")
    again = ft.modes(run.folder / "updated.bdf")[0]
    assert again.freq_hz[:6] == pytest.approx(run.results.modes[-1].freq_hz)


@pytest.mark.slow
def test_a_long_title_of_markup_is_text(beam: Bench) -> None:
    title = "<script>alert(1)</script>" * 400
    study = beam.study()
    study.write_text(study.read_text().replace('"Beam"', f"'{title}'"))
    run = ft.run(study)
    assert run.results.study.title == title
    assert run.report is not None
    assert "<script>alert(1)" not in run.report.read_text()
