"""Dependence of repeats on their order: level, drift, jump, serial correlation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, norm, rankdata, theilslopes

from femtune.uncertainty import check_repeats, order_dependence
from femtune.uncertainty.order_tests import drift_statistic, jump_statistics, normal_scores, serial_statistic

MIX = np.array([[1.0, 0.0, 0.0], [0.8, 0.5, 0.0], [-0.3, 0.9, 0.2]])
SD = np.linalg.norm(MIX, axis=1)


def _table(n, seed):
    return 100.0 + np.random.default_rng(seed).standard_normal((n, 3)) @ MIX.T


def test_scores_are_normal_quantiles_of_mean_ranks():
    column = np.array([3.0, 1.0, np.nan, 1.0, 7.0, 5.0])
    known = np.isfinite(column)
    scores = norm.ppf((rankdata(column[known]) - 0.375) / 5.25)
    scores -= scores.mean()
    found = normal_scores(column[:, None])[:, 0]
    np.testing.assert_allclose(found[known], scores / scores.std(), rtol=1e-12)
    assert found[2] == 0.0


def test_statistics_are_those_of_least_squares():
    """Sums of squares that a straight line, and two means, explain; the von Neumann ratio."""
    y = np.random.default_rng(0).standard_normal((12, 2))
    y -= y.mean(axis=0)
    order = np.arange(12)[None]
    t = np.arange(12.0)
    line = np.vander(t, 2) @ np.linalg.lstsq(np.vander(t, 2), y, rcond=None)[0]
    assert drift_statistic(y, order)[0] == pytest.approx((line**2).sum())
    found = jump_statistics(y, order)[0]
    for k, value in zip(range(3, 10), found, strict=True):
        means = np.vstack([np.tile(y[:k].mean(axis=0), (k, 1)), np.tile(y[k:].mean(axis=0), (12 - k, 1))])
        assert value == pytest.approx((means**2).sum())
    assert serial_statistic(y, order)[0] == pytest.approx((np.diff(y, axis=0) ** 2).sum() / (y**2).sum())
    shuffled = np.random.default_rng(1).permutation(12)[None]
    assert drift_statistic(y, shuffled)[0] == pytest.approx(drift_statistic(y[shuffled[0]], order)[0])


@pytest.mark.long
@pytest.mark.parametrize("n", [8, 30])
def test_level(n):
    rate = np.mean([order_dependence(_table(n, seed)).kind is not None for seed in range(500)])
    assert binom.ppf(1e-3, 500, 0.045) / 500 <= rate <= binom.ppf(1 - 1e-3, 500, 0.055) / 500


@pytest.mark.slow
def test_a_drift_is_found_and_measured():
    table = _table(30, 4)
    table[:, 1] += np.linspace(0.0, 3.0 * SD[1], 30)
    found = order_dependence(table)
    assert found.kind == "drift"
    assert found.outputs.tolist() == [1]
    assert found.change[1] == pytest.approx(29 * theilslopes(table[:, 1])[0])
    (notice,) = check_repeats(table, ("f1", "f2", "f3")).notices
    assert notice.code == "quantify.order-dependence"
    assert "drift" in notice.what
    assert "f2 +2" in notice.what


@pytest.mark.slow
def test_a_jump_is_found_where_it_is():
    table = _table(30, 4)
    table[12:] += 2.0 * SD
    found = order_dependence(table)
    assert found.kind == "jump"
    assert abs(found.jump_after - 12) <= 1
    k = found.jump_after
    np.testing.assert_allclose(found.change, np.median(table[k:], axis=0) - np.median(table[:k], axis=0))
    assert "jump after repeat 1" in check_repeats(table, "abc").notices[0].what


@pytest.mark.slow
def test_a_wave_is_serial_correlation():
    table = _table(40, 2) + 1.5 * SD * np.sin(np.arange(40)[:, None] * 2.0 * np.pi / 10.0)
    assert order_dependence(table).kind == "serial correlation"
    assert "neighbouring repeats" in check_repeats(table, "abc").notices[0].what


def test_units_missing_values_and_outliers_do_not_hide_a_drift():
    table = _table(30, 4) + np.linspace(0.0, 3.0, 30)[:, None] * SD
    same = order_dependence(table * [1e-6, 1.0, 1e6])
    assert same.p_values == order_dependence(table).p_values
    table[3] += 1e4
    table[5, 1] = table[20, 0] = np.nan
    assert order_dependence(table).kind == "drift"
    apart = _table(30, 4)
    apart[28] -= 1e4
    assert order_dependence(apart).kind is None


def test_few_repeats_are_not_tested():
    assert order_dependence(_table(7, 0)) is None
