"""Bases that FRFs are superposed from: real modes, and residual vectors as pseudo-modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.model.configured import ModelPoint
from femtune.model.derivatives.modes import complement
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.rigid import is_rigid

_DEPENDENT, _ROUNDING = 1e-10, 1e-17
_MOST_DAMPED = 24
"""Forces of dashpots and loss factors get residual vectors up to this rank, and up to a quarter of the DOFs."""


@dataclass(frozen=True, eq=False)
class ModalBasis:
    """Vectors Q that are orthogonal in K and M.

    Parameters
    ----------
    vectors : Q (n_free, r)
    stiffness, mass : (r,) diagonals of QᵀKQ and QᵀMQ; real modes come first with mass 1, rigid-body ones with
        stiffness 0; residual vectors have stiffness 1, and mass 0 where they move no mass
    n_modes : number of real modes among them
    """

    vectors: Reals
    stiffness: Reals
    mass: Reals
    n_modes: int


def modal_basis(modes: EigenSolution, forces: Reals | None) -> ModalBasis:
    """The wanted modes (and every rigid-body mode), and the static response to `forces` (n_free, k) that they miss."""
    rigid = is_rigid(modes)
    keep = max(modes.wanted, int(rigid.sum()))
    phi, stiffness = modes.shapes[:, :keep], np.where(rigid, 0.0, modes.eigenvalues)[:keep]
    if forces is None or not forces.shape[1]:
        return ModalBasis(phi, stiffness, np.ones(keep), keep)
    extra, k, m = ritz_vectors(modes.point, residual_vectors(modes, keep, forces))
    return ModalBasis(np.hstack([phi, extra]), np.concatenate([stiffness, k]), np.concatenate([np.ones(keep), m]), keep)


def static_complement(modes: EigenSolution, keep: int, forces: Reals) -> Reals:
    """(n_free, k) what the first `keep` modes miss of the static response to forces.

    These modes hold all rigid-body ones, so that the rest is elastic and its stiffness regular: inertia relief.
    """
    rest, values = modes.shapes[:, keep:], modes.eigenvalues[keep:]
    known = rest @ ((rest.T @ forces) / values[:, None])
    return np.asarray(known + complement(modes, 0.0, forces))


def residual_vectors(modes: EigenSolution, keep: int, forces: Reals) -> Reals:
    """The columns of the static complement that are more than the rounding of the whole static response."""
    missed = static_complement(modes, keep, forces)
    energy = np.einsum("ij,ij->j", missed, modes.point.stiffness @ missed)
    whole = np.einsum("ij,ij->j", forces, modes.factor.solve(forces))
    return np.asarray(missed[:, energy > _ROUNDING * whole])


def ritz_vectors(point: ModelPoint, vectors: Reals) -> tuple[Reals, Reals, Reals]:
    """Independent combinations of elastic vectors that are orthogonal in K and M, with QᵀKQ = 1 and QᵀMQ = θ.

    Returns Q, the ones and θ. A vector that is not independent of the others is dropped.
    """
    k = vectors.T @ (point.stiffness @ vectors)
    own = np.sqrt(np.maximum(np.diag(k), 0.0))
    scale = np.divide(1.0, own, out=np.zeros_like(own), where=own > 0.0)
    energy, turn = la.eigh(scale[:, None] * (0.5 * (k + k.T)) * scale)
    kept = energy > _DEPENDENT * energy.max(initial=1.0)
    unit = vectors @ (scale[:, None] * turn[:, kept] / np.sqrt(energy[kept]))
    m = unit.T @ (point.mass @ unit)
    theta, turn = la.eigh(0.5 * (m + m.T))
    return unit @ turn, np.ones(len(theta)), np.maximum(theta, 0.0)


def damping_forces(point: ModelPoint) -> Reals:
    """(n_free, k) independent forces of dashpots and of loss factors that act on few DOFs; none where they are many."""
    n = point.configured.n_free
    found = [_range(matrix) for matrix in (point.viscous, point.hysteretic)]
    some = [one for one in found if one.shape[1] <= min(_MOST_DAMPED, n // 4)]
    return np.hstack([np.zeros((n, 0)), *some])


def _range(matrix: sp.csr_array) -> Reals:
    """Basis of the range of a symmetric matrix with few rows; without columns if these are many."""
    rows = np.flatnonzero(np.abs(matrix).sum(axis=1) > 0.0)
    out = np.zeros((matrix.shape[0], 0))
    if not 0 < len(rows) <= 12 * _MOST_DAMPED:
        return out
    values, vectors = la.eigh(matrix[rows][:, rows].toarray())
    some = np.abs(values) > _DEPENDENT * np.abs(values).max()
    out = np.zeros((matrix.shape[0], int(some.sum())))
    out[rows] = vectors[:, some]
    return out
