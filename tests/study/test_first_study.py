"""init and check: a first study from a deck and a test, and all mistakes of a study at once."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator
from tests.messages.shown import check_shown

import femtune as ft
from femtune.cli import main
from femtune.errors import FemtuneError, Where
from femtune.fem.fields import FieldRef
from femtune.files.deviations import deviations_text
from femtune.files.study_file.json_schema import file_schema, schema_text
from femtune.steps.init.proposed_parameters import candidates
from femtune.testing import example_deck, example_test

_DOCS = Path(__file__).resolve().parents[2] / "docs"


def plate(
    folder: Path, nx: int, ny: int, *, scale: float = 1000.0, material: str = "7.1+4,,.33,2.7-9", case: str = "METHOD=1"
) -> Path:
    """A free aluminium plate of 600 × 400 × 5 mm³, with an EIGRL of ten modes; `scale` units of length a metre."""
    lines = ["SOL 103", "CEND", case, "BEGIN BULK", "EIGRL,1,,,10", f"MAT1,1,{material}"]
    lines.append(f"PSHELL,1,1,{0.005 * scale:.6f},1,,1")
    for j in range(ny + 1):
        for i in range(nx + 1):
            place = f"{0.6 * scale * i / nx:.4f},{0.4 * scale * j / ny:.4f},0."
            lines.append(f"GRID,{1 + i + j * (nx + 1)},,{place}")
    for j in range(ny):
        for i in range(nx):
            a = 1 + i + j * (nx + 1)
            lines.append(f"CQUAD4,{1 + i + j * nx},1,{a},{a + 1},{a + nx + 2},{a + nx + 1}")
    path = folder / "plate.bdf"
    path.write_text("\n".join([*lines, "ENDDATA", ""]))
    return path


def plate_test(deck: Path, nodes: int, units: str = "mm-t-s", count: int = 16) -> ft.ModalTest:
    """The elastic modes of the plate at all points, normal to it, with random errors."""
    scatter = {"frequency_scatter": 0.005, "shape_scatter": 0.02}
    return ft.simulate(deck, [f"1 THRU {nodes}:3"], units=units, count=count, **scatter)


@pytest.fixture
def small(tmp_path: Path) -> tuple[Path, Path]:
    deck = plate(tmp_path, 6, 4)
    return deck, ft.write_test(plate_test(deck, 35), tmp_path / "test.uff")


def test_a_free_plate_has_all_elastic_modes_paired_on_defaults(small: tuple[Path, Path]) -> None:
    """METHOD asks for ten modes, six of which are rigid: they do not count, and the test is reached."""
    deck, test = small
    found = ft.correlate(ft.read_deck(deck, units="mm-t-s"), test)
    assert len(found[0].pairs) == 10
    assert found[0].rigid_body_modes == 6


@pytest.mark.slow
def test_points_without_a_place_are_assigned_by_their_numbers(small: tuple[Path, Path], tmp_path: Path) -> None:
    """All points at 0, 0, 0: they do not lie at one grid point, and all modes are paired by the numbers."""
    deck, _ = small
    test = _moved(plate_test(deck, 35), np.zeros_like, np.eye(3))
    made = ft.init(deck, ft.write_test(test, tmp_path / "zero.uff"), tmp_path / "new")
    assert tomllib.loads(made.path.read_text())["sensors"]["by_id"] is True
    assert made.record.paired == 10


@pytest.mark.slow
def test_modes_that_a_study_asks_for_are_those_that_are_solved(small: tuple[Path, Path]) -> None:
    deck, test = small
    found = ft.correlate(ft.read_deck(deck, units="mm-t-s"), test, modes={"count": 10})
    reasons = [mode.reason for mode in found[0].unpaired_test]
    assert len(found[0].pairs) == 4
    solved, reached = found[0].mac_model_freq_hz[-1], found[0].mac_test_freq_hz[-1]
    assert f"solved to {solved:.4g} Hz, the test reaches {reached:.4g} Hz" in reasons[-1]


@pytest.mark.slow
def test_newcomers_run(small: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """init, check and correlate in an empty folder."""
    deck, test = small
    folder = deck.parent / "new"
    made = ft.init(deck, test, folder)
    assert made.record.units == "mm-t-s"
    assert made.record.rigid_body_modes == 6
    assert (made.record.test_modes, made.record.paired) == (10, 10)
    assert ft.check(made.path).ok
    data = tomllib.loads(made.path.read_text())
    assert data["study"] == {"title": "plate", "deck": "../plate.bdf", "units": "mm-t-s"}
    assert len(ft.correlate(made.path)[0].pairs) == 10
    assert made.path.read_text().count("[[parameter]]") == 1


@pytest.mark.slow
def test_newcomers_run_to_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands as they are typed, from the simulated test to the report."""
    truth = plate(tmp_path, 18, 12)
    stiff = ft.write_deck(truth, {"MAT1 1 E": 7.5e4}, tmp_path / "truth.bdf")
    ft.write_test(plate_test(stiff, 247), tmp_path / "test.uff")
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")

    def call(*words: str, code: int = 0) -> str:
        result = CliRunner().invoke(main, words)
        assert result.exit_code == code, result.output
        return result.stdout

    assert "10 test modes, 10 paired" in call("init", "../plate.bdf", "../test.uff")
    assert "no errors" in call("check", "study.toml")
    # not accepted: the error of the mesh is 4 % in the highest mode
    assert "report:" in call("run", "study.toml", code=4)
    results = ft.read_results("run").results
    assert results.judgement is not None
    assert [r.code for r in results.judgement.reasons if r.weight == "not accepted"] == ["model.mesh-coarse"]
    assert len(results.correlations[-1].pairs) == 10
    # the thickness takes the error of the modulus over: f ∝ t √E of a thin plate
    (found,) = results.update.parameters
    assert found.name == "T_PSHELL_1"
    assert found.value == pytest.approx((7.5 / 7.1) ** 0.5, abs=4 * found.sd + 2e-3)


