"""Where further runs go: far from the others, and towards the minimum of an objective."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from femtune.experiments import latin_hypercube
from femtune.surrogates import (
    KrigingRules,
    SumOfSquares,
    fit_surrogate,
    where_better,
    where_wrong,
    with_run,
)


def _function(x: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(4.0 * x[:, 0]) + x[:, 1], x[:, 0] * x[:, 1]], axis=1)


def test_a_further_run_is_passed_through() -> None:
    x = np.random.default_rng(1).random((12, 2))
    surrogate = fit_surrogate(x, _function(x), KrigingRules(starts=1, noise="none", correlation="matern-5/2"))
    point = np.array([[0.3, 0.9]])
    y = _function(point) + 1e-3
    more = with_run(surrogate, point[0], y[0])
    np.testing.assert_allclose(more.predict(point), y, atol=1e-4)
    assert np.all(np.abs(surrogate.predict(point) - y) > 5e-4)
    assert [len(fit.weights) for fit in more.fits] == [13, 13]


def test_the_expected_improvement_is_that_of_the_closed_form() -> None:
    """Of y itself, which is normal: (best − m)Φ(z) + sφ(z), z = (best − m)/s, as far as a sum of squares shows it."""
    x = np.linspace(0.0, 1.0, 6)[:, None]
    surrogate = fit_surrogate(x, np.cos(5.0 * x), KrigingRules(starts=1))
    # far from the target, the square is linear in y: ½((y − t)/sd)² with sd² = −t is y and a constant
    target = -1e6
    objective = SumOfSquares(np.array([target]), np.array([np.sqrt(-target)]))
    chosen = where_better(surrogate, objective, 1)[0]
    grid = np.linspace(0.0, 1.0, 2001)[:, None]
    middle, sd = surrogate.predict(grid)[:, 0], surrogate.predict_sd(grid)[:, 0]
    best = surrogate.y.min()
    z = (best - middle) / sd
    expected = (best - middle) * norm.cdf(z) + sd * norm.pdf(z)
    assert abs(chosen[0] - grid[np.argmax(expected), 0]) < 0.01


def test_a_few_runs_find_the_minimum_of_a_sum_of_squares() -> None:
    truth = np.array([[0.62, 0.35]])
    objective = SumOfSquares(_function(truth)[0], np.array([0.1, 0.1]))
    x = np.random.default_rng(5).random((10, 2))
    surrogate = fit_surrogate(x, _function(x), KrigingRules(starts=1), box=(np.zeros(2), np.ones(2)))
    before = objective(surrogate.y).min()
    for _ in range(3):
        for point in where_better(surrogate, objective, 2):
            surrogate = with_run(surrogate, point, _function(point[None])[0])
    best = surrogate.x[np.argmin(objective(surrogate.y))]
    np.testing.assert_allclose(best, truth[0], atol=0.05)
    assert objective(surrogate.y).min() < 0.2 * before


@pytest.mark.slow
def test_runs_by_error_find_a_local_feature_faster_than_random_ones() -> None:
    """A plane with a narrow hill: the error at fresh points after 25 further runs, against as many random ones."""

    def hill(x: np.ndarray) -> np.ndarray:
        return (x @ [1.0, 0.5] + np.exp(-0.5 * np.sum(((x - [0.75, 0.3]) / 0.08) ** 2, axis=1)))[:, None]

    fresh, rules = np.random.default_rng(99).random((2000, 2)), KrigingRules("linear", starts=1)
    limits = np.zeros(2), np.ones(2)
    for seed in (0, 3):
        ends = []
        for by_error in (True, False):
            x = latin_hypercube(2, 20, seed).points
            for i in range(5):
                surrogate = fit_surrogate(x, hill(x), rules, limits)
                more = where_wrong(surrogate, 5, i) if by_error else np.random.default_rng([seed, i]).random((5, 2))
                x = np.vstack([x, more])
            found = fit_surrogate(x, hill(x), rules, limits)
            ends.append(np.sqrt(np.mean((found.predict(fresh) - hill(fresh)) ** 2)))
        assert ends[0] < 0.5 * ends[1]
