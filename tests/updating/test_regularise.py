"""Side constraints: rows by hand, Bayes with a full covariance, what is held, and bad input."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.parameters import Parameter, ParameterSet, tied
from femtune.updating import (
    Distance,
    Identical,
    Link,
    MinimumChange,
    NoRegularisation,
    Prior,
    Regularisation,
    SideConstraint,
    Together,
    Truncated,
    correlated_prior,
    parameter_covariance,
)
from femtune.updating.regularisation import LinearModel, link_weights
from femtune.updating.search import bounded_step

PARAMETERS = ParameterSet(
    (
        Parameter("a", 2.0, 1.0, 4.0, prior_mean=3.0, prior_sd=0.5),
        Parameter("b"),
        Parameter("c", 4.0, 1.0, 5.0, prior_sd=1.0),
    )
)
X = np.array([0.25, 0.1, -0.3])
J = np.random.default_rng(1).standard_normal((7, 3)) * [1.0, 10.0, 0.01]
R = np.random.default_rng(2).standard_normal(7)


def settled(regularisation: Regularisation, moving: tuple[bool, ...] = (True, True, True)) -> SideConstraint:
    return regularisation.settle(LinearModel(PARAMETERS, X, R, J, np.array(moving)))


def test_none_has_no_rows():
    values, rows = settled(NoRegularisation()).rows(X)
    assert values.shape == (0,)
    assert rows.shape == (0, 3)


def test_minimum_change_is_of_the_parameters_that_move():
    values, rows = settled(MinimumChange(0.3), (True, False, True)).rows(X)
    np.testing.assert_allclose(values, [0.3 * 0.25, -0.3 * 0.3])
    np.testing.assert_allclose(rows, 0.3 * np.eye(3)[[0, 2]])


def test_distance_is_none_at_the_start_and_counts_prior_deviations():
    side = settled(Distance(2.0))
    np.testing.assert_allclose(side.rows(X)[0], 0.0, atol=1e-15)
    # a moves by one prior deviation of half a unit: x = 0.25
    np.testing.assert_allclose(side.rows(X + 0.25 * np.eye(3)[0])[0], [2.0, 0.0, 0.0], atol=1e-12)


def test_link_weights_by_hand():
    """Γ = (1, 4): W = mean(1, 4)/mean(1, 1/4)·(1, 1/4) = (4, 1)."""
    np.testing.assert_allclose(link_weights(np.diag([1.0, 2.0])), [4.0, 1.0])
    rows = settled(Link(0.5)).rows(X)[1]
    np.testing.assert_allclose(rows, 0.5 * np.diag(np.sqrt(link_weights(J))))


def test_a_parameter_that_is_not_felt_is_held_by_link():
    weights = link_weights(np.diag([1.0, 0.0]))
    assert weights[1] / weights[0] == pytest.approx(1e12)
    assert link_weights(np.zeros((2, 2))).tolist() == [1.0, 1.0]


def test_a_prior_of_the_parameters_themselves():
    values, rows = settled(Prior()).rows(np.array([0.25, 0.1, 0.0]))
    # a = 2.5 lies a deviation below its mean; b = 1.1, sd = 1.5/√12
    np.testing.assert_allclose(values, [-1.0, 0.1 * np.sqrt(12.0) / 1.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.diag(rows), [2.0 / 0.5, np.sqrt(12.0) / 1.5, 4.0])


def test_a_prior_with_correlations_is_bayes():
    """Posterior mean and covariance of a linear Gaussian model, in the units of the parameters."""
    mean, covariance = np.array([3.0, 4.5]), np.array([[0.25, 0.3], [0.3, 1.0]])
    side = settled(Prior(("a", "c"), mean, covariance))
    full = np.diag([0.25, 1.5**2 / 12.0, 1.0])
    full[0, 2] = full[2, 0] = 0.3
    inverse = np.linalg.inv(full / np.outer(PARAMETERS.scale, PARAMETERS.scale))
    x0 = PARAMETERS.normalise([3.0, 1.0, 4.5])
    values, rows = side.rows(X)
    assert values @ values == pytest.approx((X - x0) @ inverse @ (X - x0))
    np.testing.assert_allclose(rows.T @ rows, inverse, rtol=1e-12)
    found = parameter_covariance(
        0.5 * R / np.abs(R).max(), J, ["frequency"] * 7, side.prior_rows, np.zeros(3, bool), PARAMETERS.prior[1]
    )
    np.testing.assert_allclose(found.matrix, np.linalg.inv(J.T @ J + inverse), rtol=1e-9)


def test_correlations_of_a_study():
    prior = correlated_prior(PARAMETERS, [("a", "c", 0.5)])
    assert np.asarray(prior.covariance)[0, 2] == pytest.approx(0.5 * 0.5 * 1.0)


def test_identical_parameters_count_their_differences():
    side = settled(Identical((("a", "c"),), 10.0))
    # values 2.5 and 2.8 against the mean scale of 3
    values, rows = side.rows(X)
    assert values @ values == pytest.approx((10.0 * 0.3 / 3.0) ** 2 / 2.0)
    step = 1e-6
    slope = (side.rows(X + step * np.eye(3)[2])[0] - values) / step
    np.testing.assert_allclose(slope, rows[:, 2], rtol=1e-6)


def test_several_constraints_at_once():
    side = settled(Together((Prior(), Identical((("a", "b"),), 3.0), Truncated(1e-2))))
    assert len(side.rows(X)[0]) == 5
    assert len(side.prior_rows) == 3
    assert len(side.held) == 1
    np.testing.assert_allclose(side.rows(X)[0][:3], settled(Prior()).rows(X)[0])


def test_truncated_steps_are_those_of_the_truncated_inverse():
    side = settled(Truncated(1e-2))
    spread = PARAMETERS.prior[1]
    wide = np.full(3, 1e9)
    d = bounded_step(R, J, 1e-12, -wide, wide, spread, side.held)
    np.testing.assert_allclose(d, -spread * (np.linalg.pinv(J * spread, rcond=1e-2) @ R), rtol=1e-6, atol=1e-9)
    assert abs(side.held @ d).max() < 1e-12
    assert len(settled(Truncated(1e-9)).held) == 0


@pytest.mark.parametrize(
    ("covariance", "code", "word"),
    [
        ([[1.0, 0.0], [0.0, 0.0]], "prior.zero-variance", "gives b a variance of zero"),
        ([[1.0, 2.0], [2.0, 1.0]], "prior.not-positive-definite", "between a and b"),
        ([[1.0, 0.5], [0.1, 1.0]], "prior.not-positive-definite", "not symmetric"),
        ([[1.0, np.nan], [np.nan, 1.0]], "prior.shape", "finite"),
        ([[1.0]], "prior.shape", "(1, 1)"),
        ([[np.nan, 0.0], [0.0, 1.0]], "prior.shape", "finite"),
    ],
)
def test_what_is_no_covariance(covariance: list[list[float]], code: str, word: str):
    with pytest.raises(FemtuneError) as caught:
        Prior(("a", "b"), [2.0, 1.0], covariance)
    assert caught.value.code == code
    assert word in str(caught.value)


def test_a_mean_that_the_bounds_exclude():
    with pytest.raises(FemtuneError, match="lies outside its bounds") as caught:
        settled(Prior(("a",), [9.0], [[1.0]]))
    assert caught.value.code == "prior.outside-bounds"
    with pytest.raises(FemtuneError, match="outside its bounds"):
        settled(Prior(("a",), [np.nan], [[1.0]]))


def test_names_that_are_no_free_parameter():
    with pytest.raises(FemtuneError, match="z is not a parameter") as caught:
        settled(Identical((("a", "z"),), 1.0))
    assert caught.value.code == "update.unknown-parameter"
    bound = ParameterSet((*PARAMETERS.parameters, tied("d", "2*a")))
    with pytest.raises(FemtuneError, match="is tied"):
        Prior(("d",), [4.0], [[1.0]]).settle(LinearModel(bound, X, R, J, np.ones(3, bool)))
