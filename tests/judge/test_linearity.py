"""True beside linear χ² along principal axes: exact for a linear problem, refuted in a curved valley."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.judge.linearity import STEP, compare, principal_axes

BOX = (np.full(2, -10.0), np.full(2, 10.0))


def test_axes_are_perpendicular_standard_deviations() -> None:
    rng = np.random.default_rng(0)
    J, spread = rng.standard_normal((9, 4)), np.array([0.5, 2.0, 1.0, 0.1])
    axes = principal_axes(J, spread, np.array([True, True, False, True]))
    assert axes.shape == (3, 4)
    np.testing.assert_array_equal(axes[:, 2], 0.0)
    # one standard deviation each, the covariance is their sum
    covariance = np.zeros((4, 4))
    used = [0, 1, 3]
    covariance[np.ix_(used, used)] = np.linalg.inv(J[:, used].T @ J[:, used])
    np.testing.assert_allclose(axes.T @ axes, covariance, atol=1e-12)
    scaled = axes[:, used] / spread[used]
    np.testing.assert_allclose(scaled @ scaled.T, np.diag(np.sum(scaled**2, axis=1)), atol=1e-12)
    assert list(np.sum(scaled**2, axis=1)) == sorted(np.sum(scaled**2, axis=1), reverse=True)


@pytest.mark.parametrize("seed", range(5))
def test_a_linear_problem_is_linear(seed: int) -> None:
    rng = np.random.default_rng(seed)
    J, r = rng.standard_normal((8, 2)), rng.standard_normal(8)
    r -= J @ np.linalg.lstsq(J, r, rcond=None)[0]
    axes = principal_axes(J, np.ones(2), np.ones(2, bool))
    points, left = compare(np.zeros(2), r, J, axes, BOX, lambda x: float(np.sum((r + J @ x) ** 2)), 9)
    assert left == 0
    assert len(points) == 4
    for p in points:
        assert p.linear == pytest.approx(STEP**2)
        assert p.true == pytest.approx(p.linear)
        assert not p.curved


def test_a_curved_valley_a_flat_one_and_a_wall_are_found() -> None:
    J = np.array([[0.0, 10.0], [1.0, 0.0]])
    axes = principal_axes(J, np.ones(2), np.ones(2, bool))

    def banana(x: np.ndarray) -> float:
        return float((10.0 * (x[1] - x[0] ** 2)) ** 2 + x[0] ** 2)

    def saturated(x: np.ndarray) -> float:
        return float((10.0 * x[1]) ** 2 + np.tanh(0.3 * x[0]) ** 2)

    def wall(x: np.ndarray) -> float:
        if x[0] > 1.0:
            raise FemtuneError("eigen.mechanism", "no stiffness there")
        return float((10.0 * x[1]) ** 2 + x[0] ** 2)

    for valley, expected in ((banana, [True, True]), (saturated, [True, True]), (wall, [True, False])):
        points, _ = compare(np.zeros(2), np.zeros(2), J, axes, BOX, valley, 4)
        assert sorted((p.curved for p in points if p.axis == 1), reverse=True) == expected
        assert not any(p.curved for p in points if p.axis == 2)


def test_bounds_shorten_steps_and_the_limit_leaves_axes_out() -> None:
    J = np.diag([1.0, 10.0])
    axes = principal_axes(J, np.ones(2), np.ones(2, bool))
    box = np.array([-0.1, -10.0]), np.array([0.9, 10.0])
    points, left = compare(np.zeros(2), np.zeros(2), J, axes, box, lambda x: float(np.sum((J @ x) ** 2)), 2)
    assert left == 1
    # to one side there is no room, to the other one less than asked for
    (point,) = points
    assert abs(point.step) == pytest.approx(0.9)
    assert point.true == pytest.approx(0.81)
