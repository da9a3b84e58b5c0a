"""Studies whose model is a table of runs: every step that applies, and what does not apply is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown
from tests.model.chain_runs import modes

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.runs_table import RunsTable, write_runs_table
from femtune.surrogates import KrigingRules, SurrogateRules
from structures.coverage_of_runs import coverage

from .runs_of_chain import DOFS, STUDY, TRUTH, prepared, table


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return prepared(tmp_path)


@pytest.mark.slow
def test_a_whole_run_finds_the_parameters(study: Path) -> None:
    result = ft.run(study)
    values = dict(zip(result.parameters.column("name"), result.parameters.column("value")))
    np.testing.assert_allclose([values["k1"], values["k2"]], TRUTH, rtol=1e-4)
    page = (study.parent / "run" / "report.html").read_text(encoding="utf-8")
    assert "model of 10 runs" in page
    assert "not known" in page
    model = result.results.model
    assert model is not None
    assert model.configurations[0].mass is None
    assert model.configurations[0].rigid_body_check.verdict == "not tested"
    assert [m.rigid_body_modes for m in result.results.modes] == [0, 0]


@pytest.mark.quick(2)
@pytest.mark.parametrize("step", ["info", "modes", "correlate", "select", "update"])
def test_every_step_that_applies(study: Path, step: str) -> None:
    assert repr(getattr(ft, step)(study))


@pytest.mark.slow
def test_frequencies_without_shapes(study: Path) -> None:
    write_runs_table(study.parent / "runs.csv", table(12, shapes=False))
    hz = modes(TRUTH)[0]
    text = STUDY.replace('file = "chain.uff"', f"freq_hz = {[float(f) for f in hz]}").replace("shape_sd = 0.02\n", "")
    text = text.replace('[model]\ngrid = "nodes.bdf"\n', "").replace("degree = 1\ncrossed = false", "degree = 2")
    study.write_text(text)
    result = ft.run(study)
    values = dict(zip(result.parameters.column("name"), result.parameters.column("value")))
    # ω² of a chain is no polynomial: a few thousandths are left
    np.testing.assert_allclose([values["k1"], values["k2"]], TRUTH, rtol=0.05)


@pytest.mark.parametrize("grid", ["", '[model]\ngrid = "nodes.bdf"\n'])
def test_shapes_of_a_test_beside_runs_without_are_refused(grid: str, study: Path) -> None:
    write_runs_table(study.parent / "runs.csv", table(12, shapes=False))
    study.write_text(STUDY.replace('[model]\ngrid = "nodes.bdf"\n', grid))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    if not grid:
        check_shown("runs.no-shapes", str(caught.value).replace(str(study.parent), "FOLDER"))
    assert caught.value.code == "runs.no-shapes"


def test_failed_runs_are_left_out_and_counted(study: Path) -> None:
    whole = table()
    hz = whole.freq_hz.copy()
    hz[[2, 7]] = np.nan
    write_runs_table(study.parent / "runs.csv", RunsTable(whole.columns, hz, whole.shapes, DOFS))
    notices = ft.info(study).notices
    check_shown("runs.left-out", _shown(study, notices, "runs.left-out"))
    assert "model of 8 runs: " in _shown(study, notices, "runs.fitted")


def test_a_poor_fit_is_a_warning(study: Path) -> None:
    write_runs_table(study.parent / "runs.csv", table(12, shapes=False))
    text = STUDY.replace('file = "chain.uff"', "freq_hz = [10.0]").replace("shape_sd = 0.02\n", "")
    study.write_text(text)
    check_shown("runs.poor-fit", _shown(study, ft.info(study).notices, "runs.poor-fit"))
    study.write_text(text.replace("degree = 1", "degree = 1\ntolerance = 0.5"))
    check_shown("runs.fitted", _shown(study, ft.info(study).notices, "runs.fitted"))


def test_more_measured_frequencies_than_columns(study: Path) -> None:
    write_runs_table(study.parent / "runs.csv", table(12, shapes=False))
    text = STUDY.replace('file = "chain.uff"', "freq_hz = [10.0, 20.0, 30.0, 40.0, 50.0]").replace(
        "shape_sd = 0.02\n", ""
    )
    study.write_text(text)
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown("runs.measured", str(caught.value).replace(str(study.parent), "FOLDER"))


def _with_mode(column: np.ndarray) -> RunsTable:
    """The table with another shape of the last mode."""
    whole = table()
    assert whole.shapes is not None
    shapes = whole.shapes.copy()
    shapes[:, :, 3] = column
    return RunsTable(whole.columns, whole.freq_hz, shapes, DOFS)


def test_modes_that_do_not_move_at_the_nodes_are_left_out(study: Path) -> None:
    write_runs_table(study.parent / "runs.csv", _with_mode(1e-12 * np.array([1.0, -2.0, 3.0, 1.0])))
    found = ft.info(study)
    codes = {n.code: n.sentence for n in found.notices}
    assert codes["runs.hidden-modes"].endswith(": 1 of 4")
    assert ft.modes(study).frequencies.column("mode").tolist() == [1, 2, 3]


def test_nothing_but_hidden_modes(study: Path) -> None:
    whole = table()
    assert whole.shapes is not None
    write_runs_table(study.parent / "runs.csv", RunsTable(whole.columns, whole.freq_hz, 0.0 * whole.shapes, DOFS))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown("runs.few-dofs, none", str(caught.value).replace(str(study.parent), "FOLDER"))


def test_modes_that_look_alike_are_refused(study: Path) -> None:
    whole = table()
    assert whole.shapes is not None
    shapes = whole.shapes.copy()
    shapes[:, :, 3] = -2.0 * shapes[:, :, 1]
    write_runs_table(study.parent / "runs.csv", RunsTable(whole.columns, whole.freq_hz, shapes, DOFS))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown("runs.few-dofs, alike", str(caught.value).replace(str(study.parent), "FOLDER"))


def test_runs_with_other_modes(study: Path) -> None:
    whole = table()
    assert whole.shapes is not None
    shapes = whole.shapes.copy()
    shapes[4, :, 1] = 1e-9 * shapes[4, :, 0]
    write_runs_table(study.parent / "runs.csv", RunsTable(whole.columns, whole.freq_hz, shapes, DOFS))
    check_shown("runs.other-modes", _shown(study, ft.info(study).notices, "runs.other-modes"))


def _shown(study: Path, notices: object, code: str) -> str:
    found = next(n for n in notices if n.code == code)  # type: ignore[attr-defined]
    return f"[{found.code}] {found.sentence}"


VIBRATION = """[[vibration]]
name = "table"
kind = "random"
input = "2X+"
outputs = ["2X+"]
damping_ratio = 0.02
spectrum_hz = [4.0, 6.0]
spectrum = [1.0, 1.0]
"""
_CHANGES = {
    "runs.no-column": ('name = "k2"', 'name = "k3"'),
    "runs.too-few": ("degree = 1\ncrossed = false", "degree = 4"),
    "runs.study, deck": ('units = "m-kg-s"', 'units = "m-kg-s"\ndeck = "nodes.bdf"'),
    "runs.study, table": ("[residuals]", "[reduction]\n\n[residuals]"),
    "runs.study, vibration": ("[residuals]", f"{VIBRATION}\n[residuals]"),
    "runs.study, limit": ("[residuals]", "[validate]\nfrac = 0.9\n\n[residuals]"),
    "runs.study, max hz": ("[residuals]", "[modes]\nmax_hz = 5.0\n\n[residuals]"),
    "runs.study, fields": ('name = "k1"', 'name = "k1"\nfields = ["MAT1 1 E"]'),
    "runs.study, absolute": ("absolute = true\nlower = 1e4", "lower = 0.5"),
    "runs.study, residual": ("[residuals]", '[[residual]]\nkind = "mass"\nmass = 1.0\nsd = 0.1\n\n[residuals]'),
    "runs.measured, shapes": ('file = "chain.uff"', "freq_hz = [1.0, 2.0]"),
    "study.test-source": ('file = "chain.uff"', 'file = "chain.uff"\nfreq_hz = [1.0]'),
}  # fmt: skip


@pytest.mark.parametrize("name", _CHANGES)
def test_what_does_not_apply_is_refused(name: str, study: Path) -> None:
    text = STUDY.replace(*_CHANGES[name])
    assert text != STUDY
    study.write_text(text)
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown(name, str(caught.value).replace(str(study.parent), "FOLDER"))


def test_overlays_are_refused(study: Path) -> None:
    text = '[[configuration]]\nname = "A"\ntest = "chain.uff"\nspc = 1\n'
    study.write_text(STUDY.replace('[test]\nfile = "chain.uff"\n', text))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown("runs.study, overlay", str(caught.value).replace(str(study.parent), "FOLDER"))


def test_two_tests_of_one_table_are_two_configurations(study: Path) -> None:
    two = '[[configuration]]\nname = "A"\ntest = "chain.uff"\n' * 2
    study.write_text(STUDY.replace('[test]\nfile = "chain.uff"\n', two.replace('"A"', '"B"', 1)))
    found = ft.modes(study).mode_sets
    np.testing.assert_array_equal(found["A"].freq_hz, found["B"].freq_hz)


@pytest.mark.parametrize(("change", "code"), [("one-value", "runs.one-value"), ("line", "runs.not-determined")])
def test_tables_that_do_not_determine_the_model(study: Path, change: str, code: str) -> None:
    whole = table()
    columns = dict(whole.columns)
    columns["k2"] = np.full(10, 2e4) if change == "one-value" else 2.0 * columns["k1"]
    write_runs_table(study.parent / "runs.csv", RunsTable(columns, whole.freq_hz, whole.shapes, DOFS))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown(code, str(caught.value).replace(str(study.parent), "FOLDER"))


def test_fewer_sensors_than_modes(study: Path) -> None:
    whole = table()
    assert whole.shapes is not None
    few = RunsTable(whole.columns, whole.freq_hz, whole.shapes[:, :3], DOFS.select([0, 1, 2]))
    write_runs_table(study.parent / "runs.csv", few)
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown("runs.few-dofs", str(caught.value).replace(str(study.parent), "FOLDER"))


@pytest.mark.long
@pytest.mark.parametrize("rules", [None, KrigingRules("quadratic")], ids=["polynomials", "Kriging"])
def test_intervals_cover_the_truth_of_simulated_specimens(rules: SurrogateRules | None) -> None:
    """Six outputs of 200 runs, 90 % intervals of 100 specimens: within what the binomial of 0.1 % admits."""
    found = coverage(200, 100, rules=rules)
    assert abs(found.share - 0.9) < 3.3 * np.sqrt(0.9 * 0.1 / 100)


_METHODS = {
    'method = "kriging"\ndegree = 1': "Kriging",
    'method = "radial-basis"\nkernel = "quintic"': "radial basis functions",
    'method = "chaos"\ndegree = 4': "polynomial chaos",
}
"""Keys of [runs], and how messages name the surrogate."""


@pytest.mark.parametrize("keys", _METHODS)
@pytest.mark.slow
def test_a_surrogate_is_stated_with_its_error(study: Path, keys: str) -> None:
    write_runs_table(study.parent / "runs.csv", table(20))
    study.write_text(STUDY.replace("degree = 1\ncrossed = false", keys))
    notices = ft.info(study).notices
    assert f"model of 20 runs: {_METHODS[keys]} of" in _shown(study, notices, "runs.fitted")


@pytest.mark.slow
@pytest.mark.parametrize("keys", _METHODS)
def test_surrogates_find_the_parameters(study: Path, keys: str) -> None:
    write_runs_table(study.parent / "runs.csv", table(40))
    study.write_text(STUDY.replace("degree = 1\ncrossed = false", keys))
    result = ft.run(study)
    values = dict(zip(result.parameters.column("name"), result.parameters.column("value")))
    np.testing.assert_allclose([values["k1"], values["k2"]], TRUTH, rtol=2e-3)


@pytest.mark.parametrize(
    ("keys", "code"),
    [
        ('method = "kriging"\ncrossed = true', "runs.method"),
        ('correlation = "gaussian"', "runs.method"),
        ('method = "kriging"\ndegree = 3', "runs.method"),
        ('method = "radial-basis"\ndegree = 2', "runs.method"),
        ('method = "chaos"\nkernel = "cubic"', "runs.method"),
        ("degree = 0", "runs.method"),
    ],
)
def test_keys_of_the_other_method_are_refused(study: Path, keys: str, code: str) -> None:
    study.write_text(STUDY.replace("degree = 1\ncrossed = false", keys))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    assert caught.value.code == code
    check_shown(f"{code}, {keys.splitlines()[-1]}", str(caught.value).replace(str(study.parent), "FOLDER"))


@pytest.mark.slow
def test_repeats_and_intervals_on_a_table_of_runs(study: Path) -> None:
    """Forty specimens: mean and standard deviation of the parameters, and the box of their frequencies."""
    rng = np.random.default_rng(8)
    specimens = TRUTH * (1.0 + 0.03 * rng.standard_normal((40, 2)))
    hz = np.array([modes(p)[0] for p in specimens])
    lines = [",".join(repr(float(f)) for f in row) for row in hz]
    (study.parent / "repeats.csv").write_text("\n".join(["1,2,3,4", *lines]) + "\n")
    study.write_text(STUDY + '\n[quantify]\nrepeats = "repeats.csv"\nintervals = true\n')
    found = ft.quantify(study)
    assert found.parameters.column("parameter").tolist() == ["k1", "k2"]
    np.testing.assert_allclose(found.parameters.column("mean"), specimens.mean(axis=0), rtol=2e-3)
    np.testing.assert_allclose(found.parameters.column("sd"), specimens.std(axis=0, ddof=1), rtol=0.05)
    assert found.record.intervals is not None
    assert found.record.intervals.ok


def test_a_missing_table_is_said_of_its_line_in_the_study(study: Path) -> None:
    (study.parent / "runs.csv").unlink()
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown("study.missing-file, table of runs", str(caught.value).replace(str(study.parent), "FOLDER"))
