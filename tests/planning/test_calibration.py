"""Sensors for the parameters: against the whole least-squares problem with its scales, and exhaustive search."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

import numpy as np
import pytest

from femtune.arrays import Reals
from femtune.planning import (
    CalibrationObjective,
    CalibrationPoint,
    Candidates,
    ClusterShapes,
    data_sd,
    expand,
    expected_sd,
    joined_information,
)
from femtune.planning.calibration import Average, Criterion


def _point(sites: int, directions: int, seed: int = 0, k: int = 3) -> CalibrationPoint:
    """Two single modes and a pair of close ones, of which one is a target."""
    rng = np.random.default_rng(seed)
    sizes = ((1, 1), (1, 1), (2, 1))
    clusters = tuple(
        ClusterShapes(
            rng.standard_normal((sites, directions, q)),
            rng.standard_normal((sites, directions, t, k)),
            rng.uniform(0.3, 0.6, t),
        )
        for q, t in sizes
    )
    g = rng.standard_normal((2, k))
    return CalibrationPoint(g.T @ g, clusters)


def _whole_problem(point: CalibrationPoint, chosen: list[int]) -> Reals:
    """F from the Jacobian of parameters and scales together: the inverse of their block of the inverse."""
    k = len(point.frequencies)
    columns = k + sum(c.shapes.shape[2] * c.slopes.shape[2] for c in point.clusters)
    N, at = np.zeros((columns, columns)), k
    N[:k, :k] = point.frequencies
    for c in point.clusters:
        for t in range(c.slopes.shape[2]):
            q = c.shapes.shape[2]
            rows = np.zeros((len(chosen) * c.shapes.shape[1], columns))
            rows[:, :k] = c.slopes[chosen, :, t].reshape(-1, k)
            rows[:, at : at + q] = c.shapes[chosen].reshape(-1, q)
            at += q
            N += rows.T @ rows / c.noise[t] ** 2
    return np.linalg.inv(np.linalg.inv(N)[:k, :k])


@pytest.mark.parametrize("directions", [1, 3])
def test_scales_and_rotations_are_eliminated(directions: int) -> None:
    point, chosen = _point(12, directions), [1, 4, 5, 7, 9, 11]
    exact = _whole_problem(point, chosen)
    np.testing.assert_allclose(point.select(chosen).information, exact, rtol=1e-9)
    parts = [point.select(chosen[:2]), point.select(chosen[2:])]
    np.testing.assert_allclose(joined_information(parts), exact, rtol=1e-9)


@pytest.mark.parametrize("criterion", ["D", "A"])
@pytest.mark.parametrize("average", ["mean", "worst"])
def test_scores_are_those_of_the_sets(criterion: Criterion, average: Average) -> None:
    points, chosen, there = [_point(10, 3, s) for s in (0, 1)], [2, 5, 6], [0, 3]
    placed = [[p.select(there)] for p in points]
    found = CalibrationObjective(points, placed, criterion, average).scores(chosen)
    for i in range(10):
        each = []
        for p in points:
            F = np.eye(3) + joined_information([p.select(there), p.select([*chosen, i])])
            each.append(np.linalg.slogdet(F)[1] if criterion == "D" else -np.trace(np.linalg.inv(F)))
        assert found[i] == pytest.approx(np.mean(each) if average == "mean" else min(each), rel=1e-6)


@pytest.mark.parametrize("criterion", ["D", "A"])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.slow
def test_sets_beside_the_best_of_all_sets(criterion: Criterion, seed: int) -> None:
    point, count = _point(12, 1, seed), 6
    candidates = Candidates(np.random.default_rng(9).standard_normal((12, 1, 3)))
    found = expand(candidates, count, objective=CalibrationObjective([point], criterion=criterion))

    def score(some: Iterable[int]) -> float:
        F = np.eye(3) + point.select(list(some)).information
        return float(np.linalg.slogdet(F)[1] if criterion == "D" else -np.trace(np.linalg.inv(F)))

    best = max(score(some) for some in combinations(range(12), count))
    reached = score(found.chosen)
    assert reached <= best + 1e-9
    assert reached >= best - (0.05 if criterion == "D" else 0.02)


def test_standard_deviations_of_what_the_data_do_not_determine() -> None:
    v = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    F = 4.0 * np.outer(v, v) + np.diag([0.0, 0.0, 9.0])
    np.testing.assert_allclose(data_sd(F), [np.inf, np.inf, 1.0 / 3.0])
    np.testing.assert_allclose(expected_sd(F)[2], 10.0**-0.5)
    # a difference of the first two stays as uncertain as the prior: (1 + 1/5)/2
    np.testing.assert_allclose(expected_sd(F)[:2], np.sqrt(0.6))