# ----------------------------------------------------------------------------------------------------
# Standard deviations.


def _residuals(made: ft.InitResult) -> dict[str, Any]:
    return tomllib.loads(made.path.read_text())["residuals"]


@pytest.mark.slow
def test_deviations_that_nobody_stated_are_marked_as_guesses(small: tuple[Path, Path]) -> None:
    made = ft.init(*small, small[0].parent / "new")
    keys = ["frequency_sd", "shape_sd"]
    assert _residuals(made) == {"frequency_sd": 0.005, "shape_sd": 0.03, "assumed": keys}


@pytest.mark.slow
@pytest.mark.parametrize("of_shapes", [True, False], ids=["frequencies and shapes", "frequencies"])
def test_deviations_of_an_identification_are_those_of_the_study(small: tuple[Path, Path], of_shapes: bool) -> None:
    deck, path = small
    test = ft.read_test(path)
    assert test.modes is not None
    shapes_sd = 0.02 * np.abs(test.modes.shapes).max() * np.ones_like(test.modes.shapes) if of_shapes else None
    known = replace(test.modes, freq_sd_hz=0.004 * test.modes.freq_hz, shapes_sd=shapes_sd)
    text = deviations_text(known)
    assert text is not None
    path.with_name("deviations.json").write_text(text)
    made = ft.init(deck, path, deck.parent / "new")
    expected = {"shape_sd": "test"} if of_shapes else {"shape_sd": 0.03, "assumed": ["shape_sd"]}
    assert _residuals(made) == {"frequency_sd": "test", **expected}
    assert tomllib.loads(made.path.read_text())["test"]["deviations"] == "../deviations.json"
    assert ft.check(made.path).ok


@pytest.mark.slow
def test_deviations_of_another_test_are_left_alone(small: tuple[Path, Path]) -> None:
    deck, path = small
    test = ft.read_test(path)
    assert test.modes is not None
    other = replace(test.modes, freq_hz=2.0 * test.modes.freq_hz, freq_sd_hz=0.004 * test.modes.freq_hz)
    text = deviations_text(other)
    assert text is not None
    path.with_name("deviations.json").write_text(text)
    assert _residuals(ft.init(deck, path, deck.parent / "new"))["frequency_sd"] == 0.005


# ----------------------------------------------------------------------------------------------------
# Units.


_UNITS = {
    "m-kg-s": (1.0, "7.1+10,,.33,2700."),
    "mm-t-s": (1000.0, "7.1+4,,.33,2.7-9"),
    "mm-kg-s": (1000.0, "7.1+7,,.33,2.7-6"),
    "in-slinch-s": (1.0 / 0.0254, "1.03+7,,.33,2.53-4"),
}


@pytest.mark.quick(0)
@pytest.mark.parametrize("units", _UNITS)
def test_units_are_guessed_from_materials_and_coordinates(tmp_path: Path, units: str) -> None:
    scale, material = _UNITS[units]
    deck = plate(tmp_path, 6, 4, scale=scale, material=material)
    test = ft.write_test(plate_test(deck, 35, units), tmp_path / "test.uff")
    made = ft.init(deck, test, tmp_path / "new")
    assert made.record.units == units
    assert any("MAT1 1 is aluminium" in reason for reason in made.record.unit_reasons)
    assert not made.record.doubts


