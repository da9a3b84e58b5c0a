"""Data that are kept from the update: held-out modes and sensors, other configurations, verdicts, goodness of fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.run.result import RunResult

from .cantilever import Bench, bounded

HALF = "\n" + bounded("root", "PBAR 1 I1")


def _validation(run: RunResult) -> Any:
    assert run.results.validation is not None
    return run.results.validation


def _goodness(run: RunResult) -> Any:
    assert run.results.update is not None
    return run.results.update.goodness


def _values(run: RunResult) -> dict[str, float]:
    assert run.results.update is not None
    return {p.name: p.value for p in run.results.update.parameters}


def _noisy(bench: Bench, sd: float, seed: int = 3, shape_sd: float = 0.0) -> None:
    """The beam's test with scatter on its frequencies, and on its shapes relative to their largest entries."""
    test, rng = bench.measure(bench.truth()), np.random.default_rng(seed)
    factors = 1.0 + sd * rng.standard_normal(len(test.modes))
    object.__setattr__(test.modes, "freq_hz", test.modes.freq_hz * factors)
    shapes = test.modes.shapes
    scatter = shape_sd * np.abs(shapes).max(axis=0) * rng.standard_normal(shapes.shape)
    object.__setattr__(test.modes, "shapes", shapes + scatter)
    bench.uff(test)


@pytest.mark.slow
def test_held_out_modes_have_no_residual_and_are_judged(beam: Bench) -> None:
    run = ft.update(beam.study(beam.parameters + '[[hold_out]]\nmodes = ["2", "4"]\n[validate]\nprofile = "ECSS"'))
    assert _values(run) == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-4)
    assert run.results.selection is not None
    assert not any(label.split()[-2] in ("2", "4") for label in run.results.selection.row_labels)
    found = _validation(run)
    assert found.profile == "ECSS-E-ST-32-11C"
    assert {(p.test_label, p.data) for p in found.predictions} == {
        ("2", "held-out modes"), ("4", "beyond the frequencies used")}  # fmt: skip
    # the pairs of all modes are shown, held out or not
    assert [p.test_label for p in run.results.correlations[-1].pairs] == ["1", "2", "3", "4"]
    judged = {(v.data, v.criterion): v.verdict for v in found.verdicts}
    assert judged["held-out modes", "frequency error, ECSS-E-ST-32-11C"] == "pass"
    assert judged["beyond the frequencies used", "MAC, ECSS-E-ST-32-11C"] == "pass"
    assert not any(line.startswith(("frequencies outside", "prediction of data")) for line in found.not_tested)


@pytest.mark.slow
def test_modes_beyond_a_frequency_are_held_out(beam: Bench) -> None:
    hz = beam.measure(beam.truth()).modes.freq_hz
    run = ft.update(beam.study(beam.parameters + f"[[hold_out]]\nabove_hz = {0.5 * (hz[2] + hz[3]):.3f}\n"))
    found = _validation(run)
    assert [(p.test_label, p.data) for p in found.predictions] == [("4", "beyond the frequencies used")]


@pytest.mark.slow
def test_own_numbers_decide(beam: Bench) -> None:
    """Only the root is free, so that the model misses; the verdicts turn where the limits are set."""
    held = '[[hold_out]]\nmodes = ["3"]\n[validate]\nprofile = "own"\nfrequency_error = '
    miss = abs(_validation(ft.update(beam.study(HALF + held + "0.5"))).predictions[0].freq_error_percent)
    assert miss > 0.1
    for limit, verdict in ((1.1 * miss, "pass"), (0.9 * miss, "fail")):
        found = _validation(ft.update(beam.study(HALF + held + f"{limit / 100:.8f}")))
        (one,) = found.verdicts
        assert (one.verdict, one.criterion) == (verdict, "frequency error, own criterion")
        assert one.measured == pytest.approx(miss, rel=1e-6)
        assert one.required == pytest.approx(limit, rel=1e-6)
        assert one.sentence.startswith(f"baseline, {one.data}: {verdict}: frequency error {miss:.3g} %")


