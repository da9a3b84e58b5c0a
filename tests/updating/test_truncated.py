"""Samples of distributions that are truncated to a box, beside integrals and rejection."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import truncnorm

from femtune.updating.truncated import SamplerRules, box_samples, effective_number, line_sample

MANY = SamplerRules(least=20_000, most=1000)
LOW, HIGH = np.array([-0.5, -0.2]), np.array([0.5, 1.0])


@pytest.mark.parametrize(
    ("mean", "sd"), [(0.0, 1.0), (5.0, 1.0), (-5.0, 1.0), (40.0, 1.0), (0.3, 1e3), (0.5, 1e-6), (-3e-6, 1e-6)]
)
def test_a_line_has_the_quantiles_of_the_truncated_normal_distribution(mean: float, sd: float) -> None:
    share = np.array([0.001, 0.2, 0.5, 0.8, 0.999])
    low, high = np.zeros(5), np.ones(5)
    found = line_sample(np.full(5, -mean / sd**2), np.full(5, sd**-2), low, high, share)
    expected = truncnorm.ppf(share, -mean / sd, (1.0 - mean) / sd, mean, sd)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.ptp(expected))


def test_a_line_without_curvature_is_exponential_or_uniform() -> None:
    share, ends = np.array([0.1, 0.5, 0.9]), (np.full(3, -1.0), np.full(3, 2.0))
    np.testing.assert_allclose(line_sample(np.zeros(3), np.zeros(3), *ends, share), -1.0 + 3.0 * share)
    expected = -1.0 - np.log1p(-share * -np.expm1(-3.0 * 4.0)) / 4.0
    np.testing.assert_allclose(line_sample(np.full(3, 4.0), np.zeros(3), *ends, share), expected)
    # far outside the centre, where the normal distribution is an exponential one: rate 1e9·1e5
    steep = line_sample(np.full(3, 1e14), np.full(3, 1e5), np.zeros(3), np.ones(3), share)
    np.testing.assert_allclose(steep, -np.log1p(-share) / 1e14, rtol=1e-6)


def integrated(A: np.ndarray, b: np.ndarray, degrees: float) -> tuple[np.ndarray, float]:
    """Quantiles and mean of the first of two parameters on a grid."""
    n = 2001
    x, y = (LOW[i] + (HIGH[i] - LOW[i]) * (np.arange(n) + 0.5) / n for i in range(2))
    q = sum((row[0] * x[:, None] + row[1] * y + c) ** 2 for row, c in zip(A, b))
    log = -0.5 * q if np.isinf(degrees) else -0.5 * (degrees + len(A)) * np.log1p(q / degrees)
    weight = np.exp(log - log.max()).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(weight) / weight.sum()])
    edges = np.concatenate([[LOW[0]], x + 0.5 * (x[1] - x[0])])
    return np.interp([0.025, 0.5, 0.975], total, edges), float(weight @ x / weight.sum())


@pytest.mark.parametrize("degrees", [np.inf, 3.0])
@pytest.mark.parametrize(
    ("A", "b"),
    [
        ([[2.0, 1.0], [-1.0, 6.0]], [1.0, -2.0]),
        ([[1.0, 1.0], [9.0, -9.0]], [-3.0, 1.0]),
        ([[4.0, 4.0]], [0.5]),
    ],
)
@pytest.mark.slow
def test_two_parameters_beside_integration(A: list, b: list, degrees: float) -> None:
    rows, offset = np.array(A), np.array(b)
    found = box_samples(rows, offset, LOW, HIGH, degrees, MANY)[:, 0]
    quantiles, mean = integrated(rows, offset, degrees)
    # four standard errors of a quantile in a long tail
    np.testing.assert_allclose(np.quantile(found, [0.025, 0.5, 0.975]), quantiles, atol=0.12 * found.std())
    assert found.mean() == pytest.approx(mean, abs=0.03 * found.std())


@pytest.mark.slow
def test_five_parameters_beside_rejection() -> None:
    rng = np.random.default_rng(2)
    A = rng.standard_normal((5, 5)) + np.eye(5)
    b = -A @ np.array([0.4, -0.4, 0.1, 0.6, 0.0])
    low, high = np.full(5, -0.5), np.full(5, 0.5)
    draws = np.linalg.solve(A, rng.standard_normal((5, 400_000)) - b[:, None]).T
    kept = draws[((draws > low) & (draws < high)).all(axis=1)]
    assert len(kept) > 900
    found = box_samples(A, b, low, high, rules=SamplerRules(chains=128))
    np.testing.assert_allclose(found.mean(axis=0), kept.mean(axis=0), atol=4.0 * 0.29 / np.sqrt(len(kept)))
    np.testing.assert_allclose(found.std(axis=0), kept.std(axis=0), rtol=4.0 / np.sqrt(2 * len(kept)) + 0.03)


@pytest.mark.slow
def test_flat_combinations_are_limited_by_the_box_alone() -> None:
    """One sum of 17 parameters is known; without it all would be uniform. The seed makes samples the same."""
    A, ends = np.full((1, 17), 30.0), (np.full(17, -0.5), np.full(17, 0.5))
    rules = SamplerRules(chains=128, least=2000)
    found = box_samples(A, np.zeros(1), *ends, rules=rules)
    assert found.min() >= -0.5
    assert found.max() <= 0.5
    assert found.sum(axis=1).std() == pytest.approx(1.0 / 30.0, rel=0.05)
    # a uniform distribution with its mean taken away, about
    np.testing.assert_allclose(found.std(axis=0), np.sqrt((1.0 - 1.0 / 17.0) / 12.0), rtol=0.06)
    np.testing.assert_array_equal(found, box_samples(A, np.zeros(1), *ends, rules=rules))


def test_no_residuals_leave_the_box() -> None:
    found = box_samples(np.zeros((0, 2)), np.zeros(0), LOW, HIGH, rules=SamplerRules(chains=128))
    np.testing.assert_allclose(found.std(axis=0), (HIGH - LOW) / np.sqrt(12.0), rtol=0.04)


def test_the_effective_number_is_that_of_an_autoregressive_chain() -> None:
    rng, rho = np.random.default_rng(0), 0.8
    x = np.zeros((400, 500, 1))
    for i in range(1, 400):
        x[i] = rho * x[i - 1] + np.sqrt(1 - rho**2) * rng.standard_normal((500, 1))
    assert effective_number(x[50:])[0] == pytest.approx(350 * 500 * (1 - rho) / (1 + rho), rel=0.2)
