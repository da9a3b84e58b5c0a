"""[equalise]: a test with uneven damping is identified, and compared with the model at one damping ratio."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.deck_models import model_of
from tests.reporting.packed import unpacked

import femtune as ft
import femtune.study.residuals as study_residuals
from femtune.errors import FemtuneError, Notice
from femtune.identification.equal_damping import equalised_test
from femtune.model import damping_by_mode, solve_modes
from femtune.model.response import frf, make_ports
from femtune.residuals import state_at
from femtune.steps.bootstrap.page import bootstrap_document
from femtune.steps.report.view import view_of
from femtune.steps.report_source import ReportSource
from femtune.steps.run.result import RunResult
from femtune.steps.subject import subject_of
from femtune.study.study import load_study

from ..messages.shown import check_shown
from .cantilever import CANTILEVER, EI, TRUE, Bench

BAND = (5.0, 240.0)
LINES = np.arange(BAND[0], BAND[1], 0.1)
# of all modes, those in the other plane and beyond the band included
UNEVEN = (0.004, 0.03, 0.02, 0.008, 0.012, 0.02, *([0.01] * 14))


def _measured(bench: Bench, noise: float, seed: int = 4) -> None:
    deck = bench.truth(TRUE, CANTILEVER)
    model = model_of(deck)
    ports = make_ports(model, ["5Y+"], ["2Y+", "3Y+", "4Y+", "5Y+"])
    exact = frf(solve_modes(model.at(np.zeros(0)), 20), ports, LINES, damping=damping_by_mode(UNEVEN))
    random = np.random.default_rng(seed).standard_normal((2, *exact.values.shape))
    noisy = replace(exact, values=exact.values * (1.0 + noise * (random[0] + 1j * random[1])))
    bench.functions(noisy)


def _study(bench: Bench, table: str, residual: str = "") -> Path:
    bench.write("beam.bdf", CANTILEVER)
    text = f'{EI}\n[[residual]]\nkind = "frf"\n{residual}\n{table}'
    return bench.study(text, test="frfs.uff")


EQUALISE = f'[equalise]\ndamping = 0.02\nband_hz = [{BAND[0]}, {BAND[1]}]\nlargest_order = 20\nthen = "nothing"\n'


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", "\n[reduction]\n"])
def test_stiffness_is_found_whatever_the_damping(bench: Bench, more: str) -> None:
    _measured(bench, 0.005)
    run = ft.run(_study(bench, EQUALISE + more))
    update = run.results.update
    assert update is not None
    assert update.ok
    assert {p.name: p.value for p in update.parameters} == pytest.approx({"root": 1.3, "tip": 0.85}, rel=5e-3)
    (alert,) = [a for a in run.results.alerts if a.code == "residual.equalised"]
    assert "with the damping ratio 0.02" in alert.sentence
    # the test is nothing but stiffness, mass and one damping ratio: what is left is the error of the identification
    (record,) = update.residual_counts
    assert record.rms_after is not None
    assert record.rms_after < 1.0
    # one covariance: the table of the update and what the data tell of the parameters
    assert update.fisher is not None
    for p, q in zip(update.parameters, update.fisher.parameters):
        assert q.sd_percent is not None
        assert p.sd == pytest.approx(0.01 * q.sd_percent * p.value, rel=1e-6)
    # the damping ratios of the test come back to the modes that they belong to
    (mapped,) = run.results.mapped_damping
    assert mapped.equalised_percent == pytest.approx(2.0)
    pairs = [m for m in mapped.modes if m.mac is not None]
    # bending in the plane of the test only
    assert len(pairs) == 2
    for m in pairs:
        assert m.mode is not None
        assert m.mac is not None
        assert m.mac > 0.99
        assert m.measured_percent == m.mapped_percent == pytest.approx(100.0 * UNEVEN[m.mode - 1], rel=0.02)
        assert m.model_hz == pytest.approx(m.test_hz, rel=2e-3)
    # with them the model repeats the measured FRFs as well as the identified test does
    assert mapped.deviation_before is not None
    assert mapped.deviation_after < 0.05 * mapped.deviation_before
    assert mapped.deviation_identified < 1e-3
    raw, after = run.arrays[mapped.test_values_key], run.arrays[mapped.after_values_key]
    assert np.abs(after / raw - 1.0).mean() < 0.05
    page = run.report.read_text(encoding="utf-8") if run.report else ""
    assert "damping of the modes" in page
    assert "identified test" in page
    _check_curves(run)


def _check_curves(run: RunResult) -> None:
    """One picture has all curves of the test and of the model, with the values of the results."""
    view = view_of(ReportSource(run.results, run.arrays))
    (shown,) = view.functions
    (mapped,), update = run.results.mapped_damping, run.results.update
    assert update is not None
    (compared,) = update.frfs
    assert mapped.before_values_key is not None
    keys = {
        "test": mapped.test_values_key, "identified": mapped.identified_values_key,
        "equalised": compared.test_values_key, "before": mapped.before_values_key, "after": mapped.after_values_key,
    }  # fmt: skip
    assert {c.look: unpacked(c.real).shape[1] for c in shown.curves} == {
        look: run.arrays[key].shape[2] for look, key in keys.items()
    }
    for curve in shown.curves:
        values = run.arrays[keys[curve.look]]
        for title, real, imaginary in zip(shown.titles, unpacked(curve.real), unpacked(curve.imaginary)):
            output, _, input_ = title.partition(" by ")
            own = values[mapped.outputs.index(output), mapped.inputs.index(input_)]
            np.testing.assert_allclose(real + 1j * imaginary, np.nan_to_num(own), rtol=1e-6, atol=1e-30)
    # while the update moves, the test stays: as measured, as identified, and with the damping that is compared
    assert view.history is not None
    (moving,) = view.history.functions
    assert (moving.test_look, [c.look for c in moving.beside]) == ("equalised", ["test", "identified"])


@pytest.mark.slow
@pytest.mark.parametrize("equalised", [False, True])
def test_magnitudes_are_shifted_against_noise_of_single_lines_only(bench: Bench, equalised: bool) -> None:
    """Noise of single lines, with weights by `floor`, would bias the logarithms; identified lines have none."""
    _measured(bench, 0.01)
    path = _study(bench, EQUALISE if equalised else "", "floor = 0.05" + ("" if equalised else "\nratio = 0.01"))
    (case,) = load_study(path).cases
    assert case.compared is not None
    (residual,) = case.compared.residuals
    residual.blocks(state_at(case.compared, np.zeros(2)), False)
    shift = residual.settled.shift
    assert (shift is None) if equalised else (np.abs(shift).max() > 1e-4)


@pytest.mark.long
def test_bands_that_are_left_out_have_no_lines(bench: Bench) -> None:
    _measured(bench, 0.0)
    whole, part = (
        ft.run(_study(bench, EQUALISE + more)).results.update for more in ("", "leave_out_hz = [[60.0, 240.0]]\n")
    )
    assert whole is not None
    assert part is not None
    # lines at constant ratio: their number follows the logarithm of the band
    share = np.log(60.0 / BAND[0]) / np.log(BAND[1] / BAND[0])
    assert part.residual_counts[0].count == pytest.approx(share * whole.residual_counts[0].count, rel=0.02)


@pytest.mark.slow
def test_held_out_channels_are_compared_with_the_measured_damping(bench: Bench) -> None:
    _measured(bench, 0.0)
    more = 'leave_out_hz = [[60.0, 150.0]]\n[[hold_out]]\noutputs = ["4Y+"]\n[response]\nmodes = 12\n'
    run = ft.run(_study(bench, EQUALISE + more))
    (alert,) = [a for a in run.results.alerts if a.code == "residual.equalised"]
    assert "lines, without 60 to 150 Hz." in alert.sentence
    assert run.results.validation is not None
    (curves,) = run.results.validation.curves
    at = curves.outputs.index("4Y+")
    lines, test = run.arrays[curves.freq_key], run.arrays[curves.test_values_key][at, 0]
    inside = (lines >= 60.0) & (lines <= 150.0)
    assert np.isnan(test[inside]).all()
    assert np.isfinite(test[~inside]).all()
    # 0.4 % measured at the first resonance; with 2 % its peak would be a fifth
    model = run.arrays[curves.values_key][at, 0]
    assert np.abs(model[~inside] / test[~inside] - 1.0).max() < 0.2
    deviations = run.results.validation.deviations
    assert deviations is not None
    own, measured, held = deviations.sums
    assert [(s.data, s.compared, s.frfs) for s in (own, measured, held)] == [
        ("calibration", "equal damping", 3), ("calibration", "measured", 3), ("validation", "measured", 1),
    ]  # fmt: skip
    assert measured.after < 0.05 * measured.before
    assert held.after < 0.05 * held.before
    # the functions of [response] beside the measured ones too
    frfs = run.results.responses[-1].frfs
    assert frfs is not None
    assert frfs.test_values_key is not None
    assert frfs.test_freq_key is not None
    hertz = run.arrays[frfs.test_freq_key]
    known = np.isfinite(run.arrays[frfs.test_values_key]).any(axis=(0, 1))
    np.testing.assert_array_equal(known, (hertz < 60.0) | (hertz > 150.0))


@pytest.mark.slow
def test_an_order_that_is_too_small(bench: Bench) -> None:
    _measured(bench, 0.005)
    with pytest.raises(FemtuneError) as caught:
        ft.run(_study(bench, EQUALISE.replace("largest_order = 20", "largest_order = 4")))
    check_shown("system.equalise, no modes", str(caught.value).replace(str(bench.folder), "folder"))


@pytest.mark.slow
def test_a_poor_identification_is_told(bench: Bench) -> None:
    _measured(bench, 0.4)
    run = ft.update(_study(bench, EQUALISE))
    (alert,) = [a for a in run.results.alerts if a.code == "residual.equalised-poor"]
    assert alert.level == "warning"
    notice = Notice("residual.equalised-poor", configuration="free", misfit=23.4, modes=3, order=12)
    check_shown("residual.equalised-poor", notice)


@pytest.mark.slow
def test_every_notice_of_the_identification_reaches_the_reader(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []

    def kept(*arguments: Any, **options: Any) -> Any:
        found.append(equalised_test(*arguments, **options))
        return found[-1]

    monkeypatch.setattr(study_residuals, "equalised_test", kept)
    _measured(bench, 0.4)
    told = {a.sentence for a in ft.update(_study(bench, EQUALISE)).results.alerts}
    inner = [n.what for n in found[0].identified.notices]
    assert len(inner) > 1
    assert told.issuperset(inner)


@pytest.mark.long
def test_a_bootstrap_of_the_identified_test_has_the_spread_of_repeated_tests(bench: Bench) -> None:
    repeated = []
    for seed in range(10):
        _measured(bench, 0.005, seed)
        update = ft.update(_study(bench, EQUALISE), fresh=True).results.update
        assert update is not None
        repeated.append([p.value for p in update.parameters])
    table = "[bootstrap]\nruns = 100\nchecked = 1\n"
    study = _study(bench, EQUALISE + table)
    run = ft.bootstrap(study)
    found = run.results.bootstrap
    assert found is not None
    assert found.identified
    # lines of the measurement, not of the comparison
    assert found.drawn_from == len(LINES)
    assert found.converged == 100
    assert found.checked == 1
    # ten tests: their standard deviations lie between 0.4 and 1.8 of the true ones but for one in a thousand
    ratio = np.array([p.sd for p in found.parameters]) / np.std(repeated, axis=0, ddof=1)
    assert (ratio > 0.5).all(), ratio
    assert (ratio < 2.7).all(), ratio
    page = bootstrap_document(subject_of(study), run.results)
    assert "Frequency lines of the measured FRFs were drawn" in str(page)
    again = ft.bootstrap(study)
    assert again.results.bootstrap is not None
    assert again.results.bootstrap.recalled == 100
    # other noise, other runs
    _measured(bench, 0.005, 11)
    other = ft.bootstrap(_study(bench, EQUALISE + table))
    assert other.results.bootstrap is not None
    assert other.results.bootstrap.recalled == 0


@pytest.mark.quick(0, gate=1)
@pytest.mark.parametrize("method", ["entries", "noise"])
def test_entries_and_noise_of_the_identified_test(bench: Bench, method: str) -> None:
    _measured(bench, 0.005)
    both = [
        ft.bootstrap(_study(bench, EQUALISE + f'[bootstrap]\nruns = 100\nchecked = 0\nmethod = "{how}"\n'))
        for how in (method, "lines")
    ]
    one, other = (run.results.bootstrap for run in both)
    assert one is not None
    assert other is not None
    # the expected standard deviations are those of the same noise, before anything is drawn
    for run in both:
        selection, update = run.results.selection, run.results.update
        assert selection is not None
        assert update is not None
        assert selection.fisher is not None
        assert update.fisher is not None
        assert update.fisher.measured
        assert all(p.known for p in update.fisher.parameters)
        assert "The data alone determine" in update.fisher.sentences[0]
        if method == "noise" and run is both[0]:
            for p, q in zip(update.fisher.parameters, one.parameters):
                assert p.sd_percent is not None
                assert p.sd_percent * p.value / 100.0 == pytest.approx(q.sd, rel=0.3)
    # noise that is independent from value to value: all three see it, the draws of lines from few lines at resonances
    for p, q in zip(one.parameters, other.parameters):
        assert 0.5 * q.sd < p.sd < 2.0 * q.sd
        assert p.linear_sd == pytest.approx(p.sd, rel=0.3)


@pytest.mark.parametrize(
    ("key", "line"),
    [("band_hz = [240.0, 60.0]", "band_hz"), ("leave_out_hz = [[10.0, 20.0], [240.0, 60.0]]", "leave_out_hz[2]")],
)
def test_bands_have_a_lower_and_an_upper_end(bench: Bench, key: str, line: str) -> None:
    with pytest.raises(FemtuneError, match="the frequency band is empty") as caught:
        ft.run(_study(bench, f"[equalise]\ndamping = 0.01\n{key}\n"))
    assert f"equalise.{line}" in str(caught.value)


@pytest.mark.parametrize(
    ("key", "code"),
    [
        ("damping = 1e-7", "system.equalise"),
        ("damping = 0.02\nband_hz = [300.0, 400.0]", "identify.band"),
        ("damping = 0.02\nleave_out_hz = [[1.0, 300.0]]", "system.equalise"),
    ],
)
def test_lines_that_the_test_does_not_have_are_told_before_it_is_identified(bench: Bench, key: str, code: str) -> None:
    _measured(bench, 0.0)
    found = ft.check(_study(bench, f"[equalise]\n{key}\n"))
    (error,) = found.errors
    assert error.code == code
    assert "equalise" in str(error.where)


def test_keys_that_do_not_go_with_it(bench: Bench) -> None:
    _measured(bench, 0.0)
    path = _study(bench, EQUALISE, "ratio = 0.01")
    with pytest.raises(FemtuneError) as caught:
        load_study(path)
    (error,) = ft.check(path).errors
    assert error.code == caught.value.code
    check_shown("residual.equalised-keys", str(caught.value).replace(str(bench.folder), "folder"))


@pytest.mark.parametrize("key", ["damping = 0.0", "damping = 0.6", "", "damping = 0.01\nlines = 0.0"])
def test_keys_are_checked(bench: Bench, key: str) -> None:
    with pytest.raises(FemtuneError):
        ft.run(_study(bench, f"[equalise]\n{key}\n"))


def test_what_the_notice_says() -> None:
    notice = Notice(
        "residual.equalised", level="info", configuration="free", ratio=0.01, low=40.0, high=400.0, modes=14,
        least=0.12, most=2.9, outside=0.61, lines=347, misfit=1.83, left_out=", without 118 to 131 Hz",
    )  # fmt: skip
    check_shown("residual.equalised", notice)