@pytest.mark.slow
def test_a_weight_density_is_named_with_its_factor(tmp_path: Path) -> None:
    """In pounds a cubic inch without WTMASS; masses are 386 times too large."""
    deck = plate(tmp_path, 6, 4, scale=1.0 / 0.0254, material="1.03+7,,.33,.0976")
    test = ft.write_test(plate_test(deck, 35, "in-slinch-s"), tmp_path / "test.uff")
    made = ft.init(deck, test, tmp_path / "new")
    assert made.record.units == "in-slinch-s"
    assert "386.09" in made.record.doubts[0]
    assert "PARAM,WTMASS,0.0025901" in made.record.doubts[0]


@pytest.mark.slow
def test_a_test_whose_file_states_no_units(tmp_path: Path) -> None:
    deck = plate(tmp_path, 6, 4)
    path = ft.write_test(plate_test(deck, 35, "mm-t-s"), tmp_path / "test.uff")
    sets = re.split(r"(?m)^    -1\n", path.read_text())
    path.write_text("".join(f"    -1\n{one}    -1\n" for one in sets if one and one.split()[0] != "164"))
    made = ft.init(deck, path, tmp_path / "new")
    assert (made.record.units, made.record.test_units) == ("mm-t-s", "mm-t-s")
    assert made.record.paired == 10
    assert ft.check(made.path).ok


@pytest.mark.slow
def test_units_may_be_stated(small: tuple[Path, Path]) -> None:
    made = ft.init(*small, small[0].parent / "new", units="mm-kg-s")
    assert made.record.units == "mm-kg-s"


# ----------------------------------------------------------------------------------------------------
# Sensors.


def _moved(test: ft.ModalTest, change: Callable[[np.ndarray], np.ndarray], turn: np.ndarray) -> ft.ModalTest:
    """The test with its points elsewhere and its axes turned along."""
    frame = test.geometry
    moved = replace(frame, coordinates=change(frame.coordinates), axes=np.asarray(frame.axes) @ turn.T)
    return replace(test, geometry=moved, sensors=())


_CYCLE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_OBLIQUE = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("turn", "shift", "renumbered"),
    [(_CYCLE, 0.0, True), (_CYCLE, 50.0, False), (_OBLIQUE, 12.5, False), (np.eye(3), 100.0, True)],
    ids=["axes exchanged", "and moved, by number", "oblique, by number", "moved"],
)
def test_axes_and_origin_are_found(tmp_path: Path, turn: np.ndarray, shift: float, renumbered: bool) -> None:
    """Points x of the model are at turn·x + shift in the test; the study maps them back."""
    deck = plate(tmp_path, 6, 4)
    test = _moved(plate_test(deck, 35), lambda x: x @ turn.T + shift, turn)
    text = ft.write_test(test, tmp_path / "test.uff")
    if renumbered:
        from femtune.testdata.convert import renumber  # noqa: PLC0415

        far = renumber(ft.read_test(text), {n: 5000 + n for n in range(1, 36)})
        text = ft.write_test(far, tmp_path / "far.uff")
    made = ft.init(deck, text, tmp_path / "new")
    assert made.record.paired == 10
    stated = tomllib.loads(made.path.read_text())["test"]
    rotation, origin = np.array(stated.get("rotation", np.eye(3))), np.array(stated.get("origin", np.zeros(3)))
    points = ft.read_deck(deck).structure.nodes.xyz
    back = (points @ turn.T + shift) @ rotation.T + origin
    distance = np.linalg.norm(points[:, None] - back[None], axis=2).min(axis=0)
    assert distance.max() < 1e-3 * 721.0


@pytest.mark.slow
def test_points_between_grid_points_get_a_tolerance(tmp_path: Path) -> None:
    deck = plate(tmp_path, 6, 4)
    test = plate_test(deck, 35)
    from femtune.testdata.convert import renumber  # noqa: PLC0415

    wild = np.random.default_rng(1).uniform(-6.0, 6.0, (35, 3))
    test = _moved(test, lambda x: x + wild, np.eye(3))
    far = renumber(test, {n: 5000 + n for n in range(1, 36)})
    made = ft.init(deck, ft.write_test(far, tmp_path / "far.uff"), tmp_path / "new")
    tolerance = tomllib.loads(made.path.read_text())["sensors"]["tolerance"]
    assert 5.0 < tolerance < 0.05 * 721.2
    assert ft.check(made.path).ok


