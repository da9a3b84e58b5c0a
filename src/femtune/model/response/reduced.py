"""The dynamic stiffness on a small basis, and FRFs from it for all frequencies at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.response.basis import ModalBasis
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from femtune.model.response.modal_damping import ModalDamper
from femtune.model.response.ports import Ports

_ROUNDING = 1e-14
"""Entry of a projected matrix, relative to the sum of the magnitudes of its terms, that is rounding."""
_ORTHOGONAL = 1e-11
"""Entry of projected modal damping, relative to the sum of the magnitudes of its terms, that is rounding: modes and the
static responses beside them are orthogonal within about 1e-12. A single entry that stays makes the matrix full, and the
solution of all lines a hundred times as expensive."""
_DIAGONAL = 1e-10
"""Coupling of two modes by damping, relative to the damping of both, that is neglected: it changes FRFs by its
square."""
_SINGULAR = 1e-12
"""|Z| relative to its parts at which an undamped mode has its natural frequency."""
_LOST = 1e-5
"""Relative correction above which a solution is lost to rounding."""
_TINY = 1e-300
"""Against a division by zero."""
_ENTRIES_AT_ONCE = 2_000_000
"""Entries of matrices that are inverted together: 32 MB of complex numbers."""


@dataclass(frozen=True, eq=False)
class ReducedStiffness:
    """Z(s) = s² diag(mass) + s·viscous + diag(stiffness) + i·hysteretic on a basis of r vectors.

    Parameters
    ----------
    viscous, hysteretic : (r, r), or (r,) where they are diagonal
    inputs : QᵀB (r, n_in)
    outputs : C Q (n_out, r)
    """

    basis: ModalBasis
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


def reduce(stiffness: DynamicStiffness, basis: ModalBasis, ports: Ports) -> ReducedStiffness:
    """The dynamic stiffness and the ports on a basis."""
    Q, point = basis.vectors, stiffness.point
    viscous, hysteretic = _projected(point.viscous, Q), _projected(point.hysteretic, Q)
    if stiffness.damper is not None:
        modal = _modal(stiffness.damper, Q)
        viscous, hysteretic = (
            (viscous, hysteretic + modal) if stiffness.damper.hysteretic else (viscous + modal, hysteretic)
        )
    inputs, outputs = np.asarray((ports.inputs.T @ Q).T), np.asarray(ports.outputs @ Q)
    return ReducedStiffness(basis, slim(viscous), slim(hysteretic), inputs, outputs)


def _projected(matrix: sp.csr_array, Q: Reals) -> Reals:
    """QᵀAQ, zero where it is the rounding of larger parts: a rigid-body mode strains nothing."""
    if not np.any(matrix.data):
        return np.zeros((Q.shape[1], Q.shape[1]))
    small, parts = Q.T @ (matrix @ Q), np.abs(Q).T @ (np.abs(matrix) @ np.abs(Q))
    return np.where(np.abs(small) <= _ROUNDING * parts, 0.0, small)


def _modal(damper: ModalDamper, Q: Reals) -> Reals:
    """QᵀDQ, zero where it is the rounding of larger parts: modal damping damps no rigid-body mode."""
    small, parts = Q.T @ damper.times(Q), np.abs(Q).T @ np.abs(damper.momentum)
    return np.where(np.abs(small) <= _ORTHOGONAL * (parts * damper.rates) @ parts.T, 0.0, small)


def slim(matrix: Reals) -> Reals:
    """The diagonal of a matrix that is diagonal but for rounding, relative to its own rows and columns."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    rest = np.abs(matrix - np.diag(np.diag(matrix)))
    return np.diag(matrix).copy() if (rest <= _DIAGONAL * np.outer(size, size)).all() else matrix


