"""Messages of the step plan."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown
from tests.study.plate import plate_deck

import femtune as ft
from femtune.errors import FemtuneError
from femtune.planning import PoleTest, by_half_bandwidths

_DECK = """SOL 103
CEND
SPC = 1
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.,0.,0.
GRID,4,,3.,0.,0.
CBAR,1,1,1,2,0.,1.,0.
CBAR,2,1,2,3,0.,1.,0.
CBAR,3,1,3,4,0.,1.,0.
PBAR,1,1,1.-3,2.-7,5.-7,4.-7
MAT1,1,2.1+11,,.3,7850.
SPC1,1,123456,1
ENDDATA
"""
_HEAD = '[study]\ntitle = "Beam"\ndeck = "beam.bdf"\nunits = "m-kg-s"\n[modes]\ncount = 6\n'


def _study(folder: Path, text: str, deck: str = _DECK) -> Path:
    (folder / "beam.bdf").write_text(deck)
    path = folder / "study.toml"
    path.write_text(_HEAD + text)
    return path


def _refused(folder: Path, text: str, **options: Any) -> FemtuneError:
    with pytest.raises(FemtuneError) as caught:
        ft.plan(_study(folder, text), **options)
    return caught.value


@pytest.mark.quick(8)
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("plan.target-modes, both", '[plan]\nmodes = [1]\nband_hz = [1.0, 2.0]\n'),
        ("plan.target-modes, band", '[plan]\nband_hz = [9.0, 2.0]\n'),
        ("plan.target-modes, absent", '[plan]\nmodes = "1 THRU 60"\n'),
        ("plan.target-modes, none in the band", '[plan]\nband_hz = [0.5, 0.6]\n'),
        ("plan.candidates, excluded", '[plan]\nnodes = [2]\nexclude = [2]\n'),
        ("plan.candidates, constrained", '[plan]\nnodes = [1]\n'),
        ("plan.candidates, unknown set", '[plan]\ndof_set = "ASET"\n'),
        ("plan.placed, no sensor", '[plan]\nplaced = ["tip"]\n'),
        ("plan.placed, rotation", '[plan]\nplaced = ["4RX+"]\n'),
        ("plan.placed, twice", '[plan]\nplaced = ["4", "4Z+"]\n'),
        ("plan.too-few-sensors", '[plan]\nmodes = "1 THRU 5"\nuniaxial = 4\n'),
        ("plan.too-many-sensors, triaxial", '[plan]\ntriaxial = 4\n'),
        ("plan.too-many-sensors, uniaxial", '[plan]\nmodes = [1, 2]\nuniaxial = 8\n'),
        ("plan.too-many-sensors, visualisation", '[plan]\nmodes = [1, 2]\nuniaxial = 3\nvisualisation = 3\n'),
        ("plan.dependent", '[plan]\nmodes = [1, 2, 3]\nnodes = [4]\ntriaxial = 1\ndirections = ["Z"]\n'),
        ("plan.exciters, too many", '[plan]\nmodes = [1, 2]\nexciters = 9\n'),
        ("plan.pole-lines", '[plan]\nmodes = [1, 2]\nexciters = 1\nidentification_lines = 4\n'),
        ("plan.pole-lines, no exciters", '[plan]\nmodes = [1, 2]\nidentification_lines = 20\n'),
        ("plan.exciters, none", '[plan]\nmodes = [1, 2]\ndata = "frfs"\n'),
        ("plan.exciters, no candidate", '[plan]\nmodes = [1, 2]\nexciters = 1\nexciter_nodes = [1]\n'),
        ("plan.exciters, rotation", '[plan]\nmodes = [1, 2]\nexciters_placed = ["2RX+"]\n'),
        ("plan.exciters, still", '[plan]\nmodes = [1, 2]\nexciters_placed = ["1X+"]\n'),
        ("plan.parameters, none", '[plan]\nmodes = [1, 2]\naim = "parameters"\n'),
        ("plan.parameters, elimination", '[plan]\naim = "parameters"\nmethod = "elimination"\n'),
        ("plan.parameters, sd", "[plan]\nshape_sd = 0.0\n"),
        ("plan.suspension", '[plan]\nmodes = [1, 2]\n[[plan.suspension]]\nnodes = [2]\nstiffness = [1.0, 1.0, 1.0]\n'),
    ],
)  # fmt: skip
def test_what_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "beam.bdf").write_text(_DECK)
    Path("study.toml").write_text(_HEAD + text)
    with pytest.raises(FemtuneError) as caught:
        ft.plan(Path("study.toml"))
    check_shown(name, caught.value)
    assert caught.value.hint


def test_lines_for_an_identification_need_noise() -> None:
    with pytest.raises(FemtuneError) as caught:
        PoleTest(np.array([10.0]), np.array([0.01]), np.ones((1, 1)), 0.0, 0.0)
    check_shown("plan.pole-lines, noise", caught.value)


def test_lines_for_an_identification_need_damping_and_a_band_with_modes() -> None:
    with pytest.raises(FemtuneError) as caught:
        PoleTest(np.array([10.0, 20.0]), np.array([0.0, 0.01]), np.ones((1, 2)), 0.02, 0.0)
    check_shown("plan.pole-lines, damping", caught.value)
    with pytest.raises(FemtuneError) as caught:
        by_half_bandwidths(np.array([10.0]), np.array([0.01]), 20.0, 30.0, 4)
    check_shown("plan.pole-lines, band", caught.value)


def test_lines_for_an_identification_need_elastic_modes(tmp_path: Path) -> None:
    text = "[plan]\nmodes = [1, 2]\nrigid_body = true\nexciters = 1\nidentification_lines = 20\n"
    study = _study(tmp_path, text, _DECK.replace("SPC1,1,123456,1", "SPC1,1,4,1,2,3,4"))
    with pytest.raises(FemtuneError) as caught:
        ft.plan(study)
    check_shown("plan.pole-lines, rigid-body", str(caught.value).replace(str(tmp_path), "folder"))


def test_lines_that_are_not_wanted_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("femtune.steps.plan.run.solve", None)  # refused before
    with pytest.raises(FemtuneError) as caught:
        ft.plan(_study(tmp_path, "[plan]\nmodes = [1, 2]\n"), lines="lines.txt")
    check_shown("plan.pole-lines, not wanted", caught.value)


def test_rigid_body_modes_alone(tmp_path: Path) -> None:
    study = _study(tmp_path, "", _DECK.replace("SPC1,1,123456,1", "SPC1,1,4,1,2,3,4"))
    with pytest.raises(FemtuneError, match="rigid-body modes") as caught:
        ft.plan(study, modes=[1, 2])
    assert caught.value.code == "plan.target-modes"


@pytest.mark.quick(11)
@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"modes": []}, "study.list"),
        ({"modes": "1 UNTIL 3"}, "study.list"),
        ({"modes": 3}, "study.type"),
        ({"uniaxial": -1}, "study.value"),
        ({"uniaxial": 2.5}, "study.type"),
        ({"triaxial_threshold": 1.5}, "study.value"),
        ({"method": "best"}, "study.value"),
        ({"sensors": 3}, "study.unknown-key"),
        ({"nodes": [77]}, "model.unknown-node"),
        ({"placed": ["77"]}, "model.unknown-node"),
        ({"elements": [99]}, "parameter.region"),
        ({"region": {"set": 5}}, "parameter.region"),
        ({"directions": ["RX"]}, "study.type"),
        ({"modes": [1, 2], "exciter_nodes": [77], "exciters": 1}, "model.unknown-node"),
        ({"modes": [1, 2], "exciters_placed": ["77Z+"]}, "model.unknown-node"),
        ({"modes": "1 THRU 1000000000"}, "study.value"),
        ({"nodes": "500 THRU 600"}, "plan.candidates"),
        ({"damping_ratio": 0.0}, "study.value"),
        ({"suspension": [{"nodes": [2], "stiffness": (1.0, -1.0, 0.0)}]}, "study.value"),
        ({"configuration": "free"}, "study.unknown-configuration"),
    ],
)
def test_options_are_checked(tmp_path: Path, options: dict[str, Any], code: str) -> None:
    error = _refused(tmp_path, "", **options)
    (first, *_) = getattr(error, "errors", (error,))
    assert first.code == code
    assert first.hint


def test_a_universal_file_needs_units_and_overwrites_no_input(tmp_path: Path) -> None:
    (tmp_path / "beam.bdf").write_text(_DECK)
    deck = tmp_path / "beam.bdf"
    for options, code in (
        ({"uff": tmp_path / "a.uff"}, "response.units-needed"),
        ({"csv": deck}, "write.overwrites-input"),
        ({"csv": tmp_path / "x.html", "report": tmp_path / "x.html"}, "write.overwrites-input"),
    ):
        with pytest.raises(FemtuneError) as caught:
            ft.plan(deck, uniaxial=12, **options)
        assert caught.value.code == code
    assert deck.read_text() == _DECK


def test_alerts(tmp_path: Path) -> None:
    study = _study(tmp_path, "[plan]\nmodes = [1, 2]\nuniaxial = 6\nuniaxial_threshold = 0.9\n")
    found = ft.plan(study)
    for one in found.record.alerts:
        check_shown(f"{one.code}", f"[{one.code}] {one.sentence}")
    assert {a.code for a in found.record.alerts} >= {"plan.rejected", "plan.still"}


def test_alerts_of_the_setup(tmp_path: Path) -> None:
    (tmp_path / "plate.bdf").write_text(plate_deck())
    found = ft.plan(
        tmp_path / "plate.bdf", modes=[7, 8, 9], uniaxial=5, uniaxial_mass=0.1, exciters_placed=["32Z+"],
        suspension=[{"nodes": [1, 9, 55, 63], "stiffness": (0.0, 0.0, 1e4)}],
    )  # fmt: skip
    told = {a.code for a in found.record.alerts}
    assert told >= {"plan.not-excited", "plan.no-driving-point", "plan.mass-loading", "plan.stiff-suspension"}
    for one in found.record.alerts:
        # which of equal modes is worst depends on rounding
        words = re.sub(r"-?\b[0-9]+(\.[0-9]+)?", "1", one.sentence)
        check_shown(one.code, f"[{one.code}] {words}")


def test_parameters_that_the_test_tells_nothing_of(tmp_path: Path) -> None:
    parameter = '[[parameter]]\nname = "nu"\nfields = ["PBAR 1 J"]\nlower = 0.99\nupper = 1.01\n'
    text = parameter + "[plan]\nmodes = [1, 2]\nuniaxial = 3\n"
    found = ft.plan(_study(tmp_path, text))
    (alert,) = [a for a in found.record.alerts if a.code == "plan.uninformed"]
    check_shown(alert.code, f"[{alert.code}] {alert.sentence}")


def test_modes_that_look_alike_at_the_sensors(tmp_path: Path) -> None:
    (tmp_path / "plate.bdf").write_text(plate_deck())
    found = ft.plan(tmp_path / "plate.bdf", modes=[7, 8], placed=["1Z+", "2Z+"])
    (alert,) = found.record.alerts
    assert alert.code == "plan.alike"
    assert alert.level == "warning"
    assert f"AutoMAC {found.auto_mac[0, 1]:.2f}" in alert.sentence
    check_shown("plan.alike", f"[{alert.code}] target modes 7 and 8 look alike at the sensors: AutoMAC 0.98")