@pytest.mark.slow
def test_places_win_against_numbers_that_are_those_of_other_grid_points(tmp_path: Path) -> None:
    """Points 1 to 15 at every second grid point, one of them displaced, in axes turned about the normal and shifted."""
    from femtune.testdata.convert import renumber  # noqa: PLC0415

    deck = plate(tmp_path, 6, 4)
    sensors = [1, 3, 5, 7, 8, 12, 15, 17, 20, 22, 25, 28, 29, 33, 35]
    made = ft.simulate(deck, [f"{n}:3" for n in sensors], units="mm-t-s", count=16)
    turned = _moved(made, lambda x: (x + np.array([0.0, 0.0, 40.0])) @ _OBLIQUE.T, _OBLIQUE)
    places = turned.geometry.coordinates.copy()
    places[4] += [20.0, 9.0, 0.0]
    turned = replace(turned, geometry=replace(turned.geometry, coordinates=places), sensors=())
    numbered = renumber(turned, {n: i for i, n in enumerate(sensors, 1)})
    first = ft.init(deck, ft.write_test(numbered, tmp_path / "test.uff"), tmp_path / "new")
    assert "by_id" not in first.path.read_text()
    assert first.record.paired == 10
    assert "equally well" in " ".join(first.record.doubts)
    assert Path(first.record.picture).read_text().startswith("<svg")
    assert ft.check(first.path).ok


@pytest.mark.slow
def test_points_without_place_are_told(tmp_path: Path) -> None:
    """The study is written, and check says what is missing."""
    deck = plate(tmp_path, 6, 4)
    test = _moved(plate_test(deck, 35), lambda x: 5.0 * x + 10_000.0, np.eye(3))
    from femtune.testdata.convert import renumber  # noqa: PLC0415

    far = renumber(test, {n: 5000 + n for n in range(1, 36)})
    made = ft.init(deck, ft.write_test(far, tmp_path / "far.uff"), tmp_path / "new")
    assert any("nodes = {" in doubt for doubt in made.record.doubts)
    assert made.record.paired is None
    assert any(p.proposed for p in made.record.parameters)
    assert [p.code for p in ft.check(made.path).record.problems] == ["sensor.unmatched"]


# ----------------------------------------------------------------------------------------------------
# Parameters.


@pytest.mark.slow
def test_what_cannot_be_told_apart_is_proposed_once(small: tuple[Path, Path]) -> None:
    """Thickness, modulus and density of a thin plate change all frequencies alike: f ∝ t √(E/ρ)."""
    made = ft.init(*small, small[0].parent / "new")
    first, *others = made.record.parameters
    assert (first.field, first.proposed) == ("PSHELL 1 T", True)
    assert {(p.field, p.like) for p in others} == {("MAT1 1 E", "T_PSHELL_1"), ("MAT1 1 RHO", "T_PSHELL_1")}
    # f ∝ t: n frequencies of 0.5 % give the thickness to 0.5 %/√n; the eleventh mode is near the tenth
    assert first.sd_percent is not None
    assert 0.49 / 11**0.5 < first.sd_percent < 0.515 / 10**0.5


def test_candidates_are_fields_of_materials_properties_joints_and_masses(tmp_path: Path) -> None:
    text = example_deck(tmp_path).read_text()
    joint = "PELAS,7,1.+5\nCELAS1,70,7,5,2\nPELAS,8,1.+5\n"
    deck = tmp_path / "joint.bdf"
    deck.write_text(text.replace("ENDDATA", f"{joint}ENDDATA"))
    found = {str(c.ref): c.kind.what for c in candidates(ft.read_deck(deck).built)}
    assert found["PELAS 7 K"] == "joint: stiffness"
    assert "PELAS 8 K" not in found
    assert {found[str(FieldRef("MAT1", 1, name))] for name in ("E", "RHO")} == {
        "material: stiffness", "material: density",
    }  # fmt: skip
    assert found["PBAR 1 I1"] == "property: section"
    assert found["CONM2 9 M"] == "mass"


