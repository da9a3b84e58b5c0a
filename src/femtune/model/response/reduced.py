"""The dynamic stiffness on a small basis, and FRFs from it for all frequencies at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.response.basis import Basis
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from femtune.model.response.ports import Ports

Reals = NDArray[np.float64]

_ROUNDING, _DIAGONAL, _SINGULAR, _LOST = 1e-14, 1e-10, 1e-12, 1e-5
_TINY = 1e-300
_CHUNK = 2_000_000
"""Entries of matrices that are solved at once."""


@dataclass(frozen=True, eq=False)
class ReducedStiffness:
    """Z(s) = s² diag(mass) + s·viscous + diag(stiffness) + i·hysteretic on a basis of r vectors.

    Parameters
    ----------
    viscous, hysteretic : (r, r), or (r,) where they are diagonal
    inputs : QᵀB (r, n_in)
    outputs : C Q (n_out, r)
    """

    basis: Basis
    viscous: Reals
    hysteretic: Reals
    inputs: Reals
    outputs: Reals

    @property
    def is_diagonal(self) -> bool:
        """True where the damping couples no modes: modal, or proportional to stiffness and mass."""
        return self.viscous.ndim == 1 and self.hysteretic.ndim == 1

    def diagonal(self, s: NDArray) -> NDArray:
        """(k, r) Z at the frequencies s (k,), where it is diagonal."""
        free = self.basis.stiffness + s[:, None] ** 2 * self.basis.mass
        return np.asarray(free + s[:, None] * self.viscous + 1j * self.hysteretic)

    def full(self, s: NDArray) -> NDArray:
        """(k, r, r) Z at the frequencies s (k,)."""
        C, H = (np.diag(d) if d.ndim == 1 else d for d in (self.viscous, self.hysteretic))
        Z = s[:, None, None] * C + 1j * H
        at = np.arange(len(self.basis.mass))
        Z[:, at, at] += self.basis.stiffness + s[:, None] ** 2 * self.basis.mass
        return Z


def reduce(stiffness: DynamicStiffness, basis: Basis, ports: Ports) -> ReducedStiffness:
    """The dynamic stiffness and the ports on a basis."""
    Q, point = basis.vectors, stiffness.point
    viscous, hysteretic = _projected(point.viscous, Q), _projected(point.hysteretic, Q)
    if stiffness.damper is not None:
        modal = Q.T @ stiffness.damper.times(Q)
        viscous, hysteretic = (
            (viscous, hysteretic + modal) if stiffness.damper.hysteretic else (viscous + modal, hysteretic)
        )
    inputs, outputs = np.asarray((ports.inputs.T @ Q).T), np.asarray(ports.outputs @ Q)
    return ReducedStiffness(basis, _slim(viscous), _slim(hysteretic), inputs, outputs)


def _projected(matrix: sp.csr_array, Q: Reals) -> Reals:
    """QᵀAQ, zero where it is the rounding of larger parts: a rigid-body mode strains nothing."""
    if not np.any(matrix.data):
        return np.zeros((Q.shape[1], Q.shape[1]))
    small, parts = Q.T @ (matrix @ Q), np.abs(Q).T @ (np.abs(matrix) @ np.abs(Q))
    return np.where(np.abs(small) <= _ROUNDING * parts, 0.0, small)


def _slim(matrix: Reals) -> Reals:
    """The diagonal of a matrix that is diagonal but for rounding, relative to its own rows and columns."""
    own = np.sqrt(np.abs(np.diag(matrix)))
    rest = np.abs(matrix - np.diag(np.diag(matrix)))
    return np.diag(matrix).copy() if (rest <= _DIAGONAL * np.outer(own, own)).all() else matrix


def fields(reduced: ReducedStiffness, s: NDArray, forces: Reals) -> NDArray:
    """(k, r, b) coordinates of the response to forces QᵀF (r, b) at the frequencies s; NaN where Z is singular."""
    if reduced.is_diagonal:
        Z = reduced.diagonal(s)
        parts = reduced.basis.stiffness + np.abs(s[:, None]) ** 2 * reduced.basis.mass
        lost = np.abs(Z) <= _SINGULAR * parts
        inverse = np.where(lost.any(axis=1, keepdims=True), np.nan, 1.0 / np.where(lost, 1.0, Z))
        return np.asarray(inverse[:, :, None] * forces)
    step = max(1, _CHUNK // len(forces) ** 2)
    return np.concatenate([_solved(reduced.full(s[i : i + step]), forces) for i in range(0, len(s), step)])


def _solved(Z: NDArray, forces: Reals) -> NDArray:
    """(k, r, b) solutions of Z (k, r, r), corrected once; NaN where the correction does not vanish."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.einsum("kii->ki", Z)), _TINY))[:, :, None]
    scaled, b = scale * Z * scale.transpose(0, 2, 1), scale * forces
    try:
        inverse = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:
        return _one_by_one(Z, forces)
    x = inverse @ b
    step = inverse @ (b - scaled @ x)
    lost = np.linalg.norm(step, axis=(1, 2)) > _LOST * np.linalg.norm(x, axis=(1, 2))
    return np.asarray(np.where(lost[:, None, None], np.nan, scale * (x + step)))


def _one_by_one(Z: NDArray, forces: Reals) -> NDArray:
    if len(Z) == 1:
        return np.full((1, *forces.shape), np.nan + 0j)
    return np.concatenate([_solved(one[None], forces) for one in Z])