@pytest.mark.slow
def test_whole_tests_are_judged_by_the_same_profile(beam: Bench) -> None:
    lines = '[validate]\nprofile = "MIL"\nmac = 0.97\nshape_error = 0.1'
    run = ft.update(beam.study(f"{beam.parameters}[[hold_out]]\nmodes = ['4']\n{lines}"))
    expected = {
        "frequency error, MIL-STD-1540C": 3.0,
        "cross-orthogonality, diagonal, MIL-STD-1540C": 0.95,
        "self-orthogonality of the test, off the diagonal, common practice": 0.1,
        "MAC, own criterion": 0.97,
    }
    for correlation in run.results.correlations:
        assert {c.name: c.limit for c in correlation.criteria} == pytest.approx(expected)


@pytest.mark.slow
def test_held_out_sensors_are_predicted_by_shape(beam: Bench) -> None:
    tail = '[[hold_out]]\nsensors = ["4Y+", "4Z+"]\n[validate]\nprofile = "own"\n'
    tail += "shape_error = 0.02\nmac = 0.99\nshape_sd = 0.01"
    run = ft.update(beam.study(beam.parameters + tail))
    found = _validation(run)
    assert found.held_out_sensors == ("baseline: 4Y+", "baseline: 4Z+")
    assert [v.verdict for v in found.verdicts] == ["pass", "pass"]
    assert {v.data for v in found.verdicts} == {"held-out sensors"}
    assert len(found.shapes) == 4
    assert all(s.error_percent < 0.01 for s in found.shapes)
    assert all(0.3 < s.noise_percent < 3.0 for s in found.shapes)


@pytest.mark.slow
def test_a_configuration_tells_in_what_it_differs(bench: Bench) -> None:
    from femtune.model import Configuration  # noqa: PLC0415
    from femtune.model.configuration import AddedMass  # noqa: PLC0415

    labels, true = ("2Y+", "2Z+", "3Y+", "3Z+", "4Y+", "4Z+"), bench.truth()
    states = {
        "free": (Configuration("free"), ""),
        "loaded": (Configuration("loaded", masses=(AddedMass(3, 1.5),)), "masses = [{ node = 3, mass = 1.5 }]\n"),
        "propped": (Configuration("propped", supports_added=((5, "23"),)), 'supports_added = ["5:23"]\n'),
    }
    bench.uff([bench.measure(true, *labels, configuration=c, name=name) for name, (c, _) in states.items()])
    text = "".join(
        f'[[configuration]]\nname = "{name}"\ntest = "beam.uff"\nrecords = "{name}"\n{keys}'
        + ("" if name == "free" else 'use = "validation"\n')
        for name, (_, keys) in states.items()
    )
    found = _validation(ft.update(bench.study(text + bench.parameters, test=None)))
    data = {p.configuration: p.data for p in found.predictions}
    assert data == {"loaded": "modified structure", "propped": "other boundary conditions"}
    assert all(
        p.parameter_sd_percent is not None and p.test_sd_percent == pytest.approx(1.0) for p in found.predictions
    )
    assert {v.verdict for v in found.verdicts if v.criterion.startswith("frequency")} == {"pass"}
    assert any(line.startswith("frequencies outside the range used") for line in found.not_tested)