@pytest.mark.slow
def test_every_proposed_parameter_is_determined_beside_the_others(tmp_path: Path) -> None:
    """An independent check: `select` on the study that was written."""
    made = ft.init(example_deck(tmp_path), example_test(tmp_path), tmp_path / "new")
    proposed = [p for p in made.record.parameters if p.proposed]
    assert len(proposed) > 1
    found = ft.select(made.path).record
    assert found.measures is not None
    information = {p.parameter: p for p in found.measures.information}
    for p in proposed:
        prior = 100.0 * (p.upper - p.lower) / 12**0.5
        # the study compares the measured modes, the proposal those of the model
        assert information[p.name].sd_together * prior == pytest.approx(p.sd_percent, rel=0.2)


# ----------------------------------------------------------------------------------------------------
# Functions, files that are there.


def _functions(folder: Path, scatter: float) -> Path:
    lines = {"from_hz": 5.0, "to_hz": 400.0, "step_hz": 0.5, "ratio": 0.01}
    path = folder / "frf.uff"
    places = [f"{n}{d}+" for n in (2, 3, 4, 5) for d in "YZ"]
    deck = example_deck(folder)
    noise = {"scatter": scatter, "seed": 3} if scatter else {}
    ft.respond(deck, inputs=["5Y+", "5Z+"], outputs=places, uff=path, units="m-kg-s", **noise, **lines)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.0, 0.005])
def test_functions_are_identified_first(tmp_path: Path, scatter: float) -> None:
    """Also simulated ones without noise, whose rounding had poles that were taken for modes."""
    made = ft.init(tmp_path / "cantilever.bdf", _functions(tmp_path, scatter), tmp_path / "new")
    assert sorted(path.name for path in made.path.parent.iterdir()) == [
        "identified",
        "identify.toml",
        "sensors.svg",
        "study.toml",
    ]
    assert tomllib.loads(made.path.read_text())["test"]["file"] == "identified/modes.uff"
    assert made.record.paired == made.record.test_modes >= 3
    alerts = json.loads((tmp_path / "new" / "identified" / "identified.json").read_text())["alerts"]
    told = [f"identification: {alert['sentence']}" for alert in alerts if alert["level"] != "info"]
    assert told
    assert [*made.record.doubts[: len(told)]] == told
    written = " ".join(line.removeprefix("#").strip() for line in made.path.read_text().splitlines())
    assert all(doubt in written for doubt in told)
    assert ft.check(made.path).ok


@pytest.mark.slow
def test_nothing_is_overwritten(small: tuple[Path, Path]) -> None:
    folder = small[0].parent / "new"
    made = ft.init(*small, folder)
    made.path.write_text("edited")
    with pytest.raises(FemtuneError) as refused:
        ft.init(*small, folder)
    check_shown("init.exists", str(refused.value).replace(str(folder), "…"))
    assert made.path.read_text() == "edited"
    assert ft.init(*small, folder, force=True).path.read_text() != "edited"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["study.toml", "identify.toml", "identified/modes.csv"])
def test_an_input_is_never_overwritten(tmp_path: Path, name: str) -> None:
    """A file that the deck includes has the name of one that init writes; force does not change that."""
    deck = example_deck(tmp_path)
    test = _functions(tmp_path, 0.0) if name.startswith("identif") else example_test(tmp_path)
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("$ included\n")
    deck.write_text(deck.read_text().replace("BEGIN BULK", f"BEGIN BULK\nINCLUDE '{name}'"))
    with pytest.raises(FemtuneError) as caught:
        ft.init(deck, test, tmp_path, force=True)
    assert caught.value.code == "write.overwrites-input"
    assert (tmp_path / name).read_text() == "$ included\n"


@pytest.mark.slow
def test_identified_modes_of_others_are_not_overwritten(tmp_path: Path) -> None:
    deck, test = example_deck(tmp_path), _functions(tmp_path, 0.0)
    (tmp_path / "identified").mkdir()
    (tmp_path / "identified" / "modes.uff").write_text("measured")
    with pytest.raises(FemtuneError) as caught:
        ft.init(deck, test, tmp_path)
    assert caught.value.code == "init.exists"
    assert (tmp_path / "identified" / "modes.uff").read_text() == "measured"


@pytest.mark.parametrize("words", [{"tolerance": -1.0}, {"origin": [0.0, 1.0]}])
def test_options_that_no_sensor_has(small: tuple[Path, Path], words: dict[str, Any]) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.init(*small, small[0].parent / "new", **words)
    assert caught.value.code == "init.option"
    if "origin" in words:
        check_shown("init.option", caught.value)


def test_the_message_without_identified_modes() -> None:
    error = FemtuneError("init.no-modes", where=Where("ambient.csv"), identification="identify.toml")
    check_shown("init.no-modes", error)


