"""Intervals of eigenvalues, published ones among them, and intervals of parameters."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.uncertainty import EigenvalueOutputs, FunctionOutputs, definite_signs, interval_bounds, interval_update
from femtune.uncertainty.stochastic import StochasticStatus
from structures.springs import factor_model, spring_structure


def apart():
    ends = [(0, -1, 1.0), (1, -1, 1.0), (2, -1, 1.0), (0, 1, 1.0), (1, 2, 1.0), (0, 2, 3.0)]
    model = factor_model(spring_structure(ends, [1.0] * 3), {"k1": [1], "k2": [2], "k5": [5]})
    box = np.full(3, 0.8), np.full(3, 1.2)
    return model, box, ([0.86482, 3.53112, 7.80405], [1.13176, 4.46370, 8.20454])


def repeated():
    ends = [(1, -1, 8.0), (0, 1, 2.0), (1, 2, 2.0), (0, 2, 1.0)]
    model = factor_model(spring_structure(ends, [1.0, 4.0, 1.0]), {"k2": [1], "k4": [2], "k5": [3]})
    box = np.array([7.5 / 8.0, 0.9, 0.9]), np.array([8.5 / 8.0, 1.1, 1.1])
    return model, box, ([0.92454, 3.65046, 3.80000], [1.07462, 4.20000, 4.35038])


@pytest.mark.quick(2)
@pytest.mark.parametrize("known", [True, False], ids=["definite", "searched"])
@pytest.mark.parametrize("problem", [apart, repeated])
def test_published_intervals(problem, known):
    model, box, (lower, upper) = problem()
    signs = definite_signs(model) if known else None
    found = interval_bounds(EigenvalueOutputs(model, 3, np.ones(3)), *box, signs)
    np.testing.assert_allclose(found.lower, lower, atol=6e-6)
    np.testing.assert_allclose(found.upper, upper, atol=6e-6)
    assert found.proven is known
    assert not found.inside.any()
    assert found.solutions == 2 if known else found.solutions < 100


@pytest.mark.slow
def test_no_random_point_lies_outside():
    model, box, _ = repeated()
    outputs = EigenvalueOutputs(model, 3, np.ones(3))
    found = interval_bounds(outputs, *box)
    for theta in np.random.default_rng(0).uniform(*box, (50, 3)):
        z = outputs.values(theta)
        assert (z >= found.lower - 1e-9).all()
        assert (z <= found.upper + 1e-9).all()


def test_an_extremum_inside_the_box_is_found():
    model = FunctionOutputs(
        lambda t: np.array([(t[0] - 0.3) ** 2 + t[1]]), lambda t: np.array([[2.0 * (t[0] - 0.3), 1.0]])
    )
    found = interval_bounds(model, np.zeros(2), np.ones(2))
    assert found.lower[0] == pytest.approx(0.0, abs=1e-9)
    assert found.upper[0] == pytest.approx(1.49)
    assert found.inside.tolist() == [[True, False]]
    assert not found.proven


def test_a_well_in_the_middle_is_found_beside_one_near_a_corner():
    """A bowl with its bottom, 0, near the corner (12, 10), and a deep narrow well in the middle of the box."""
    bottom, middle = np.array([11.9, 10.2]), np.array([11.0, 11.0])

    def well(t):
        return 3.0 * np.exp(-20.0 * np.sum((t - middle) ** 2, axis=-1))

    def z(t):
        return np.sum((t - bottom) ** 2, axis=-1) - well(t)

    model = FunctionOutputs(
        lambda t: np.array([z(t)]), lambda t: (2.0 * (t - bottom) + 40.0 * (t - middle) * well(t))[None]
    )
    found = interval_bounds(model, np.full(2, 10.0), np.full(2, 12.0))
    grid = np.stack(np.meshgrid(*2 * [np.linspace(10.0, 12.0, 401)]), axis=-1)
    assert found.lower[0] == pytest.approx(z(grid).min(), abs=1e-3)
    assert np.linalg.norm(found.at_lower[0] - middle) < 0.05
    assert found.inside[0, 0]


def test_many_parameters_are_led_to_their_corners():
    c = np.array([(-1.0) ** i * (1.0 + i) for i in range(12)])
    model = FunctionOutputs(lambda t: np.array([np.exp(c @ t / 50.0)]), lambda t: np.exp(c @ t / 50.0) * c[None] / 50.0)
    found = interval_bounds(model, -np.ones(12), np.ones(12))
    np.testing.assert_allclose([found.lower[0], found.upper[0]], np.exp([-78.0 / 50.0, 78.0 / 50.0]))
    assert found.solutions < 60


def test_modes_that_cross_are_followed():
    """Two masses without coupling: raising one spring past the other swaps the order, not the motions."""
    model = factor_model(spring_structure([(0, -1, 1.0), (1, -1, 2.0)], [1.0, 1.0]), {"a": [1]})
    outputs = EigenvalueOutputs(model, 2, np.ones(1))
    np.testing.assert_allclose(outputs.values(np.array([2.9])), [2.9, 2.0])
    np.testing.assert_allclose(outputs.linearised(np.array([2.9]))[1][:, 0], [1.0, 0.0], atol=1e-12)


def test_signs_of_masses_and_of_what_is_neither():
    structure = spring_structure([(0, -1, 1.0), (0, 1, 1.0)], [1.0, 1.0])
    assert definite_signs(factor_model(structure, {"k": [1], "m": [1002], "both": [2, 1001]})).tolist() == [1, -1, 0]


def test_signs_of_springs_of_negative_stiffness():
    """−¼ between a mass and the ground, alone and with a spring of 1 beside it, whose matrix is indefinite then."""
    structure = spring_structure([(0, -1, 3.0), (0, 1, 1.0), (1, -1, -0.25)], [1.0, 1.0])
    model = factor_model(structure, {"k": [1], "negative": [3]})
    assert definite_signs(model).tolist() == [1, -1]
    assert definite_signs(factor_model(structure, {"k": [1], "both": [2, 3]})).tolist() == [1, 0]


def test_intervals_of_parameters_from_those_of_outputs():
    model, box, (lower, upper) = apart()
    signs = definite_signs(model)
    outputs = EigenvalueOutputs(model, 3, np.ones(3))
    exact = interval_bounds(outputs, *box, signs)
    found = interval_update(outputs, (exact.lower, exact.upper), (np.full(3, 0.9), np.full(3, 1.05)), signs)
    assert found.status is StochasticStatus.CONVERGED
    np.testing.assert_allclose([found.lower, found.upper], box, rtol=1e-8)
    np.testing.assert_allclose(found.bounds.lower, lower, atol=6e-6)
    np.testing.assert_allclose(found.bounds.upper, upper, atol=6e-6)
