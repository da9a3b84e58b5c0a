"""Spread over specimens: closed forms, and the rate at which the tests reject what is true."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from femtune.uncertainty import adjusted, common_test, common_test_of_estimates, spread_of


def test_equal_independent_errors_have_closed_forms() -> None:
    values, sd = np.array([2.0, 2.3, 1.8, 2.1]), 0.1
    found = spread_of(values, sd**2 * np.eye(4))
    assert found.sd == pytest.approx(np.std(values, ddof=1), rel=1e-14)
    assert found.stated_sd == pytest.approx(sd, rel=1e-14)
    assert found.chi_square == pytest.approx(3 * np.var(values, ddof=1) / sd**2, rel=1e-12)
    assert found.p_value == pytest.approx(stats.chi2.sf(found.chi_square, 3), rel=1e-12)
    assert found.real_sd == pytest.approx(np.sqrt(np.var(values, ddof=1) - sd**2), rel=1e-12)
    assert found.cov == pytest.approx(found.sd / 2.05, rel=1e-12)


def test_an_error_that_all_share_does_not_explain_a_spread() -> None:
    values = np.array([1.0, 1.1, 0.95])
    alone = spread_of(values, 0.01**2 * np.eye(3))
    shared = spread_of(values, 0.01**2 * np.eye(3) + 0.5**2)
    assert shared.chi_square == pytest.approx(alone.chi_square, rel=1e-8)
    assert shared.stated_sd == pytest.approx(alone.stated_sd, rel=1e-8)


@pytest.mark.slow
def test_p_values_are_uniform_and_the_rest_of_the_spread_is_unbiased() -> None:
    """At a significance of 1e-3, with a full covariance."""
    rng = np.random.default_rng(5)
    root = rng.standard_normal((4, 4))
    covariance = root @ root.T + 0.5 * np.eye(4)
    factor = np.linalg.cholesky(covariance)
    draws = [spread_of(3.0 + factor @ rng.standard_normal(4), covariance) for _ in range(2000)]
    assert stats.kstest([d.p_value for d in draws], "uniform").pvalue > 1e-3
    # what noise alone makes of the variance
    assert np.mean([d.sd**2 for d in draws]) == pytest.approx(draws[0].stated_sd ** 2, rel=0.1)


def test_holm_adjusts_as_published_examples_do() -> None:
    # Holm's procedure step by step: 3p, 2p, p of the ordered values, never falling
    assert adjusted([0.02, 0.01, 0.2]) == pytest.approx([0.04, 0.03, 0.2])
    assert adjusted([0.5, 0.6]) == pytest.approx([1.0, 1.0])
    assert adjusted([]) == []


@pytest.mark.parametrize(("size", "scaled"), [(1.0, None), (3.0, True)])
def test_common_parameters_are_rejected_at_the_stated_rate(size: float, scaled: bool | None) -> None:
    """Three groups of eight values with one mean; noise as stated, or larger: then the F test (significance 1e-3)."""
    rng = np.random.default_rng(8)
    p_values = []
    for _ in range(1500):
        values = size * rng.standard_normal((3, 8))
        separate = float(((values - values.mean(axis=1, keepdims=True)) ** 2).sum())
        found = common_test(float(((values - values.mean()) ** 2).sum()), separate, 2, 21)
        p_values.append(found.p_value)
        assert scaled is None or found.scaled is scaled
    # where noise is as stated, the choice between the two tests is made by chance and makes them cautious
    rejected = float(np.mean(np.array(p_values) < 0.05))
    assert stats.binom.cdf(round(1500 * rejected), 1500, 0.05) > 1e-3 or scaled is None
    assert stats.binom.sf(round(1500 * rejected) - 1, 1500, 0.05) > 1e-3


def test_common_parameters_by_separate_estimates() -> None:
    """Rejected at the stated rate where they are common, and found where one specimen differs (significance 1e-3).

    Each specimen has a covariance of its own, with strong correlations, as calibrations with other data have.
    """
    rng = np.random.default_rng(12)
    roots = [rng.standard_normal((2, 2)) + 0.1 * np.eye(2) for _ in range(3)]
    covariances = [root @ root.T for root in roots]
    different = [np.zeros(2), np.zeros(2), 5.0 * np.sqrt(np.diag(sum(covariances)))]

    def p_value(shifts: list[np.ndarray]) -> float:
        values = [np.array([1.0, 2.0]) + shift + root @ rng.standard_normal(2) for shift, root in zip(shifts, roots)]
        found = common_test_of_estimates(values, covariances)
        assert found.restrictions == 4
        return found.p_value

    right = [p_value([np.zeros(2)] * 3) for _ in range(1500)]
    assert stats.kstest(right, "uniform").pvalue > 1e-3
    assert np.mean([p_value(different) < 0.05 for _ in range(200)]) > 0.9
