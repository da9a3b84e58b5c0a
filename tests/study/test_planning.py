"""The step plan on small decks: targets, candidates, sensors, files and the page."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff
from click.testing import CliRunner
from scipy.stats import qmc

import femtune as ft
from femtune import Study
from femtune.arrays import Reals
from femtune.cli import main
from femtune.errors import FemtuneError
from femtune.files.uff import scan_uff
from femtune.files.uff.geometry import read_geometry
from femtune.planning import information_of, log_det, outcome_of
from femtune.reporting.html import html_text
from femtune.steps.plan.candidates import surface_normals
from femtune.steps.plan.result import PlanResult
from femtune.steps.report.build import build_page
from femtune.steps.results import Results
from structures.plan_chain import BOUNDS, NAMES, chain_deck, chain_modes, scatter_of_updates

from .matrix_chain import written
from .plate import NX, NY, grid_at, plate_deck


@pytest.fixture
def clamped(tmp_path: Path) -> Path:
    path = tmp_path / "clamped.bdf"
    path.write_text(plate_deck(clamped=True))
    return path


@pytest.fixture
def free(tmp_path: Path) -> Path:
    path = tmp_path / "plate.bdf"
    path.write_text(plate_deck())
    return path


def test_a_plan_of_a_plain_deck(free: Path) -> None:
    found = ft.plan(free, modes="7 THRU 12", uniaxial=10, triaxial=2, visualisation=3)
    kinds = [s.kind for s in found.record.sensors]
    assert kinds == ["triaxial"] * 2 + ["uniaxial"] * 10 + ["visualisation"] * 3
    assert [m.number for m in found.record.modes] == [7, 8, 9, 10, 11, 12]
    assert found.record.chosen.channels == 2 * 3 + 10 + 3
    nodes = [s.node for s in found.record.sensors]
    assert len(set(nodes)) == len(nodes)
    # the normal of a plate in the plane is Z
    assert all(s.direction == (0.0, 0.0, 1.0) for s in found.record.sensors[2:])
    assert found.auto_mac.shape == (6, 6)


@pytest.mark.slow
def test_numbers_of_the_set_are_those_of_the_shapes_at_its_points(free: Path) -> None:
    found = ft.plan(free, modes=[7, 8, 9, 10], uniaxial=6)
    shapes = ft.modes(free, count=12).mode_sets["baseline"]
    rows = shapes.select_dofs(shapes.dofs.parse(dof for s in found.record.sensors for dof in s.dofs)).shapes[:, 6:10]
    own = outcome_of(rows)
    chosen = found.record.chosen
    assert chosen.condition == pytest.approx(np.linalg.cond(rows), rel=1e-6)
    assert chosen.log_det == pytest.approx(log_det(information_of(rows)), rel=1e-6)
    np.testing.assert_allclose(found.auto_mac, own.auto_mac, atol=1e-9)
    E = np.diag(rows @ np.linalg.inv(rows.T @ rows) @ rows.T)
    assert [s.independence for s in found.record.sensors] == pytest.approx(E, abs=1e-8)


@pytest.mark.slow
def test_elastic_modes_are_the_targets_where_none_are_named(free: Path) -> None:
    found = ft.plan(free)
    assert [m.number for m in found.record.modes] == list(range(7, 13))
    assert found.record.rigid_left_out == 6
    assert len(found.record.sensors) == 12
    with_rigid = ft.plan(free, modes="1 THRU 8", rigid_body=True, triaxial=6)
    assert [m.rigid_body for m in with_rigid.record.modes] == [True] * 6 + [False] * 2


@pytest.mark.slow
def test_all_modes_and_all_points(free: Path) -> None:
    found = ft.plan(free, modes="ALL", nodes="ALL", uniaxial=8)
    assert [m.number for m in found.record.modes] == list(range(7, 13))
    assert found.record.candidate_points == (NX + 1) * (NY + 1)
    with pytest.raises(FemtuneError, match="has none of the listed numbers"):
        ft.plan(free, uniaxial=8, suspension=[{"nodes": "500 THRU 600", "stiffness": (1.0, 1.0, 1.0)}])


@pytest.mark.slow
def test_targets_of_a_band_are_solved_for(free: Path) -> None:
    hz = ft.modes(free, count=24).freq_hz
    found = ft.plan(free, band_hz=(hz[8] - 0.01, hz[20] + 0.01), uniaxial=20)
    assert [m.freq_hz for m in found.record.modes] == pytest.approx(hz[8:21], rel=1e-6)


@pytest.mark.parametrize("method", ["expansion", "elimination"])
@pytest.mark.parametrize("weighting", ["none", "kinetic-energy"])
@pytest.mark.quick(0)
def test_placed_sets_are_better_than_random_ones(free: Path, method: str, weighting: str) -> None:
    found = ft.plan(free, uniaxial=9, method=method, weighting=weighting, uniaxial_threshold=0.0)
    shapes = ft.modes(free).mode_sets["baseline"]
    z = shapes.select_dofs(shapes.dofs.parse(f"{n}Z+" for n in range(1, grid_at(NX, NY) + 1))).shapes[:, 6:]
    rng = np.random.default_rng(0)
    others = [log_det(information_of(z[rng.choice(len(z), 9, replace=False)])) for _ in range(500)]
    assert found.record.chosen.log_det is not None
    assert found.record.chosen.log_det > np.quantile(others, 0.9 if weighting == "kinetic-energy" else 0.999)


@pytest.mark.slow
def test_kinetic_energy_is_weighted_by_the_mass_at_the_points(tmp_path: Path) -> None:
    # a mass beside which all others are nothing draws a sensor, though the point moves less for it
    path = tmp_path / "plate.bdf"
    path.write_text(plate_deck(False, f"CONM2,900,{grid_at(4, 3)},,20."))
    plain = ft.plan(path, modes=[7, 8, 9, 10], uniaxial=5)
    weighted = ft.plan(path, modes=[7, 8, 9, 10], uniaxial=5, weighting="kinetic-energy")
    assert grid_at(4, 3) not in [s.node for s in plain.record.sensors]
    assert grid_at(4, 3) in [s.node for s in weighted.record.sensors]


def test_constrained_points_are_no_candidates(clamped: Path) -> None:
    found = ft.plan(clamped, uniaxial=12)
    assert found.record.still == NY + 1
    assert not {s.node for s in found.record.sensors} & {grid_at(0, j) for j in range(NY + 1)}
    assert "plan.still" in [a.code for a in found.record.alerts]


@pytest.mark.slow
def test_candidates_are_limited(free: Path) -> None:
    asked = {"modes": [7, 8, 9], "uniaxial": 4}
    some = ft.plan(free, nodes="1 THRU 30", exclude=[1, 9], **asked)
    assert some.record.candidate_points == 28
    assert {s.node for s in some.record.sensors} <= set(range(2, 31)) - {9}
    of_elements = ft.plan(free, elements="1 THRU 8", **asked)
    assert of_elements.record.candidate_points == 2 * (NX + 1)
    boxed = ft.plan(free, region={"box": ((0.0, 0.0, -1.0), (0.4, 0.6, 1.0))}, **asked)
    assert boxed.record.candidate_points == 5 * (NY + 1)


def test_points_of_a_named_set_of_the_deck(tmp_path: Path) -> None:
    path = tmp_path / "plate.bdf"
    path.write_text(plate_deck(False, "ASET1,3,1,9,12,20,33,41,55,", ",63"))
    found = ft.plan(path, dof_set="ASET", modes=[7, 8, 9], uniaxial=4)
    assert found.record.candidate_points == 8
    with pytest.raises(FemtuneError, match=r"CSET; .*ASET"):
        ft.plan(path, dof_set="CSET")


def test_directions_along_the_axes(free: Path) -> None:
    found = ft.plan(free, directions=["X", "Z"], modes="7 THRU 10", uniaxial=8)
    assert {s.dofs[0][-2] for s in found.record.sensors} == {"Z"}
    # in-plane motion is zero but for rounding in bending modes
    assert found.record.candidate_directions == (NX + 1) * (NY + 1)


@pytest.mark.slow
def test_given_sensors_stay_and_count(free: Path) -> None:
    found = ft.plan(free, modes="7 THRU 10", placed=["1", "9Z-"], uniaxial=4)
    first, second, *others = found.record.sensors
    assert (first.node, first.kind, first.given, first.dofs) == (1, "triaxial", True, ("1X+", "1Y+", "1Z+"))
    assert (second.node, second.kind, second.direction) == (9, "uniaxial", (0.0, 0.0, -1.0))
    assert not {1, 9} & {s.node for s in others}
    alone = ft.plan(free, modes="7 THRU 9", placed=["1", "9Z+", "59Z+", "32Z+"])
    assert [s.given for s in alone.record.sensors] == [True] * 4
    # the plate does not move in its plane: of four directions two see something
    with pytest.raises(FemtuneError, match="the 4 measured directions of the sensors see only 2 independent"):
        ft.plan(free, modes="7 THRU 9", placed=["1", "9Z+"])


def test_the_universal_file_holds_points_axes_and_lines(free: Path, tmp_path: Path) -> None:
    path = tmp_path / "plan.uff"
    found = ft.plan(free, modes="7 THRU 12", uniaxial=12, uff=path, units="m-kg-s")
    frame, notices = read_geometry(scan_uff(path))
    assert not notices
    assert frame.nodes.tolist() == sorted(s.node for s in found.record.sensors)
    by_node = {s.node: s for s in found.record.sensors}
    np.testing.assert_allclose(frame.coordinates, [by_node[n].position for n in frame.nodes.tolist()])
    assert frame.axes is not None
    np.testing.assert_allclose(frame.axes, [by_node[n].axes for n in frame.nodes.tolist()])
    assert set(frame.lines) == set(found.record.lines)
    assert len(frame.lines) >= 11
    # another reader finds the same points
    points = next(one for one in pyuff.UFF(str(path)).read_sets() if one["type"] == 2411)
    np.testing.assert_allclose(np.column_stack([points["x"], points["y"], points["z"]]), frame.coordinates)


def test_axes_of_an_inclined_surface(tmp_path: Path) -> None:
    path = tmp_path / "turned.bdf"
    lines = []
    for line in plate_deck().splitlines():
        word, n, *place = line.split(",") if line.startswith("GRID") else ("", "")
        turned = f"GRID,{n},,{0.8 * float(place[1]):.4f},{place[2]},{0.6 * float(place[1]):.4f}" if word else line
        lines.append(turned)
    path.write_text("\n".join(lines) + "\n")
    found = ft.plan(path, modes="7 THRU 10", uniaxial=6)
    for s in found.record.sensors:
        assert s.direction == pytest.approx((-0.6, 0.0, 0.8), abs=1e-12)
        axes = np.array(s.axes)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)
    assert _LETTER in html_text(build_page("plan", found.results, found.arrays))


_LETTER = "the letter is an axis of the sensor"


def test_letters_that_are_axes_of_the_model_are_not_explained(free: Path) -> None:
    found = ft.plan(free, modes="7 THRU 9", uniaxial=4)
    assert _LETTER not in html_text(build_page("plan", found.results, found.arrays))


def test_normals_of_a_cube_and_of_a_shell_wound_both_ways() -> None:
    xyz = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [5, 5, 5]], float)
    faces = np.array([[0, 1, 2, 3], [1, 2, 5, 4], [2, 5, 3, -1]])
    found = surface_normals(xyz, faces)
    np.testing.assert_allclose(np.abs(found[:6]), np.tile([0.0, 0.0, 1.0], (6, 1)), atol=1e-15)
    assert not found[6].any()
    # a corner of a cube: the mean of three faces
    cube = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], float)
    corner = surface_normals(cube, np.array([[0, 3, 2, 1], [0, 1, 5, 4], [0, 4, 6, 3]]))[0]
    np.testing.assert_allclose(np.abs(corner), np.full(3, 3**-0.5))


def test_the_table_of_sensors(free: Path, tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    found = ft.plan(free, modes="7 THRU 9", triaxial=1, uniaxial=3, csv=path)
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [r["name"] for r in rows] == ["T1", "U1", "U2", "U3"]
    assert [int(r["node"]) for r in rows] == [s.node for s in found.record.sensors]
    assert [r["dofs"].split() for r in rows] == [list(s.dofs) for s in found.record.sensors]
    assert rows[0]["direction_z"] == ""
    assert float(rows[1]["direction_z"]) == 1.0


@pytest.mark.slow
def test_a_study_without_a_test_is_planned_from_the_command_line(tmp_path: Path) -> None:
    (tmp_path / "plate.bdf").write_text(plate_deck())
    study = tmp_path / "study.toml"
    study.write_text(
        '[study]\ntitle = "Plate"\ndeck = "plate.bdf"\nunits = "m-kg-s"\n[plan]\nmodes = "7 THRU 12"\nuniaxial = 9\n'
    )
    page, uff = tmp_path / "plan.html", tmp_path / "plan.uff"
    shown = CliRunner().invoke(
        main, ["plan", str(study), "--report", str(page), "--uff", str(uff), "--band", "1", "90"]
    )
    assert shown.exit_code == 0, shown.output
    assert "Largest AutoMAC of two target modes" in shown.output
    assert uff.exists()
    assert "data:image/svg+xml" in page.read_text()
    as_json = CliRunner().invoke(main, ["plan", str(study), "--json", "--uniaxial", "7"])
    assert len(json.loads(as_json.stdout)["sensors"]) == 7


def test_the_page_can_be_kept_as_results(free: Path) -> None:
    found = ft.plan(free, modes="7 THRU 9", triaxial=1, uniaxial=4)
    again = Results.model_validate_json(found.results.model_dump_json())
    assert again == found.results
    assert set(again.array_keys()) <= set(found.arrays)
    page = html_text(build_page("plan", again, found.arrays))
    assert {c.key for c in again.citations} == {
        "kammer2005",
        "kammer2004",
        *["fedorov1972"] * bool(found.record.exchanges),
    }
    assert "Kammer" in page
    assert "T1" in page
    assert "AutoMAC" in page


def test_how_a_plan_shows_itself(free: Path) -> None:
    found: PlanResult = ft.plan(free, modes="7 THRU 9", triaxial=1, uniaxial=4)
    assert repr(found).startswith("PlanResult: baseline: 1 triaxial, 4 uniaxial sensors for 3 target modes")
    assert found.sensors.column("kind").tolist() == ["triaxial"] + ["uniaxial"] * 4
    assert found.modes[0].number == 7


def test_options_replace_single_keys_of_the_study(tmp_path: Path) -> None:
    (tmp_path / "plate.bdf").write_text(plate_deck())
    study = tmp_path / "study.toml"
    study.write_text(
        '[study]\ntitle = "Plate"\ndeck = "plate.bdf"\nunits = "m-kg-s"\n[plan]\nmodes = [7, 8, 9]\nuniaxial = 9\n'
        "region = { box = [[0.0, 0.0, -1.0], [0.4, 0.6, 1.0]] }\n[[plan.suspension]]\nnodes = [1, 9]\n"
        "stiffness = [1.0, 1.0, 1.0]\n"
    )
    found = ft.plan(study, uniaxial=4)
    assert len(found.record.sensors) == 4
    assert found.record.candidate_points == 5 * (NY + 1)
    assert found.record.suspension is not None
    assert [m.number for m in found.record.modes] == [7, 8, 9]


@pytest.mark.slow
def test_only_the_configuration_that_is_asked_for_is_planned(tmp_path: Path) -> None:
    (tmp_path / "plate.bdf").write_text(plate_deck())
    study = tmp_path / "study.toml"
    study.write_text(
        '[study]\ntitle = "Plate"\ndeck = "plate.bdf"\nunits = "m-kg-s"\n[[configuration]]\nname = "free"\n'
        '[[configuration]]\nname = "heavy"\nmasses = [{ node = 1, mass = 3.0 }]\n'
        '[plan]\nconfiguration = "heavy"\nmodes = [7, 8]\nuniaxial = 3\n'
    )
    found = ft.plan(study)
    assert found.record.configuration == "heavy"
    heavy = ft.modes(study)["heavy"].freq_hz
    assert [m.freq_hz for m in found.record.modes] == pytest.approx(heavy[6:8])
    with pytest.raises(FemtuneError, match="light"):
        ft.plan(study, configuration="light")


@pytest.mark.slow
def test_exciters_excite_every_target_mode(free: Path) -> None:
    found = ft.plan(free, modes="7 THRU 12", uniaxial=12, exciters=2)
    assert [e.name for e in found.record.exciters] == ["E1", "E2"]
    shapes = ft.modes(free).mode_sets["baseline"]
    z = shapes.select_dofs(shapes.dofs.parse(f"{n}Z+" for n in range(1, grid_at(NX, NY) + 1))).shapes[:, 6:12]
    levels = (z**2 / (z**2).max(axis=0))[[e.node - 1 for e in found.record.exciters]]
    assert [m.level for m in found.record.excitation] == pytest.approx(levels.max(axis=0), rel=1e-6)
    # no pair of points is much better
    every = z**2 / (z**2).max(axis=0)
    best = max(np.maximum(every[i], every[j]).min() for i in range(len(z)) for j in range(i))
    assert levels.max(axis=0).min() > 0.8 * best
    assert all(0.0 <= m.indicator < 0.1 for m in found.record.excitation)
    assert found.exciters[0].dof == found.record.exciters[0].dof


@pytest.mark.slow
def test_a_given_exciter_and_the_sensor_at_its_driving_point(free: Path) -> None:
    # on the axis of symmetry: antisymmetric modes are not excited
    middle = f"{grid_at(4, 3)}Z+"
    found = ft.plan(free, modes="7 THRU 10", placed=[middle], uniaxial=8, exciters_placed=[middle])
    (exciter,) = found.record.exciters
    assert exciter.given
    assert exciter.sensor == "U1"
    low = [m.number for m in found.record.excitation if m.level < 0.1]
    assert low
    (alert,) = [a for a in found.record.alerts if a.code == "plan.not-excited"]
    assert ", ".join(map(str, low)) in alert.sentence
    both = ft.plan(free, modes="7 THRU 10", placed=[middle], uniaxial=8, exciters_placed=[middle], exciters=1)
    assert min(m.level for m in both.record.excitation) > 0.3
    only = ft.plan(free, modes="7 THRU 10", uniaxial=8, exciters=1, exciter_nodes=[1, 9])
    assert only.record.exciters[0].node in (1, 9)


@pytest.mark.slow
def test_frequency_lines_of_the_band(free: Path) -> None:
    found = ft.plan(free, band_hz=(20.0, 120.0), uniaxial=20, damping_ratio=0.005, lines_per_half_band=4)
    lines = found.calibration_lines
    assert lines is not None
    assert lines[[0, -1]] == pytest.approx([20.0, 120.0])
    assert (np.diff(lines) / (0.01 * lines[:-1])).max() <= 0.25 + 1e-12
    record = found.record.frequency_lines
    assert record is not None
    lowest = found.record.modes[0].freq_hz
    assert record.spacing_hz == pytest.approx(0.01 * lowest / 4)
    own = ft.plan(free, modes=[7, 9], uniaxial=4).record
    assert own.frequency_lines is not None
    assert own.frequency_lines.low_hz == pytest.approx(0.9 * own.modes[0].freq_hz)


@pytest.mark.slow
def test_masses_of_the_sensors_shift_as_masses_of_the_configuration(free: Path) -> None:
    found = ft.plan(free, modes="7 THRU 10", triaxial=1, uniaxial=5, triaxial_mass=0.02, uniaxial_mass=0.01)
    assert found.record.sensor_mass == pytest.approx(0.07)
    masses = [{"node": s.node, "mass": 0.02 if s.kind == "triaxial" else 0.01} for s in found.record.sensors]
    loaded = Study(
        model=free, units="m-kg-s", configurations=[{"name": "loaded", "masses": masses}], modes={"count": 12}
    )
    exact = 100.0 * (ft.modes(loaded).freq_hz[6:10] / ft.modes(free).freq_hz[6:10] - 1.0)
    assert [m.shift_percent for m in found.record.loading] == pytest.approx(exact, rel=1e-4)
    assert [m.rayleigh_percent for m in found.record.loading] == pytest.approx(exact, rel=0.1)
    heavy = ft.plan(free, modes="7 THRU 10", uniaxial=5, uniaxial_mass=0.2)
    assert "plan.mass-loading" in [a.code for a in heavy.record.alerts]
    assert not ft.plan(free, modes="7 THRU 10", uniaxial=5).record.loading


@pytest.mark.slow
def test_a_suspension_beside_springs_in_the_deck(tmp_path: Path, free: Path) -> None:
    corners = [grid_at(0, 0), grid_at(NX, 0), grid_at(0, NY), grid_at(NX, NY)]
    found = ft.plan(
        free, modes="7 THRU 10", uniaxial=6, suspension=[{"nodes": corners, "stiffness": (30.0, 40.0, 50.0)}]
    ).record.suspension
    assert found is not None
    cards = [
        f"CELAS2,{900 + 10 * k + c},{10.0 * (c + 2)},{node},{c}" for k, node in enumerate(corners) for c in (1, 2, 3)
    ]
    path = tmp_path / "hung.bdf"
    path.write_text(plate_deck(False, *cards))
    hung, own = ft.modes(path).freq_hz, ft.modes(free).freq_hz
    assert found.rigid_hz == pytest.approx(hung[:6], rel=2e-3)
    assert found.first_elastic_hz == pytest.approx(hung[6], rel=2e-5)
    assert found.shift_percent == pytest.approx(100.0 * (hung[6:10] / own[6:10] - 1.0), rel=2e-2)
    # a mass of 5.2 kg on four springs of 50 N/m
    assert found.rigid_hz[2] == pytest.approx(np.sqrt(200.0 / (0.48 * 0.004 * 2700.0)) / (2.0 * np.pi), rel=2e-3)
    stiff = ft.plan(free, modes="7 THRU 10", uniaxial=6, suspension=[{"nodes": corners, "stiffness": (0.0, 0.0, 1e5)}])
    assert "plan.stiff-suspension" in [a.code for a in stiff.record.alerts]


def test_everything_is_on_the_page_and_in_the_files(free: Path, tmp_path: Path) -> None:
    table, frame = tmp_path / "plan.csv", tmp_path / "plan.uff"
    found = ft.plan(
        free, modes="7 THRU 10", uniaxial=6, exciters=1, uniaxial_mass=0.01, csv=table, uff=frame, units="m-kg-s",
        suspension=[{"nodes": [1, 9, 55, 63], "stiffness": (1.0, 1.0, 1.0)}], report=tmp_path / "plan.html",
    )  # fmt: skip
    page = (tmp_path / "plan.html").read_text()
    for words in (
        "Excitation of the target modes",
        "Masses of the sensors",
        "Effect of the suspension",
        "per half band",
    ):
        assert words in page
    assert table.read_text().splitlines()[-1].startswith(f"E1,exciter,{found.record.exciters[0].node},")
    assert found.record.exciters[0].node in read_geometry(scan_uff(frame))[0].nodes


_CALIBRATION = {"frequency_sd": 0.002, "shape_sd": 0.03}


def _chain(folder: Path, **more: Any) -> Study:
    fields = {name: [f"PELAS {g + 1} K"] for g, name in enumerate(NAMES)}
    parameters = [{"name": n, "fields": f, "lower": BOUNDS[0], "upper": BOUNDS[1]} for n, f in fields.items()]
    plan = {"modes": "1 THRU 4", "directions": ("X",), "uniaxial_threshold": 0.0, **_CALIBRATION, **more}
    return Study(model=chain_deck(folder), units="m-kg-s", parameters=parameters, modes={"count": 6}, plan=plan)


def _expected(nodes: list[int], at: Reals | None = None) -> tuple[Reals, Reals]:
    """F of the chain by central differences, per prior standard deviation, and standard deviations with the prior."""
    x, step, sd = np.ones(3) if at is None else at, 1e-5, (BOUNDS[1] - BOUNDS[0]) / np.sqrt(12.0)
    rows = np.array(nodes) - 2
    hz, shapes = chain_modes(x, 4)
    entry_sd = _CALIBRATION["shape_sd"] * np.abs(shapes).max(axis=0)

    def unit(z: Reals) -> Reals:
        phi = chain_modes(z, 4)[1]
        phi = phi * np.sign((phi * shapes).sum(axis=0))
        return phi[rows] / np.linalg.norm(phi[rows], axis=0)

    blocks = []
    for e in step * np.eye(3):
        f = (chain_modes(x + e, 4)[0] - chain_modes(x - e, 4)[0]) / (2.0 * step) / hz / _CALIBRATION["frequency_sd"]
        u = (unit(x + e) - unit(x - e)) / (2.0 * step) * np.linalg.norm(shapes[rows], axis=0) / entry_sd
        blocks.append(np.concatenate([f, u.ravel()]) * sd)
    J = np.array(blocks).T
    F = J.T @ J
    return F, sd * np.sqrt(np.diag(np.linalg.inv(np.eye(3) + F)))


def test_expected_standard_deviations_beside_differences(tmp_path: Path) -> None:
    found = ft.plan(_chain(tmp_path, uniaxial=6))
    F, expected = _expected([s.node for s in found.record.sensors])
    sd = (BOUNDS[1] - BOUNDS[0]) / np.sqrt(12.0)
    assert [p.name for p in found.record.parameters] == list(NAMES)
    assert found.parameters.column("expected_sd") == pytest.approx(expected, rel=1e-5)
    assert found.parameters.column("data_sd") == pytest.approx(sd * np.sqrt(np.diag(np.linalg.inv(F))), rel=1e-5)
    assert found.parameters.column("prior_sd") == pytest.approx([sd] * 3)
    assert (found.parameters.column("frequencies_sd") > expected).all()
    assert "σ expected" in html_text(build_page("plan", found.results, found.arrays))


@pytest.mark.parametrize("criterion", ["D", "A"])
@pytest.mark.slow
def test_sensors_for_the_parameters_are_the_best_of_all_sets(tmp_path: Path, criterion: str) -> None:
    found = ft.plan(_chain(tmp_path, aim="parameters", criterion=criterion, uniaxial=4))

    def score(nodes: Iterable[int]) -> float:
        F = np.eye(3) + _expected(list(nodes))[0]
        return float(np.linalg.slogdet(F)[1] if criterion == "D" else -np.trace(np.linalg.inv(F)))

    own = score(s.node for s in found.record.sensors)
    # 1,001 sets of four of the fourteen masses
    every = [score(some) for some in combinations(range(2, 16), 4)]
    assert own == pytest.approx(max(every), rel=1e-3 if criterion == "D" else 0.03)
    assert own >= np.quantile(every, 0.99)
    assert all(p.candidates_sd is not None and p.candidates_sd <= p.expected_sd for p in found.record.parameters)


def test_points_within_the_bounds(tmp_path: Path) -> None:
    found = ft.plan(_chain(tmp_path, aim="parameters", uniaxial=6, points=4, average="worst", seed=3))
    lower, upper = BOUNDS
    unit = qmc.LatinHypercube(3, rng=np.random.default_rng(3)).random(3)
    nodes = [s.node for s in found.record.sensors]
    each = [_expected(nodes)[1], *(_expected(nodes, lower + (upper - lower) * u)[1] for u in unit)]
    assert found.parameters.column("expected_sd") == pytest.approx(each[0], rel=1e-5)
    assert found.parameters.column("worst_sd") == pytest.approx(np.max(each, axis=0), rel=1e-4)


def test_given_and_triaxial_sensors_count_for_the_parameters(tmp_path: Path) -> None:
    found = ft.plan(_chain(tmp_path, aim="parameters", triaxial=2, uniaxial=2, placed=("15X+",)))
    nodes = [s.node for s in found.record.sensors]
    assert nodes[0] == 15
    assert found.parameters.column("expected_sd") == pytest.approx(_expected(nodes)[1], rel=1e-5)


def test_a_plan_of_matrices(tmp_path: Path) -> None:
    (tmp_path / "mesh.inp").write_text("*NODE\n" + "".join(f"{10 * (i + 1)}, {i}., 0., 0.\n" for i in range(5)))
    found = ft.plan(written(tmp_path, "", model='grid = "mesh.inp"'), modes=[1, 2], uniaxial=3)
    assert {s.node for s in found.record.sensors} <= {10, 20, 30, 40, 50}
    assert all(p.expected_sd < p.prior_sd for p in found.record.parameters)
    with pytest.raises(FemtuneError, match="have no coordinates") as caught:
        ft.plan(written(tmp_path, ""), modes=[1, 2], uniaxial=3)
    assert caught.value.code == "plan.candidates"


@pytest.mark.slow
@pytest.mark.parametrize("tests", [300, pytest.param(1000, marks=pytest.mark.long)])
def test_the_scatter_of_simulated_tests_is_the_expected_one(tmp_path: Path, tests: int) -> None:
    found = ft.plan(_chain(tmp_path, aim="parameters", uniaxial=6))
    shapes = chain_modes(np.ones(3), 4)[1]
    entry_sd = _CALIBRATION["shape_sd"] * np.abs(shapes).max(axis=0)
    masses = np.array([s.node - 1 for s in found.record.sensors])
    factors = scatter_of_updates(masses, np.arange(1, 5), _CALIBRATION["frequency_sd"], entry_sd, tests)
    # four and a half standard errors of a standard deviation: 10 % of 1000 values, 18 % of 300
    assert factors.std(axis=0) == pytest.approx(found.parameters.column("data_sd"), rel=4.5 / np.sqrt(2.0 * tests))
