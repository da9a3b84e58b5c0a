"""Vibration tests of a study: measured curves, criteria, and what cannot be compared."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.deck_models import model_of
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.study_file.reading import read_study_file
from femtune.files.study_file.validate import ValidateTable
from femtune.model import solve_modes
from femtune.model.damping import constant_damping
from femtune.model.response import make_ports
from femtune.model.vibration import (
    ModalTransfer,
    Spectrum,
    Sweep,
    base_transfer,
    response_density,
    swept_response,
)
from femtune.steps.run.result import RunResult
from femtune.steps.vibration.record import VibrationPoint, VibrationResults
from femtune.steps.vibration.run import MODES_TO, vibration_verdicts

from .cantilever import CANTILEVER, EI, Bench

SWEEP = """
[[vibration]]
name = "sweep"
kind = "sweep"
base = "Y"
outputs = ["5Y+", "3Y+"]
damping_ratio = {damping}
from_hz = 10.0
to_hz = 80.0
rate = 4.0
amplitude = 0.5
measured = "sweep.csv"
"""
RANDOM = """
[[vibration]]
name = "random"
kind = "random"
base = "Y"
outputs = ["5Y+", "3Y+"]
damping_ratio = {damping}
spectrum_hz = [10.0, 40.0, 400.0]
spectrum = [0.01, 0.04, 0.01]
measured = "random.csv"
"""
LIMITS = """
[residuals]
frequency_sd = 0.01
[validate]
sweep_frequency = 0.03
sweep_amplitude = 0.05
random_rms = 0.05
"""


LEVEL = Spectrum(np.array([10.0, 40.0, 400.0]), np.array([0.01, 0.04, 0.01]))


TRANSIENT = """
[[vibration]]
name = "shock"
kind = "transient"
base = "Y"
outputs = ["5Y+", "3Y+"]
damping_ratio = {damping}
signal = "shock.csv"
measured = "shock_response.csv"
"""


def _transfer(deck: Path, highest_hz: float) -> ModalTransfer:
    """The deck on its base with a damping ratio of 2 %, excited up to a frequency."""
    modes = solve_modes(model_of(deck).at(np.zeros(0)), 6, MODES_TO * highest_hz)
    ports = make_ports(modes.point.configured, ["5Y+"], ["5Y+", "3Y+"])
    return base_transfer(modes, ports, "Y", constant_damping(0.02))


def _of_deck(deck: Path, kind: str, lines: np.ndarray) -> np.ndarray:
    """Amplitudes of the sweep, or densities, at lines."""
    if kind == "random":
        return response_density(_transfer(deck, 400.0), [LEVEL], lines)
    hz, envelope = swept_response(_transfer(deck, 80.0), Sweep(10.0, 80.0, 4.0, amplitude=0.5))
    return np.array([np.interp(lines, hz, one) for one in envelope])


def _measure(bench: Bench) -> None:
    """Curves of the true beam."""
    deck, lines = bench.folder / "truth/true.bdf", np.linspace(15.0, 300.0, 6000)
    sweep = Sweep(10.0, 80.0, 4.0, amplitude=0.5)
    _write(bench.folder / "sweep.csv", *swept_response(_transfer(deck, 80.0), sweep))
    _write(bench.folder / "random.csv", lines, response_density(_transfer(deck, 400.0), [LEVEL], lines))


def _write(path: Path, hz: np.ndarray, values: np.ndarray) -> None:
    np.savetxt(path, np.vstack([hz, values]).T, delimiter=",", header="Hz,5Y,3Y", comments="")


def _run(bench: Bench, damping: float, more: str = "") -> RunResult:
    tables = (SWEEP + RANDOM).replace("{damping}", str(damping))
    return ft.run(bench.study(EI + tables + LIMITS + more))


@pytest.fixture(scope="module")
def tested(tmp_path_factory: pytest.TempPathFactory, true_test: Path) -> Callable[[float], RunResult]:
    """Runs with both vibration tests by damping ratio, each made once and not to be changed."""

    @cache
    def run(damping: float) -> RunResult:
        bench = Bench(tmp_path_factory.mktemp("vibration"))
        bench.write("beam.bdf", CANTILEVER)
        bench.truth()
        shutil.copy(true_test, bench.folder)
        _measure(bench)
        return _run(bench, damping)

    return run


def _vibrations(found: RunResult) -> tuple[VibrationResults, ...]:
    assert found.results.validation is not None
    return found.results.validation.vibrations


@pytest.mark.slow
def test_the_updated_model_meets_the_curves_of_the_true_one(tested: Callable[[float], RunResult]) -> None:
    found = tested(0.02)
    verdicts = [v for v in found.results.validation.verdicts if v.data == "vibration test"]
    assert [v.verdict for v in verdicts] == ["pass"] * 3
    assert all(v.measured is not None and v.measured < 0.5 for v in verdicts)
    untested = " ".join(found.results.validation.not_tested)
    assert "forced response" not in untested
    assert "no configurations or modes were held out" not in untested
    sweep, random = _vibrations(found)
    assert sweep.excitation == "base Y, 10 to 80 Hz with 4 octaves per minute, amplitude 0.5"
    for point in sweep.points:
        assert point.peak == pytest.approx(point.test_peak, rel=1e-3)
    for point in random.points:
        assert point.rms == pytest.approx(point.test_rms, rel=2e-3)
    # the stiffness changes frequencies; the height of a peak is that of damping and shape
    assert [v.before_verdict for v in verdicts] == ["fail", "pass", "fail"]
    page = (Path(found.folder) / "report.html").read_text()
    for word in (
        "Largest response in the sweep",
        "Test RMS",
        "RMS error in random vibration",
        "Damping ratio 2 %",
        "Its source is not stated",
        "Responses of sweep: test, model before and after the update",
    ):
        assert word in page  # fmt: skip


@pytest.mark.slow
def test_a_wrong_damping_ratio_fails_the_amplitudes_and_not_the_frequencies(
    tested: Callable[[float], RunResult],
) -> None:
    """Amplitudes at resonance fall with 1/ζ, root mean squares with 1/√ζ."""
    found = tested(0.04)
    verdicts = {v.criterion: v for v in found.results.validation.verdicts if v.data == "vibration test"}
    assert {name.partition(",")[0]: v.verdict for name, v in verdicts.items()} == {
        "resonance frequency error in a sweep": "pass",
        "error of the largest response in a sweep": "fail",
        "RMS error in random vibration": "fail",
    }
    errors = [v.measured for v in verdicts.values()]
    assert errors[1] == pytest.approx(47.0, abs=5.0)
    assert errors[2] == pytest.approx(100.0 * (1.0 - 0.5**0.5), abs=6.0)


WRONG = {
    "vibration.no-damping": (RANDOM, "damping_ratio = {damping}\n", ""),
    "vibration.spectrum": (RANDOM, "[0.01, 0.04, 0.01]", "[0.01, 0.04]"),
    "vibration.sweep": (SWEEP, "to_hz = 80.0", "to_hz = 10.0"),
    "vibration.sweep, slow": (SWEEP, "rate = 4.0", "rate = 1e-9"),
    "vibration.no-overlap": (SWEEP, "from_hz = 10.0\nto_hz = 80.0", "from_hz = 600.0\nto_hz = 800.0"),
    "vibration.no-overlap, random": (RANDOM, "[10.0, 40.0, 400.0]", "[1000.0, 4000.0, 8000.0]"),
    "vibration.no-overlap, lines": (SWEEP, "to_hz = 80.0", "to_hz = 10.1"),
    "response.held-port": (SWEEP, '"5Y+", "3Y+"', '"5Y+", "1Y+"'),
    "model.unknown-node": (RANDOM, '"5Y+", "3Y+"', '"5Y+", "99Y+"'),
    "vibration.no-base": (SWEEP, "outputs =", 'configuration = "free"\noutputs ='),
}
FREE = """
[[configuration]]
name = "fixed"
test = "beam.uff"
[[configuration]]
name = "free"
supports_removed = ["1:12356"]
"""


@pytest.mark.quick(0)
@pytest.mark.parametrize("name", WRONG)
def test_errors_of_vibration_tests_are_reported_before_the_update(
    beam: Bench, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(beam.folder)
    text, old, new = WRONG[name]
    assert old in text
    free = "free" in new
    for file in ("sweep.csv", "random.csv"):
        _write(beam.folder / file, np.linspace(10.0, 80.0, 200), np.ones((2, 200)))
    tables = EI + text.replace(old, new).replace("{damping}", "0.02") + LIMITS
    beam.study(FREE + tables if free else tables, test=None if free else "beam.uff")
    with pytest.raises(FemtuneError) as caught:
        ft.run(Path("study.toml"))
    assert caught.value.code == name.partition(",")[0]
    assert "vibration" in str(caught.value.where)
    # the first line that the update writes
    assert not (beam.folder / "run" / "history.jsonl").exists()
    if name in ("vibration.no-damping", "vibration.no-overlap", "vibration.no-overlap, lines"):
        check_shown(name, caught.value)


def test_all_errors_of_vibration_tests_are_reported_together(beam: Bench) -> None:
    wrong = [text.replace(old, new) for text, old, new in (WRONG["vibration.no-damping"], WRONG["vibration.sweep"])]
    for file in ("sweep.csv", "random.csv"):
        _write(beam.folder / file, np.linspace(10.0, 80.0, 200), np.ones((2, 200)))
    with pytest.raises(FemtuneErrors) as caught:
        ft.run(beam.study(EI + "".join(wrong).replace("{damping}", "0.02") + LIMITS))
    assert {error.code for error in caught.value.errors} == {"vibration.no-damping", "vibration.sweep"}


@pytest.mark.slow
def test_curves_before_and_after_are_those_of_the_two_models(beam: Bench, tested: Callable[[float], RunResult]) -> None:
    """The initial model is the deck itself, solved here past the study; the updated one meets the measured curves."""
    found = tested(0.02)
    for test in _vibrations(found):
        assert test.curves is not None
        hz, before = (found.arrays[key] for key in (test.curves.before_lines_key, test.curves.before_key))
        expected = _of_deck(beam.folder / "beam.bdf", test.kind, hz)
        np.testing.assert_allclose(before, expected, rtol=2e-3)
        at, after = (found.arrays[key] for key in (test.curves.after_lines_key, test.curves.after_key))
        assert test.curves.test_lines_key is not None
        assert test.curves.test_key is not None
        measured = [
            np.interp(at, found.arrays[test.curves.test_lines_key], v) for v in found.arrays[test.curves.test_key]
        ]
        inside = (at > 16.0) & (at < 79.0)
        np.testing.assert_allclose(after[:, inside], np.array(measured)[:, inside], rtol=0.03)


@pytest.mark.slow
def test_a_shock_that_is_integrated_step_by_step(beam: Bench) -> None:
    """Measured: the true beam by integration of its equations of motion with an adaptive step."""
    times, pulse = np.arange(0.0, 0.4, 1e-4), 0.02
    signal = np.where(times < pulse, 5.0 * np.sin(np.pi * times / pulse), 0.0)
    transfer = _transfer(beam.folder / "truth/true.bdf", 150.0)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return transfer.poles * y + np.interp(t, times, signal)

    found = solve_ivp(rate, (0.0, times[-1]), np.zeros(len(transfer.poles), complex), "DOP853", times,
                      rtol=1e-9, atol=1e-12, max_step=1e-3)  # fmt: skip
    response = 2.0 * np.real(transfer.residues[:, 0] @ found.y) + transfer.direct * signal
    _write(beam.folder / "shock_response.csv", times, response)
    np.savetxt(beam.folder / "shock.csv", np.vstack([times, signal]).T, delimiter=",", header="s,g", comments="")
    tables = TRANSIENT.replace("{damping}", "0.02")
    run = ft.run(beam.study(EI + tables + LIMITS + "transient_peak = 0.02\n"))
    (shock,) = _vibrations(run)
    assert shock.compared_s == (0.0, pytest.approx(times[-1]))
    for point, measured in zip(shock.points, response):
        assert point.peak == pytest.approx(np.abs(measured).max(), rel=2e-3)
        assert point.peak_s == pytest.approx(times[np.abs(measured).argmax()], abs=2e-4)
        assert point.before_peak != pytest.approx(point.peak, rel=0.01)
    (verdict,) = [v for v in run.results.validation.verdicts if v.data == "vibration test"]  # type: ignore[union-attr]
    assert verdict.criterion == "error of the largest response to a transient, own criterion"
    assert verdict.verdict == "pass"
    page = (Path(run.folder) / "report.html").read_text()
    assert "Largest magnitude in the transient" in page


@pytest.mark.slow
def test_a_band_limits_what_is_compared(beam: Bench) -> None:
    """In a band below the resonance the largest amplitudes are at its upper end, and the RMS is that of the band."""
    _measure(beam)
    band = "band_hz = [12.0, 20.0]\n"
    tables = (SWEEP + band + RANDOM + band.replace("12.0", "15.0")).replace("{damping}", "0.02")
    found = ft.run(beam.study(EI + tables + LIMITS))
    sweep, random = _vibrations(found)
    assert sweep.compared_hz == (12.0, 20.0)
    assert random.compared_hz == (15.0, 20.0)
    for point in sweep.points:
        assert point.peak_hz == pytest.approx(20.0, abs=0.3)
        assert point.test_peak_hz == pytest.approx(20.0, abs=0.3)
    assert random.curves is not None
    hz, after = (found.arrays[key] for key in (random.curves.after_lines_key, random.curves.after_key))
    line = np.linspace(15.0, 20.0, 4001)
    for point, density in zip(random.points, after):
        assert point.rms == pytest.approx(np.sqrt(np.trapezoid(np.interp(line, hz, density), line)), rel=2e-3)


@pytest.mark.slow
def test_ratios_by_frequency_and_their_source(beam: Bench, tested: Callable[[float], RunResult]) -> None:
    """A ratio at the frequency of the first mode and another one high above it: the peak is that of the first ratio."""
    _measure(beam)
    first, constant = _vibrations(tested(0.02))
    ratios = 'damping_ratio = [0.04, 0.02]\ndamping_hz = [200.0, 400.0]\ndamping_source = "half-power bandwidths"\n'
    tables = SWEEP.replace("damping_ratio = {damping}\n", ratios) + RANDOM.replace("{damping}", "0.02")
    (table, again) = _vibrations(ft.run(beam.study(EI + tables + LIMITS)))
    doubled = _vibrations(tested(0.04))[0]
    assert table.damping == "damping ratio 4 % at 200 Hz, 2 % at 400 Hz, linear between them"
    assert table.damping_source == "half-power bandwidths"
    assert [p.peak for p in table.points] == pytest.approx([p.peak for p in doubled.points], rel=1e-5)
    assert [p.peak for p in table.points] != pytest.approx([p.peak for p in first.points], rel=0.2)
    assert again == constant


@pytest.mark.slow
@pytest.mark.parametrize("curve", ["measured", "computed"])
def test_a_maximum_at_a_band_end_is_no_resonance(beam: Bench, curve: str) -> None:
    """Below the first mode both curves rise to the end of the band; in the whole band both have their resonance."""
    hz = np.linspace(10.0, 80.0, 300)
    rising = 1.0 + hz / 80.0
    peaked = 1.0 + np.exp(-(((hz - 14.0) / 1.0) ** 2))
    sweep = SWEEP.replace("{damping}", "0.02").replace('"5Y+", "3Y+"', '"5Y+"')
    if curve == "computed":
        sweep = sweep.replace("to_hz = 80.0", "to_hz = 18.0")
    np.savetxt(
        beam.folder / "sweep.csv", np.vstack([hz, rising if curve == "measured" else peaked]).T, delimiter=",",
        header="Hz,5Y", comments="",
    )  # fmt: skip
    found = ft.run(beam.study(EI + sweep + LIMITS))
    point = _vibrations(found)[0].points[0]
    assert (point.test_peak_at_end, point.peak_at_end) == (curve == "measured", curve == "computed")
    judged = (v for v in found.results.validation.verdicts if v.data == "vibration test")
    verdicts = {v.criterion.partition(",")[0]: v for v in judged}
    of_frequency = verdicts["resonance frequency error in a sweep"]
    assert of_frequency.verdict == "not tested"
    assert f"the maximum of the {curve} curve lies at an end of the band" in of_frequency.remark
    assert verdicts["error of the largest response in a sweep"].measured is not None
    assert "no resonance" in (Path(found.folder) / "report.html").read_text()


def test_points_without_resonance_do_not_decide() -> None:
    """The worst of the other points does, and the remark names those left out."""
    facts = {"peak": 1.0, "rms": None, "test_peak": 1.0, "test_peak_hz": 20.0}
    flat = VibrationPoint(output="3Y+", peak_hz=40.0, test_peak_at_end=True, **facts)
    good = VibrationPoint(output="5Y+", peak_hz=21.0, **facts)
    found = VibrationResults(name="s", kind="sweep", configuration="c", excitation="", points=(flat, good))
    study = SimpleNamespace(file=SimpleNamespace(validation=ValidateTable(profile="own", sweep_frequency=0.1)))
    ((verdict, _),) = vibration_verdicts(study, found)  # type: ignore[arg-type]
    assert verdict.measured == pytest.approx(0.05)
    assert verdict.remark.startswith("s, 5Y+; 3Y+: the maximum of the measured curve")


@pytest.mark.slow
def test_limits_without_data_are_not_tested(beam: Bench) -> None:
    found = ft.run(beam.study(EI + LIMITS.replace("[validate]", "[validate]\nshape_error = 0.1")))
    said = " ".join(found.results.validation.not_tested)
    assert 'resonance frequency error in a sweep: the study has no [[vibration]] of kind "sweep"' in said
    assert 'RMS error in random vibration: the study has no [[vibration]] of kind "random"' in said
    assert "shape error at held-out sensors: no sensors were held out" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("vibration.file", "Hz,a,b\n10,1,1\n9,1,1\n"),
        ("vibration.file, columns", "Hz,a,b\n10,1\n20,1,1\n"),
        ("vibration.file, heading", "10,1,1\n20,1,1\n30,2,2\n"),
        ("vibration.file, number", "Hz,a,b\n10,1,one\n20,1,1\n"),
    ],
)
def test_files_that_are_no_curves(beam: Bench, monkeypatch: pytest.MonkeyPatch, name: str, text: str) -> None:
    monkeypatch.chdir(beam.folder)
    beam.study(EI + SWEEP.replace("{damping}", "0.02") + LIMITS)
    (beam.folder / "sweep.csv").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        ft.run(Path("study.toml"))
    check_shown(name, caught.value)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("vibration.signal", "s,g\n0,0\n0.001,1\n0.003,0\n"),
        ("vibration.file, times", "s,g\n0,0\n0.002,-1\n0.001,0\n"),
    ],
)
def test_signals_that_cannot_be_used(beam: Bench, monkeypatch: pytest.MonkeyPatch, name: str, text: str) -> None:
    monkeypatch.chdir(beam.folder)
    beam.study(EI + TRANSIENT.replace("{damping}", "0.02").replace('measured = "shock_response.csv"\n', "") + LIMITS)
    (beam.folder / "shock.csv").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        ft.run(Path("study.toml"))
    check_shown(name, caught.value)


def test_a_file_that_is_not_there(beam: Bench) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.run(beam.study(EI + SWEEP.replace("{damping}", "0.02") + LIMITS))
    assert caught.value.code == "study.missing-file"
    assert caught.value.where.record == "vibration[1].measured"


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("vibration.entry", 'base = "Y"\n', ""),
        ("vibration.entry, missing", "rate = 4.0\n", ""),
        ("vibration.entry, damping", "0.02\n", "[0.02, 0.01]\ndamping_hz = [20.0]\n"),
        ("vibration.entry, band", 'base = "Y"\n', 'base = "Y"\nband_hz = [50.0, 40.0]\n'),
        ("vibration.entry, no list", "0.02\n", "0.02\ndamping_hz = [20.0]\n"),
        ("vibration.entry, other kind", 'base = "Y"\n', 'base = "Y"\nspectrum = [0.1, 0.1]\n'),
        ("vibration.entry, configuration", 'base = "Y"\n', 'base = "Y"\nconfiguration = "table"\n'),
    ],
)
def test_entries_that_are_not_complete(
    beam: Bench, monkeypatch: pytest.MonkeyPatch, name: str, old: str, new: str
) -> None:
    monkeypatch.chdir(beam.folder)
    (beam.folder / "sweep.csv").write_text("Hz,5Y+,3Y+\n10,1,1\n80,1,1\n")
    beam.study(EI + SWEEP.replace("{damping}", "0.02").replace(old, new) + LIMITS)
    with pytest.raises(FemtuneError) as caught:
        ft.run(Path("study.toml"))
    check_shown(name, caught.value)


@pytest.mark.parametrize(
    "damping",
    ["0.02\ndamping_hz = [20.0]", "[0.02, 0.01]", "[0.02, 0.01]\ndamping_hz = [40.0, 20.0]"],
)
def test_a_list_of_ratios_needs_a_rising_frequency_each(beam: Bench, damping: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        read_study_file(beam.study(EI + SWEEP.replace("{damping}", damping) + LIMITS))
    assert "vibration.entry" in {e.code for e in _all(caught.value)}


@pytest.mark.parametrize(
    ("damping", "said"),
    [
        ("0.0", "'damping_ratio' should be greater than 0"),
        ("[0.02, 2.0]\ndamping_hz = [20.0, 40.0]", "entry 2 of 'damping_ratio' should be less than 1"),
        ('"2 %"', "'damping_ratio' should be a number"),
    ],
)
def test_a_wrong_ratio_is_one_error_at_its_place(beam: Bench, damping: str, said: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        read_study_file(beam.study(EI + SWEEP.replace("{damping}", damping) + LIMITS))
    wrong = [e for e in _all(caught.value) if e.code != "study.missing-file"]
    assert [e.what for e in wrong if "damping_ratio" in e.what] == [said]
    assert "tuple[" not in str(caught.value)


def _all(error: FemtuneError) -> tuple[FemtuneError, ...]:
    return error.errors if isinstance(error, FemtuneErrors) else (error,)
