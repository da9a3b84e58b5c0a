"""Means and covariances of repeats with gaps; Latin hypercubes; ellipses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal, norm, spearmanr

from femtune.errors import FemtuneError
from femtune.uncertainty import ellipse, latin_hypercube, statistics_of_repeats

SPREAD = np.array([[1.0, 0.6, 0.0], [0.6, 2.0, -0.3], [0.0, -0.3, 0.5]])
MEAN = np.array([10.0, 20.0, 30.0])


def _table(count, missing, seed=0):
    rng = np.random.default_rng(seed)
    table = rng.multivariate_normal(MEAN, SPREAD, count)
    table[rng.uniform(size=table.shape) < missing] = np.nan
    return table


@pytest.mark.slow
def test_whole_repeats_give_the_sample_moments():
    table = _table(12, 0.0)
    found = statistics_of_repeats(table, ("a", "b", "c"))
    np.testing.assert_allclose(found.mean, table.mean(axis=0))
    np.testing.assert_allclose(found.covariance, np.cov(table.T))
    assert found.complete
    assert not found.notices


@pytest.mark.slow
def test_em_ends_at_the_largest_likelihood():
    """Beside a general optimiser on the same likelihood."""
    table = _table(25, 0.2, 3)[:, :2]
    table = table[np.isfinite(table).any(axis=1)]

    def loss(p):
        L = np.array([[np.exp(p[2]), 0.0], [p[3], np.exp(p[4])]])
        C, out = L @ L.T, 0.0
        for row in table:
            at = np.isfinite(row)
            out -= multivariate_normal.logpdf(row[at], p[:2][at], C[np.ix_(at, at)])
        return out

    best = minimize(loss, [10.0, 20.0, 0.0, 0.0, 0.3], method="BFGS", options={"gtol": 1e-7}).x
    L = np.array([[np.exp(best[2]), 0.0], [best[3], np.exp(best[4])]])
    found = statistics_of_repeats(table)
    n = len(table)
    np.testing.assert_allclose(found.mean, best[:2], rtol=1e-5)
    np.testing.assert_allclose(found.covariance * (n - 1) / n, L @ L.T, rtol=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("missing", ["em", "pairwise", "complete"])
def test_every_estimate_tends_to_the_truth(missing):
    found = statistics_of_repeats(_table(4000, 0.1), missing=missing)
    np.testing.assert_allclose(found.mean, MEAN, atol=0.1)
    np.testing.assert_allclose(found.covariance, SPREAD, atol=0.12)
    assert any("not measured" in n.what for n in found.notices)


def test_few_repeats_are_singular_and_said_to_be():
    found = statistics_of_repeats(_table(3, 0.0))
    assert found.singular
    assert [n.code for n in found.notices] == ["quantify.singular"]


def test_a_robust_estimate_is_that_of_the_repeats_without_the_outlier():
    table = _table(40, 0.0)
    apart = table.copy()
    apart[7, 1] += 12.0
    found = statistics_of_repeats(apart, estimate="robust")
    assert found.robust
    assert not found.complete
    assert [n.code for n in found.notices] == ["quantify.outlier"]
    clean = statistics_of_repeats(table, estimate="robust")
    np.testing.assert_allclose(found.mean, clean.mean, atol=0.15)
    np.testing.assert_allclose(found.sd, clean.sd, rtol=0.15)
    assert statistics_of_repeats(apart).sd[1] > 1.4 * clean.sd[1]


@pytest.mark.parametrize(
    ("table", "words"),
    [(_table(6, 0.0), "at least four more repeats"), (np.round(_table(20, 0.0), -2) + np.eye(20, 3), "singular")],
)
def test_no_robust_estimate_is_an_error(table, words):
    with pytest.raises(FemtuneError, match=words) as error:
        statistics_of_repeats(table, estimate="robust")
    assert error.value.code == "quantify.robust"


@pytest.mark.parametrize("imposed", ["moments", "ranks"])
def test_a_hypercube_has_the_correlation_that_was_asked_for(imposed):
    theta = latin_hypercube(MEAN, SPREAD, 500, 4, imposed)
    exact = imposed == "moments"
    np.testing.assert_allclose(theta.mean(axis=0), MEAN, atol=1e-10 if exact else 5e-3)
    np.testing.assert_allclose(np.cov(theta.T), SPREAD, atol=1e-10 if exact else 0.04)


def test_ranks_keep_one_sample_in_each_stratum():
    theta = latin_hypercube(np.zeros(3), SPREAD, 200, 1, "ranks")
    sd = np.sqrt(np.diag(SPREAD))
    strata = np.floor(norm.cdf(theta / sd) * 200).astype(int)
    assert all(sorted(column) == list(range(200)) for column in strata.T)
    # rank correlation of a normal pair: 6/π·asin(ρ/2)
    rho = SPREAD[0, 1] / (sd[0] * sd[1])
    assert spearmanr(theta[:, 0], theta[:, 1])[0] == pytest.approx(6.0 / np.pi * np.arcsin(rho / 2.0), abs=0.05)


def test_an_ellipse_holds_its_share():
    C = SPREAD[:2, :2]
    cloud = np.random.default_rng(0).multivariate_normal(MEAN[:2], C, 40000)
    edge = ellipse(MEAN[:2], C, 0.95)
    radius = np.einsum("ij,ij->i", (edge - MEAN[:2]) @ np.linalg.inv(C), edge - MEAN[:2])
    inside = np.einsum("ij,ij->i", (cloud - MEAN[:2]) @ np.linalg.inv(C), cloud - MEAN[:2]) <= radius[0]
    np.testing.assert_allclose(radius, radius[0])
    assert inside.mean() == pytest.approx(0.95, abs=0.004)
