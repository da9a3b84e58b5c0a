"""Criteria on FRFs that the update did not use: held-out channels, and a modified structure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.run.result import RunResult
from femtune.steps.validate.record.validation import ValidationVerdict
from femtune.study.study import load_study

from ..messages.shown import check_shown
from .cantilever import Bench
from .fine_cantilever import BEAM, OUTPUTS, measure, write_functions

LIMITS = """
[validate]
profile = "own"
frac = 0.95
fdac = 0.95
frf_mean_db = 1.0
frf_max_db = 3.0
resonance_error = 0.01
"""
LINES = np.arange(4.0, 244.0, 4.0)
RESIDUAL = '\n[[residual]]\nkind = "frf"\nto_hz = 240.0\n'
LEVEL = "level error of an FRF, mean over the lines"
CONFIGURED = """
[[configuration]]
name = "as built"
test = "frfs.uff"

[[configuration]]
name = "with mass"
test = "heavy.uff"
use = "validation"
masses = [{{ node = {node}, mass = {mass} }}]
"""


def by_criterion(run: RunResult, configuration: str = "baseline") -> dict[str, ValidationVerdict]:
    assert run.results.validation is not None
    return {
        v.criterion.removesuffix(", own criterion"): v
        for v in run.results.validation.verdicts
        if v.configuration == configuration
    }


@pytest.fixture(scope="module")
def with_frfs(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = Bench(tmp_path_factory.mktemp("frfs"))
    measure(made, LINES)
    return made


@pytest.mark.slow
def test_deviations_of_both_sets_before_and_after(with_frfs: Bench) -> None:
    """δ of the validation set by the FRFs in the results; sums weighted by the lines."""
    hold = '\n[[hold_out]]\noutputs = ["12Y+"]\n'
    path = with_frfs.study(with_frfs.parameters + RESIDUAL + hold, test="frfs.uff")
    run = ft.update(path)
    assert run.results.validation is not None
    found = run.results.validation.deviations
    assert found is not None
    assert [(c.data, c.output) for c in found.channels] == [
        ("calibration", "7Y+"), ("calibration", "17Y+"), ("validation", "12Y+")
    ]  # fmt: skip
    assert run.results.update is not None
    (compared,) = run.results.update.frfs
    assert (compared.kind, compared.unit) == ("accelerance", "m/s²/N")
    assert run.arrays[compared.values_key].shape == (len(run.results.update.history), 3, 1, len(LINES))
    (curves,) = run.results.validation.curves
    at = curves.outputs.index("12Y+")
    model, test = run.arrays[curves.values_key][at, 0], run.arrays[curves.test_values_key][at, 0]
    held = found.channels[2]
    assert held.after == pytest.approx(np.mean(np.abs(np.log(model / test) / np.log(10.0)) ** 2), rel=1e-9)
    assert held.lines == np.isfinite(test).sum()
    calibration, validation = found.sums
    for one, own in ((calibration, found.channels[:2]), (validation, found.channels[2:])):
        lines = [c.lines for c in own]
        assert one.before == pytest.approx(np.average([c.before for c in own], weights=lines))
        assert one.after == pytest.approx(np.average([c.after for c in own], weights=lines))
        assert one.change_percent == pytest.approx(100.0 * (one.after / one.before - 1.0))
        assert one.change_percent < -90.0
    assert found.sentences[1].startswith("δ of the validation set, 1 FRFs: ")


@pytest.mark.slow
def test_held_out_channels_pass_after_the_update(with_frfs: Bench) -> None:
    hold = '\n[[hold_out]]\noutputs = ["12Y+"]\n'
    limits = LIMITS.replace("fdac = 0.95\n", "")
    path = with_frfs.study(with_frfs.parameters + RESIDUAL + hold + limits, test="frfs.uff")
    run = ft.run(path)
    found = run.results.validation
    assert found is not None
    assert run.results.update is not None
    assert {c.label for c in run.results.update.comparisons} == {"7Y+ / 7Y+", "17Y+ / 7Y+"}
    verdicts = by_criterion(run)
    assert len(verdicts) == 4
    assert {v.verdict for v in verdicts.values()} == {"pass"}
    assert {v.data for v in verdicts.values()} == {"unused FRFs"}
    assert verdicts["FRAC"].measured == pytest.approx(1.0, abs=1e-6)
    (frf,) = found.frfs
    assert (frf.output, frf.input) == ("12Y+", "7Y+")
    # the largest one at an antiresonance
    assert frf.mean_db < 0.01
    assert frf.max_db < 0.1
    assert [r.test_hz for r in found.resonances] == pytest.approx([r.model_hz for r in found.resonances], rel=1e-5)
    # levels were tested on data that were not used, damping ratios were not compared
    (alert,) = [a for a in run.results.alerts if a.code == "update.frfs-alone"]
    assert "modal damping" in alert.sentence
    assert "forced response" not in alert.sentence
    page = Path(ft.report(run.folder)).read_text()
    assert "Measured FRFs that the update did not use" in page
    assert "Measured FRFs of baseline that the update did not use, and those of the updated model" in page
    (curves,) = found.curves
    test = run.arrays[curves.test_values_key]
    known = [curves.outputs[i] for i in np.flatnonzero(np.isfinite(test).any(axis=(1, 2)))]
    assert known == ["12Y+"]
    assert run.arrays[curves.values_key].shape == test.shape == (3, 1, len(LINES))


@pytest.mark.slow
def test_without_held_out_frfs_nothing_is_tested_and_the_results_say_so(with_frfs: Bench) -> None:
    run = ft.run(with_frfs.study(with_frfs.parameters + RESIDUAL + LIMITS, test="frfs.uff"))
    verdicts = by_criterion(run)
    assert {v.verdict for v in verdicts.values()} == {"not tested"}
    assert "the update used all FRFs" in verdicts["FRAC"].remark
    (alert,) = [a for a in run.results.alerts if a.code == "update.frfs-alone"]
    assert "modal damping" in alert.sentence
    assert "forced response levels" in alert.sentence
    check_shown("update.frfs-alone", f"[update.frfs-alone] {alert.sentence}")
    assert run.results.validation is not None
    assert any("forced response levels" in s for s in run.results.validation.not_tested)


@pytest.mark.parametrize(("stated", "outcome"), [(1.5, "pass"), (0.5, "fail")])
@pytest.mark.slow
def test_a_modified_structure(with_frfs: Bench, stated: float, outcome: str) -> None:
    """Its curves are predicted if the study states the mass that was added, and not otherwise."""
    heavy = BEAM.replace("SPC1    1", "CONM2   98      12              1.5\nSPC1    1")
    write_functions(with_frfs, heavy, LINES, "heavy.uff", OUTPUTS)
    tail = CONFIGURED.format(node=12, mass=stated) + with_frfs.parameters
    tail += RESIDUAL + 'configuration = "as built"\n' + LIMITS
    run = ft.run(with_frfs.study(tail, test=None))
    verdicts = by_criterion(run, "with mass")
    assert {v.data for v in verdicts.values()} == {"modified structure"}
    assert len(verdicts) == 5
    for name in ("FRAC", "resonance frequency error in the FRFs", LEVEL):
        assert verdicts[name].verdict == outcome
    assert verdicts["resonance frequency error in the FRFs"].unit == "%"
    assert verdicts[LEVEL].unit == "dB"
    assert {v.verdict for v in by_criterion(run, "as built").values()} == {"not tested"}
    assert run.results.validation is not None
    assert not any(s.startswith("a modified structure") for s in run.results.validation.not_tested)


REFUSED = {
    "unknown output": ('[[hold_out]]\noutputs = ["3Y+"]', "study.hold-out", "no 3Y+ among their outputs"),
    "unknown input": ('[[hold_out]]\ninputs = ["12Y+"]', "study.hold-out", "no 12Y+ among their inputs"),
    "all of them": ('[[hold_out]]\ninputs = ["7Y+"]', "study.hold-out", "no FRF would remain"),
    "frac": ("[validate]\nfrac = 1.5", "study.value", ""),
    "level": ("[validate]\nfrf_max_db = -3.0", "study.value", ""),
    "band": ("[validate]\nfrf_from_hz = 50.0\nfrf_to_hz = 20.0", "study.response-lines", "frf_from_hz"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_values(name: str, with_frfs: Bench) -> None:
    text, code, words = REFUSED[name]
    with pytest.raises(FemtuneError) as error:
        load_study(with_frfs.study(f"{with_frfs.parameters}{RESIDUAL}\n{text}\n", test="frfs.uff"))
    assert error.value.code == code
    assert words in error.value.what
    assert error.value.hint


def test_frfs_cannot_be_held_out_of_a_test_of_modes(beam: Bench) -> None:
    with pytest.raises(FemtuneError, match="has no FRFs") as error:
        load_study(beam.study(f'{beam.parameters}\n[[hold_out]]\noutputs = ["5Y+"]\n'))
    assert error.value.code == "study.hold-out"


def test_a_band_without_measured_lines_is_reported_before_the_update(
    with_frfs: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(with_frfs.folder)
    with_frfs.study(f"{with_frfs.parameters}{RESIDUAL}{LIMITS}frf_from_hz = 500.0\n", test="frfs.uff")
    with pytest.raises(FemtuneError) as caught:
        ft.run(Path("study.toml"), output=tmp_path / "run")
    check_shown("response.no-lines, validation", caught.value)
    assert not (tmp_path / "run" / "history.jsonl").exists()
