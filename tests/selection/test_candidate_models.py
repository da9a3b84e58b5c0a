"""Criteria of candidate models beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import multivariate_normal, norm

from femtune.selection.candidate_models import CandidateFit, rank_candidates, subset_count, subsets
from femtune.selection.evidence import LinearFit, log_box_integral, log_evidence
from femtune.truncated_normal import log_mass


def linear_fit(r0: np.ndarray, A: np.ndarray, prior_sd: np.ndarray) -> tuple[CandidateFit, float]:
    """The optimum of r = r0 + A d with a prior on d as its fit, and the exact logarithm of the evidence."""
    S = A * prior_sd
    d = -np.linalg.solve(S.T @ S + np.eye(len(prior_sd)), S.T @ r0)
    r = r0 + S @ d
    exact = multivariate_normal(np.zeros(len(r0)), np.eye(len(r0)) + S @ S.T).logpdf(r0)
    # with bounds far outside the prior
    far = np.full(len(d), 60.0)
    linear = LinearFit(A.T @ A, A.T @ r, -far * prior_sd, far * prior_sd, -d * prior_sd, prior_sd)
    fit = CandidateFit(float(r @ r), len(r0), len(d), linear, np.ones(3), float(np.abs(r).max()), 0.01)
    return fit, float(exact)


def test_the_evidence_of_linear_models_is_exact() -> None:
    rng = np.random.default_rng(4)
    r0, A = rng.standard_normal(30), rng.standard_normal((30, 4))
    r0 = r0 + A[:, :2] @ [1.5, -1.0]
    made = [linear_fit(r0, A[:, :k], np.array([0.7, 2.0, 0.1, 30.0])[:k]) for k in (1, 2, 3, 4)]
    found = rank_candidates([fit for fit, _ in made])
    exact = np.array([value for _, value in made])
    np.testing.assert_allclose(np.diff(found.log_evidence), np.diff(exact), atol=1e-3)
    weights = np.exp(exact - exact.max())
    np.testing.assert_allclose(found.probabilities, weights / weights.sum(), rtol=2e-3)
    # two parameters made the data; a third with a wide prior is charged for
    assert np.argmax(found.probabilities) in (1, 2)
    assert found.probabilities[3] < found.probabilities[1]


def fit(
    chi2: float, n: int, k: int, place: tuple[float, ...] = (1.0, 1.0), worst: float = 1.0, error: float = 1.0
) -> CandidateFit:
    free = [np.zeros(k), -np.ones(k), np.ones(k), np.zeros(k), np.full(k, np.inf)]
    return CandidateFit(chi2, n, k, LinearFit(100.0 * np.eye(k), *free), np.array(place), worst, error)


@pytest.mark.parametrize("seed", range(6))
def test_the_evidence_of_bounds_alone_is_the_mean_likelihood(seed: int) -> None:
    """Beside a dense sum over the box: with a slope at a bound, and with a combination that nothing determines."""
    rng = np.random.default_rng(seed)
    J, r = rng.standard_normal((5, 2)) * [1.0, 6.0], rng.standard_normal(5)
    if seed % 2:
        J[:, 0] = 0.3 * J[:, 1]
    lower, upper = np.array([-0.2, 0.0]) if seed > 3 else -rng.uniform(0.2, 2.0, 2), rng.uniform(0.2, 2.0, 2)
    middles = [low + (np.arange(1500) + 0.5) / 1500 * (high - low) for low, high in zip(lower, upper)]
    d = np.stack(np.meshgrid(*middles), axis=-1)
    dense = np.log(np.mean(np.exp(-0.5 * np.sum((r + d @ J.T) ** 2, axis=-1))))
    fit = LinearFit(J.T @ J, J.T @ r, lower, upper, np.zeros(2), np.full(2, np.inf))
    assert log_evidence(float(r @ r), fit) == pytest.approx(float(dense), abs=2e-3)


def by_quadrature(H: np.ndarray, g: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """ln ∫ exp(−gᵀd − ½ dᵀH d) of two parameters: the second one in closed form, the first by a sum on a fine grid."""
    near = np.geomspace(1e-12, 1.0, 40_000) * (upper[0] - lower[0])
    places = [np.linspace(lower[0], upper[0], 200_001), lower[0] + near, upper[0] - near, near, -near]
    d = np.unique(np.clip(np.concatenate(places), lower[0], upper[0]))
    slope, sd = H[0, 1] * d + g[1], 1.0 / np.sqrt(H[1, 1])
    inner = log_mass((lower[1] + slope * sd**2) / sd, (upper[1] + slope * sd**2) / sd)
    logs = -g[0] * d - 0.5 * H[0, 0] * d**2 + 0.5 * (slope * sd) ** 2 + np.log(sd * np.sqrt(2.0 * np.pi)) + inner
    return float(logs.max() + np.log(np.trapezoid(np.exp(logs - logs.max()), d)))


def test_the_integral_of_two_parameters_that_end_at_a_bound() -> None:
    """One at its bound with a slope, the other tied to it by the data."""
    H = np.array([[5663.6, -2208.9], [-2208.9, 2554.16]])
    box = np.array([0.0, -0.59]), np.array([2.0, 1.41])
    found = log_box_integral(H, np.array([1350.6, 0.0]), *box)
    assert found == pytest.approx(-10.214, abs=1e-3)
    assert found == pytest.approx(by_quadrature(H, np.array([1350.6, 0.0]), *box), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_the_integral_where_data_pull_past_the_bounds(seed: int) -> None:
    """Correlated parameters of very different curvature, of which none, one or both end at a bound."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((6, 2)) * np.exp(rng.uniform(-1.0, 6.0, 2))
    if seed % 3 == 0:
        J[:, 0] = 0.98 * J[:, 1] + 0.02 * J[:, 0]
    if seed % 4 == 1:
        J[:, 0] = 0.999 * J[:, 1] + 0.001 * J[:, 0]
    r = 3.0 * rng.standard_normal(6) - J @ rng.uniform(-1.6, 1.6, 2)
    x = lsq_linear(J, -r, (-1.0, 1.0)).x
    H, g = J.T @ J, J.T @ (r + J @ x)
    assert log_box_integral(H, g, -1.0 - x, 1.0 - x) == pytest.approx(by_quadrature(H, g, -1.0 - x, 1.0 - x), abs=3e-3)


