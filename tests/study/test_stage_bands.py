"""Stages with their own band and with values that are set by hand between them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.study_file import study_from_text
from femtune.parameters import Parameter, ParameterSet
from femtune.reporting.html import html_text
from femtune.residuals import Evaluation, ResidualBlock
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult
from femtune.study.stages import bottom_up, covariance_of_stages, used_in_stage
from femtune.study.study import read_study
from femtune.updating.stages import Belief, SetByHand, set_by_hand

from .specimen_data import SD, TIP, TRUTH, study_text, write_frfs, write_tests

STAGES = """
[[stage]]
name = "loaded"
configurations = ["A loaded", "B loaded", "C loaded"]
parameters = ["root"]
residuals = ["frequency"]
to_hz = 200.0

[[stage]]
name = "free"
configurations = ["A free", "B free", "C free"]
parameters = ["tip"]
residuals = ["frequency"]
from_hz = 20.0
to_hz = 400.0
by_hand = [{ parameter = "root_B", value = 1.0, sd = 0.01, reason = "measured thickness" },
           { parameter = "tip", add = 0.05, reason = "first guess" }]
"""
BOTH = ("free", "loaded")


@pytest.fixture(scope="module")
def staged(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    folder = tmp_path_factory.mktemp("stages")
    write_tests(folder, states=BOTH)
    (folder / "study.toml").write_text(study_text(BOTH, STAGES))
    return ft.run(folder / "study.toml")


@pytest.mark.slow
def test_a_stage_compares_the_modes_of_its_band(staged: RunResult) -> None:
    study = read_study(staged.folder.parent / "study.toml")
    for entry, low, high in ((study.file.stage[0], 0.0, 200.0), (study.file.stage[1], 20.0, 400.0)):
        for case in study.cases:
            used = used_in_stage(case, entry)
            assert used is not None
            inside = (used.test.freq_hz >= low) & (used.test.freq_hz <= high)
            assert [i in used.left_out for i in range(len(inside))] == (~inside).tolist()
    assert staged.results.update is not None
    first, second = staged.results.update.stages
    assert (first.band_hz, second.band_hz) == ((0.0, 200.0), (20.0, 400.0))
    # three of five modes lie below 200 Hz, four below 400 Hz
    assert (first.comparisons, second.comparisons) == (9, 12)
    assert {m.reason for m in first.left_out} == {"outside the band of the stage"}


@pytest.mark.slow
def test_values_set_by_hand_are_recorded_and_used(staged: RunResult) -> None:
    assert staged.results.update is not None
    first, second = staged.results.update.stages
    assert first.by_hand == ()
    by_name = {v.parameter: v for v in second.by_hand}
    found = {p.name: p.value for p in first.parameters}
    assert by_name["root_B"].before == pytest.approx(found["root_B"])
    assert (by_name["root_B"].value, by_name["root_B"].sd) == pytest.approx((1.0, 0.01))
    assert (by_name["tip"].before, by_name["tip"].value) == pytest.approx((1.0, 1.05))
    assert by_name["root_B"].reason == "measured thickness"
    fixed = {p.name: p.value for p in second.fixed}
    assert fixed == pytest.approx({"root_A": found["root_A"], "root_B": 1.0, "root_C": found["root_C"]})
    assert staged.values["root_B"] == pytest.approx(1.0)
    assert next(p.before for p in second.parameters if p.name == "tip") == pytest.approx(1.05)
    assert abs(staged.values["tip"] - TIP) < 0.1


@pytest.mark.slow
def test_the_report_shows_bands_and_values(staged: RunResult) -> None:
    text = html_text(build_report(staged.results, staged.arrays))
    for words in ("Values set by hand", "measured thickness", "20 to 400 Hz", "Parameters in the stages", "(by hand)"):
        assert words in text


@pytest.mark.slow
def test_specimens_with_stages_are_calibrated_separately(staged: RunResult) -> None:
    found = staged.results.specimens
    assert found is not None
    assert [s.specimen for s in found.separate] == list(TRUTH)
    root = next(p for p in found.parameters if p.name == "root")
    assert root.values[1].separate_value == pytest.approx(1.0)


@pytest.mark.slow
def test_a_band_of_frfs_holds_the_lines_of_the_stage_only(tmp_path: Path) -> None:
    """Against a study whose residual has that band: the same result."""
    write_frfs(tmp_path)
    base = study_text().replace(f"[residuals]\nfrequency_sd = {SD}\n", "")
    frf = '[[residual]]\nkind = "frf"\nform = "log-complex"\nsd = 0.01\n'
    stage = '[[stage]]\nname = "low"\nparameters = ["root", "tip"]\nresiduals = ["frf"]\n'
    limits = "from_hz = 20.0\nto_hz = 150.0\n"
    values = []
    for name, text in (("stage", base + frf + stage + limits), ("residual", base + frf + limits + stage)):
        (tmp_path / f"{name}.toml").write_text(text)
        study = read_study(tmp_path / f"{name}.toml")
        result, (found,) = bottom_up(study, study.problem().start(np.zeros(4)), lambda stage, seed, iteration: None)
        lines = {float(hz) for b in found.best.after.blocks for hz in b.samples.freq_hz}  # type: ignore[union-attr]
        assert (min(lines), max(lines)) == (20.0, 150.0)
        values.append(result.x)
    assert values[0] == pytest.approx(values[1], abs=1e-8)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("empty band", "from_hz = 20.0", "from_hz = 500.0"),
        ("value and add", "value = 1.0, sd", "value = 1.0, add = 0.1, sd"),
        ("unknown parameter by hand", '"root_B", value', '"rot_B", value'),
        ("value outside the bounds", "value = 1.0", "value = 5.0"),
        ("set twice", 'parameter = "tip"', 'parameter = "root_B"'),
    ],
)
def test_keys_that_do_not_fit_are_refused(name: str, old: str, new: str, tmp_path: Path) -> None:
    for file in ("beam.bdf", *(f"{s}_{state}.uff" for s in TRUTH for state in BOTH)):
        (tmp_path / file).touch()
    text = study_text(BOTH, STAGES)
    assert old in text
    with pytest.raises(FemtuneError) as caught:
        study_from_text(text.replace(old, new), tmp_path / "study.toml")
    errors = caught.value.errors if isinstance(caught.value, FemtuneErrors) else (caught.value,)
    found = next(error for error in errors if error.code == "study.stage")
    check_shown(f"study.stage, {name}", str(found).replace(str(tmp_path), "."))


@pytest.mark.slow
def test_an_addition_that_leads_outside_the_bounds_is_an_error(tmp_path: Path) -> None:
    write_tests(tmp_path, states=BOTH)
    (tmp_path / "study.toml").write_text(study_text(BOTH, STAGES.replace("add = 0.05", "add = 1.5")))
    study = read_study(tmp_path / "study.toml")
    with pytest.raises(FemtuneError, match="lies outside the bounds") as caught:
        bottom_up(study, study.problem().start(np.zeros(4)), lambda stage, seed, iteration: None)
    assert caught.value.values["tip"] == pytest.approx(2.5)


def test_a_value_set_by_hand_last_is_not_called_unmoved() -> None:
    parameters = ParameterSet((Parameter("a"), Parameter("b"), Parameter("c")))
    found = Belief(parameters, np.zeros(3), np.diag([0.01, 0.02, 0.03]), np.array([True, True, False]))
    later = set_by_hand(found, [SetByHand("b", value=1.1)])
    block = ResidualBlock("frequency", "x", "1", np.zeros(4), np.zeros((4, 3)), 0.01)
    covariance = covariance_of_stages(later, Evaluation(np.zeros(3), (), (block,)))
    assert covariance.reasons == {
        1: "set by hand and not updated after that, σ not given", 2: "not updated in any stage, σ not given"
    }  # fmt: skip
    assert np.isfinite(covariance.matrix[0, 0])
