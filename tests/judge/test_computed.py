"""Reasons for the verdict from the computation itself: runs that the update leaves, decks that are not the solution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.study.cantilever import CANTILEVER, EI, Bench, bounded

import femtune as ft
from femtune.steps.judge.record.reason import ReasonRecord


def _two_masses_hz(k: float) -> np.ndarray:
    """Two masses of 1 kg on springs k and 3000 N/m in a chain."""
    K = np.array([[k + 3000.0, -3000.0], [-3000.0, 3000.0]])
    return np.sqrt(np.linalg.eigvalsh(K)) / (2.0 * np.pi)


def _reasons(folder: Path, runs: np.ndarray, truth: float, more: str) -> tuple[ReasonRecord, ...]:
    rows = [",".join(f"{v:.10g}" for v in (k, *_two_masses_hz(k))) for k in runs]
    (folder / "runs.csv").write_text("\n".join(["k,f1_hz,f2_hz", *rows, ""]))
    hz = ", ".join(f"{f:.8g}" for f in _two_masses_hz(truth))
    (folder / "s.toml").write_text(
        f'[study]\ntitle = "runs"\nunits = "m-kg-s"\n[runs]\nfile = "runs.csv"\n{more}\n[test]\nfreq_hz = [{hz}]\n'
        '[[parameter]]\nname = "k"\nabsolute = true\nnominal = 2000.0\nlower = 50.0\nupper = 9000.0\n'
        "[residuals]\nfrequency_sd = 0.005\n"
    )
    judgement = ft.update(folder / "s.toml").results.judgement
    assert judgement is not None
    return judgement.reasons


KRIGING, QUADRATIC = 'method = "kriging"', "degree = 2"


@pytest.mark.slow
@pytest.mark.parametrize("method", [KRIGING, QUADRATIC, 'method = "radial-basis"'])
@pytest.mark.parametrize(("truth", "side"), [(200.0, "below"), (6000.0, "above"), (2600.0, "")])
def test_a_solution_outside_the_runs_is_not_accepted(method: str, truth: float, side: str, tmp_path: Path) -> None:
    found = _reasons(tmp_path, np.linspace(500.0, 4000.0, 15), truth, method)
    outside = [r for r in found if r.code == "judge.outside-runs"]
    assert [(r.weight, r.place) for r in outside] == ([("not accepted", "k")] if side else [])
    assert all(f"is {side} all runs of the table (500 to 4000)" in r.sentence for r in outside)
    assert "judge.between-runs" not in {r.code for r in found}


@pytest.mark.slow
def test_a_solution_in_a_gap_of_the_runs_is_a_reservation(tmp_path: Path) -> None:
    """Between 300 and 4000 N/m no run tells how the frequencies go."""
    few, asked = np.array([100.0, 200.0, 300.0, 4000.0]), KRIGING + "\ndegree = 0\ntolerance = 0.002"
    (found,) = [r for r in _reasons(tmp_path, few, 1500.0, asked) if r.code == "judge.between-runs"]
    assert found.weight == "reservation"
    many = _reasons(tmp_path, np.linspace(100.0, 4000.0, 15), 1500.0, asked)
    assert "judge.between-runs" not in {r.code for r in many}


MASSLESS = CANTILEVER.replace("0.3     7850.", "0.3").replace(
    "CONM2   9       5               2.0\n",
    "".join(f"CONM2   {n + 90}      {n}               {2.0 + 0.5 * n}\n" for n in (2, 3, 4, 5)),
)
"""Four masses without rotary inertia on massless beams: 12 of the 24 DOFs have no mass."""


@pytest.mark.slow
def test_a_small_model_with_massless_motions_is_reduced(tmp_path: Path) -> None:
    """Its basis soon holds all motions with mass; the solution is that of the full model."""
    bench = Bench(tmp_path, MASSLESS)
    bench.write("beam.bdf", MASSLESS)
    bench.uff(bench.measure(bench.truth(text=MASSLESS)))
    full = ft.update(bench.study())
    reduced = ft.update(bench.study(EI + "[reduction]\n"), output=tmp_path / "reduced")
    update = reduced.results.update
    assert update is not None
    assert update.reduction is not None
    assert update.reduction.certified
    assert reduced.values == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-4)
    assert reduced.values == pytest.approx(full.values, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_a_vibration_test_takes_the_modes_that_its_band_needs(count: int, tmp_path: Path) -> None:
    """[modes] states the modes of the correlation, which end far below the excitation."""
    bench = Bench(tmp_path)
    bench.write("beam.bdf", CANTILEVER)
    bench.uff(bench.measure(bench.truth(), count=count))
    random = (
        '[[vibration]]\nname = "shake"\nkind = "random"\nbase = "Y"\noutputs = ["3Y+"]\ndamping_ratio = 0.02\n'
        "spectrum_hz = [10.0, 600.0]\nspectrum = [0.01, 0.01]\n"
    )
    rms = []
    for number in (count, 12):
        study = bench.study(bounded("root", "PBAR 1 I1") + random)
        study.write_text(study.read_text().replace("count = 6", f"count = {number}"))
        run = ft.update(study)
        assert run.results.validation is not None
        (test,) = run.results.validation.vibrations
        rms.append(test.points[0].rms)
        assert test.modes_to_hz is not None
        assert test.modes_to_hz > 600.0
        assert test.truncation_percent is not None
        assert test.truncation_percent < 1.0
    assert rms[0] == pytest.approx(rms[1], rel=2e-3)
