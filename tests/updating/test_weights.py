"""Paths over the weight of a side constraint, and weights by the L-curve and by cross-validation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.parameters import Parameter, ParameterSet
from femtune.updating import Link, MinimumChange
from femtune.updating.regularisation import (
    LinearModel,
    SideConstraint,
    WeightStatus,
    choose_weight,
    corner_of,
    curvature,
    regularisation_path,
)

K = 3
PARAMETERS = ParameterSet(tuple(Parameter(n, 1.0, -5.0, 5.0) for n in "abc"))


def ill_posed(noise: float = 0.03, seed: int = 3) -> LinearModel:
    """Twenty residuals, of which the third combination of parameters is hardly felt."""
    rng = np.random.default_rng(seed)
    u, _ = np.linalg.qr(rng.standard_normal((20, K)))
    v, _ = np.linalg.qr(rng.standard_normal((K, K)))
    jacobian = u @ np.diag([1.0, 0.5, 1e-3]) @ v.T
    truth = v @ [0.4, 0.3, 0.1]
    residuals = -jacobian @ truth + noise * rng.standard_normal(20)
    return LinearModel(PARAMETERS, np.zeros(K), residuals, jacobian, np.ones(K, bool))


def side(at: LinearModel) -> SideConstraint:
    return MinimumChange(1.0).settle(at)


def test_the_path_is_that_of_the_normal_equations():
    at, weights = ill_posed(), np.array([1e-3, 0.1, 2.0])
    path = regularisation_path(side(at), at, weights)
    J, r = at.jacobian, at.residuals
    for mu, d, rho, eta, gcv in zip(
        weights, path.changes, path.residual_norms, path.constraint_norms, path.cross_validation
    ):
        inverse = np.linalg.inv(J.T @ J + mu**2 * np.eye(K))
        np.testing.assert_allclose(d, -inverse @ J.T @ r, rtol=1e-6)
        assert rho == pytest.approx(np.linalg.norm(r + J @ d))
        assert eta == pytest.approx(np.linalg.norm(d))
        spare = 20 - np.trace(J @ inverse @ J.T)
        assert gcv == pytest.approx(rho**2 / spare**2)


def test_the_path_moves_the_active_parameters_only():
    at = replace(ill_posed(), moving=np.array([True, False, True]))
    path = regularisation_path(side(at), at)
    assert (path.changes[:, 1] == 0.0).all()
    assert np.abs(path.changes[0]).max() > 0.0


def test_the_curvature_of_a_circle():
    """The lower left quarter of a circle of radius r, run through as an L-curve is: 1/r everywhere."""
    t = np.linspace(np.pi + 0.01, 1.5 * np.pi - 0.01, 2001)
    found = curvature(np.exp(t), np.exp(3.0 * np.cos(t)), np.exp(3.0 * np.sin(t)))
    np.testing.assert_allclose(found[5:-5], 1.0 / 3.0, rtol=1e-3)


@pytest.mark.parametrize(("rule", "status"), [("l-curve", WeightStatus.CORNER), ("gcv", WeightStatus.LEAST)])
def test_noise_calls_for_a_weight_between_the_singular_values(rule: str, status: WeightStatus):
    choice = choose_weight(side(ill_posed()), rule, ill_posed())  # type: ignore[arg-type]
    assert choice.status is status
    assert 1e-3 < choice.weight < 0.5
    truth = np.linalg.norm(choice.path.changes[choice.position])
    assert truth < 0.1 * np.linalg.norm(choice.path.changes[0])


def test_the_settled_constraint_has_the_weight():
    at = ill_posed()
    settled = MinimumChange("l-curve").settle(at)
    assert settled.choice is not None
    assert settled.weight == settled.choice.weight > 0.0
    linked = Link("gcv").settle(at)
    assert linked.choice is not None
    assert linked.choice.rule == "gcv"


def test_without_a_corner_there_is_no_constraint():
    """Fewer residuals than parameters and no noise: a weighted mean of the least solution and none, no corner."""
    at = ill_posed()
    few = replace(at, residuals=np.array([0.1, -0.2]), jacobian=np.array([[0.61, 0.34, 0.0], [0.0, -0.34, 0.27]]))
    bent = MinimumChange("l-curve").settle(few)
    assert bent.choice is not None
    assert bent.choice.status is WeightStatus.NO_CORNER
    assert bent.weight == 0.0
    crossed = MinimumChange("gcv").settle(few)
    assert crossed.choice is not None
    assert crossed.choice.status is WeightStatus.NO_SPARE


def test_nothing_to_balance():
    at = ill_posed()
    still = choose_weight(side(at), "l-curve", replace(at, residuals=np.zeros(20)))
    assert still.status is WeightStatus.STANDS_STILL
    assert still.weight == 0.0


def test_exact_data_want_no_weight():
    choice = choose_weight(side(ill_posed(0.0)), "gcv", ill_posed(0.0))
    assert choice.status is WeightStatus.AT_END
    assert "Set weight to a number" in choice.status.value


def test_a_curve_that_only_bends_at_its_end():
    """Curvature that rises to the last point is no corner."""
    at = ill_posed()
    path = regularisation_path(side(at), at)
    rising = replace(path, curvature=np.linspace(0.0, 5.0, len(path.weights)))
    assert corner_of(rising, 17)[0] is WeightStatus.MONOTONE
