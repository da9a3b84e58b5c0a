"""Vibration tests of a study: measured curves, criteria, and what cannot be compared."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune import steps
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.files.study_file.validation import ValidateTable
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.model.damping import constant_damping
from femtune.model.response import make_ports
from femtune.model.vibration import Spectrum, Sweep, base_transfer, response_density, swept_response
from femtune.parameters import ParameterSet
from femtune.results.step_results import RunResult
from femtune.results.vibration import VibrationPoint, VibrationResults, vibration_verdicts

from .conftest import EI, Bench

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


def _measure(bench: Bench) -> None:
    """Curves of the true beam with a damping ratio of 2 %."""
    model = parametric_model(
        build_structure(read_deck(bench.folder / "truth/true.bdf")).structure, ParameterSet(()), ()
    )
    modes = solve_modes(configure(model, Configuration()).at(np.zeros(0)), 6)
    ports = make_ports(modes.point.configured, ["5Y+"], ["5Y+", "3Y+"])
    transfer = base_transfer(modes, ports, "Y", constant_damping(0.02))
    hz, envelope = swept_response(transfer, Sweep(10.0, 80.0, 4.0, amplitude=0.5))
    _write(bench.folder / "sweep.csv", hz, envelope)
    lines = np.linspace(15.0, 300.0, 6000)
    level = Spectrum(np.array([10.0, 40.0, 400.0]), np.array([0.01, 0.04, 0.01]))
    _write(bench.folder / "random.csv", lines, response_density(transfer, [level], lines))


def _write(path: Path, hz: np.ndarray, values: np.ndarray) -> None:
    np.savetxt(path, np.vstack([hz, values]).T, delimiter=",", header="Hz,5Y,3Y", comments="")


def _run(bench: Bench, damping: float, more: str = "") -> RunResult:
    tables = (SWEEP + RANDOM).replace("{damping}", str(damping))
    return steps.run(bench.study(EI + tables + LIMITS + more))


def _vibrations(found: RunResult) -> tuple[VibrationResults, ...]:
    assert found.results.validation is not None
    return found.results.validation.vibrations


@pytest.mark.slow
def test_the_updated_model_meets_the_curves_of_the_true_one(beam: Bench) -> None:
    _measure(beam)
    found = _run(beam, 0.02)
    verdicts = [v for v in found.results.validation.verdicts if v.data == "vibration test"]
    assert [v.verdict for v in verdicts] == ["pass"] * 3
    assert all(v.measured is not None and v.measured < 0.5 for v in verdicts)
    sweep, random = _vibrations(found)
    assert sweep.excitation == "base Y, 10 to 80 Hz with 4 octaves per minute, amplitude 0.5"
    for point in sweep.points:
        assert point.peak == pytest.approx(point.test_peak, rel=1e-3)
    for point in random.points:
        assert point.rms == pytest.approx(point.test_rms, rel=2e-3)
    page = (Path(found.folder) / "report.html").read_text()
    for word in ("Largest response in the sweep", "Test RMS", "RMS error in random vibration"):
        assert word in page


@pytest.mark.slow
def test_a_wrong_damping_ratio_fails_the_amplitudes_and_not_the_frequencies(beam: Bench) -> None:
    """Amplitudes at resonance fall with 1/ζ, root mean squares with 1/√ζ."""
    _measure(beam)
    found = _run(beam, 0.04)
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
        steps.run(Path("study.toml"))
    assert caught.value.code == name.partition(",")[0]
    assert "vibration" in str(caught.value.where)
    # the first line that the update writes
    assert not (beam.folder / "run" / "history.jsonl").exists()
    if name in ("vibration.no-damping", "vibration.no-overlap, lines"):
        check_shown(name, caught.value)


def test_all_errors_of_vibration_tests_are_reported_together(beam: Bench) -> None:
    wrong = [text.replace(old, new) for text, old, new in (WRONG["vibration.no-damping"], WRONG["vibration.sweep"])]
    for file in ("sweep.csv", "random.csv"):
        _write(beam.folder / file, np.linspace(10.0, 80.0, 200), np.ones((2, 200)))
    with pytest.raises(FemtuneErrors) as caught:
        steps.run(beam.study(EI + "".join(wrong).replace("{damping}", "0.02") + LIMITS))
    assert {error.code for error in caught.value.errors} == {"vibration.no-damping", "vibration.sweep"}


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
    found = steps.run(beam.study(EI + sweep + LIMITS))
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
    (verdict,) = vibration_verdicts(study, found)  # type: ignore[arg-type]
    assert verdict.measured == pytest.approx(0.05)
    assert verdict.remark.startswith("s, 5Y+; 3Y+: the maximum of the measured curve")


@pytest.mark.slow
def test_limits_without_data_are_not_tested(beam: Bench) -> None:
    found = steps.run(beam.study(EI + LIMITS.replace("[validate]", "[validate]\nshape_error = 0.1")))
    said = " ".join(found.results.validation.not_tested)
    assert 'resonance frequency error in a sweep: the study has no [[vibration]] of kind "sweep"' in said
    assert 'RMS error in random vibration: the study has no [[vibration]] of kind "random"' in said
    assert "shape error at held-out sensors: no sensors were held out" in said


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("vibration.file", "Hz,a,b\n10,1,1\n9,1,1\n"),
        ("vibration.file, columns", "Hz,a\n10,1\n20,1\n"),
        ("vibration.file, heading", "10,1,1\n20,1,1\n30,2,2\n"),
        ("vibration.file, number", "Hz,a,b\n10,1,one\n20,1,1\n"),
    ],
)
def test_files_that_are_no_curves(beam: Bench, monkeypatch: pytest.MonkeyPatch, name: str, text: str) -> None:
    monkeypatch.chdir(beam.folder)
    beam.study(EI + SWEEP.replace("{damping}", "0.02") + LIMITS)
    (beam.folder / "sweep.csv").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        steps.run(Path("study.toml"))
    check_shown(name, caught.value)


def test_a_file_that_is_not_there(beam: Bench) -> None:
    with pytest.raises(FemtuneError) as caught:
        steps.run(beam.study(EI + SWEEP.replace("{damping}", "0.02") + LIMITS))
    assert caught.value.code == "vibration.file"


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("vibration.entry", 'base = "Y"\n', ""),
        ("vibration.entry, missing", "rate = 4.0\n", ""),
        ("vibration.entry, configuration", 'base = "Y"\n', 'base = "Y"\nconfiguration = "table"\n'),
    ],
)
def test_entries_that_are_not_complete(
    beam: Bench, monkeypatch: pytest.MonkeyPatch, name: str, old: str, new: str
) -> None:
    monkeypatch.chdir(beam.folder)
    beam.study(EI + SWEEP.replace("{damping}", "0.02").replace(old, new) + LIMITS)
    with pytest.raises(FemtuneError) as caught:
        steps.run(Path("study.toml"))
    check_shown(name, caught.value)
