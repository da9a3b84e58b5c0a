"""The benchmark of the chain: its tests are those of the true deck, and its rates are what they say."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.deck_models import model_of

import femtune as ft
from femtune.files.uff import read_uff
from femtune.model import solve_modes
from femtune.steps.update import in_run
from femtune.steps.update import run as update_run
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


@pytest.mark.long
def test_specimens_that_are_fitted_together_have_their_true_moduli(run: dict[str, Any], tmp_path: Path) -> None:
    factors = {"A": 0.95, "B": 1.05}
    write_specimens = sys.modules[run["Trial"].__module__].write_specimens
    study, truth = write_specimens(tmp_path, factors, "top", "[update]\nlook_further = false\n")
    results = ft.update(study, output=tmp_path / "out").results
    update, specimens = results.update, results.specimens
    assert update is not None
    assert update.ok
    assert update.raw is not None
    assert {p.name for p in update.parameters} == set(truth)
    for p in update.parameters:
        assert p.sd is not None
        assert abs(p.value - truth[p.name]) < 4.0 * p.sd < 2e-3
    assert specimens is not None
    assert specimens.common is not None
    assert specimens.common.p_value > 1e-3
    assert specimens.common.restrictions == len(truth) - len(factors)


@pytest.mark.long
def test_ends_of_a_trial_are_known_by_their_names(
    run: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(update_run, "then_raw", update_run.then_raw)
    monkeypatch.setattr(in_run, "find_parameters", in_run.find_parameters)
    run["keep_ends"]()
    one = run["Trial"]("right", 0)
    update = ft.update(one.write(tmp_path, run["MORE"]), output=tmp_path / "out").results.update
    assert update is not None
    assert update.raw is not None
    errors = {name: np.array(rows[0]) for name, rows in run["together"](one).items()}
    equalised = np.array([v.equalised for v in update.raw.values])
    np.testing.assert_allclose(errors["equalised"], equalised - one.truth, rtol=1e-6, atol=1e-9)
    final = np.array([p.value for p in update.parameters])
    np.testing.assert_allclose(errors["final"], final - one.truth, rtol=1e-6, atol=1e-9)
    assert np.abs(final - equalised).max() > 1e-5
    # a second update would be one of another trial
    with pytest.raises(RuntimeError, match="two results"):
        update_run.then_raw(*4 * [None])  # type: ignore[list-item]


@pytest.mark.long
def test_exact_frfs_of_a_right_model_give_its_moduli(run: dict[str, Any], tmp_path: Path) -> None:
    """Modes far above the band have damping ratios that the identification does not know: 0.2 to 2 %."""
    one = run["Trial"]("right", 0, noisy=False)
    study = one.write(tmp_path, run["MORE"])
    # a lower order takes less time; the modes that it misses are found with the model
    study.write_text(study.read_text("utf-8").replace("[equalise]\n", "[equalise]\nlargest_order = 20\n"), "utf-8")
    update = ft.update(study, output=tmp_path / "out").results.update
    assert update is not None
    assert update.raw is not None
    values = np.array([p.value for p in update.parameters])
    assert np.abs(values / one.truth - 1.0).max() < 3e-6


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
