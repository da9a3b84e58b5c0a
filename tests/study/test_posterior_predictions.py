"""[posterior] predictions: frequencies of all configurations and FRFs over the samples, with errors of the model."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import femtune as ft
from femtune.journal.run_files import PREDICTIONS_FILE
from femtune.model import Configuration
from femtune.sampling import Likelihood, NoiseGroup, NuisanceClass
from femtune.steps.posterior.model_errors import ModelErrors
from femtune.steps.posterior.predictions import joint_chance
from structures.wrong_property import FRAME

from .cantilever import EI, TRUE, Bench, measured

ONE = '[[parameter]]\nname = "E"\nfields = ["MAT1 1 E"]\nlower = 0.5\nupper = 2.0\n'
TWO = """
[[configuration]]
name = "bare"
test = "beam.uff"

[[configuration]]
name = "light"
elements_off = [9]
"""
ASKED = """
[residuals]
frequency_sd = 0.02
[posterior]
noise = "stated"
draws = 150
starts = 0
predictions = 150
"""
RESPONSE = """
[response]
inputs = ["5Y+"]
outputs = ["3Y+", "5Y+"]
from_hz = 2.0
to_hz = 60.0
lines = 30
ratio = 0.02
"""


def test_drawn_changes_have_the_distribution_of_their_linear_model() -> None:
    """With q ~ N(0, s²) and r = −Bq + e, the changes given r are normal; all of it in closed form."""
    rng = np.random.default_rng(1)
    B, sigma, s = rng.standard_normal((5, 2)), 0.7, np.array([0.3, 0.3])
    group = NoiseGroup("frequency", np.arange(5), 5.0, True)
    likelihood = Likelihood((group,), (NuisanceClass("stiffnesses", np.arange(2), (1e-3, 1.0)),), B)
    r, theta = rng.standard_normal(5), np.log([sigma, s[0]])
    drawn = np.array([likelihood.drawn_factors(r, theta, rng) for _ in range(4000)])
    C = np.linalg.inv(B.T @ B / sigma**2 + np.diag(s**-2))
    mean, scatter = -C @ B.T @ r / sigma**2, np.sqrt(C.diagonal() / len(drawn))
    assert (np.abs(drawn.mean(axis=0) - mean) < 4.0 * scatter).all()
    np.testing.assert_allclose(np.cov(drawn.T), C, atol=0.08 * C.diagonal().max())
    np.testing.assert_allclose(likelihood.factors(r[None], theta[None])[0], mean, rtol=1e-10)


def test_what_the_data_do_not_see_has_the_deviation_of_its_class() -> None:
    """Three changes of one class, of which the data see the sum; and a class that they do not see."""
    unit = np.array([[1.0], [1.0], [1.0], [0.0]]) / np.sqrt(3.0)
    errors = ModelErrors(
        (NuisanceClass("stiffnesses", np.arange(1), (5e-4, 1.0)),), np.ones((2, 1)), unit, np.full(4, 0.2),
        0.2 * np.eye(4), np.zeros(4), tuple("abcd"), ("stiffnesses",) * 3 + ("masses",),
    )  # fmt: skip
    rng = np.random.default_rng(2)
    drawn = np.array([errors.drawn(np.array([0.5]), np.array([0.1]), rng) for _ in range(4000)])
    # what the data see is as given, in each draw
    np.testing.assert_allclose(drawn[:, :3].sum(axis=1), 0.2 * 0.5 * np.sqrt(3.0), rtol=1e-10)
    # the others are normal with s: of three changes two combinations are free
    assert drawn[:, :3].std(axis=0) == pytest.approx(0.2 * 0.1 * np.sqrt(2.0 / 3.0), rel=0.05)
    # log-uniform between the limits of a class that has no samples
    log = np.log(np.median(np.abs(drawn[:, 3])) / 0.2)
    assert log == pytest.approx(0.5 * np.log(5e-4 * 1.0) - 0.4, abs=0.5)


@pytest.mark.parametrize("m", [1, 4, 12])
def test_the_joint_chance_has_the_level_and_the_power_of_hotellings_test(m: int) -> None:
    """Frequencies that have most of their scatter in common, from 200 samples; one value is off in the second half."""
    rng, n, trials = np.random.default_rng(m), 200, 500
    covariance = 0.8 * np.ones((m, m)) + 0.2 * np.eye(m)
    root, off = np.linalg.cholesky(covariance), 2.5
    right, wrong = 0, 0
    for _ in range(trials):
        y = rng.standard_normal((n, m)) @ root.T
        true = root @ rng.standard_normal(m)
        right += (joint_chance(y, true) or 1.0) < 0.01
        true[0] += off
        wrong += (joint_chance(y, true) or 1.0) < 0.01
    # in 500 trials at 1 % more than thirteen have a probability of 0.1 %
    assert right <= 13
    beyond = off**2 * np.linalg.inv(covariance)[0, 0] * n / (n + 1)
    power = stats.ncf.sf(stats.f.isf(0.01, m, n - m), m, n - m, beyond)
    assert wrong / trials == pytest.approx(power, abs=0.07)


def test_each_sample_is_held_against_the_others() -> None:
    y = np.random.default_rng(5).standard_normal((40, 3))
    value = y[0] * 2.0

    def distance(one: np.ndarray, others: np.ndarray) -> float:
        away = one - others.mean(axis=0)
        return float(away @ np.linalg.solve(np.cov(others.T), away))

    own = distance(value, y)
    beyond = sum(distance(one, np.delete(y, i, axis=0)) >= own for i, one in enumerate(y))
    assert 0 < beyond < 40
    assert joint_chance(y, value) == (1 + beyond) / 41


def test_values_in_common_count_once() -> None:
    """Two equal frequencies that are off together are no rarer than one; apart they are."""
    rng = np.random.default_rng(0)
    common = rng.standard_normal((200, 1)) @ np.ones((1, 2)) + 0.05 * rng.standard_normal((200, 2))
    together, apart = joint_chance(common, np.array([2.2, 2.2])), joint_chance(common, np.array([1.0, -1.0]))
    assert together is not None
    assert apart is not None
    assert together > 0.02
    assert apart < 0.01
    assert joint_chance(common[:10], np.zeros(2)) is None


@pytest.mark.slow
def test_predicted_frequencies_in_closed_form(bench: Bench) -> None:
    """One stiffness of the whole beam: all frequencies have half of its relative deviation."""
    bench.write("beam.bdf", bench.text)
    truth = bench.truth(())
    bench.uff(bench.measure(truth))
    study = bench.study(TWO + ONE + ASKED + 'discrepancy = "none"\n' + RESPONSE, test=None)
    run = ft.run(study)
    record = run.results.posterior
    assert record is not None
    assert (record.predictions, record.predictions_failed) == (150, 0)
    (E,) = record.parameters
    low, high = (np.sqrt(end / E.value) for end in E.interval_95)
    assert {f.configuration for f in record.frequencies} == {"bare", "light"}
    for f in record.frequencies:
        # the ends of 150 other samples
        assert f.interval_95[0] / f.value_hz == pytest.approx(low, abs=0.35 * (high - low))
        assert f.interval_95[1] / f.value_hz == pytest.approx(high, abs=0.35 * (high - low))
    bare = [f for f in record.frequencies if f.configuration == "bare"]
    assert [f.test_mode for f in bare if f.test_mode] == ["1", "2", "3", "4"]
    assert all(f.used and f.measured_inside for f in bare if f.test_mode)
    light = modes_without_mass(truth)
    for f, true in zip((f for f in record.frequencies if f.configuration == "light"), light):
        assert f.test_mode is None
        assert f.interval_95[0] < true < f.interval_95[1]
    of_bare, of_light = record.functions
    assert (of_bare.configuration, of_bare.outputs, of_bare.inputs) == ("bare", ("3Y+", "5Y+"), ("5Y+",))
    hz, band = run.arrays[of_light.freq_key], run.arrays[of_light.band_key]
    assert band.shape == (3, 2, 1, len(hz))
    assert (band[0] <= band[1]).all()
    assert (band[1] <= band[2]).all()
    true = ft.respond(
        truth, inputs=["5Y+"], outputs=["3Y+", "5Y+"], from_hz=2.0, to_hz=60.0, lines=30, ratio=0.02, units="m-kg-s",
    )  # fmt: skip
    size = np.abs(true.frfs.values)
    bare_band = run.arrays[of_bare.band_key]
    # the parameter is at the truth within its interval, and with it all lines are in the band
    assert ((size >= 0.98 * bare_band[0]) & (size <= 1.02 * bare_band[2])).mean() > 0.9
    page = run.report.read_text(encoding="utf-8") if run.report else ""
    assert "Predicted frequencies" in page
    assert "median and 95 % band of the magnitude" in page


@pytest.mark.slow
def test_predictions_of_an_earlier_run_are_taken_if_they_are_of_the_same_model(bench: Bench) -> None:
    bench.write("beam.bdf", bench.text)
    bench.uff(bench.measure(bench.truth(())))
    study = bench.study(TWO + ONE + ASKED + 'discrepancy = "none"\n' + RESPONSE, test=None)
    run = ft.posterior(study)
    record = run.results.posterior
    assert record is not None
    band = run.arrays[record.functions[1].band_key]
    # what was solved is not solved again, and what is no solution is; in other processes too
    file = run.folder / PREDICTIONS_FILE
    content = file.read_bytes()
    lines = content.splitlines(keepends=True)
    first = json.loads(lines[1])
    short = json.dumps({**first, "hz": first["hz"][:16]}).encode() + b"\n"
    file.write_bytes(b"".join([lines[0], short, *lines[2:100]]))
    again = ft.posterior(study, jobs=2)
    other = again.results.posterior
    assert other is not None
    assert other.frequencies == record.frequencies
    kept = [json.loads(line) for line in file.read_bytes().splitlines()[1:]]
    assert {line["run"]: line["hz"] for line in kept} == {
        line["run"]: line["hz"] for line in map(json.loads, lines[1:])
    }
    np.testing.assert_array_equal(again.arrays[record.functions[1].band_key], band)
    # FRFs with other damping are others, though the matrices are the same
    text = study.read_text(encoding="utf-8")
    study.write_text(text.replace("ratio = 0.02", "ratio = 0.04"), encoding="utf-8")
    damped = ft.posterior(study)
    peaks = damped.arrays[record.functions[1].band_key][1].max() / band[1].max()
    assert peaks == pytest.approx(0.5, abs=0.25)


def modes_without_mass(deck: Path) -> np.ndarray:
    """Frequencies of the cantilever without the mass at its tip."""
    test = measured(deck, count=6, configuration=Configuration(elements_off=frozenset({9})))
    return test.modes.freq_hz


@pytest.mark.slow
@pytest.mark.parametrize(("step_hz", "compared"), [(2.0, True), (2.13, False)])
def test_measured_functions_stand_beside_their_bands(bench: Bench, step_hz: float, compared: bool) -> None:
    """At other lines than those of the test they are drawn, but not counted."""
    truth, asked = bench.truth(()), {"from_hz": 2.0, "to_hz": 60.0, "ratio": 0.02, "units": "m-kg-s"}
    bench.write("beam.bdf", bench.text)
    true = ft.respond(truth, inputs=["5Y+"], outputs=["3Y+", "5Y+"], step_hz=2.0, **asked)
    bench.functions(true.frfs, "beam.uff")
    response = f"[response]\nratio = 0.02\nfrom_hz = 2.0\nto_hz = 60.0\nstep_hz = {step_hz}\n"
    residual = '[[residual]]\nkind = "frf"\nsd = 0.05\nratio = 0.02\n'
    asked_of = ASKED.replace("[residuals]\nfrequency_sd = 0.02\n", residual)
    run = ft.run(bench.study(ONE + asked_of + 'discrepancy = "none"\n' + response))
    assert run.results.posterior is not None
    (record,) = run.results.posterior.functions
    assert record.test_freq_key is not None
    assert record.test_values_key is not None
    count = len(run.arrays[record.test_freq_key])
    assert count >= len(true.frfs.freq_hz) - 1
    np.testing.assert_allclose(run.arrays[record.test_freq_key], true.frfs.freq_hz[:count])
    np.testing.assert_allclose(run.arrays[record.test_values_key], true.frfs.values[:, :, :count], rtol=1e-5)
    assert (record.measured_inside_percent is not None) == compared
    assert not compared or record.measured_inside_percent == pytest.approx(100.0)
    page = run.report.read_text(encoding="utf-8") if run.report else ""
    assert "95 % band of the magnitude, without errors of the model; wide and pale the test" in page


@pytest.mark.slow
def test_a_mode_that_was_not_used_is_named(bench: Bench) -> None:
    bench.write("beam.bdf", bench.text)
    bench.uff(measured(bench.truth(TRUE), count=6))
    held = '\n[[hold_out]]\nmodes = ["5", "6"]\n'
    record = ft.posterior(bench.study(EI + ASKED + held)).results.posterior
    assert record is not None
    unused = [f for f in record.frequencies if f.test_mode in ("5", "6")]
    assert [(f.used, f.measured_inside) for f in unused] == [(False, True), (False, True)]
    assert any("Of 2 measured frequencies that the update did not use, 2 are in" in s for s in record.sentences)
    assert record.unused_chance is not None
    assert record.unused_chance > 0.01
    assert "posterior.prediction-missed" not in [a.code for a in record.alerts]
    # a mode that was not used and is 15 % off is found
    test = measured(bench.truth(TRUE), count=6)
    wrong = replace(test.modes, freq_hz=test.modes.freq_hz * np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.15]))
    bench.uff(replace(test, modes=wrong))
    record = ft.posterior(bench.study(EI + ASKED + 'discrepancy = "none"\n' + held)).results.posterior
    assert record is not None
    assert "posterior.prediction-missed" in [a.code for a in record.alerts]


@pytest.mark.slow
def test_predictions_contain_errors_of_the_model(tmp_path: Path) -> None:
    """A frame with one stiffness 20 % off: frequencies that nothing measured, with and without errors of the model."""
    study = FRAME.study(tmp_path, {"PBAR 1 I2": 1.1, "PBAR 3 I2": 0.9, "PBAR 4 I2": 1.15, "PBAR 2 I2": 1.2})
    rules = {"noise": "stated", "draws": 120, "starts": 0, "seed": 3, "predictions": 80}
    true = np.ravel(ft.modes(tmp_path / "true.bdf", units="m-kg-s", count=FRAME.modes + 5).freq_hz)
    hits: dict[str, list[bool]] = {}
    for discrepancy in ("properties", "none"):
        found = ft.posterior(study, posterior=rules | {"discrepancy": discrepancy}, update={"look_further": False})
        record = found.results.posterior
        assert record is not None
        unmeasured = [f for f in record.frequencies if f.test_mode is None and f.mode <= len(true)]
        hits[discrepancy] = [f.interval_95[0] <= true[f.mode - 1] <= f.interval_95[1] for f in unmeasured]
    assert len(hits["properties"]) >= 4
    assert all(hits["properties"])
    assert not all(hits["none"])


@pytest.mark.slow
def test_what_cannot_be_predicted_is_told(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.write("beam.bdf", bench.text)
    bench.uff(bench.measure(bench.truth(TRUE)))
    asked = ASKED.replace("predictions = 150\n", "") + 'discrepancy = "none"\n'
    monkeypatch.setattr("femtune.steps.posterior.predictions.MOST_DOFS", 10)
    record = ft.posterior(bench.study(EI + asked)).results.posterior
    assert record is not None
    assert (record.frequencies, record.predictions) == ((), 0)
    assert any("with more than 10 free DOFs" in s for s in record.sentences)
    monkeypatch.setattr("femtune.steps.posterior.predictions.MOST_VALUES", 10)
    asked = ASKED + 'discrepancy = "none"\n' + RESPONSE
    record = ft.posterior(bench.study(EI + asked)).results.posterior
    assert record is not None
    assert record.frequencies
    assert record.functions == ()
    assert any("[response] asks for 60 values" in s for s in record.sentences)
