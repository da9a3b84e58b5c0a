"""Fronts of several objectives that have closed forms, and ranks by their definition."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.global_search import SearchRules, front_of
from femtune.global_search.front import Front, ranks


def _zdt1(x: np.ndarray) -> np.ndarray:
    """Zitzler, Deb and Thiele 2000: the front is f2 = 1 − √f1 at x2 = … = 0."""
    g = 1.0 + 9.0 * x[:, 1:].mean(axis=1)
    return np.stack([x[:, 0], g * (1.0 - np.sqrt(x[:, 0] / g))], axis=1)


def _zdt2(x: np.ndarray) -> np.ndarray:
    """The same source: f2 = 1 − f1², which no weighted sum of both finds but for its ends."""
    g = 1.0 + 9.0 * x[:, 1:].mean(axis=1)
    return np.stack([x[:, 0], g * (1.0 - (x[:, 0] / g) ** 2)], axis=1)


@pytest.mark.parametrize(("objectives", "power"), [(_zdt1, 0.5), (_zdt2, 2.0)], ids=["convex", "concave"])
@pytest.mark.slow
def test_fronts_of_closed_form(objectives: object, power: float) -> None:
    found = front_of(objectives, np.zeros(6), np.ones(6), SearchRules(population=60, generations=200))  # type: ignore[arg-type]
    f1, f2 = found.values.T
    above = f2 - (1.0 - f1**power)
    # a single point may lag behind the front without being dominated by another one
    assert np.sqrt(np.mean(above**2)) < 0.01
    assert above.max() < 0.04
    assert above.min() > -1e-12
    # the whole front, without gaps
    assert f1[0] < 0.01
    assert f1[-1] > 0.98
    assert np.diff(f1).max() < 0.08
    assert np.all(np.diff(f2) < 0.0)
    assert found.evaluations == 60 * 201


def test_points_that_cannot_be_computed_are_not_on_the_front() -> None:
    def objectives(x: np.ndarray) -> np.ndarray:
        values = np.stack([x[:, 0] ** 2, (x[:, 0] - 1.0) ** 2], axis=1)
        return np.where(x[:, :1] < 0.5, np.nan, values)

    found = front_of(objectives, np.array([-2.0]), np.array([2.0]), SearchRules(generations=40))
    assert found.x.min() >= 0.5
    assert found.x.min() < 0.51
    assert found.x.max() <= 1.01
    assert np.all(np.diff(found.values[:, 0]) > 0.0)


def test_ranks_by_their_definition() -> None:
    values = np.random.default_rng(3).integers(0, 6, (40, 2)).astype(float)
    left, rank, expected = set(range(40)), 0, np.zeros(40, int)
    while left:
        best = {
            i for i in left
            if not any(np.all(values[j] <= values[i]) and np.any(values[j] < values[i]) for j in left)
        }  # fmt: skip
        expected[list(best)] = rank
        left, rank = left - best, rank + 1
    assert ranks(values).tolist() == expected.tolist()


def test_points_spread_along_a_front() -> None:
    t = np.linspace(0.0, 1.0, 101) ** 3
    front = Front(t[:, None], np.stack([t, 1.0 - t], axis=1), 0)
    chosen = front.spread(5)
    np.testing.assert_allclose(t[chosen], [0.0, 0.25, 0.5, 0.75, 1.0], atol=0.02)
    assert front.spread(1000).tolist() == list(range(101))
