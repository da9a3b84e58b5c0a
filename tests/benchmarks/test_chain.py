"""The benchmark of the chain: its tests are those of the true deck, and its rates are what they say."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.deck_models import model_of

from femtune.files.uff import read_uff
from femtune.model import solve_modes
from femtune.units import SI

_FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "chain"


@pytest.fixture(scope="module")
def run() -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(_FOLDER))
        return runpy.run_path(str(_FOLDER / "run.py"))


@pytest.mark.slow
def test_the_resonances_of_a_test_are_those_of_its_true_deck(run: dict[str, Any], tmp_path: Path) -> None:
    trial = run["Trial"]("mass", 3)
    study = trial.write(tmp_path)
    assert "drop_hz" not in study.read_text("utf-8")
    true, nominal = (
        solve_modes(model_of(tmp_path / name).at(np.zeros(0)), 12).freq_hz for name in ("true.bdf", "deck.bdf")
    )
    assert np.abs(true[3:] / nominal[3:] - 1.0).max() > 0.01
    frfs = read_uff(tmp_path / "test.uff", units=SI).test.frfs
    assert frfs is not None
    assert frfs.values.shape[:2] == (8, 2)
    power = np.sum(np.abs(frfs.values) ** 2, axis=(0, 1))
    peaks = frfs.freq_hz[1:-1][(power[1:-1] > power[:-2]) & (power[1:-1] > power[2:])]
    inside = true[(true > 25.0) & (true < 390.0)]
    # within a half bandwidth of 2 % and a line
    assert all(np.abs(peaks - hertz).min() < 0.02 * hertz + 0.5 for hertz in inside)


def test_rates_count_parameters_and_trials(run: dict[str, Any]) -> None:
    def row(kind: str, number: int, final: list[float], codes: list[str]) -> dict[str, Any]:
        return {
            "setup": run["SETUPS"][0], "kind": kind, "number": number, "noisy": True, "equalised": [0.0] * 5,
            "final": final, "bootstrap": [], "together": {}, "codes": codes, "found": False, "seconds": 4.0,
        }  # fmt: skip

    rows = [
        row("right", 0, [0.1, -1.0, 1.9, 2.5, 0.0], []),
        row("mass", 0, [9.0, 0.0, 0.0, 0.0, 0.0], ["update.raw-misfit"]),
        row("mass", 1, [4.0, 0.0, 0.0, 0.0, 0.0], ["study.worst-held"]),
    ]
    table = [line for line in run["page"](rows, 2).splitlines() if line.startswith("| ")]
    lines = {line.split(" | ")[0][2:]: line for line in table if run["SETUPS"][0].replace(" x ", " × ") in line}
    assert "| 5 of 5 (" in lines["right"]
    assert "| 4 of 5 (" in lines["right"]
    mass = next(line for name, line in lines.items() if name.startswith("lacks a mass"))
    # both are wrong by more than three standard deviations, and one of them is told
    assert mass.count("1 of 2 (") == 2
