"""A cluster's model vectors aligned with the test's, with exact derivatives; a single mode is a cluster of one.

Aligned frequencies and shapes are functions of the invariant subspace only, so they are smooth where the modes of
the cluster cross or repeat, where a Jacobian of single eigenvalues does not exist.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.model import SubspaceDerivative

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class AlignedModes:
    """t aligned modes at s sensors and their derivatives by k parameters.

    `eigenvalues` (t,) are the diagonal of QᵀΛQ, `shapes` (s, t) are CΦQ.
    """

    eigenvalues: Reals
    eigenvalue_gradients: Reals
    shapes: Reals
    shape_gradients: Reals


def align(derivative: SubspaceDerivative, test: Reals) -> AlignedModes:
    """Rotate a subspace to test shapes by the polar factor of their modal coordinates, and differentiate it all.

    Parameters
    ----------
    derivative : of c modes, at s sensors
    test : (s, t) real test shapes, t ≤ c; rows with NaN in any of them do not count
    """
    known = ~np.isnan(test).any(axis=1)
    A, B = derivative.shapes[known], test[known]
    dA = _basis_gradient(derivative)
    Q, dQ = _rotation(A, dA[known], B)
    small = np.diag(derivative.eigenvalues)
    d_small = _small_gradient(derivative)
    turned = np.einsum("ai,ab,bi->i", Q, small, Q)
    d_turned = 2.0 * np.einsum("aik,ab,bi->ik", dQ, small, Q) + np.einsum("ai,abk,bi->ik", Q, d_small, Q)
    shapes = derivative.shapes @ Q
    d_shapes = np.einsum("sak,ai->sik", dA, Q) + np.einsum("sa,aik->sik", derivative.shapes, dQ)
    return AlignedModes(turned, d_turned, shapes, d_shapes)


def _basis_gradient(d: SubspaceDerivative) -> Reals:
    """(s, c, k): CΦ′ with no rotation inside the subspace."""
    return d.outside - 0.5 * np.einsum("sa,kab->sbk", d.shapes, d.mass)


def _small_gradient(d: SubspaceDerivative) -> Reals:
    """(c, c, k): (ΦᵀKΦ)′ = ΦᵀK′Φ − ½(Λ ΦᵀM′Φ + ΦᵀM′Φ Λ) for the same choice of vectors."""
    values = d.eigenvalues
    mixed = 0.5 * d.mass * (values[None, :, None] + values[None, None, :])
    return np.moveaxis(d.stiffness - mixed, 0, -1)


def _rotation(A: Reals, dA: Reals, B: Reals) -> tuple[Reals, Reals]:
    """Polar factor Q (c, t) of the unit modal coordinates of B in A, and its gradient (c, t, k)."""
    X, dX = _coordinates(A, dA, B)
    length = np.linalg.norm(X, axis=0)
    U = X / length
    dU = (dX - U[:, :, None] * np.einsum("ai,aik->ik", U, dX)) / length[None, :, None]
    u, s, vt = la.svd(U, full_matrices=False)
    Q, H = u @ vt, (vt.T * s) @ vt
    inside = np.einsum("ai,ajk->ijk", Q, dU)
    skew = inside - np.swapaxes(inside, 0, 1)
    across = np.einsum("ab,bjk->ajk", np.eye(len(Q)) - Q @ Q.T, dU)
    turn = vt @ np.moveaxis(skew, -1, 0) @ vt.T / (s[:, None] + s[None, :])
    spin = np.moveaxis(vt.T @ turn @ vt, 0, -1)
    return Q, np.einsum("ai,ijk->ajk", Q, spin) + np.einsum("aik,ij->ajk", across, la.inv(H))


def _coordinates(A: Reals, dA: Reals, B: Reals) -> tuple[Reals, Reals]:
    """Least-squares coordinates X = A⁺B and their gradient (c, t, k)."""
    inverse = np.linalg.pinv(A)
    X = inverse @ B
    rest = B - A @ X
    direct = -np.einsum("as,sbk,bj->ajk", inverse, dA, X)
    return X, direct + np.einsum("ab,sbk,sj->ajk", inverse @ inverse.T, dA, rest)
