"""A small dynamic stiffness as poles and residues: FRFs by complex modes.

State (q, v) with v = q̇/s₀ for the vectors that move mass; (sA + B)y = 0 with the symmetric pair

    A = [[C, s₀M], [s₀M, 0]],  B = [[K + iH, 0], [0, −s₀²M]].

Rigid-body motions that no damping touches would be a double, defective pole 0; they are superposed by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.response.reduced import ReducedStiffness

Reals = NDArray[np.float64]

_WORST_CONDITION = 1e7
_MASSLESS, _NO_MASS, _LOST, _UNTOUCHED, _TINY = 1e-13, 1e-10, 1e-12, 1e-9, 1e-300


@dataclass(frozen=True, eq=False)
class PoleResidues:
    """q(s) = Σ_j right_j left_j / (1 + (s − origin) θ_j) + free · pushed / s², pushed = freeᵀ QᵀF.

    Parameters
    ----------
    origin : s₀ > 0, where the pencil is inverted
    theta : (p,) 1/(origin − pole); 0 for a pole at infinity
    right : (r, p), left : (p, b)
    free, pushed : (r, f) undamped rigid-body motions of unit mass, and their forces (f, b)
    """

    origin: float
    theta: NDArray[np.complex128]
    right: NDArray[np.complex128]
    left: NDArray[np.complex128]
    free: Reals
    pushed: Reals

    def fields(self, s: NDArray) -> NDArray:
        """(k, r, b) coordinates of the response at the frequencies s (k,); NaN on an undamped pole."""
        below = 1.0 + (s[:, None] - self.origin) * self.theta
        size = np.abs(s[:, None] - self.origin) * np.abs(self.theta)
        moves_freely = self.free.shape[1] > 0
        lost = (np.abs(below) <= _LOST * size).any(axis=1) | (moves_freely & (s == 0.0))
        gain = np.where(lost[:, None], np.nan, 1.0 / np.where(lost[:, None], 1.0, below))
        out = np.einsum("rp,kp,pb->krb", self.right, gain, self.left, optimize=True)
        if moves_freely:
            out += (self.free @ self.pushed) / np.where(lost, 1.0, s)[:, None, None] ** 2
        return np.asarray(out)


def pole_residues(reduced: ReducedStiffness, forces: Reals) -> PoleResidues:
    """Poles and residues of a reduced dynamic stiffness for forces QᵀF (r, b).

    Raises
    ------
    FemtuneError : ``response.defective`` where poles coincide without vectors of their own
    """
    C, H = (np.diag(d) if d.ndim == 1 else d for d in (reduced.viscous, reduced.hysteretic))
    k, m = reduced.basis.stiffness, reduced.basis.mass
    free, turn = _split(k, C, H)
    pushed = free.T @ forces
    K, M, C, H = (turn.T @ x @ turn for x in (np.diag(k), np.diag(m), C, H))
    origin = _origin(k, m)
    theta, Y, inverse = _inverted(K + 1j * H, C, M, origin)
    n = len(K)
    left = _left(Y, inverse @ (turn.T @ forces))
    return PoleResidues(origin, theta, turn @ Y[:n], left, free, pushed)


def _split(k: Reals, C: Reals, H: Reals) -> tuple[Reals, Reals]:
    """Rigid-body motions (r, f) that no damping touches, and an orthonormal basis (r, r − f) of all others."""
    r, rigid = len(k), np.flatnonzero(k == 0.0)
    unit = np.eye(r)
    touched = np.hstack([C[:, rigid].T, H[:, rigid].T])
    _, size, turn = la.svd(touched.T, full_matrices=True) if rigid.size else (None, np.zeros(0), np.zeros((0, 0)))
    some = int((size > _UNTOUCHED * max(np.abs(C).max(initial=0.0), np.abs(H).max(initial=0.0), _TINY)).sum())
    free, held = unit[:, rigid] @ turn[some:].T, unit[:, rigid] @ turn[:some].T
    return free, np.hstack([unit[:, k != 0.0], held])


def _origin(k: Reals, m: Reals) -> float:
    """A positive frequency amid those of the basis, vectors that move next to no mass left out."""
    theta = np.divide(m, k, out=np.zeros_like(m), where=k > 0.0)
    some = theta > _NO_MASS * theta.max(initial=0.0)
    return float(np.exp(-0.5 * np.mean(np.log(theta[some])))) if some.any() else 1.0


def _inverted(K: NDArray, C: Reals, M: Reals, s: float) -> tuple[NDArray, NDArray, NDArray]:
    """θ and Y of (B + sA)⁻¹A, and the columns of (B + sA)⁻¹ that belong to forces."""
    values, vectors = la.eigh(M)
    heavy = vectors[:, values > _MASSLESS * values.max(initial=0.0)]
    m = heavy.T @ M @ heavy
    Z = la.inv(K + s * C + s * s * M)
    half = M @ heavy
    # rows q: (B + sA)(q, v) = (f, g) with v = heavyᵀq − m⁻¹g/s², and g = s·halfᵀq₀ from A
    top = np.hstack([Z @ (C + s * M), s * Z @ half])
    bottom = heavy.T @ top - np.hstack([heavy.T / s, np.zeros_like(m)])
    theta, Y = la.eig(np.vstack([top, bottom]))
    return theta, Y, np.vstack([Z, heavy.T @ Z])


def _left(Y: NDArray, forces: NDArray) -> NDArray:
    if np.linalg.cond(Y) > _WORST_CONDITION:
        raise FemtuneError(
            "response.defective",
            "two poles coincide and share one vector (critical damping), so that complex modes do not span the motion",
            hint='use method "direct" or "real-modes"',
        )
    return np.asarray(la.solve(Y, forces))