def fields(reduced: ReducedStiffness, s: NDArray, forces: Reals) -> NDArray:
    """(k, r, b) coordinates of the response to forces QᵀF (r, b) at the frequencies s; NaN where Z is singular."""
    if reduced.is_diagonal:
        Z = reduced.diagonal(s)
        parts = reduced.basis.stiffness + np.abs(s[:, None]) ** 2 * reduced.basis.mass
        lost = np.abs(Z) <= _SINGULAR * parts
        inverse = np.where(lost.any(axis=1, keepdims=True), np.nan, 1.0 / np.where(lost, 1.0, Z))
        return np.asarray(inverse[:, :, None] * forces)
    step = max(1, _ENTRIES_AT_ONCE // len(forces) ** 2)
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


# ----------------------------------------------------------------------------------------------------
# A small dynamic stiffness as poles and residues: FRFs by complex modes.
#
# State (q, v) with v = q̇/s₀ for the vectors that move mass; (sA + B)y = 0 with the symmetric pair
#
#     A = [[C, s₀M], [s₀M, 0]],  B = [[K + iH, 0], [0, −s₀²M]].
#
# Rigid-body motions that no damping touches would be a double, defective pole 0; they are superposed by themselves.


_LARGEST_CONDITION = 1e7
"""Condition number of the eigenvectors above which poles are defective: residues would lose half of their digits."""
_MASSLESS = 1e-11
"""Inertia relative to stiffness plus inertia below which a vector moves no mass."""
_LITTLE_MASS = 1e-10
"""m/k relative to the largest below which a vector does not count for the frequency s₀."""
_PENCIL_LOST = 1e-12
"""|1 + (s − s₀)θ| relative to its second term at which s is an undamped pole."""
_UNDAMPED = 1e-9
"""Damping of a rigid-body motion, relative to the largest entry of the damping matrices, that counts as none."""


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
        lost = (np.abs(below) <= _PENCIL_LOST * size).any(axis=1) | (moves_freely & (s == 0.0))
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
    some = int((size > _UNDAMPED * max(np.abs(C).max(initial=0.0), np.abs(H).max(initial=0.0), _TINY)).sum())
    free, held = unit[:, rigid] @ turn[some:].T, unit[:, rigid] @ turn[:some].T
    return free, np.hstack([unit[:, k != 0.0], held])


def _origin(k: Reals, m: Reals) -> float:
    """A positive frequency in the middle of those of the basis, without vectors that move almost no mass."""
    theta = np.divide(m, k, out=np.zeros_like(m), where=k > 0.0)
    some = theta > _LITTLE_MASS * theta.max(initial=0.0)
    return float(np.exp(-0.5 * np.mean(np.log(theta[some])))) if some.any() else 1.0


def _inverted(K: NDArray, C: Reals, M: Reals, s: float) -> tuple[NDArray, NDArray, NDArray]:
    """θ and Y of (B + sA)⁻¹A, and the columns of (B + sA)⁻¹ that belong to forces."""
    values, vectors = la.eigh(M)
    # beside the stiffness, since modes are scaled to mass 1 and residual vectors to stiffness 1
    inertia, stiff = s * s * values, np.abs(np.einsum("ij,ik,kj->j", vectors, K, vectors))
    heavy = vectors[:, inertia > _MASSLESS * (stiff + inertia)]
    half = M @ heavy
    # almost massless vectors left in M would cost the eigenvalues digits
    M = half @ heavy.T
    m = heavy.T @ half
    Z = la.inv(K + s * C + s * s * M)
    # rows q: (B + sA)(q, v) = (f, g) with v = heavyᵀq − m⁻¹g/s², and g = s·halfᵀq₀ from A
    top = np.hstack([Z @ (C + s * M), s * Z @ half])
    bottom = heavy.T @ top - np.hstack([heavy.T / s, np.zeros_like(m)])
    theta, Y = la.eig(np.vstack([top, bottom]))
    return theta, Y, np.vstack([Z, heavy.T @ Z])


def _left(Y: NDArray, forces: NDArray) -> NDArray:
    if np.linalg.cond(Y) > _LARGEST_CONDITION:
        raise FemtuneError("response.defective/left-eigenvector")
    return np.asarray(la.solve(Y, forces))
