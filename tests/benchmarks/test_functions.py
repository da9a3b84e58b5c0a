"""The benchmark of identification from functions: errors are what they are called, and a small run finds all modes."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from tests.loaded import load_module

_RUN = Path(__file__).resolve().parents[2] / "benchmarks" / "functions" / "run.py"


@pytest.fixture(scope="module")
def run() -> ModuleType:
    return load_module(_RUN, "benchmark_of_functions")


def test_errors_are_relative_and_a_missing_mode_is_no_number(run: ModuleType) -> None:
    truth = run.truth_of("two 0.5 % apart", 8)
    keep = [0, 1, 2, 4, 5]
    found = (1.001 * truth.freq_hz[keep], 0.9 * truth.damping_ratio[keep], -2.0 * truth.shapes[:, keep])
    errors = run.errors(found, truth)
    np.testing.assert_allclose(errors[0, keep], 1e-3)
    np.testing.assert_allclose(errors[1, keep], -0.1)
    np.testing.assert_allclose(errors[2, keep], 0.0, atol=1e-12)
    assert np.isnan(errors[:, 3]).all()


@pytest.mark.slow
def test_a_small_run_finds_all_modes(run: ModuleType) -> None:
    row = run.measured("apart, 0.1 to 5 %", 40, "femtune", 8, 1)
    assert (row.found, row.extra) == (6.0, 0.0)
    assert row.freq_bias < 1e-4
    assert row.text().count("|") == 12
