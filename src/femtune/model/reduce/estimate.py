"""How far the eigenvalues of a reduced model are off at any p, without a solution of the full model.

The Ritz pairs (λ, x = Vy) leave residuals r = K(p)x − λM(p)x. With the factors of the nominal A0 = K0 − σM0 the
vectors d = A0⁻¹r are nearly the errors of the shapes; one Rayleigh-Ritz step on [X, D] gives λ⁺ between the true
eigenvalue and λ. So λ − λ⁺ never exceeds the true error, and misses a part of it where A0 differs from A(p), for which
the estimate is multiplied by SAFETY. A mode of which the basis has nothing at all can escape: only a full solution,
with its Sturm count, certifies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.model.factorise import Factor
from femtune.model.reduce.reduced_model import ReducedModel
from femtune.model.reduce.reduced_modes import elastic, reduced_modes
from femtune.model.symmetric import SymmetricMatrix

Reals = NDArray[np.float64]

ABOVE = 0.25
"""Ritz vectors above the wanted ones, as a part of them: what comes down from there shows modes that are missed."""
SAFETY = 2.0
"""What the estimate is multiplied by, since the step with the nominal factors finds a part of the error only."""
_DEPENDENT = 1e-10


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Estimated errors at one point.

    Parameters
    ----------
    eigenvalues : (m,) of the reduced model
    improved : (m,) λ⁺, upper bounds of the true ones
    frequency_error : (m,) estimated relative errors of the frequencies; 0 for rigid-body modes
    vectors : (n_free, m) directions that the basis misses
    """

    x: Reals
    eigenvalues: Reals
    improved: Reals
    frequency_error: Reals
    vectors: Reals

    @property
    def worst(self) -> float:
        """The largest of the estimated relative frequency errors."""
        return float(self.frequency_error.max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Estimator:
    """Error estimates of the `count` lowest modes; `factor` holds factors of K0 − σM0 of the nominal model."""

    factor: Factor
    count: int

    def at(self, model: ReducedModel, basis: Reals, x: Reals) -> ErrorEstimate:
        """The estimate at one parameter vector; costs one block solve and three products with K and M."""
        modes = reduced_modes(model.at(x), self.count)
        number = min(int((1.0 + ABOVE) * self.count), model.order)
        values, X = modes.eigenvalues[:number], basis @ modes.shapes[:, :number]
        point = model.configured.at(x)
        K, M = point.symmetric_stiffness, point.symmetric_mass
        KX, MX = K @ X, M @ X
        D = self.factor.solve(np.asfortranarray(KX - MX * values))
        improved = _ritz(K, M, X, KX, MX, D)[: modes.wanted]
        found = values[: modes.wanted]
        return ErrorEstimate(np.asarray(x, float), found, improved, SAFETY * frequency_error(found, improved), D)


def frequency_error(eigenvalues: Reals, better: Reals) -> Reals:
    """(m,) relative errors √(λ/λ⁺) − 1 of frequencies in sorted order; 0 for rigid-body modes."""
    flexible = elastic(better)
    error = np.zeros(len(eigenvalues))
    error[flexible] = np.sqrt(np.maximum(eigenvalues[flexible], 0.0) / better[flexible]) - 1.0
    return error


def certified_error(model: ReducedModel, x: Reals, eigenvalues: Reals) -> Reals:
    """(m,) relative frequency errors at a point where the full model was solved; `eigenvalues` (m,) are its own."""
    found = reduced_modes(model.at(x), len(eigenvalues)).eigenvalues[: len(eigenvalues)]
    return np.abs(frequency_error(found, eigenvalues[: len(found)]))


def _ritz(K: SymmetricMatrix, M: SymmetricMatrix, X: Reals, KX: Reals, MX: Reals, D: Reals) -> Reals:
    """Eigenvalues on [X, D]; D is freed of X and of what is linearly dependent first."""
    D = D - X @ (MX.T @ D)
    size = np.einsum("ij,ij->j", D, D) ** 0.5
    D = D[:, size > 0.0] / size[size > 0.0]
    KD, MD = K @ D, M @ D
    dependence, Q = la.eigh(D.T @ MD)
    Q = Q[:, dependence > _DEPENDENT * dependence.max(initial=0.0)]
    KD, MD, D = KD @ Q, MD @ Q, D @ Q
    kxd, mxd = X.T @ KD, X.T @ MD
    k = np.block([[X.T @ KX, kxd], [kxd.T, D.T @ KD]])
    m = np.block([[X.T @ MX, mxd], [mxd.T, D.T @ MD]])
    return np.asarray(la.eigvalsh(0.5 * (k + k.T), 0.5 * (m + m.T)))
