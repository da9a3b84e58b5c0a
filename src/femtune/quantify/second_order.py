"""Means and covariances to second order at the price of (39): k further model solutions.

Equation (39) takes z(θ) as linear over the cloud, so that its means are those of a model without curvature: off by
½ T H:Cov θ, percents at a scatter of 20 %. With H from k differences of the sensitivity matrix the quadratic model

    z(θ) = z₀ + G d + ½ H[d, d],  d = θ − θ₀

stands for the structure, and no further solution is needed. Where the repeats are at hand each of them is inverted
through it, and mean and covariance are those of the inverted repeats: exact to the quadratic model for any
distribution. Where only moments are known, or repeats have gaps, the moments of a normal distribution are matched:
mean z₀ + G d + ½ H:C and covariance G C Gᵀ + ½ tr(H_i C H_j C).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.quantify.estimator import Estimator
from femtune.quantify.means import Means
from femtune.quantify.outputs import Counted, second_derivatives
from femtune.quantify.repeats import OutputStatistics

Reals = NDArray[np.float64]

_STEP, _TOLERANCE, _MOST = 1e-3, 1e-10, 60


@dataclass(frozen=True)
class QuadraticModel:
    """Outputs around θ₀ to second order: z₀ (m,), G (m, k), H (m, k, k)."""

    theta: Reals
    z: Reals
    G: Reals
    H: Reals

    def values(self, theta: Reals) -> Reals:
        """z (m,) at θ (k,)."""
        d = theta - self.theta
        return np.asarray(self.z + self.G @ d + 0.5 * (self.H @ d) @ d)

    def slope(self, theta: Reals) -> Reals:
        """∂z/∂θ (m, k)."""
        return np.asarray(self.G + self.H @ (theta - self.theta))

    def mean(self, theta: Reals, C: Reals) -> Reals:
        """Mean outputs (m,) of a distribution of mean θ and covariance C."""
        return np.asarray(self.values(theta) + 0.5 * np.einsum("ijk,jk->i", self.H, C))

    def covariance(self, theta: Reals, C: Reals) -> Reals:
        """Covariance (m, m) of the outputs of a normal distribution."""
        slope, HC = self.slope(theta), self.H @ C
        return np.asarray(slope @ C @ slope.T + 0.5 * np.einsum("iab,jba->ij", HC, HC))


def quadratic_model(outputs: Counted, at: Means, scale: Reals) -> QuadraticModel:
    """The quadratic model where the means ended, by k model solutions at steps of a thousandth of `scale`."""
    return QuadraticModel(at.theta, *second_derivatives(outputs, at.theta, _STEP * scale))


def corrected(model: QuadraticModel, measured: OutputStatistics, by: Estimator) -> tuple[Reals, Reals] | None:
    """Mean (k,) and covariance (k, k) of the parameters; None where the curvature is too strong for the cloud."""
    if measured.complete:
        return _of_repeats(model, measured.repeats, by)
    return _of_moments(model, measured, by)


def _of_repeats(model: QuadraticModel, repeats: Reals, by: Estimator) -> tuple[Reals, Reals] | None:
    found = [_inverse(model, z, by) for z in repeats]
    cloud = np.array([theta for theta in found if theta is not None])
    if len(cloud) < len(repeats):
        return None
    return cloud.mean(axis=0), np.atleast_2d(np.cov(cloud.T))


def _inverse(model: QuadraticModel, z: Reals, by: Estimator) -> Reals | None:
    """θ whose quadratic outputs are z, by Newton's method from θ₀; None where it does not end."""
    theta = model.theta
    for _ in range(_MOST):
        d = by.matrix(model.slope(theta)) @ (z - model.values(theta)) - _pull(model, theta, by)
        theta = theta + d
        if np.abs(d / by.scale).max(initial=0.0) <= _TOLERANCE:
            return theta
    return None


def _pull(model: QuadraticModel, theta: Reals, by: Estimator) -> Reals:
    """What a regularised repeat gives way to: μ²W_θ holds it near the mean, and not near its last iterate."""
    if not by.regularisation:
        return np.zeros_like(theta)
    A = by.root @ model.slope(theta) * by.scale
    normal = A.T @ A + by.regularisation**2 * np.eye(len(theta))
    return np.asarray(by.scale * np.linalg.solve(normal, by.regularisation**2 * (theta - model.theta) / by.scale))


def _of_moments(model: QuadraticModel, measured: OutputStatistics, by: Estimator) -> tuple[Reals, Reals] | None:
    T = by.matrix(model.G)
    theta, C = model.theta, T @ measured.covariance @ T.T
    for _ in range(_MOST):
        T = by.matrix(model.slope(theta))
        curved = model.covariance(theta, C) - model.slope(theta) @ C @ model.slope(theta).T
        new = T @ (measured.covariance - curved) @ T.T
        d = T @ (measured.mean - model.mean(theta, C)) - _pull(model, theta, by)
        moved = max(np.abs(d / by.scale).max(), np.abs((new - C) / np.outer(by.scale, by.scale)).max())
        theta, C = theta + d, new
        if moved <= _TOLERANCE:
            return theta, C
    return None