@pytest.mark.slow
def test_json_of_init_and_check(small: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    deck, test = small
    monkeypatch.chdir(deck.parent)
    made = CliRunner().invoke(main, ["init", str(deck), str(test), "new", "--json"])
    assert json.loads(made.stdout)["units"] == "mm-t-s"
    checked = CliRunner().invoke(main, ["check", "new/study.toml", "--json"])
    assert (checked.exit_code, json.loads(checked.stdout)["errors"]) == (0, 0)


# ----------------------------------------------------------------------------------------------------
# All mistakes at once.


@pytest.mark.slow
def test_mistakes_of_study_deck_and_test_at_once(small: tuple[Path, Path]) -> None:
    deck, test = small
    made = ft.init(deck, test, deck.parent / "new")
    text = made.path.read_text()
    text = text.replace('units = "mm-t-s"', 'units = "mm-ton-s"').replace("lower = 0.8", "lower = 1.3")
    text += '\n[[parameter]]\nname = "stiff"\nfields = ["MAT1 7 E"]\nlower = 0.5\nupper = 2.0\n[modez]\ncount = 3\n'
    made.path.write_text(text)
    found = ft.check(made.path)
    assert not found.ok
    assert [(p.code, p.line) for p in found.record.problems if p.level == "error"] == [
        (code, 1 + text[: text.index(words)].count("\n"))
        for code, words in [
            ("units.unknown", 'units = "mm-ton-s"'),
            ("parameter.bounds", "lower = 1.3"),
            ("study.unknown-field", '[[parameter]]\nname = "stiff"'),
            ("study.unknown-key", "[modez]"),
        ]
    ]
    result = CliRunner().invoke(main, ["check", str(made.path)])
    assert result.exit_code == 2
    assert result.stderr.count("hint:") >= 3


@pytest.mark.slow
def test_mistakes_of_deck_and_test_beside_those_of_the_study(small: tuple[Path, Path]) -> None:
    deck, test = small
    made = ft.init(deck, test, deck.parent / "new")
    made.path.write_text(made.path.read_text().replace("upper = 1.25", "upper = nan"))
    deck.write_text(deck.read_text().replace("EIGRL,1,,,10", "EIGRL,1,,,ten"))
    test.write_text(test.read_text()[:-400])
    files = [Path(p.file).name for p in ft.check(made.path).record.problems if p.level == "error"]
    assert set(files) == {"study.toml", "plate.bdf", "test.uff"}


def test_a_file_after_an_update_that_there_is_not(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(
        f'[study]\ntitle = "a"\ndeck = "{example_deck(tmp_path).name}"\nunits = "m-kg-s"\n[output]\nvtu = true\n'
    )
    (remark,) = ft.check(path).remarks
    check_shown("study.no-update", str(remark).replace(str(path), "/home/anna/study.toml"))


@pytest.mark.parametrize("what", ["missing", "not TOML"])
def test_a_study_that_cannot_be_read(tmp_path: Path, what: str) -> None:
    path = tmp_path / "study.toml"
    if what != "missing":
        path.write_text("[study\n")
    (found,) = ft.check(path).record.problems
    assert found.code == {"missing": "study.missing-file", "not TOML": "study.syntax"}[what]


# ----------------------------------------------------------------------------------------------------
# The schema for editors.


@pytest.mark.parametrize("kind", ["study", "identify"])
@pytest.mark.slow
def test_the_published_schema_is_that_of_the_code(kind: str) -> None:
    assert (_DOCS / "_static" / f"{kind}.schema.json").read_text("utf-8") == schema_text(kind)
    Draft202012Validator.check_schema(file_schema(kind))


def _problems(text: str) -> list[Any]:
    return list(Draft202012Validator(file_schema("study")).iter_errors(tomllib.loads(text)))


@pytest.mark.slow
def test_the_schema_accepts_studies_and_refuses_mistakes(small: tuple[Path, Path]) -> None:
    page = (_DOCS / "study-file.md").read_text("utf-8")
    for text in (
        re.findall(r"```toml\n(.*?)```", page, re.S)[0],
        ft.init(*small, small[0].parent / "n").path.read_text(),
    ):
        assert not _problems(text)
    good = '[study]\ntitle = "a"\nunits = "m-kg-s"\n'
    for bad in (
        "[modes]\ncuont = 3\n",
        '[modes]\ncount = "3"\n',
        "[[parameter]]\nlower = 0.5\n",
        "[update]\nsearch = 1\n",
    ):
        assert _problems(good + bad)
