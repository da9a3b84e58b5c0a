"""Stochastic updating: the chapter's three masses, and linear problems with known answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.uncertainty import (
    CloudRules,
    ForwardCheck,
    FunctionOutputs,
    StochasticRules,
    StochasticStatus,
    forward_check,
    given_statistics,
    statistics_of_repeats,
    stochastic_update,
    unexplained,
)

from . import three_masses as three

START, START_SD = np.full(3, 2.0), np.full(3, 0.3)
METHODS = ("perturbation", "cross-covariance", "output-difference", "second-order")


def _updated(seed, method):
    k, hz = three.simulated(seed, 30)
    rules = StochasticRules(method, cloud=CloudRules(samples=400))
    return k, stochastic_update(three.MODEL, statistics_of_repeats(hz), three.NAMES, START, START_SD, rules)


def _linear(m=4, k=3, seed=0):
    rng = np.random.default_rng(seed)
    G, z0 = rng.standard_normal((m, k)), 5.0 + rng.uniform(size=m)
    return G, FunctionOutputs(lambda t: z0 + G @ t, lambda t: G)


@pytest.mark.quick(0)
@pytest.mark.parametrize("seed", range(20))
def test_second_order_means_are_within_half_a_percent_at_less_than_three_times_the_price(seed):
    k, plain = _updated(seed, "perturbation")
    _, better = _updated(seed, "second-order")
    assert better.status is StochasticStatus.CONVERGED
    np.testing.assert_allclose(better.mean, k.mean(axis=0), rtol=5e-3)
    np.testing.assert_allclose(better.sd, k.std(axis=0, ddof=1), rtol=2e-2)
    assert better.solutions <= 3 * plain.solutions
    assert np.abs(plain.mean / k.mean(axis=0) - 1.0).max() > 1e-2


def test_a_known_distribution_is_found_from_its_moments_alone():
    """Moments of the outputs by Gauss-Hermite integration: no sample decides."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    weights = weights / weights.sum()
    grid = np.stack(np.meshgrid(*[nodes] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    w = np.prod(np.stack(np.meshgrid(*[weights] * 3, indexing="ij"), axis=-1), axis=-1).ravel()
    hz = np.array([three.hertz(1.0 + 0.1 * g) for g in grid])
    mean = w @ hz
    measured = given_statistics(mean, (hz - mean).T @ ((hz - mean) * w[:, None]))
    found = stochastic_update(three.MODEL, measured, three.NAMES, START, START_SD)
    np.testing.assert_allclose(found.mean, 1.0, atol=3e-4)
    np.testing.assert_allclose(found.sd, 0.1, rtol=1e-2)
    np.testing.assert_allclose(found.correlation, np.eye(3), atol=0.02)


@pytest.mark.parametrize("method", ["cross-covariance", "output-difference"])
@pytest.mark.slow
def test_a_propagated_cloud_has_the_measured_moments(method):
    _, found = _updated(3, method)
    assert found.status is StochasticStatus.CONVERGED
    check = forward_check(three.MODEL, found, 400, seed=0)
    assert np.abs(check.mean_error).max() < 1e-3
    assert found.solutions > 400 * (len(found.steps) - 1)
    # (41) ends where the cloud's covariance is the measured one, (40) where its joint covariance with θ is
    assert check.covariance_error < (1e-3 if method == "output-difference" else 0.1)


@pytest.mark.parametrize("method", METHODS)
def test_all_formulations_agree_where_the_model_is_linear(method):
    G, model = _linear()
    mean, spread = np.array([0.3, -0.2, 0.5]), np.diag([0.04, 0.01, 0.09]) + 0.01
    measured = given_statistics(model.values(mean), G @ spread @ G.T + 1e-14 * np.eye(4))
    rules = StochasticRules(method, cloud=CloudRules(samples=60))
    found = stochastic_update(model, measured, ("a", "b", "c"), np.zeros(3), np.full(3, 0.4), rules)
    np.testing.assert_allclose(found.mean, mean, atol=1e-4)
    np.testing.assert_allclose(found.covariance, spread, atol=2e-4)
    assert found.unexplained == pytest.approx(0.0, abs=1e-8)


def test_perturbation_is_generalised_least_squares():
    """With W the inverse covariance (39) is (GᵀC⁻¹G)⁻¹."""
    G, model = _linear()
    spread = np.cov(np.random.default_rng(2).standard_normal((4, 50)))
    measured = given_statistics(model.values(np.array([0.1, 0.2, 0.3])), spread)
    rules = StochasticRules("perturbation", weighting="covariance")
    found = stochastic_update(model, measured, ("a", "b", "c"), np.zeros(3), np.ones(3), rules)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(G.T @ np.linalg.inv(spread) @ G), rtol=1e-8)


def test_regularisation_is_mu_squared():
    G, model = _linear()
    measured = given_statistics(model.values(np.full(3, 0.1)), np.eye(4))
    rules = StochasticRules("perturbation", regularisation=0.7)
    found = stochastic_update(model, measured, ("a", "b", "c"), np.zeros(3), np.full(3, 0.5), rules)
    W, Wt = np.diag(measured.mean**-2), np.eye(3) / 0.25
    T = np.linalg.solve(G.T @ W @ G + 0.49 * Wt, G.T @ W)
    np.testing.assert_allclose(found.T, T, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, T @ T.T, rtol=1e-9)


def test_more_parameters_than_outputs_end_nearest_to_the_start_and_say_so():
    _, model = _linear(m=2, k=3)
    measured = given_statistics(model.values(np.array([0.3, 0.1, 0.2])), 0.01 * np.eye(2))
    found = stochastic_update(model, measured, ("a", "b", "c"), np.zeros(3), np.ones(3))
    assert found.status is StochasticStatus.UNDETERMINED
    np.testing.assert_allclose(model.values(found.mean), measured.mean, rtol=1e-6)
    null = np.linalg.svd(model.jacobian(found.mean))[2][2]
    assert abs(null @ found.mean) < 1e-9


def test_a_set_that_lacks_what_scatters_meets_the_means_and_is_told_by_its_covariance():
    _, hz = three.simulated(0, 30)
    model = FunctionOutputs(
        lambda t: three.hertz(np.array([*t, 1.0])), lambda t: three.slopes(np.array([*t, 1.0]))[:, :2]
    )
    found = stochastic_update(model, statistics_of_repeats(hz), ("k1", "k2"), START[:2], START_SD[:2])
    check = forward_check(model, found, 400)
    assert np.abs(check.mean / found.measured.mean - 1.0).max() < 0.02
    assert not check.agrees
    assert check.covariance_error > 0.2
    assert found.unexplained > 0.02
    assert "Other parameters may vary" in check.sentences[0]


@pytest.mark.parametrize(
    ("G", "share"),
    [(np.zeros((2, 0)), 1.0), (np.zeros((2, 1)), 1.0), ([[3.0], [0.0]], 0.8), ([[2.0], [4.0]], 0.5), (np.eye(2), 0.0)],
    ids=["none", "without effect", "first output", "both alike", "square"],
)
def test_share_of_the_variance_that_parameters_cannot_explain(G, share):
    """Two independent outputs with coefficients of variation of 10 and 20 %: relative variances of 1 to 4."""
    measured = given_statistics(np.array([2.0, 4.0]), np.diag([0.2**2, 0.8**2]))
    assert unexplained(np.asarray(G, float), measured) == pytest.approx(share)


@pytest.mark.slow
def test_gaps_are_used_for_what_was_measured_beside_them():
    k, hz = three.simulated(5, 200)
    holes = hz.copy()
    holes[np.random.default_rng(1).uniform(size=hz.shape) < 0.1] = np.nan
    measured = statistics_of_repeats(holes)
    found = stochastic_update(three.MODEL, measured, three.NAMES, START, START_SD)
    assert any(n.code == "quantify.missing-values" for n in measured.notices)
    np.testing.assert_allclose(found.mean, k.mean(axis=0), atol=0.03)
    np.testing.assert_allclose(found.sd, k.std(axis=0, ddof=1), rtol=0.12)


def test_too_strong_a_curvature_falls_back_and_says_so():
    model = FunctionOutputs(lambda t: np.array([2.0 + t[0] ** 2]), lambda t: np.array([[2.0 * t[0]]]))
    measured = given_statistics(np.array([2.01]), np.array([[0.25]]))
    found = stochastic_update(model, measured, ("a",), np.array([0.2]), np.array([0.1]))
    assert found.status is StochasticStatus.TOO_CURVED
    assert not found.status.ok


@pytest.mark.parametrize("method", ["perturbation", "second-order", "cross-covariance", "output-difference"])
def test_measurement_errors_are_subtracted(method):
    """C_z = G C_θ Gᵀ + C_ε of a linear model, chapter equation (38): every method returns C_θ."""
    G = np.array([[1.0, 0.3], [0.2, 1.0], [0.5, -0.4]])
    outputs = FunctionOutputs(lambda t: 10.0 + G @ t, lambda t: G)
    C, noise = np.array([[0.04, 0.01], [0.01, 0.02]]), np.diag([0.03, 0.01, 0.02]) + 0.005
    theta = np.array([1.0, 2.0])
    measured = replace(given_statistics(10.0 + G @ theta, G @ C @ G.T + noise), noise=noise)
    rules = StochasticRules(method, cloud=CloudRules(samples=60))
    found = stochastic_update(outputs, measured, ("a", "b"), np.ones(2), np.full(2, 0.2), rules)
    np.testing.assert_allclose(found.mean, theta, atol=1e-6)
    np.testing.assert_allclose(found.covariance, C, rtol=1e-4, atol=1e-7)
    check = forward_check(outputs, found, 50)
    np.testing.assert_allclose(check.covariance, measured.covariance, rtol=1e-4, atol=1e-7)
    assert check.agrees
    assert np.std(check.with_noise(), axis=0) == pytest.approx(np.sqrt(np.diag(measured.covariance)), rel=0.3)


def test_errors_larger_than_the_variability_leave_none():
    outputs = FunctionOutputs(lambda t: 10.0 + t, lambda t: np.eye(2))
    measured = replace(given_statistics(np.full(2, 11.0), np.diag([0.01, 0.04])), noise=np.diag([0.02, 0.01]))
    found = stochastic_update(outputs, measured, ("a", "b"), np.ones(2), np.ones(2))
    np.testing.assert_allclose(found.covariance, np.diag([0.0, 0.03]), atol=1e-12)


@pytest.mark.parametrize(("outputs", "means", "spreads"), [(2, 2, 2), (9, 1, 1)])
@pytest.mark.slow
def test_differences_of_many_outputs_are_one_sentence(outputs, means, spreads):
    """Of more than three outputs the number and the three largest differences are given."""
    own = np.random.default_rng(0).standard_normal((40, outputs))
    measured = statistics_of_repeats(10.0 + own, [f"mode {i + 1}" for i in range(outputs)])
    z = 2.0 * own + 10.0 + np.arange(1.0, outputs + 1.0)
    check = ForwardCheck(("k",), np.zeros((40, 1)), z, measured, 40)
    said = check.sentences[1:]
    assert len(said) == means + spreads
    if outputs == 9:
        assert said[0].startswith("The means of 9 of 9 outputs differ")
        order = np.argsort(-np.abs(check.mean_error))
        assert f"mode {order[0] + 1} ({check.mean_error[order[0]]:.2g} above), mode {order[1] + 1} (" in said[0]
        assert said[0].count("mode") == said[1].count("mode") == 3
        assert "The standard deviations of 9 of 9 outputs differ" in said[1]
        assert "(+100 %)" in said[1]
