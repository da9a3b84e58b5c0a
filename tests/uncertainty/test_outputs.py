"""Outputs: their derivatives, at a repeated eigenvalue too, what they count, and the quadratic model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from femtune.residuals import UpdateProblem
from femtune.uncertainty import (
    Counted,
    EigenvalueOutputs,
    FrequenciesByOrder,
    ModeOutputs,
    frequency_outputs,
    shape_outputs,
    statistics_of_repeats,
    stochastic_update,
    update_means,
)
from femtune.uncertainty.outputs import second_derivatives
from femtune.uncertainty.stochastic import LinearEstimator, quadratic_model
from structures.springs import factor_model, simulated_case, spring_structure

from . import three_masses as three

SPRINGS = [(0, -1, 4.0), (0, 1, 3.0), (1, 2, 2.0), (2, 3, 2.0), (3, -1, 1.5)]
GROUPS = {"ka": [1, 2], "kb": [3], "kc": [4, 5], "m": [1003]}
PLACE = np.array([1.1, 0.9, 1.2, 0.95])


def _chain():
    return factor_model(spring_structure(SPRINGS, [1.0, 1.5, 1.0, 2.0]), GROUPS)


def _frequencies():
    model = _chain()
    case = simulated_case(model, np.zeros(4), range(4), 4)
    return frequency_outputs(UpdateProblem((case,), model.model.parameters))


def _differences(outputs, theta, h=1e-6):
    steps = h * np.eye(len(theta))
    return np.stack([(outputs.values(theta + s) - outputs.values(theta - s)) / (2.0 * h) for s in steps], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "outputs",
    [
        _frequencies(),
        FrequenciesByOrder(_chain(), 4),
        EigenvalueOutputs(_chain(), 4, np.ones(4)),
        ModeOutputs(EigenvalueOutputs(_chain(), 4, np.ones(4))),
        ModeOutputs(EigenvalueOutputs(_chain(), 3, np.ones(4)), (0, 2, 3)),
    ],
    ids=["followed", "by order", "eigenvalues", "with shapes", "with three entries"],
)
def test_sensitivities_are_differences_of_the_values(outputs):
    z, G = outputs.linearised(PLACE)
    np.testing.assert_allclose(z, outputs.values(PLACE), rtol=1e-12)
    np.testing.assert_allclose(G, _differences(outputs, PLACE), rtol=1e-7, atol=1e-8 * np.abs(G).max())


def test_parameters_are_in_their_own_units():
    """A spring whose start is 5 in its own unit: f = √(k/m)/2π."""
    model = factor_model(spring_structure([(0, -1, 3.0)], [2.0]), {"k": [1]})
    outputs = FrequenciesByOrder(model, 1)
    z, G = outputs.linearised(np.array([1.5]))
    assert z[0] == pytest.approx(np.sqrt(4.5 / 2.0) / (2.0 * np.pi))
    assert G[0, 0] == pytest.approx(z[0] / (2.0 * 1.5))


def test_frequencies_of_a_cluster_are_smooth_where_its_modes_repeat():
    """K = I and K′ = [[1, −1], [−1, 1]]: the branches λ = 1 and 1 + 2c, followed as motions through c = 0."""
    structure = spring_structure([(0, -1, 1.0), (1, -1, 1.0), (0, 1, 1.0)], [1.0, 1.0])
    model = factor_model(structure, {"a": [1], "b": [2], "c": [3]})
    case = simulated_case(model, np.array([0.0, 0.0, -0.999]), (0, 1), 2)
    near = np.array([1.0, 1.0, 0.001])
    outputs = frequency_outputs(UpdateProblem((case,), model.model.parameters), near)
    at = np.array([1.0, 1.0, 0.0])
    z, G = outputs.linearised(at)
    np.testing.assert_allclose(z, 1.0 / (2.0 * np.pi))
    np.testing.assert_allclose(G[:, 2], [0.0, 1.0 / (2.0 * np.pi)], atol=1e-9)
    for direction in (np.array([0.0, 0.0, 1.0]), np.array([1.0, -0.5, 0.7])):
        h = 1e-6 * direction
        slope = (outputs.values(at + h) - outputs.values(at - h)) / 2e-6
        np.testing.assert_allclose(G @ direction, slope, atol=1e-8)


def test_a_point_is_solved_once():
    counted = Counted(three.MODEL)
    theta = np.array([1.0, 1.1, 0.9])
    z, _ = counted.linearised(theta)
    np.testing.assert_array_equal(counted.values(theta), z)
    counted.linearised(theta)
    assert counted.solutions == 1
    counted.values(theta + 0.1)
    assert counted.solutions == 2


def test_second_derivatives_cost_one_solution_a_parameter():
    counted = Counted(three.MODEL)
    theta = np.array([1.0, 1.1, 0.9])
    _, _, H = second_derivatives(counted, theta, np.full(3, 1e-5))
    assert counted.solutions == 4
    np.testing.assert_array_equal(H, np.swapaxes(H, 1, 2))
    for k, e in enumerate(np.eye(3)):
        exact = (three.slopes(theta + 1e-6 * e) - three.slopes(theta - 1e-6 * e)) / 2e-6
        np.testing.assert_allclose(H[:, :, k], exact, atol=2e-5 * np.abs(H).max())


def test_the_quadratic_model_errs_in_third_order():
    counted = Counted(three.MODEL)
    theta = np.array([1.0, 1.1, 0.9])
    by = LinearEstimator(np.eye(3), np.full(3, 1e-4))
    at = update_means(counted, three.hertz(theta), theta, by)
    model = quadratic_model(counted, at, by.scale)
    direction = np.array([1.0, -0.5, 0.3])
    errors = [
        np.linalg.norm(model.values(theta + h * direction) - three.hertz(theta + h * direction)) for h in (0.1, 0.05)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(3.0, abs=0.2)


def test_taylor_slope_of_the_frequencies():
    outputs = _frequencies()
    z, G = outputs.linearised(PLACE)
    direction = np.array([0.3, -0.2, 0.1, 0.25])
    errors = [np.linalg.norm(outputs.values(PLACE + h * direction) - z - h * G @ direction) for h in (0.1, 0.05, 0.025)]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(slopes, 2.0, atol=0.15)


def test_shapes_are_those_of_the_dense_problem():
    model = _chain()
    outputs = ModeOutputs(EigenvalueOutputs(model, 4, np.ones(4)))
    point = model.at(model.model.parameters.normalise(PLACE))
    values, vectors = eigh(point.stiffness.toarray(), point.mass.toarray())
    z = outputs.values(PLACE)
    np.testing.assert_allclose(z[:4], values, rtol=1e-9)
    shapes = z[4:].reshape(4, -1).T
    np.testing.assert_allclose(np.linalg.norm(shapes, axis=0), 1.0)
    unit = vectors / np.linalg.norm(vectors, axis=0)
    np.testing.assert_allclose(np.abs(np.sum(shapes * unit, axis=0)), 1.0, rtol=1e-9)
    start = outputs.values(np.ones(4))[4:].reshape(4, -1).T
    assert (np.sum(start * shapes, axis=0) > 0.5).all()


@pytest.mark.slow
def test_frequencies_and_shapes_give_mean_and_covariance_of_parameters():
    """Repeats of four factors, eigenvalues and shapes of two modes: the second-order update returns the factors."""
    outputs = ModeOutputs(EigenvalueOutputs(_chain(), 2, np.ones(4)))
    theta = np.array([1.05, 0.95, 1.1, 1.0]) + 0.02 * np.random.default_rng(1).standard_normal((25, 4))
    measured = statistics_of_repeats(np.array([outputs.values(t) for t in theta]), checked=False)
    found = stochastic_update(outputs, measured, tuple(GROUPS), np.ones(4), np.full(4, 0.1))
    assert found.status.ok
    np.testing.assert_allclose(found.mean, theta.mean(axis=0), rtol=1e-4)
    np.testing.assert_allclose(found.sd, theta.std(axis=0, ddof=1), rtol=1e-2)


@pytest.mark.slow
def test_shapes_of_paired_modes_have_derivatives_and_the_scale_of_the_test():
    model = _chain()
    case = simulated_case(model, np.zeros(4), range(4), 3)
    outputs = shape_outputs(UpdateProblem((case,), model.model.parameters))
    z, G = outputs.linearised(PLACE)
    np.testing.assert_allclose(G, _differences(outputs, PLACE), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(z, outputs.values(PLACE), rtol=1e-12)
    modes = outputs.frequencies.modes
    shapes = z[len(modes) :].reshape(len(modes), -1)
    np.testing.assert_allclose(np.linalg.norm(shapes, axis=1), 1.0)
    np.testing.assert_allclose(outputs.scaled(modes[1], -3.0 * shapes[1]), shapes[1])
    assert len(outputs.labels) == len(z)
    some = replace(outputs, kept=(0, 5))
    np.testing.assert_allclose(some.values(PLACE)[len(modes) :], shapes.ravel()[[0, 5]])
    assert some.linearised(PLACE)[1].shape == (len(modes) + 2, 4)
