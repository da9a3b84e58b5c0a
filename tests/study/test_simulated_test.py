"""A simulated test from the command line: what is written is what the model does, and a study takes it as a test."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from tests.messages.shown import check_shown

import femtune as ft
from femtune.cli.commands import main
from femtune.errors import FemtuneError
from femtune.files.uff import read_uff
from femtune.model import solve_modes
from femtune.steps.modes.simulated_test import SimulatedTest, sensor_dofs, shape_signs, simulated
from femtune.study.study import load_study
from femtune.units import SI

from .cantilever import Bench


def _written(path: Path) -> tuple[np.ndarray, np.ndarray, list[str]]:
    modes = read_uff(path, units=SI).test.modes
    assert modes is not None
    return modes.freq_hz, modes.shapes, list(modes.dofs.labels())


@pytest.mark.slow
def test_an_update_finds_the_values_of_the_deck_that_was_simulated(bench: Bench) -> None:
    options = ["--uff", str(bench.folder / "beam.uff"), "--sensor", "2 THRU 5:23", "--units", "m-kg-s", "--count", "4"]
    found = CliRunner().invoke(main, ["modes", str(bench.truth()), "--quiet", *options])
    assert (found.exit_code, found.output) == (0, "")
    update = ft.update(bench.study()).results.update
    assert update is not None
    assert {p.name: p.value for p in update.parameters} == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-4)


@pytest.mark.slow
def test_rigid_body_motions_are_left_out_and_a_sign_turns_label_and_motion(bench: Bench) -> None:
    deck = bench.write("free.bdf", bench.text.replace("123456  1", "14      1"))
    plain, turned = bench.folder / "plain.uff", bench.folder / "turned.uff"
    modes = ft.modes(deck, count=9, simulate=SimulatedTest(plain, ("2Y+", "5Z+"), "m-kg-s"))[0]
    ft.modes(deck, report=bench.folder / "p.html", count=9, simulate=SimulatedTest(turned, ("2Y-", "5Z+"), "m-kg-s"))
    freq, shapes, labels = _written(plain)
    assert labels == ["2Y+", "5Z+"]
    assert freq == pytest.approx(modes.freq_hz[modes.rigid_body_modes :], rel=1e-5)
    np.testing.assert_allclose(_written(turned)[1], shapes, rtol=1e-6)


@pytest.mark.slow
def test_scatter_is_that_asked_for_and_the_same_again(bench: Bench) -> None:
    deck, path = bench.folder / "beam.bdf", bench.folder / "t.uff"
    sensors = ("2 THRU 5:23",)

    def written(**scatter: Any) -> tuple[np.ndarray, np.ndarray]:
        ft.modes(deck, simulate=SimulatedTest(path, sensors, "m-kg-s", **scatter))
        return _written(path)[:2]

    freq, shapes = written()
    off, moved = written(frequency_scatter=0.01, shape_scatter=0.02)
    assert 0.002 < np.std(off / freq - 1.0) < 0.02
    largest = np.abs(shapes).max(axis=0)
    assert 0.01 < np.std((moved - shapes) / largest) < 0.03
    np.testing.assert_array_equal(written(frequency_scatter=0.01, shape_scatter=0.02)[1], moved)
    assert not np.allclose(written(frequency_scatter=0.01, shape_scatter=0.02, seed=2)[1], moved)


def test_the_errors_do_not_depend_on_the_signs_that_the_eigen_solution_gives(bench: Bench) -> None:
    study = load_study(bench.folder / "beam.bdf")
    (case,) = study.cases
    solution = solve_modes(case.configured.at(np.zeros(0)), 4)
    solved = solution.shapes.shape[1]
    wanted = SimulatedTest(None, ("2 THRU 5:23",), "m-kg-s", frequency_scatter=0.01, shape_scatter=0.02)

    def shapes(signs: list[float]) -> np.ndarray:
        (test,) = simulated(
            study, wanted, [(case, replace(solution, shapes=solution.shapes * np.resize(signs, solved)))]
        )
        assert test.modes is not None
        return test.modes.shapes

    as_solved = shapes([1.0, 1.0, 1.0, 1.0])
    np.testing.assert_array_equal(shapes([-1.0, 1.0, -1.0, 1.0]), as_solved)
    np.testing.assert_array_equal(shapes([-1.0, -1.0, 1.0, -1.0]), as_solved)


def test_rounding_does_not_decide_the_sign_of_a_shape_of_a_symmetric_structure() -> None:
    shape = np.array([0.2, -1.0, 0.0, 1.0, -0.2])
    for rounding in np.random.default_rng(1).uniform(-1e-12, 1e-12, (20, 5)):
        assert shape_signs((shape + rounding)[:, None]) == -1.0


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"units": None}, "response.units-needed"),
        ({"sensors": ()}, "uff.cannot-write"),
        ({"sensors": ("78Z+",)}, "model.unknown-node"),
        ({"sensors": ("2 THRU :3",)}, "study.support"),
        ({"sensors": ("2Z",)}, "dof.syntax"),
        ({"path": Path("none/at/all.uff")}, "uff.cannot-write"),
        ({"sensors": ("2Z+", "77S+")}, "uff.cannot-write"),
        ({"sensors": ("77S+", "77X+")}, "dof.duplicate"),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is_solved(
    bench: Bench, options: dict[str, Any], code: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("femtune.study.solved.solve", lambda *_: pytest.fail("it was solved"))
    spring = "SPOINT,77\nCELAS2,770,1.+3,77,0\nCMASS2,771,1.,77,0\n"
    deck = bench.write("with_scalar_point.bdf", bench.text.replace("ENDDATA", f"{spring}ENDDATA"))
    asked = {"path": bench.folder / "t.uff", "sensors": ("2Z+",), "units": "m-kg-s", **options}
    with pytest.raises(FemtuneError) as caught:
        ft.modes(deck, simulate=SimulatedTest(**asked))
    assert caught.value.code == code


def test_a_study_has_units_of_its_own(beam: Bench) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.modes(beam.study(), simulate=SimulatedTest(beam.folder / "t.uff", ("2Z+",), "m-kg-s"))
    assert caught.value.code == "response.units-given"
    with pytest.raises(FemtuneError) as caught:
        ft.modes(beam.study(), simulate=SimulatedTest(beam.folder / "beam.uff", ("2Z+",)))
    assert caught.value.code == "write.overwrites-input"


def test_a_test_is_not_written_to_the_file_that_it_was_read_from(beam: Bench) -> None:
    path = beam.folder / "beam.uff"
    before, test = path.read_bytes(), ft.read_test(path)
    (beam.folder / "link.uff").symlink_to(path)
    for name in ("beam.uff", "link.uff"):
        with pytest.raises(FemtuneError) as caught:
            ft.write_test(test, beam.folder / name)
        assert path.read_bytes() == before
    check_shown("write.overwrites-input, test", str(caught.value).replace(str(beam.folder), "FOLDER"))
    assert ft.write_test(test, beam.folder / "other.uff").exists()


def test_sensors_are_labels_or_ranges_each_once() -> None:
    assert [str(d) for d in sensor_dofs(("3Z-", "1 THRU 2:13", "2:1"))] == ["3Z-", "1X+", "1Z+", "2X+", "2Z+"]


def test_sensors_without_a_file_are_a_slip(bench: Bench) -> None:
    found = CliRunner().invoke(main, ["modes", str(bench.folder / "beam.bdf"), "--sensor", "2Z+"])
    assert found.exit_code == 2
    assert "--sensor requires --uff" in found.stderr


def test_scalar_points_are_measured_like_other_dofs(bench: Bench) -> None:
    """An oscillator of 1 kg on 1000 N/m beside the beam, by the direction S and as component 1."""
    spring = "SPOINT,77\nCELAS2,770,1.+3,77,0\nCMASS2,771,1.,77,0\n"
    deck = bench.write("with_scalar_point.bdf", bench.text.replace("ENDDATA", f"{spring}ENDDATA"))
    for label in ("77S+", "77X+"):
        modes = ft.simulate(deck, ["5Z+", label], units="m-kg-s", count=4).modes
        assert modes is not None
        assert modes.dofs.labels() == ["5Z+", "77S+"]
        moved = np.abs(modes.shapes[1]) > 1e-6
        assert modes.freq_hz[moved] == pytest.approx([np.sqrt(1000.0) / (2.0 * np.pi)])
        assert np.abs(modes.shapes[1, moved]) == pytest.approx([1.0])


@pytest.mark.parametrize("other", ["report", "vtu"])
def test_no_two_files_are_one(bench: Bench, other: str) -> None:
    """Neither the page nor the VTU file may be the simulated test."""
    path = bench.folder / "one.vtu"
    with pytest.raises(FemtuneError) as caught:
        ft.modes(bench.folder / "beam.bdf", simulate=SimulatedTest(path, ("2Z+",), "m-kg-s"), **{other: path})
    assert caught.value.code == "write.overwrites-input"
