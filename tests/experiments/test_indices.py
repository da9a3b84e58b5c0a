"""Sensitivity indices: functions whose effects and variances are known."""

from __future__ import annotations

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.experiments import elementary_effects, morris_design, sobol_design, sobol_indices, variance_indices


def test_a_trajectory_changes_one_factor_at_a_time() -> None:
    paths = morris_design(5, 40, levels=4, seed=1)
    steps = np.diff(paths, axis=1)
    assert np.all(np.sum(steps != 0.0, axis=2) == 1)
    assert np.all(np.sum(steps != 0.0, axis=1) == 1)
    np.testing.assert_allclose(np.abs(steps[steps != 0.0]), 2.0 / 3.0)
    assert set(np.round(3.0 * paths.ravel(), 9)) == {0.0, 1.0, 2.0, 3.0}


def test_every_level_is_equally_probable() -> None:
    start = morris_design(2, 4000, seed=3)[:, 0]
    counts = np.unique(np.round(3.0 * start[:, 0]), return_counts=True)[1]
    # four standard deviations of a binomial count
    assert np.all(np.abs(counts - 1000) < 4.0 * np.sqrt(4000 * 0.25 * 0.75))


def test_elementary_effects_of_a_linear_function_with_an_interaction() -> None:
    paths = morris_design(4, 50, seed=2)
    x = paths
    responses = np.stack([3.0 * x[..., 0] - 2.0 * x[..., 1] + x[..., 0] * x[..., 2], x[..., 3] ** 2], axis=2)
    found = elementary_effects(paths, responses)
    assert found.mean[1, 0] == pytest.approx(-2.0)
    assert found.absolute[1, 0] == pytest.approx(2.0)
    assert found.spread[1, 0] == pytest.approx(0.0, abs=1e-12)
    assert found.spread[0, 0] > 0.1
    assert found.absolute[3, 0] == 0.0
    # the elementary effect of a square is the sum of its two levels, here 2/3 or 4/3
    assert 2.0 / 3.0 < found.mean[3, 1] < 4.0 / 3.0
    assert np.isnan(elementary_effects(paths[:1], responses[:1]).spread).all()


@pytest.mark.slow
def test_the_indices_of_ishigami() -> None:
    """Closed forms of Ishigami's function (a = 7, b = 0.1)."""
    a, b = 7.0, 0.1

    def function(points: np.ndarray) -> np.ndarray:
        x = np.pi * (2.0 * points - 1.0)
        return (np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0]))[:, None]

    variance = a**2 / 8 + b * np.pi**4 / 5 + b**2 * np.pi**8 / 18 + 0.5
    first = np.array([0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8, 0.0]) / variance
    interaction = 8 * b**2 * np.pi**8 / 225 / variance
    found = sobol_indices(function, 3, points=4096, seed=1)
    np.testing.assert_allclose(found.first[:, 0], first, atol=0.01)
    total = first + np.array([interaction, 0.0, interaction])
    np.testing.assert_allclose(found.total[:, 0], total, atol=0.01)
    for true, interval in ((first, found.first_interval), (total, found.total_interval)):
        assert interval is not None
        assert np.all((interval[0, :, 0] <= true + 1e-12) & (true - 1e-12 <= interval[1, :, 0]))


def test_effects_of_a_linear_and_a_quadratic_function() -> None:
    """a·x has μ* = |a| and σ = 0; x² has the effects 2/3 and 4/3, as often as the steps are low and high."""
    paths = morris_design(3, 40, seed=4)
    slopes = np.array([2.0, -5.0, 0.0])
    found = elementary_effects(paths, np.stack([paths @ slopes, paths[..., 0] ** 2], axis=2))
    np.testing.assert_allclose(found.absolute[:, 0], np.abs(slopes), atol=1e-12)
    np.testing.assert_allclose(found.spread[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.margin[:, 0], 0.0, atol=1e-12)
    high = np.mean(paths[..., 0].max(axis=1) == 1.0)
    assert 0.2 < high < 0.8
    assert found.absolute[0, 1] == pytest.approx(2 / 3 * (1 + high))
    assert found.spread[0, 1] == pytest.approx(2 / 3 * np.sqrt(high * (1 - high) * 40 / 39))


def test_missing_runs_are_left_out() -> None:
    paths = morris_design(2, 6, seed=1)
    y = (paths @ np.array([1.0, 3.0]))[..., None]
    y[0, 1] = np.nan
    np.testing.assert_allclose(elementary_effects(paths, y).mean[:, 0], [1.0, 3.0])
    design = sobol_design(2, 64, seed=2)
    y = np.sin(3.0 * design[..., 0])[..., None] + design[..., 1:]
    few = np.delete(y, [3, 40], axis=1)
    y[0, 3] = y[3, 40] = np.nan
    np.testing.assert_array_equal(variance_indices(y).total, variance_indices(few).total)


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("design.morris-levels", lambda: morris_design(3, 4, levels=5)),
        ("design.power-of-two", lambda: sobol_indices(lambda x: x, 2, points=1000)),
        ("screen.too-few-effects", lambda: elementary_effects(morris_design(2, 3), np.full((3, 3, 1), np.nan))),
        ("screen.too-few-points", lambda: variance_indices(np.full((4, 8, 1), np.nan))),
    ],
)
def test_errors(name: str, call: object) -> None:
    with pytest.raises(FemtuneError) as caught:
        call()  # type: ignore[operator]
    check_shown(name, caught.value)
