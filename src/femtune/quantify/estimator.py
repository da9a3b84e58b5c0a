"""The transformation T that takes changes of outputs to changes of parameters, chapter equations (22) and (36)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.quantify.covariance_matrix import factor
from femtune.quantify.repeats import OutputStatistics

Reals = NDArray[np.float64]
Weighting = Literal["relative", "covariance"]

_RANK = 1e-8


@dataclass(frozen=True)
class Estimator:
    """T = (GᵀWG + μ²W_θ)⁻¹GᵀW, through a singular value decomposition of the stacked and scaled matrix.

    Parameters
    ----------
    root : (m, m) R with RᵀR = W
    scale : (k,) unit of each parameter; W_θ = diag(1/scale²)
    regularisation : μ
    """

    root: Reals
    scale: Reals
    regularisation: float = 0.0

    def matrix(self, G: Reals) -> Reals:
        """T (k, m); the minimum-norm one, in units of `scale`, where the outputs do not determine the parameters."""
        return np.asarray(self.scale[:, None] * self._inverse(G)[:, : len(self.root)] @ self.root)

    def rank(self, G: Reals) -> int:
        """Number of combinations of parameters that the outputs determine to first order."""
        s = np.linalg.svd(self.root @ (G * self.scale), compute_uv=False)
        return int((s > _RANK * s.max(initial=0.0)).sum())

    def _inverse(self, G: Reals) -> Reals:
        rows = self.root @ (G * self.scale)
        if self.regularisation:
            rows = np.vstack([rows, self.regularisation * np.eye(len(self.scale))])
        return np.asarray(np.linalg.pinv(rows, rcond=_RANK), dtype=float)


def estimator(
    measured: OutputStatistics, scale: Reals, weighting: Weighting = "relative", regularisation: float = 0.0
) -> Estimator:
    """An estimator for measured outputs.

    Parameters
    ----------
    weighting : "relative": W = diag(1/z²); "covariance": W is the inverse of the measured covariance
    regularisation : μ ≥ 0 of the chapter's equation (22), with the parameters in units of `scale`

    Raises
    ------
    FemtuneError : ``quantify.singular`` where a singular covariance is to be inverted; ``quantify.zero-mean`` where a
        mean is zero and outputs are to be weighted relative to it
    """
    if weighting == "covariance":
        return Estimator(_inverse_root(measured), scale, regularisation)
    if (measured.mean == 0.0).any():
        raise FemtuneError(
            "quantify.zero-mean",
            f"{measured.labels[int(np.argmin(np.abs(measured.mean)))]} has a mean of zero: no weight is relative to it",
            hint='take weighting = "covariance"',
        )
    return Estimator(np.diag(1.0 / np.abs(measured.mean)), scale, regularisation)


def _inverse_root(measured: OutputStatistics) -> Reals:
    if measured.singular:
        raise FemtuneError(
            "quantify.singular",
            "the covariance of the outputs is singular: it has no inverse to weight with",
            values={"repeats": len(measured.repeats), "outputs": len(measured.mean)},
            hint='give more repeats than outputs, or take weighting = "relative"',
        )
    return np.asarray(np.linalg.inv(factor(measured.covariance)), dtype=float)
