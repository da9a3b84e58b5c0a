"""M-orthonormal blocks: classical Gram-Schmidt by blocks, with a rank that is revealed rather than assumed."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.model.dense_products import multiply, subtract, transposed_times
from femtune.model.sparse_products import Product

Reals = NDArray[np.float64]

_RANK, _CLIPPED, _GONE = 1e-14, 1e-16, 1e-4
"""Directions of a block's Gram matrix (of unit diagonal) below the first are rounding of it, not of the block: they are
enlarged by at most the root of the second, and gone where their norm then is below the third."""
_WELL, _SWEEPS = 1e3, 4
"""A block whose coefficients are conditioned better than this keeps its orthogonality to the basis."""
_NOTHING = 1e-12
"""A part in the basis that is smaller, against the block that is left, changes no product with M."""


def orthonormalise(W: Reals, V: Reals, mass: Product, smallest: float) -> tuple[Reals, Reals, Reals]:
    """Q (n, r) with VᵀMQ = 0 and QᵀMQ = 1, MQ, and B (r, b) with W = Q B + (a part in V that is rounding).

    Parameters
    ----------
    W : (n, b) in Fortran's order, overwritten; its part in V is small or known to the caller
    V : (n, k), M-orthonormal
    smallest : columns of W whose M-norm is below this are rounding and are dropped

    Sources: block classical Gram-Schmidt, twice; Stathopoulos and Wu 2002 (orthonormalisation by the Gram matrix).
    """
    total = np.eye(W.shape[1])
    for sweep in range(_SWEEPS):
        MW = mass @ W
        C = transposed_times(V, MW)
        subtract(W, V, C)
        R, condition, change = _factors(transposed_times(W, MW), smallest, clipped=sweep == 0)
        W, MW, total = multiply(W, R), multiply(MW, R), change @ total
        removed = float(np.abs(C @ R).max(initial=0.0))
        smallest = _GONE
        if max(condition, removed) < _WELL or not W.shape[1]:
            break
    return _once_more(W, MW if removed < _NOTHING else mass @ W, total)


def _once_more(W: Reals, MW: Reals, total: Reals) -> tuple[Reals, Reals, Reals]:
    """Mend what is left of the first Gram matrix' rounding, inside the block."""
    if W.shape[1]:
        R, _, change = _factors(transposed_times(W, MW), 0.0)
        W, MW, total = multiply(W, R), multiply(MW, R), change @ total
    return W, MW, total


def _factors(gram: Reals, smallest: float, clipped: bool = False) -> tuple[Reals, float, Reals]:
    """R (b, r) with RᵀGR = 1, the condition of the columns, and R's left inverse (r, b).

    Directions that are rounding are left out, or kept as they are clipped: then RᵀGR is smaller there.
    """
    norms = np.sqrt(np.maximum(np.diag(gram), 0.0))
    some = norms > smallest
    scale = np.divide(1.0, norms, out=np.zeros_like(norms), where=some)
    if not some.any():
        return np.zeros((len(norms), 0)), 1.0, np.zeros((0, len(norms)))
    values, vectors = la.eigh(0.5 * scale[:, None] * (gram + gram.T) * scale)
    keep = some if clipped and some.all() else values > _RANK * values[-1]
    root = np.sqrt(np.maximum(values[keep], _CLIPPED * values[-1]))
    R = scale[:, None] * vectors[:, keep] / root
    change = (root[:, None] * vectors[:, keep].T) * norms
    return R, float(root[-1] / root[0]), change


def column_products(A: Reals, B: Reals) -> Reals:
    """a_jᵀb_j of the columns of two arrays in Fortran's order."""
    return np.array([a @ b for a, b in zip(A.T, B.T, strict=True)])
