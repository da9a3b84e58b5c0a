"""How far a polynomial of matrices misses a checking set in its softest motions.

Entries over the diagonal show what is stiff: the membrane of a panel hides its bending, whose energy is smaller by
(thickness over element size)² and which alone decides the lowest frequencies. A few steps of subspace iteration on
(K, D) with the diagonal D give soft motions x; what counts is the error of x·K x over its change between the sets.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.factorise import factorise

Reals = NDArray[np.float64]

_MOTIONS, _STEPS = 24, 4
# stiffness over the diagonal: what is added to make rigid motions solvable, and what is no rigid motion
_ADDED, _ELASTIC = 1e-10, 1e-8


def soft_error(pattern: sp.csr_array, expected: Reals, missed: Reals, sets: Reals) -> float:
    """Largest error of the energy of a soft motion, over its change between the sets.

    Parameters
    ----------
    pattern : upper triangle whose entries the numbers are
    expected : (nnz,) the matrix of the checking set
    missed : (nnz,) what the polynomial gives beside it
    sets : (sets, nnz) the matrices of all sets
    """
    K = _full(pattern, expected)
    used = np.flatnonzero(K.diagonal() > 0.0)
    D = K.diagonal()[used]
    if not used.size:
        return 0.0
    X = _soft(sp.csr_array(K[used][:, used]), D)
    energy = _energies(_full(pattern, expected), used, X)
    elastic = energy > _ELASTIC * np.einsum("ij,i,ij->j", X, D, X)
    change = np.ptp([_energies(_full(pattern, data), used, X) for data in sets], axis=0)
    error = np.abs(_energies(_full(pattern, missed), used, X))
    # what does not change has nothing but the digits of the file
    known = elastic & (change > 1e-3 * energy)
    return float((error[known] / change[known]).max(initial=0.0))


def _full(pattern: sp.csr_array, data: Reals) -> sp.csr_array:
    upper = sp.csr_array((data, pattern.indices, pattern.indptr), shape=pattern.shape)
    return sp.csr_array(upper + sp.triu(upper, 1).T)


def _energies(K: sp.csr_array, used: NDArray[np.int64], X: Reals) -> Reals:
    """x·K x of the columns of X."""
    return np.asarray(np.einsum("ij,ij->j", X, K[used][:, used] @ X))


def _soft(K: sp.csr_array, D: Reals) -> Reals:
    """(n, motions) Ritz vectors of (K, D) for the lowest values."""
    n = len(D)
    factor = factorise(sp.csr_array(K + sp.diags_array(_ADDED * D)))
    X = np.random.default_rng(7).standard_normal((n, min(_MOTIONS, n)))
    for _ in range(_STEPS):
        X = factor.solve(D[:, None] * X)
        # columns of unit weight, so that rigid motions do not drown the others
        root = np.sqrt(D)[:, None]
        X = np.linalg.qr(root * X)[0] / root
    _, vectors = scipy.linalg.eigh(X.T @ (K @ X))
    return np.asarray(X @ vectors)
