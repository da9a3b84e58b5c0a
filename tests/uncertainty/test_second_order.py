"""The second-order stochastic update is exact for outputs that are quadratic in normally distributed parameters."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.uncertainty import FunctionOutputs, StochasticStatus, given_statistics, stochastic_update

_Z0, _G = np.array([4.0, 5.0]), np.array([[1.0, 0.4], [-0.3, 1.2]])
_H = np.array([[[0.6, 0.2], [0.2, -0.3]], [[-0.2, 0.25], [0.25, 0.5]]])
_MEAN, _COVARIANCE = np.array([0.2, -0.1]), np.array([[0.05, 0.015], [0.015, 0.03]])


def _outputs(t: np.ndarray) -> np.ndarray:
    return _Z0 + _G @ t + 0.5 * np.einsum("ijk,j,k->i", _H, t, t)


def _moments() -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the outputs by Gauss-Hermite integration, which is exact for polynomials."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    x = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
    w = np.outer(weights, weights).ravel() / weights.sum() ** 2
    z = np.array([_outputs(_MEAN + np.linalg.cholesky(_COVARIANCE) @ row) for row in x])
    mean = w @ z
    return mean, (z - mean).T @ ((z - mean) * w[:, None])


def test_moments_of_quadratic_outputs_give_the_distribution_back() -> None:
    mean, covariance = _moments()
    model = FunctionOutputs(_outputs, lambda t: _G + _H @ t)
    found = stochastic_update(model, given_statistics(mean, covariance), ("a", "b"), np.zeros(2), np.full(2, 0.3))
    assert found.status is StochasticStatus.CONVERGED
    assert found.mean == pytest.approx(_MEAN, abs=1e-8)
    np.testing.assert_allclose(found.covariance, _COVARIANCE, atol=1e-8)
