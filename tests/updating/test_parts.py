"""The bounded step, the side constraints and the covariance, each against something else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from femtune.updating import parameter_covariance
from femtune.updating.search import LevenbergMarquardt, LocalModel, bounded_step

WIDE = (np.full(3, -1e9), np.full(3, 1e9))


@pytest.fixture
def rng() -> np.random.Generator:
    """Of each test anew: what a test draws must not depend on which tests ran before."""
    return np.random.default_rng(2)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 10**6), st.floats(-8, 1))
def test_the_step_is_the_constrained_optimum(seed: int, exponent: float):
    rng = np.random.default_rng(seed)
    J, r, spread = rng.standard_normal((6, 3)), 3 * rng.standard_normal(6), rng.uniform(0.3, 2.0, 3)
    lower, upper = -rng.uniform(0.0, 1.0, 3), rng.uniform(0.0, 1.0, 3)
    damping = 10.0**exponent
    d = bounded_step(r, J, damping, lower, upper, spread)
    size = np.linalg.norm(J * spread, 2)
    rows = np.vstack([J, np.sqrt(damping) * size * np.diag(1 / spread)])
    best = lsq_linear(rows, np.concatenate([-r, np.zeros(3)]), (lower, upper), tol=1e-13).x
    assert ((lower <= d) & (d <= upper)).all()
    np.testing.assert_allclose(d, best, atol=1e-6)


def test_the_step_without_bounds_or_damping_is_that_of_gauss_newton(rng: np.random.Generator):
    J, r = rng.standard_normal((6, 3)), rng.standard_normal(6)
    np.testing.assert_allclose(bounded_step(r, J, 0.0, *WIDE, np.ones(3)), -np.linalg.pinv(J) @ r, atol=1e-12)


def test_combinations_without_effect_stay_and_weak_ones_move(rng: np.random.Generator):
    base = rng.standard_normal(6)
    J = np.column_stack([base, base, 1e-1 * rng.standard_normal(6)])
    r = rng.standard_normal(6)
    d = bounded_step(r, J, 1e-12, *WIDE, np.ones(3))
    assert d[0] == pytest.approx(d[1], rel=1e-3)
    np.testing.assert_allclose(J @ d, -J @ np.linalg.pinv(J) @ r, rtol=1e-4)


def test_held_combinations_stay_although_bounds_are_active(rng: np.random.Generator):
    J, r, scale = rng.standard_normal((6, 3)), 5.0 * rng.standard_normal(6), np.array([1.0, 0.1, 3.0])
    held = np.array([[1.0, -1.0, 0.5]])
    d = bounded_step(r, J, 1e-12, np.full(3, -0.1), np.full(3, 0.1), scale, held)
    assert np.abs(d).max() == pytest.approx(0.1, rel=1e-9)
    assert abs(held @ d)[0] < 1e-6


def test_no_room_no_step():
    assert bounded_step(np.ones(2), np.eye(2), 0.1, np.zeros(2), np.zeros(2), np.ones(2)).tolist() == [0.0, 0.0]


NONE = np.zeros((0, 3))
FREE = np.zeros(3, bool)


F20 = ["frequency"] * 20


def test_covariance_of_linear_regression(rng: np.random.Generator):
    J, e = rng.standard_normal((20, 3)), 3.0 * rng.standard_normal(20)
    r = e - J @ np.linalg.lstsq(J, e)[0]
    found = parameter_covariance(r, J, F20, NONE, FREE, np.ones(3))
    s2 = r @ r / 17
    np.testing.assert_allclose(found.matrix, s2 * np.linalg.inv(J.T @ J), rtol=1e-10)
    assert found.misfit == {"frequency": pytest.approx(np.sqrt(s2))}
    # the stated scatter is not made smaller by a lucky fit
    lucky = parameter_covariance(0.01 * r, J, F20, NONE, FREE, np.ones(3))
    np.testing.assert_allclose(lucky.matrix, np.linalg.inv(J.T @ J), rtol=1e-10)


def test_many_loose_shapes_do_not_sharpen_frequencies():
    """Two kinds: what the frequencies say is as uncertain as they are, however well loose shapes fit."""
    J = np.vstack([np.eye(3), np.eye(3), np.zeros((300, 3))])
    r = np.concatenate([0.8 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0]), np.full(300, 0.01)])
    kinds = ["frequency"] * 6 + ["shape"] * 300
    found = parameter_covariance(r, J, kinds, NONE, FREE, np.ones(3))
    np.testing.assert_allclose(found.sd, np.sqrt(0.5), rtol=0.01)


def test_covariance_of_kinds_is_that_of_the_estimate_by_simulation(rng: np.random.Generator):
    J = rng.standard_normal((40, 2))
    scatter = np.where(np.arange(40) < 20, 3.0, 1.0)
    estimates = np.array([np.linalg.lstsq(J, scatter * rng.standard_normal(40))[0] for _ in range(4000)])
    r = scatter * np.sqrt(38.0 / 40.0) * np.resize([1.0, -1.0], 40)
    found = parameter_covariance(r, J, ["shape"] * 20 + ["frequency"] * 20, np.zeros((0, 2)), FREE[:2], np.ones(2))
    np.testing.assert_allclose(found.matrix, np.cov(estimates.T), rtol=0.15, atol=0.01)


def test_covariance_with_a_prior_is_bayes(rng: np.random.Generator):
    J, prior = rng.standard_normal((20, 3)), np.diag([1.0, 2.0, 0.5])
    found = parameter_covariance(np.full(20, 0.9), J, F20, prior, FREE, np.ones(3))
    np.testing.assert_allclose(found.matrix, np.linalg.inv(J.T @ J + prior.T @ prior), rtol=1e-10)


def test_at_bounds_and_undetermined_parameters_have_no_deviation(rng: np.random.Generator):
    base = rng.standard_normal((20, 4))
    J = np.column_stack([base[:, 0], base[:, 1], base[:, 1], base[:, 2]]) * 10.0
    bound = np.array([False, False, False, True])
    found = parameter_covariance(base[:, 3], J, F20, np.zeros((0, 4)), bound, np.ones(4))
    assert np.isfinite(found.sd).tolist() == [True, False, False, False]
    assert found.reasons == {
        1: "not determined by the data, σ not given",
        2: "not determined by the data, σ not given",
        3: "at bound, σ not given",
    }
    # two combinations are determined, one parameter is at its bound: 20 − 2 spare residuals
    assert found.misfit["frequency"] == pytest.approx(np.linalg.norm(base[:, 3]) / np.sqrt(18.0))


def test_without_spare_residuals_the_stated_scatter_counts():
    found = parameter_covariance(np.zeros(3), 10 * np.eye(3), ["frequency"] * 3, NONE, FREE, np.ones(3))
    np.testing.assert_allclose(found.sd, 0.1)


def test_a_tiny_misfit_makes_nothing_determined(rng: np.random.Generator):
    """Unit weights and residuals of 1e-12: what was undetermined stays so."""
    base = rng.standard_normal((9, 2))
    J = np.column_stack([base[:, 0], base[:, 0], base[:, 1]])
    found = parameter_covariance(1e-12 * base[:, 1], J, ["frequency"] * 9, NONE, FREE, np.ones(3))
    assert np.isfinite(found.sd).tolist() == [False, False, True]


def test_chance_widens_nothing():
    """Three spare residuals of 1.2 standard deviations happen in one test of four."""
    J = np.vstack([np.eye(3), np.eye(3)])
    r = 1.2 * np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0]) / np.sqrt(2.0)
    found = parameter_covariance(r, J, ["frequency"] * 6, NONE, FREE, np.ones(3))
    assert found.misfit["frequency"] == pytest.approx(1.2)
    assert found.freedom == {"frequency": pytest.approx(3.0)}
    assert found.factors == {}
    assert found.coverage_factor() == pytest.approx(1.959964)
    np.testing.assert_allclose(found.sd, np.sqrt(0.5))
    large = parameter_covariance(2.0 * r, J, ["frequency"] * 6, NONE, FREE, np.ones(3))
    assert large.factors == {"frequency": pytest.approx(2.4)}
    # Student's t with three degrees of freedom
    assert large.coverage_factor() == pytest.approx(3.182446)
    np.testing.assert_allclose(large.sd, 2.4 * np.sqrt(0.5))


def test_degrees_of_freedom_are_those_of_the_variance(rng: np.random.Generator):
    """A parameter that a kind of unknown size determines has its degrees, one that both determine has more."""
    J = np.zeros((6, 1))
    J[:5] = 1.0
    e = np.array([5.0, -3.0, 2.0, -1.0, -3.0, 0.0])
    alone = parameter_covariance(e, J, ["shape"] * 5 + ["frequency"], NONE[:, :1], FREE[:1], np.ones(1))
    assert alone.degrees_of_freedom == pytest.approx(4.0)
    J[5] = 10.0
    both = parameter_covariance(e, J, ["shape"] * 5 + ["frequency"], NONE[:, :1], FREE[:1], np.ones(1))
    s, nu = both.factors["shape"], both.freedom["shape"]
    of_shape, of_frequency = 5.0 * s**2, 100.0 * both.factors.get("frequency", 1.0) ** 2
    assert both.degrees_of_freedom == pytest.approx((of_shape + of_frequency) ** 2 / (of_shape**2 / nu))


def test_a_kind_of_the_right_size_is_not_widened_by_one_of_the_wrong_size(rng: np.random.Generator):
    """Deviations of the shapes are three times too small; the frequencies, which share the parameters, keep theirs."""
    kinds, n = ["frequency"] * 30 + ["shape"] * 60, 90
    sizes = np.repeat([1.0, 3.0], [30, 60])
    frequency, shape = [], []
    for _ in range(40):
        J = rng.standard_normal((n, 4))
        e = sizes * rng.standard_normal(n)
        r = e - J @ np.linalg.lstsq(J, e)[0]
        found = parameter_covariance(r, J, kinds, np.zeros((0, 4)), np.zeros(4, bool), np.ones(4))
        frequency.append(found.factors.get("frequency", 1.0))
        shape.append(found.factors["shape"])
    assert np.mean(shape) == pytest.approx(3.0, rel=0.05)
    assert np.mean(frequency) < 1.1


def test_estimated_errors_narrow_no_interval_where_a_test_of_the_fit_fails(rng: np.random.Generator):
    J, r = rng.standard_normal((7, 3)), 0.01 * rng.standard_normal(7)
    narrow = parameter_covariance(r, J, F20[:7], NONE, FREE, np.ones(3), scatter="estimated")
    kept = parameter_covariance(r, J, F20[:7], NONE, FREE, np.ones(3), scatter="estimated", may_narrow=False)
    assert (narrow.narrowed, kept.narrowed) == (True, False)
    np.testing.assert_allclose(kept.matrix, np.linalg.inv(J.T @ J), rtol=1e-10)
    assert kept.coverage_factor() == narrow.coverage_factor()


def test_estimated_scatter_is_linear_regression(rng: np.random.Generator):
    J, r = rng.standard_normal((7, 3)), 0.01 * rng.standard_normal(7)
    found = parameter_covariance(r, J, F20[:7], NONE, FREE, np.ones(3), scatter="estimated")
    np.testing.assert_allclose(found.matrix, r @ r / 4 * np.linalg.inv(J.T @ J), rtol=1e-10)
    assert found.coverage_factor() == pytest.approx(2.776445)


def test_without_spare_residuals_no_scatter_is_estimated():
    found = parameter_covariance(np.zeros(3), np.eye(3), F20[:3], NONE, FREE, np.ones(3), scatter="estimated")
    assert np.isnan(found.sd).all()
    assert "degrees of freedom" in found.reasons[0]


def test_what_is_lost_by_scaling_is_no_freedom(rng: np.random.Generator):
    """A shape of unit norm cannot scatter along itself: its sum of squares has one degree less."""
    J, r = rng.standard_normal((7, 3)), 0.01 * rng.standard_normal(7)
    found = parameter_covariance(r, J, ["shape"] * 7, NONE, FREE, np.ones(3), scatter="estimated", lost={"shape": 2})
    np.testing.assert_allclose(found.matrix, r @ r / 2 * np.linalg.inv(J.T @ J), rtol=1e-10)
    assert found.degrees_of_freedom == pytest.approx(2.0)


@pytest.mark.parametrize(("gain", "factor"), [(1.0, 0.1), (0.75, 1.0), (0.99, 0.04**0.6), (0.0, 4.0**0.6), (2.5, 0.5)])
def test_damping_after_an_accepted_step_follows_the_gain(gain: float, factor: float):
    assert LevenbergMarquardt().longer(1e-3, gain) == pytest.approx(1e-3 * factor)


@pytest.mark.parametrize(
    ("gain", "rejected", "factor"),
    [(0.0, 0, 4.0**0.6), (1e-5, 2, 4.0**0.6), (-3.0, 0, 16.0**0.6), (-np.inf, 0, 10.0), (-np.inf, 4, 160.0)],
)
def test_damping_after_a_rejected_step_grows_with_the_increase(gain: float, rejected: int, factor: float):
    assert LevenbergMarquardt().shorter(1e-3, gain, rejected) == pytest.approx(1e-3 * factor, rel=1e-4)


def test_damping_ends():
    assert LevenbergMarquardt().shorter(1e12, 0.0, 0) is None


def test_a_corrected_step_ends_in_the_curved_valley():
    """Rosenbrock's valley y = x²: a straight step along it leaves it by the square of the step, which is its error."""

    def residuals(x: np.ndarray) -> np.ndarray:
        return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])

    x = np.array([0.5, 0.25])
    J = np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])
    local = LocalModel(residuals(x), J, np.full(2, -9.0), np.full(2, 9.0), np.ones(2), np.zeros((0, 2)))
    d = local.step()
    error = residuals(x + d) - residuals(x) - J @ d
    assert 0.5 * np.sum(residuals(x + d) ** 2) > 10.0 * 0.5 * np.sum(residuals(x) ** 2)
    turned = LevenbergMarquardt().corrected(local, d, 1e-12, error)
    assert turned is not None
    np.testing.assert_allclose(x + turned, [1.0, 1.0], atol=1e-6)


@pytest.mark.parametrize("error", [0.0, 1e3])
def test_a_correction_that_is_small_or_large_is_no_trial(error: float):
    local = LocalModel(np.ones(2), np.eye(2), np.full(2, -9.0), np.full(2, 9.0), np.ones(2), np.zeros((0, 2)))
    assert LevenbergMarquardt().corrected(local, local.step(), 1e-12, np.full(2, error)) is None