@pytest.mark.slow
def test_residuals_that_are_noise_pass(bench: Bench) -> None:
    _noisy(bench, 0.002, shape_sd=0.01)
    run = ft.update(bench.study(bench.parameters + "[residuals]\nfrequency_sd = 0.002\nshape_sd = 0.01"))
    found = _goodness(run)
    # 4 frequencies, and 4 shapes of 8 entries of unit norm, less two parameters
    assert found.degrees_of_freedom == 4 + 4 * 7 - 2
    assert (found.verdict, found.p_value > 0.01) == ("pass", True)
    assert [k.kind for k in found.by_kind] == ["frequency", "shape"]
    assert not [a for a in run.results.alerts if a.code == "update.misfit"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tail", "percent"),
    [
        ("sd = 0.004", 0.4),
        ('sd = 0.004\nform = "eigenvalue"', 0.2),
        ("sd = 0.004\n[residuals]\nfrequency_sd = 0.002", 0.4),  # the larger of two statements
    ],
)
def test_scatter_of_a_prediction_is_what_the_residuals_state(beam: Bench, tail: str, percent: float) -> None:
    """Not the default of [residuals], by which such a study compares nothing."""
    table = f'[[hold_out]]\nmodes = ["4"]\n[[residual]]\nkind = "frequency"\n{tail}\n'
    found = _validation(ft.update(beam.study(beam.parameters + table)))
    assert [p.test_sd_percent for p in found.predictions] == [pytest.approx(percent)]


@pytest.mark.slow
def test_data_that_leave_nothing_over_are_an_alert(bench: Bench) -> None:
    """Frequencies of a beam with a wrong mass are reproduced exactly by as many stiffnesses: nothing shows the mass."""
    wrong = bench.text.replace("7850.", "9800.")
    assert wrong != bench.text
    bench.uff(bench.measure(bench.truth((), wrong)))
    keep = '[[hold_out]]\nmodes = ["2", "4"]\n'
    run = ft.update(bench.study(bench.parameters + keep))
    found = _goodness(run)
    assert (found.values, found.rank, found.finding) == (2, 2, "NOT_TESTED")
    alerts = {a.code: a.sentence for a in run.results.alerts}
    assert "2 independent values" in alerts["update.few-data"]
    spare = ft.update(bench.study(bench.parameters + "[residuals]\nfrequency_sd = 0.002\nshape_sd = 0.1"))
    assert "update.few-data" not in {a.code for a in spare.results.alerts}


_OWN = '[[residual]]\nkind = "frequency"\nmodes = ["1", "3"]\nsd = 0.01\n'
_SHAPES = '[[residual]]\nkind = "shape"\nsd = 0.05\nscaling = '


@pytest.mark.parametrize(
    ("tail", "said"),
    [
        ("", True),
        (f'{_OWN}{_SHAPES}"unit-norm"\n[[residual]]\nkind = "mac"\nsd = 0.1\n', True),
        (f'{_OWN}{_SHAPES}"mass"\nmass_scaled = true\n', False),
        (f'{_OWN}[[residual]]\nkind = "mass"\nmass = 9.85\nsd = 0.002\n', False),
        ("weighed_mass = 9.85", False),
        ("masses = [{ node = 3, mass = 0.5 }]", False),
        ("[residuals]\nfrequency_sd = 0.01\ncommon_frequency_sd = 0.04\n", False),
    ],
)
@pytest.mark.slow
def test_a_mass_that_was_not_measured_is_told(bench: Bench, tail: str, said: bool) -> None:
    """Frequencies, MAC and shapes of any length are those of a structure with twice the stiffness and mass."""
    bench.uff(bench.measure(bench.truth()))
    case = '[[configuration]]\nname = "free"\ntest = "beam.uff"\n'
    key = tail.startswith(("weighed", "masses"))
    text = f"{case}{tail}\n{bench.parameters}" if key else f"{case}{bench.parameters}{tail}"
    found = _validation(ft.update(bench.study(text, test=None)))
    assert any(line.startswith("total mass: ") for line in found.not_tested) is said


@pytest.mark.slow
def test_an_unmodelled_spring_is_no_noise(bench: Bench) -> None:
    """The real beam stands on a spring that the deck lacks."""
    sprung = bench.text.replace("CONM2", "CELAS2,77,3.+5,4,3\nCONM2")
    bench.uff(bench.measure(bench.truth((), sprung)))
    run = ft.update(bench.study(bench.parameters + "[residuals]\nfrequency_sd = 0.002"))
    found = _goodness(run)
    assert found.verdict == "fail"
    assert found.p_value < 1e-6
    assert [found.sentence in a.sentence for a in run.results.alerts if a.code == "update.misfit"] == [True]


