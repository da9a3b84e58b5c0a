"""Designs: what defines each of them, checked on the points."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.stats import qmc
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.experiments import (
    central_composite,
    full_factorial,
    latin_hypercube,
    nested_latin_hypercube,
    orthogonal_design,
    plackett_burman,
    sobol,
)


def _intervals(points: np.ndarray) -> np.ndarray:
    """Which of as many intervals as there are points each point is in."""
    return np.sort(np.floor(points * len(points)).astype(int), axis=0)


def test_a_full_factorial_has_every_combination_once() -> None:
    design = full_factorial([2, 3, 4])
    assert design.levels is not None
    assert len({tuple(row) for row in design.levels}) == len(design.points) == 24
    assert set(design.points[:, 1]) == {0.0, 0.5, 1.0}


@pytest.mark.parametrize(
    ("factors", "runs"), [(3, 4), (4, 8), (7, 8), (11, 12), (19, 20), (23, 24), (27, 28), (31, 32)]
)
def test_plackett_burman_designs_are_orthogonal(factors: int, runs: int) -> None:
    signed = 2.0 * plackett_burman(factors).points - 1.0
    assert signed.shape == (runs, factors)
    np.testing.assert_array_equal(signed.T @ signed, runs * np.eye(factors))
    np.testing.assert_array_equal(signed.sum(axis=0), 0.0)


def test_an_orthogonal_design_of_a_name_or_of_the_smallest_array() -> None:
    assert orthogonal_design([3] * 5).name == orthogonal_design([3] * 5, "L18").name == "L18"
    assert orthogonal_design([3] * 5, "L27").points.shape == (27, 5)
    assert set(orthogonal_design([3, 2]).points[:, 0]) == {0.0, 0.5, 1.0}


@pytest.mark.parametrize("factors", [2, 3, 4])
def test_a_rotatable_design_predicts_as_well_in_every_direction(factors: int) -> None:
    """The variance of a quadratic prediction depends on the distance from the centre only."""
    design = central_composite(factors, centres=3, rotatable=True)
    assert len(design.points) == 2**factors + 2 * factors + 3
    assert design.points.min() >= 0.0
    assert design.points.max() <= 1.0

    def terms(points: np.ndarray) -> np.ndarray:
        x = 2.0 * points - 1.0
        products = [x[:, i] * x[:, j] for i, j in combinations(range(factors), 2)]
        return np.column_stack([np.ones(len(x)), x, x**2, *products])

    fitted = terms(design.points)
    rng = np.random.default_rng(1)
    directions = rng.standard_normal((50, factors))
    places = terms(0.5 + 0.3 * directions / np.linalg.norm(directions, axis=1)[:, None])
    variance = np.sum(places @ np.linalg.inv(fitted.T @ fitted) * places, axis=1)
    np.testing.assert_allclose(variance, variance[0], rtol=1e-9)


def test_a_face_centred_design_has_three_levels() -> None:
    design = central_composite(3)
    assert set(design.points.ravel()) == {0.0, 0.5, 1.0}
    assert len(np.unique(design.points, axis=0)) == 8 + 6 + 1


@pytest.mark.slow
def test_a_latin_hypercube_has_one_point_in_every_interval() -> None:
    points = latin_hypercube(4, 30, seed=3).points
    np.testing.assert_array_equal(_intervals(points), np.arange(30)[:, None] * np.ones((1, 4)))
    plain = latin_hypercube(4, 30, seed=3, optimised=False).points
    assert qmc.discrepancy(points) < qmc.discrepancy(plain)
    np.testing.assert_array_equal(points, latin_hypercube(4, 30, seed=3).points)


def test_the_first_runs_of_a_nested_latin_hypercube_are_one_themselves() -> None:
    points = nested_latin_hypercube(3, 10, 4, seed=1).points
    assert points.shape == (40, 3)
    np.testing.assert_array_equal(_intervals(points), np.arange(40)[:, None] * np.ones((1, 3)))
    np.testing.assert_array_equal(_intervals(points[:10]), np.arange(10)[:, None] * np.ones((1, 3)))


def test_a_sobol_sequence_is_balanced_at_powers_of_two() -> None:
    points = sobol(3, 16, seed=2).points
    np.testing.assert_array_equal(_intervals(points), np.arange(16)[:, None] * np.ones((1, 3)))
    assert sobol(3, 10).points.shape == (10, 3)


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("design.columns", lambda: orthogonal_design([3] * 5, "L9")),
        ("design.too-many", lambda: full_factorial([10] * 12)),
        ("design.too-many, central composite", lambda: central_composite(20)),
    ],
)
def test_errors(name: str, call: object) -> None:
    with pytest.raises(FemtuneError) as caught:
        call()  # type: ignore[operator]
    check_shown(name, caught.value)