@pytest.mark.parametrize("size", [1e4, 1e8, 1e12])
def test_the_integral_of_combinations_that_nothing_determines(size: float) -> None:
    """Only the sum of three parameters is known: the box cuts the plane on which it is zero."""
    H = size * np.ones((3, 3))
    # the density of the sum of three uniform numbers of −1 to 1 is 3/8 at zero, and 1/√(2π size) wide
    expected = np.log(8.0 * 0.375 * np.sqrt(2.0 * np.pi / size))
    found = log_box_integral(H, np.zeros(3), -np.ones(3), np.ones(3))
    assert found == pytest.approx(expected, abs=0.01)


def test_each_parameter_of_bounds_costs_the_width_of_its_bounds() -> None:
    """ln √(2π) σ / w: the normal prior of the same standard deviation would say ½ ln(12/2π) = 0.32 more for each."""
    k, sd, width = 10, 0.01, 4.0
    box = [np.zeros(k), np.full(k, -0.5 * width), np.full(k, 0.5 * width), np.zeros(k)]
    uniform = LinearFit(np.eye(k) / sd**2, *box, np.full(k, np.inf))
    assert log_evidence(0.0, uniform) == pytest.approx(k * np.log(np.sqrt(2.0 * np.pi) * sd / width), abs=1e-6)
    free = np.zeros((k, k)), np.zeros(k), np.full(k, -1.0), np.full(k, 2.0)
    assert log_box_integral(*free) == pytest.approx(k * np.log(3.0), abs=1e-6)


def test_bic_with_stated_and_estimated_scatter() -> None:
    fits = [fit(80.0, 50, 1), fit(60.0, 50, 3)]
    stated = rank_candidates(fits)
    assert stated.bic[0] - stated.bic[1] == pytest.approx(20.0 - 2.0 * np.log(50.0))
    assert stated.size == 1.0
    estimated = rank_candidates(fits, scatter="estimated")
    assert estimated.bic[0] - estimated.bic[1] == pytest.approx(50.0 * np.log(80.0 / 60.0) - 2.0 * np.log(50.0))
    assert estimated.size == pytest.approx(np.sqrt(60.0 / 47.0))
    # weights of another size change nothing if the scatter is estimated
    scaled = rank_candidates([fit(8000.0, 50, 1), fit(6000.0, 50, 3)], scatter="estimated")
    np.testing.assert_allclose(scaled.bic_weights, estimated.bic_weights, rtol=1e-12)


def test_a_right_model_is_admissible_with_the_stated_probability() -> None:
    n, rng = 40, np.random.default_rng(0)
    limit = rank_candidates([fit(40.0, n, 1)]).limit
    assert limit == pytest.approx(norm.ppf(0.5 + 0.5 * 0.95 ** (1.0 / n)))
    worst = np.abs(rng.standard_normal((20_000, n))).max(axis=1)
    assert (worst <= limit).mean() == pytest.approx(0.95, abs=0.006)


def test_a_threshold_of_the_error() -> None:
    fits = [fit(9.0, 10, 1, error=0.02), fit(5.0, 10, 2, error=0.0105), fit(4.0, 10, 3, error=0.01)]
    found = rank_candidates(fits, threshold=1.1)
    assert found.admissible.tolist() == [False, True, True]
    assert found.limit is None


def test_models_that_compare_other_data_are_not_ranked() -> None:
    found = rank_candidates([fit(9.0, 10, 1), fit(5.0, 10, 2), fit(1.0, 9, 2)])
    assert found.comparable.tolist() == [True, True, False]
    assert np.isnan(found.bic[2])
    assert np.isnan(found.log_evidence[2])
    assert not found.admissible[2]
    assert np.nansum(found.probabilities) == pytest.approx(1.0)


def test_distances_and_clusters() -> None:
    places = [(1.0, 1.0), (0.70, 1.30), (0.71, 1.31), (1.5, 0.6)]
    found = rank_candidates(
        [fit(c, 10, 2, place, worst) for c, place, worst in zip((30.0, 9.0, 8.0, 7.0), places, (9.0, 1.0, 1.0, 1.0))]
    )
    assert found.distances[0, 1] == pytest.approx(0.3)
    assert found.distances[1, 2] == pytest.approx(0.01)
    np.testing.assert_array_equal(found.distances, found.distances.T)
    # the cluster of the smallest residuals is the first; what is not admissible is in none
    assert found.clusters.tolist() == [0, 2, 2, 1]


def test_subsets_of_groups() -> None:
    groups = [("a",), ("b", "c"), ("d",)]
    found = list(subsets(groups, 1, 2))
    assert len(found) == subset_count(3, 1, 2) == 6
    assert found[0] == (("a",),)
    assert (("b", "c"), ("d",)) in found
