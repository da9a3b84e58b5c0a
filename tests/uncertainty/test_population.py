"""Populations of structures with known distributions: how often the intervals hold, and the limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.uncertainty import PopulationRules, QuadraticModel, sample_population


def linear(J: Reals) -> QuadraticModel:
    m, k = J.shape
    return QuadraticModel(np.zeros(k), np.zeros(m), J, np.zeros((m, k, k)))


@pytest.mark.slow
def test_one_parameter_is_that_of_numerical_integration() -> None:
    """The mean integrated out in closed form, the standard deviation with its prior on a grid."""
    rng = np.random.default_rng(3)
    p, noise, scale = 12, 0.6, 5.0
    z = 2.0 + rng.standard_normal((p, 1)) + noise * rng.standard_normal((p, 1))
    found = sample_population(z, np.array([[noise**2]]), linear(np.ones((1, 1))), np.full(1, scale))
    sd = np.linspace(1e-3, 8.0, 8000)
    total = sd**2 + noise**2
    log = -0.5 * (p - 1) * np.log(total) - 0.5 * np.sum((z - z.mean()) ** 2) / total
    # half of Student's distribution with two degrees of freedom
    log += stats.t(2.0, scale=scale).logpdf(sd)
    cumulative = np.cumsum(np.exp(log - log.max()))
    exact = np.interp([0.025, 0.5, 0.975], cumulative / cumulative[-1], sd)
    np.testing.assert_allclose(np.quantile(found.sd, [0.025, 0.5, 0.975]), exact, rtol=0.12, atol=0.03)
    assert found.r_hat < 1.05
    # each structure is drawn to the mean by as much as its error is larger than the spread
    weight = np.mean(found.sd**2 / (found.sd**2 + noise**2))
    expected = z.mean() + weight * (z[:, 0] - z.mean())
    np.testing.assert_allclose(found.individual.mean(axis=0)[:, 0], expected, atol=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.0, 0.15])
def test_chains_settle_where_errors_are_small_beside_the_curvature(missing: float) -> None:
    """Each structure is linearised where its own data put it."""
    rng = np.random.default_rng(4)
    H = 0.5 * rng.standard_normal((4, 2, 2))
    model = QuadraticModel(np.zeros(2), np.zeros(4), rng.standard_normal((4, 2)), 0.5 * (H + np.swapaxes(H, 1, 2)))
    each = 0.06 * rng.standard_normal((12, 2))
    z = np.array([model.values(theta) for theta in each]) + 0.001 * rng.standard_normal((12, 4))
    z[rng.random(z.shape) < missing] = np.nan
    found = sample_population(z, 1e-6 * np.eye(4), model, np.ones(2))
    assert found.r_hat < 1.03
    assert found.accepted > 0.9
    np.testing.assert_allclose(np.median(found.sd, axis=0), each.std(axis=0, ddof=1), rtol=0.25)
    known = np.isfinite(z).sum(axis=1) >= 3
    np.testing.assert_allclose(np.median(found.individual, axis=0)[known], each[known], atol=0.01)
    assert found.misfit < 2.0 * found.degrees


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "other", "accused"), [(0.02, 0.0, False), (0.3, 0.0, False), (0.02, 0.03, True)])
def test_how_often_structures_are_said_not_to_fit(noise: float, other: float, accused: bool) -> None:
    """At 1 %, right ones, also where each is drawn to the mean, and ones of which another parameter varies."""
    told = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        J, each = rng.standard_normal((5, 2)), 0.1 * rng.standard_normal((30, 2))
        z = each @ J.T + noise * rng.standard_normal((30, 5))
        z += other * np.outer(rng.standard_normal(30), rng.standard_normal(5))
        rules = PopulationRules(chains=2, sweeps=400, most=400, seed=seed)
        found = sample_population(z, noise**2 * np.eye(5), linear(J), np.ones(2), rules)
        told += found.misfit > stats.chi2(found.degrees).ppf(0.99)
    assert told >= 7 if accused else told <= 1


@pytest.mark.long
@pytest.mark.parametrize(
    ("k", "m", "noise", "curvature", "missing"),
    [(2, 4, 0.02, 0.0, 0.0), (3, 6, 0.3, 0.0, 0.1), (2, 4, 0.05, 0.5, 0.0), (3, 3, 0.1, 0.0, 0.0)],
    ids=["strong", "weak, with gaps", "quadratic", "as many parameters as outputs"],
)
def test_the_intervals_of_populations_hold(k: int, m: int, noise: float, curvature: float, missing: float) -> None:
    """Forty populations of thirty structures, whose standard deviations are about a tenth."""
    held: dict[str, list[bool]] = {"mean": [], "sd": [], "correlation": [], "new": []}
    for seed in range(40):
        rng = np.random.default_rng(seed)
        H = curvature * rng.standard_normal((m, k, k))
        model = QuadraticModel(np.zeros(k), np.zeros(m), rng.standard_normal((m, k)), 0.5 * (H + np.swapaxes(H, 1, 2)))
        sd, A = 0.1 * np.exp(rng.uniform(-0.5, 0.5, k)), rng.standard_normal((k, k + 2))
        C = np.corrcoef(A) if k > 1 else np.ones((1, 1))
        root, mean = np.linalg.cholesky(C * sd * sd[:, None]), 0.03 * rng.standard_normal(k)
        each = mean + rng.standard_normal((30, k)) @ root.T
        z = np.array([model.values(theta) for theta in each]) + noise * rng.standard_normal((30, m))
        z[rng.random((30, m)) < missing] = np.nan
        found = sample_population(z, noise**2 * np.eye(m), model, np.ones(k), PopulationRules(seed=seed))
        pairs = np.triu_indices(k, 1)
        for name, samples, true in (
            ("mean", found.mean, mean), ("sd", found.sd, sd), ("new", found.new, mean + root @ rng.standard_normal(k)),
            ("correlation", found.correlation[:, pairs[0], pairs[1]], C[pairs]),
        ):  # fmt: skip
            low, high = np.quantile(samples, [0.025, 0.975], axis=0)
            held[name] += list((low <= true) & (true <= high))
    for name, of in held.items():
        assert stats.binomtest(int(np.sum(of)), len(of), 0.95).pvalue > 1e-3, (name, np.mean(of))


@pytest.mark.parametrize(
    ("rows", "noise", "words"),
    [(4, 0.1, "too few repeats"), (9, 0.0, "measurement errors of unknown size")],
    ids=["few", "no errors"],
)
def test_what_cannot_be_sampled_is_refused(rows: int, noise: float, words: str) -> None:
    with pytest.raises(FemtuneError, match=words):
        sample_population(np.zeros((rows, 3)), noise * np.eye(3), linear(np.eye(3)), np.ones(3))
