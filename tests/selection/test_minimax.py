"""The smallest largest residual, against closed forms and a dense search."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from femtune.selection.minimax import smallest_largest

RNG = np.random.default_rng(3)


def _problem(r: Any, J: Any) -> Any:
    """Move of an evaluation whose residuals and derivatives are functions of x."""
    return lambda x, near: SimpleNamespace(x=np.asarray(x), residuals=r(x), jacobian=J(x))


def _search(move: Any, x: Any, moving: Any, width: float = 50.0) -> Any:
    bounds = (np.full(len(x), -width), np.full(len(x), width))
    return smallest_largest(move(np.asarray(x, float), None), move, np.asarray(moving), bounds, 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_a_common_value_is_the_middle_of_the_range(seed: int) -> None:
    data = np.random.default_rng(seed).normal(size=12)
    move = _problem(lambda x: x[0] - data, lambda x: np.ones((12, 1)))
    found = _search(move, [data.mean()], [True])
    assert found.x[0] == pytest.approx(0.5 * (data.min() + data.max()), abs=1e-3)
    assert np.abs(found.residuals).max() == pytest.approx(0.5 * np.ptp(data), rel=2e-3)


@pytest.mark.parametrize("seed", range(5))
def test_more_parameters_never_have_a_larger_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(16, 3)), rng.normal(size=16)
    move = _problem(lambda x: A @ x - b, lambda x: A)
    largest = [
        np.abs(_search(move, np.zeros(3), [i < count for i in range(3)]).residuals).max() for count in range(1, 4)
    ]
    assert largest[0] >= largest[1] - 1e-9 >= largest[2] - 2e-9


def test_a_curved_problem_agrees_with_a_dense_search() -> None:
    t = np.linspace(0.0, 1.0, 9)
    noise = RNG.normal(scale=0.1, size=9)
    move = _problem(lambda x: np.exp(x[0] * t) - np.exp(0.7 * t) - noise, lambda x: (t * np.exp(x[0] * t))[:, None])
    found = _search(move, [0.0], [True], width=3.0)
    grid = np.linspace(-3.0, 3.0, 60001)
    dense = np.abs(np.exp(grid[:, None] * t) - np.exp(0.7 * t) - noise).max(axis=1).min()
    assert np.abs(found.residuals).max() == pytest.approx(dense, rel=2e-3)


def test_parameters_that_stay_stay_and_bounds_hold() -> None:
    move = _problem(lambda x: np.array([x[0] - 9.0, x[1] - 1.0]), lambda x: np.eye(2))
    found = _search(move, [0.5, 0.5], [True, False], width=2.0)
    assert found.x.tolist() == pytest.approx([2.0, 0.5])
