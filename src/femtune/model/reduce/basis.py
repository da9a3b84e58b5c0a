"""Bases of reduced models: vectors made orthonormal in the energy of the nominal model, without what weighs nothing."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.model.symmetric import SymmetricMatrix

Reals = NDArray[np.float64]

NEGLIGIBLE = 2e-3
"""Singular value below which a direction is left out: the part of a unit vector that the basis misses, in energy.

The relative error of an eigenvalue is of the size of its square.
"""
DEPENDENT = 1e-9


def extend(basis: Reals, vectors: Reals, metric: SymmetricMatrix, negligible: float = NEGLIGIBLE) -> Reals:
    """The basis with the directions of `vectors` that it misses.

    Each vector is given unit energy vᵀAv = 1 first; what is left of them outside the basis is orthonormalised by its
    singular values, those below `negligible` dropped. Columns of the basis are not touched.

    Parameters
    ----------
    basis : (n, r), BᵀAB = 1
    vectors : (n, m)
    metric : A, positive definite, of the nominal model: K − σM with σ below the spectrum
    """
    energy = np.einsum("ij,ij->j", vectors, metric @ vectors)
    some = energy > 0.0
    W = vectors[:, some] / np.sqrt(energy[some])
    # the second pass removes what rounding left of the first; orthonormal to rounding in the end
    for limit in (negligible, 0.5):
        W = W - basis @ (basis.T @ (metric @ W))
        W = _orthonormal(W, metric, limit)
    return np.ascontiguousarray(np.hstack([basis, W]))


def orthonormal(vectors: Reals, metric: SymmetricMatrix) -> Reals:
    """An orthonormal basis of all that `vectors` span, only linear dependence left out."""
    return extend(np.zeros((len(vectors), 0)), vectors, metric, DEPENDENT)


def _orthonormal(W: Reals, metric: SymmetricMatrix, limit: float) -> Reals:
    gram = W.T @ (metric @ W)
    values, Q = la.eigh(0.5 * (gram + gram.T))
    keep = values > max(limit, DEPENDENT) ** 2
    # largest first, so that a basis that is cut has the best of them
    return W @ (Q[:, keep] / np.sqrt(values[keep]))[:, ::-1]
