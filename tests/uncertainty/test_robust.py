"""Robust mean and covariance of repeats: against all subsets, units, level and power."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.stats import binom, f

from femtune.uncertainty import RobustMoments, check_repeats, robust_moments
from femtune.uncertainty.robust import LEVEL, calibration, raw_distances, subset_size

MIX = np.array([[1.0, 0.0, 0.0], [0.8, 0.5, 0.0], [-0.3, 0.9, 0.2]])


def _table(n, seed, m=3):
    return np.random.default_rng(seed).standard_normal((n, m)) @ MIX[:m, :m].T


@pytest.mark.parametrize("seed", range(5))
def test_the_subset_has_the_smallest_determinant_of_all(seed):
    table = _table(11, seed, 2)
    table[:2] += [[5.0, -5.0], [-6.0, 1.0]]
    h = subset_size(11, 2)

    def size(rows):
        return np.linalg.det(np.cov(table[list(rows)].T))

    best = list(min(combinations(range(11), h), key=size))
    gap = table - table[best].mean(axis=0)
    d2 = np.einsum("ij,jk,ik->i", gap, np.linalg.inv(np.cov(table[best].T, ddof=0)), gap)
    np.testing.assert_allclose(raw_distances(table[None])[0][0], d2, rtol=1e-8)


@pytest.mark.slow
def test_units_and_origin_do_not_matter():
    table = _table(25, 3)
    table[4] += 9.0
    change, shift = np.diag([1e-3, 1.0, 1e4]) @ MIX, np.array([1e5, -3.0, 7.0])
    a, b = robust_moments(table), robust_moments(table @ change.T + shift)
    np.testing.assert_allclose(b.distance, a.distance, rtol=1e-6)
    np.testing.assert_allclose(b.mean, change @ a.mean + shift, rtol=1e-9)
    np.testing.assert_allclose(b.covariance, change @ a.covariance @ change.T, rtol=1e-6, atol=1e-12)


def test_the_covariance_is_that_of_the_repeats_within_the_ellipsoid():
    table = _table(30, 5)
    table[2] += 20.0
    found = robust_moments(table)
    raw = raw_distances(((table - np.median(table, axis=0)) / table.std(axis=0))[None])[0][0]
    usual = calibration(30, 3)
    kept = table[raw <= usual.cut]
    np.testing.assert_allclose(found.mean, kept.mean(axis=0), rtol=1e-8)
    np.testing.assert_allclose(found.covariance, usual.factor * np.cov(kept.T), rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("n", "m"), [(12, 2), (30, 3), (50, 3)])
def test_level_and_consistency(n, m):
    """One clean data set in twenty has an outlier, and the covariance has no bias: other draws."""
    found = [robust_moments(_table(n, 100 + seed, m)) for seed in range(600)]
    rate = np.mean([len(one.outliers) > 0 for one in found])
    assert binom.ppf(1e-3, 600, 0.04) / 600 <= rate <= binom.ppf(1 - 1e-3, 600, 0.06) / 600
    whole = np.linalg.inv(MIX[:m, :m] @ MIX[:m, :m].T)
    assert np.mean([np.trace(whole @ one.covariance) / m for one in found]) == pytest.approx(1.0, abs=0.04)
    assert np.mean([one.p_value <= LEVEL for one in found]) == pytest.approx(rate, abs=0.01)


@pytest.mark.slow
def test_two_kinds_of_outliers_do_not_hide_each_other():
    """Four repeats in one direction and four in another; a rule that leaves out one repeat at a time names none."""
    table = _table(50, 8)
    table[[3, 17, 40, 45]] += 7.0 * MIX[:, 0]
    table[[9, 33, 36, 48]] -= 7.0 * MIX[:, 1]
    assert robust_moments(table).outliers.tolist() == [3, 9, 17, 33, 36, 40, 45, 48]
    assert len(_one_at_a_time(table)) <= 1


def _one_at_a_time(table):
    """Repeats that are outliers against mean and covariance of all others, at 5 % for the data set."""
    (n, m), found = table.shape, []
    for i in range(n):
        rest = np.delete(table, i, axis=0)
        gap = table[i] - rest.mean(axis=0)
        d2 = gap @ np.linalg.solve(np.cov(rest.T), gap)
        if f.sf(d2 * (n - 1 - m) * (n - 1) / (n * m * (n - 2)), m, n - 1 - m) < LEVEL / n:
            found.append(i)
    return found


def test_too_few_or_rounded_repeats_have_no_distances():
    assert robust_moments(_table(6, 0)) == "few"
    assert isinstance(robust_moments(_table(7, 0)), RobustMoments)
    rounded = np.round(_table(20, 0), 0)
    rounded[:17, 1] = 1.0
    assert robust_moments(rounded) == "flat"
    assert robust_moments(np.column_stack([_table(20, 0, 2), _table(20, 0, 2)[:, 0]])) == "flat"


@pytest.mark.slow
def test_repeats_with_missing_values_have_none():
    table = _table(20, 1)
    table[2, 0] = np.nan
    table[5] += 30.0
    checks = check_repeats(table, ("a", "b", "c"))
    assert checks.outliers == (6,)
    assert len(checks.robust.distance) == 19
