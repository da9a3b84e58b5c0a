"""Tables of the masses of sensors: they enter the model, and their effect on the modes is stated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError, FemtuneErrors, Notice
from femtune.files.masses_table import read_masses_table
from femtune.model import AddedMass, Configuration
from femtune.study.study import load_study

from .cantilever import Bench, modes_of_deck

TABLE = "node;mass_g;z;label\n3;40;0.01;triaxial\n5; 25 ;0;uniaxial\n3;5;0;cable\n"
OWN = '[[configuration]]\nname = "a"\nmasses_file = "sensors.csv"\n'


def _study(bench: Bench, table: str = TABLE) -> Path:
    bench.write("sensors.csv", table)
    return bench.study(OWN, test=None)  # type: ignore[no-any-return]


def test_masses_enter_the_model_in_the_units_of_the_study(bench: Bench) -> None:
    path = _study(bench)
    found = ft.modes(path).records[0]
    masses = (AddedMass(3, 0.04, (0.0, 0.0, 0.01)), AddedMass(5, 0.025), AddedMass(3, 0.005))
    exact, _ = modes_of_deck(bench.folder / "beam.bdf", 6, Configuration(masses=masses))
    assert found.freq_hz == pytest.approx(exact, rel=1e-10)
    assert load_study(path).cases[0].configured.configuration.masses[0].label == "triaxial"
    millimetres = read_masses_table(path.parent / "sensors.csv", 1e3)
    assert millimetres[0].mass == pytest.approx(40e-6)
    assert [m.line for m in millimetres] == [2, 3, 4]


def test_their_effect_is_that_of_a_solution_without_them(bench: Bench) -> None:
    found = ft.modes(_study(bench)).records[0]
    assert found.test_masses is not None
    bare, _ = modes_of_deck(bench.folder / "beam.bdf", 6)
    shifts = np.array([m.shift_percent for m in found.test_masses.modes])
    exact = 100.0 * (np.array(found.freq_hz) / bare[: len(found.freq_hz)] - 1.0)
    assert shifts == pytest.approx(exact, abs=0.03 * np.abs(exact).max())
    assert (found.test_masses.count, found.test_masses.mass) == (3, pytest.approx(0.07))
    assert found.test_masses.modes[0].node == 5
    assert [a.code for a in found.alerts if a.code == "model.test-masses"] == ["model.test-masses"]
    assert found.test_masses.exchanged == ()


def test_an_exchange_of_modes_is_told(bench: Bench) -> None:
    """Bending in the two planes is nearly equal; a mass with an arm moves one of the two below the other."""
    text = bench.text.replace("2.0-7   5.0-7", "2.0-7   2.02-7").replace("CONM2   9       5               2.0\n", "")
    bench.write("beam.bdf", text)
    bench.write("sensors.csv", "node,mass,z,label\n5,0.02,0.3,block\n")
    record = ft.modes(bench.study(OWN, test=None)).records[0]
    assert record.test_masses is not None
    bare, _ = modes_of_deck(bench.folder / "beam.bdf", 6)
    without = [hz / (1.0 + m.shift_percent / 100.0) for hz, m in zip(record.freq_hz, record.test_masses.modes)]
    assert sorted(without[:4]) == pytest.approx(bare[:4], rel=1e-3)
    pairs = [(i + 1, j + 1) for j in range(len(without)) for i in range(j) if without[i] > without[j]]
    assert list(record.test_masses.exchanged) == pairs
    assert pairs == [(3, 4)]
    told = [a.sentence for a in record.alerts if a.level == "warning" and a.code == "model.test-masses"]
    assert len(told) == 1
    assert "without the masses of the test equipment, the order of the modes 3 and 4 would be exchanged" in told[0]


@pytest.mark.slow
def test_masses_in_another_unit_than_the_study_are_told(bench: Bench) -> None:
    """40 g in a column of the study's unit: 1000 times too heavy."""
    record = ft.modes(_study(bench, "node,mass\n3,40\n5,25\n")).records[0]
    assert record.test_masses is not None
    structure = ft.modes(bench.study(OWN.replace('masses_file = "sensors.csv"\n', ""), test=None)).records[0]
    own = max(structure.effective_masses.total[:3])
    assert record.test_masses.ratio == pytest.approx(65.0 / own)
    said = "times the mass of the structure"
    (told,) = (a for a in record.alerts if said in a.sentence)
    assert (told.code, told.level) == ("model.test-masses", "warning")
    light = ft.modes(_study(bench, "node,mass_g\n3,40\n5,25\n")).records[0]
    assert not any(said in a.sentence for a in light.alerts)
    assert light.test_masses is not None
    assert light.test_masses.ratio == pytest.approx(0.065 / own)


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("one line", "node,mass\n"),
        ("heading", "node,mas\n3,1\n"),
        ("columns", "node,x\n3,1\n"),
        ("fields", "node,mass\n3,1,2\n"),
        ("number", "node,mass\n3,a\n"),
        ("node", "node,mass\n-3,1\n"),
        ("negative", "node,mass\n3,-1\n"),
    ],
)
def test_a_table_that_is_none_is_an_error_with_its_line(bench: Bench, name: str, table: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        load_study(_study(bench, table))
    assert caught.value.code == "configuration.masses-file"
    check_shown(f"configuration.masses-file, {name}", str(caught.value).replace(str(bench.folder), "."))


def test_unknown_points_and_files_are_errors(bench: Bench) -> None:
    with pytest.raises(FemtuneError) as caught:
        load_study(_study(bench, "node,mass\n3,1\n77,1\n78,1\n"))
    errors = caught.value.errors if isinstance(caught.value, FemtuneErrors) else (caught.value,)
    assert [str(e.where).rsplit(":", 1)[-1] for e in errors] == ["3", "4"]
    (bench.folder / "sensors.csv").unlink()
    with pytest.raises(FemtuneError) as caught:
        load_study(bench.folder / "study.toml")
    assert caught.value.code == "study.missing-file"


def test_messages_of_the_effect() -> None:
    check_shown(
        "model.test-masses", Notice("model.test-masses", configuration="free", count=36, mode=8, shift=-1.2, node=512)
    )
