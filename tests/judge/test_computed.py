"""Reasons for the verdict from the computation itself: runs that the update leaves, decks that are not the solution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

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