@pytest.mark.long
def test_shapes_that_are_not_normal_stay_out_of_the_test(beam: Bench) -> None:
    tail = '[residuals]\nfrequency_sd = 0.002\nshape_sd = 0.01\nshape_form = "mac"'
    found = _goodness(ft.update(beam.study(beam.parameters + tail)))
    assert [k.kind for k in found.by_kind] == ["frequency"]
    alone = _goodness(ft.update(beam.study(beam.parameters + tail.replace("0.002", "0"))))
    assert alone.verdict == "not tested"
    assert "quadratic form" in alone.sentence


@pytest.mark.slow
def test_shapes_scaled_by_their_largest_entry_are_tested(beam: Bench) -> None:
    tail = '[residuals]\nfrequency_sd = 0.002\nshape_sd = 0.01\nshape_scaling = "largest-entry"'
    found = _goodness(ft.update(beam.study(beam.parameters + tail)))
    assert [k.kind for k in found.by_kind] == ["frequency", "shape"]


@pytest.mark.parametrize(
    ("tail", "code", "says"),
    [
        ('[[hold_out]]\nmodes = ["9"]', "study.unknown-mode", "the test has no mode '9'"),
        ('[[hold_out]]\nsensors = ["77Z+"]', "study.hold-out", "the test has no sensor 77Z+"),
        ("[[hold_out]]\nabove_hz = 0.001", "study.hold-out", "no mode would remain"),
        (
            '[[hold_out]]\nsensors = ["2Y+", "2Z+", "3Y+", "3Z+", "4Y+", "4Z+", "5Y+"]',
            "study.hold-out",
            "fewer than two",
        ),
    ],
)
def test_what_cannot_be_held_out_is_refused(beam: Bench, tail: str, code: str, says: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.update(beam.study(beam.parameters + tail))
    assert caught.value.code == code
    assert says in caught.value.what
    assert "study.toml" in str(caught.value.where)


@pytest.mark.slow
def test_validate_is_a_step_and_the_report_shows_it(beam: Bench) -> None:
    study = beam.study(HALF + '[[hold_out]]\nmodes = ["2", "4"]\nsensors = ["4Y+"]\n[validate]\nprofile = "ECSS"')
    run = ft.validate(study)
    assert ".validate(" in run.results.provenance.command
    assert _validation(run).verdicts
    page = ft.report(run.folder).read_text()
    assert "On data that the update did not use" in page
    assert "Shapes at held-out sensors" in page
    assert "Errors of predicted frequencies" in page


@pytest.mark.slow
def test_residuals_that_tell_their_own_scatter_cannot_be_tested_by_it(beam: Bench) -> None:
    run = ft.update(beam.study(beam.parameters + '[residuals]\nscatter = "estimated"'))
    said = "not tested: frequency residuals: their standard deviations are estimated from the residuals themselves"
    assert _goodness(run).sentence == said


@pytest.mark.slow
def test_the_page_marks_modes_that_the_update_did_not_see(beam: Bench) -> None:
    run = ft.run(beam.study(beam.parameters + '[[hold_out]]\nmodes = ["4"]'))
    assert run.report is not None
    page = run.report.read_text()
    modes = page[page.index('id="modes"') : page.index('id="mode_shapes"')]
    assert modes.count("not used in the update") == 1
    assert "baseline: beyond the frequencies used" in page


@pytest.mark.slow
def test_chi_square_without_an_optimum_is_that_of_the_kept_values(beam: Bench) -> None:
    run = ft.update(beam.study(beam.parameters + "[residuals]\nfrequency_sd = 0.001\n[update]\nmax_iterations = 1\n"))
    update = run.results.update
    assert update is not None
    assert not update.ok
    assert update.goodness is not None
    assert update.goodness.chi_square == pytest.approx(update.chi_square, rel=1e-9)
    assert "ended without an optimum" in update.goodness.sentence
