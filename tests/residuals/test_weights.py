"""Weights: standard deviations and covariances, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.residuals import MassResidual
from femtune.residuals.weights import Weights

COVARIANCE = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 2.0], [0.0, 2.0, 1.0]])


def test_whitened_values_have_the_covariance_taken_out():
    errors, jacobian = np.array([1.0, -2.0, 0.5]), np.arange(6.0).reshape(3, 2)
    r, J = Weights(covariance=COVARIANCE).whiten(errors, jacobian)
    np.testing.assert_allclose(r @ r, errors @ np.linalg.solve(COVARIANCE, errors))
    np.testing.assert_allclose(J.T @ r, jacobian.T @ np.linalg.solve(COVARIANCE, errors))


def test_whitened_noise_is_white():
    """Errors go to W e, so that their covariance goes to W C Wᵀ."""
    weights = Weights(covariance=COVARIANCE)
    W = np.column_stack([weights.whiten(e, np.zeros((3, 0)))[0] for e in np.eye(3)])
    np.testing.assert_allclose(W @ COVARIANCE @ W.T, np.eye(3), atol=1e-14)


def test_deviations_are_the_diagonal_case():
    errors, none = np.array([1.0, 2.0, 3.0]), np.zeros((3, 0))
    by_sd, _ = Weights([1.0, 2.0, 4.0]).whiten(errors, none)
    by_matrix, _ = Weights(covariance=np.diag([1.0, 4.0, 16.0])).whiten(errors, none)
    np.testing.assert_allclose(by_sd, by_matrix)
    assert Weights([3.0, 4.0]).scale == pytest.approx(np.sqrt(12.5))
    assert Weights(covariance=np.diag([9.0, 16.0])).scale == pytest.approx(np.sqrt(12.5))


def test_some_of_the_values():
    assert Weights([1.0, 2.0, 3.0]).of([2, 0]).sd.tolist() == [3.0, 1.0]  # type: ignore[union-attr]
    part = Weights(covariance=COVARIANCE).of([0, 2])
    np.testing.assert_array_equal(part.covariance, [[4.0, 0.0], [0.0, 1.0]])
    assert Weights(0.1).of([1]).size is None


def test_a_block_tells_its_deviation_relative_to_the_size():
    residual = MassResidual(10.0, Weights(0.1))
    block = residual.weighted("c", "total", np.array([0.2]), np.zeros((1, 0)), residual.weights, residual.mass)
    assert block.values.tolist() == [2.0]
    assert block.sd == pytest.approx(0.01)
    assert block.error == pytest.approx(0.02)
    assert block.label == "c total mass"


@pytest.mark.parametrize(
    ("given", "code", "word"),
    [
        ({}, "residual.weights", "either sd or covariance"),
        ({"sd": 1.0, "covariance": np.eye(2)}, "residual.weights", "either sd or covariance"),
        ({"sd": 0.0}, "residual.zero-variance", "standard deviation is zero"),
        ({"sd": [1.0, 0.0]}, "residual.zero-variance", "of value 2 is zero"),
        ({"sd": -1.0}, "residual.weights", "not negative"),
        ({"sd": np.nan}, "residual.weights", "finite"),
        ({"covariance": np.diag([1.0, 0.0])}, "residual.zero-variance", "value 2"),
        ({"covariance": np.ones((2, 2))}, "residual.covariance", "smallest eigenvalue"),
        ({"covariance": [[1.0, 2.0], [2.0, 1.0]]}, "residual.covariance", "smallest eigenvalue"),
        ({"covariance": [[1.0, 0.5], [0.1, 1.0]]}, "residual.covariance", "not symmetric"),
        ({"covariance": [[1.0, 0.5], [0.50001, 1.0]]}, "residual.covariance", "not symmetric"),
        ({"covariance": [[-1.0, 0.0], [0.0, 1.0]]}, "residual.covariance", "negative variance"),
        ({"covariance": [[1.0, np.nan], [np.nan, 1.0]]}, "residual.weights", "finite"),
        ({"covariance": [[1.0, 0.0]]}, "residual.weights", "square"),
    ],
)
def test_what_is_no_weight_is_refused(given: dict, code: str, word: str):
    with pytest.raises(FemtuneError) as error:
        Weights(**given)
    assert error.value.code == code
    assert word in error.value.what
    assert error.value.hint


def test_weights_of_another_number_of_values():
    with pytest.raises(FemtuneError, match="2 values, but 3 values"):
        Weights([1.0, 2.0]).check_size(3, "entries")
    Weights(1.0).check_size(3, "entries")
