"""Predictions: σ from the parameters' covariance, and the chance of a miss; held-out sensors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from femtune.correlation import NotTested, correlate
from femtune.dofs import Dof, DofSet
from femtune.modal import ModeSet
from femtune.validation import frequency_miss, held_out_sensors


def test_chances_of_misses_are_uniform_where_model_and_scatter_are_right() -> None:
    """A linear model fitted to noisy data predicts new noisy data: p-values of the misses are uniform."""
    rng, G, g = np.random.default_rng(0), np.random.default_rng(1).normal(size=(8, 3)), np.array([0.5, -1.0, 2.0])
    covariance = 0.01**2 * np.linalg.inv(G.T @ G)
    p = []
    for _ in range(1500):
        x = np.linalg.lstsq(G, 0.01 * rng.normal(size=8), rcond=None)[0]
        p.append(frequency_miss(float(g @ x) - 0.02 * rng.normal(), g, covariance, 0.02).p_value)
    assert kstest(p, "uniform").pvalue > 0.01


def test_the_standard_deviation_is_that_of_the_parameters() -> None:
    found = frequency_miss(0.05, np.array([0.5, 2.0]), np.array([[0.04, 0.01], [0.01, 0.01]]), 0.03)
    assert found.parameter_sd == pytest.approx(np.sqrt(0.25 * 0.04 + 2 * 0.5 * 2.0 * 0.01 + 4 * 0.01))
    assert found.sd == pytest.approx(np.hypot(found.parameter_sd or 0.0, 0.03))
    assert found.z == pytest.approx(0.05 / found.sd)
    assert found.explained


def test_a_miss_beyond_scatter_says_so() -> None:
    found = frequency_miss(0.05, np.array([0.5]), np.array([[0.0001]]), 0.005)
    assert not found.explained
    assert str(found) == (
        "uncertainty (σ 0.71 %: test 0.5 %, parameters 0.5 %) does not explain the error of 5 % (7.1 σ)"
    )


def test_a_parameter_without_covariance_counts_only_where_it_matters() -> None:
    unknown = np.array([[0.01, np.nan], [np.nan, np.nan]])
    assert frequency_miss(0.1, np.array([1.0, 0.0]), unknown, 0.0).parameter_sd == pytest.approx(0.1)
    open_ = frequency_miss(0.1, np.array([1.0, 1.0]), unknown, 0.02)
    assert open_.parameter_sd is None
    assert "that of the parameters is not known" in str(open_)
    assert frequency_miss(0.1, np.zeros(2), unknown, 0.0).p_value == 0.0


def _pair(error: float = 0.0, **more: object) -> tuple[ModeSet, ModeSet]:
    dofs = DofSet(Dof(i + 1, "Z") for i in range(6))
    phi = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [3.0, -1.0, -2.0, 2.0, 1.0, -1.0]]).T
    psi = 2.5 * phi
    psi[5, 0] += error
    return ModeSet(np.array([5.0, 9.0]), psi, dofs, **more), ModeSet(np.array([5.0, 9.0]), phi, dofs)  # type: ignore[arg-type]


def test_the_scale_comes_from_the_sensors_that_were_used() -> None:
    error = 1.5
    test, model = _pair(error)
    found = held_out_sensors(correlate(test, model), [5])
    size = np.sqrt(np.mean(test.shapes[:, 0] ** 2))
    assert found.error == pytest.approx([error / size, 0.0], abs=1e-12)
    assert found.sensors == ("6Z+",)
    worst = found.worst()
    assert not isinstance(worst, NotTested)
    assert worst == (pytest.approx(error / size), "test mode 1", "")


def test_scatter_beside_the_error_at_a_held_out_sensor() -> None:
    test, model = _pair(0.1, shapes_sd=np.full((6, 2), 0.2))
    worst = held_out_sensors(correlate(test, model), [5]).worst()
    assert not isinstance(worst, NotTested)
    assert worst[2].endswith("could explain it")


def test_a_sensor_without_entries_is_not_tested() -> None:
    test, model = _pair()
    shapes = test.shapes.copy()
    shapes[5] = np.nan
    gap = ModeSet(test.freq_hz, shapes, test.dofs)
    assert isinstance(held_out_sensors(correlate(gap, model), [5]).worst(), NotTested)
