"""Exact derivatives of eigenvalues and eigenvectors, for single modes and for clusters of close or repeated ones.

A mode is a cluster of one. What is differentiated is the invariant subspace: inside it the vectors are fixed only
up to a rotation, so functions of the subspace (aligned shapes, Φ̂ᵀKΦ̂) are what residuals are made of.
Sources: Fox and Kapoor 1968 (modal superposition), Dailey 1989 (repeated eigenvalues).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.eigen import EigenSolution

_TOLERANCE, _ENOUGH, _MAX_STEPS = 1e-13, 1e-7, 400
_REPEATED = 1e-9


@dataclass(frozen=True)
class SubspaceDerivative:
    """First derivatives of an M-orthonormal basis Φ_c of c modes, by k parameters.

    Parameters
    ----------
    eigenvalues : (c,)
    stiffness : (k, c, c) ΦᵀK′Φ
    mass : (k, c, c) ΦᵀM′Φ
    outside : (rows, c, k) part of C Φ′ that is M-orthogonal to the cluster
    shapes : (rows, c) C Φ

    Then CΦ′ = outside + CΦ(−½ΦᵀM′Φ + Ω) with a skew Ω that the choice of vectors in the subspace decides, and
    λ′ = (stiffness − λ·mass)_jj for a single mode.
    """

    eigenvalues: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    mass: NDArray[np.float64]
    outside: NDArray[np.float64]
    shapes: NDArray[np.float64]

    @property
    def eigenvalue_gradient(self) -> NDArray[np.float64]:
        """(k,) derivative of λ of a single mode."""
        return self.stiffness[:, 0, 0] - self.eigenvalues[0] * self.mass[:, 0, 0]

    @property
    def shape_gradient(self) -> NDArray[np.float64]:
        """(rows, k) derivative of C φ of a single mass-normalised mode."""
        return self.outside[:, 0, :] - 0.5 * self.shapes[:, :1] * self.mass[None, :, 0, 0]


def subspace_derivative(
    solution: EigenSolution, members: Sequence[int], rows: sp.csr_array | None = None
) -> SubspaceDerivative:
    """Derivatives of the subspace of some modes.

    Parameters
    ----------
    members : positions of the cluster's modes in the solution
    rows : C (rows, n_free), the combinations of DOFs that are wanted; None for all free DOFs

    Raises
    ------
    FemtuneError : ``derivative.not-converged``
    """
    members = list(members)
    phi = solution.shapes[:, members]
    forces, k, m = _forces(solution, members)
    outside = _outside(solution, members, forces)
    n, c, p = outside.shape
    observe = rows if rows is not None else sp.eye_array(n, format="csr")
    seen = (observe @ outside.reshape(n, c * p)).reshape(observe.shape[0], c, p)
    return SubspaceDerivative(solution.eigenvalues[members], k, m, seen, observe @ phi)


def _forces(solution: EigenSolution, members: list[int]) -> tuple[NDArray, NDArray, NDArray]:
    """(K′ − λ_jM′)φ_j as (n, c, k), and ΦᵀK′Φ, ΦᵀM′Φ as (k, c, c)."""
    point, phi, values = solution.point, solution.shapes[:, members], solution.eigenvalues[members]
    forces, stiffness, mass = [], [], []
    for i in range(point.n_parameters):
        k, m = point.stiffness_derivatives[i] @ phi, point.mass_derivatives[i] @ phi
        forces.append(k - m * values)
        stiffness.append(phi.T @ k)
        mass.append(phi.T @ m)
    size = (0, len(members), len(members))
    full = np.stack(forces, axis=-1) if forces else np.zeros((*phi.shape, 0))
    return full, np.array(stiffness).reshape(-1, *size[1:]), np.array(mass).reshape(-1, *size[1:])


def _outside(solution: EigenSolution, members: list[int], forces: NDArray) -> NDArray:
    """Part of Φ′ outside the cluster: known modes by superposition, the rest by an iterative solve."""
    others = [h for h in range(len(solution.eigenvalues)) if h not in members]
    known = solution.shapes[:, others]
    out = np.empty_like(forces)
    for j, member in enumerate(members):
        eigenvalue = float(solution.eigenvalues[member])
        part = (known.T @ forces[:, j, :]) * _inverse_gap(solution, eigenvalue, others)[:, None]
        out[:, j, :] = known @ part + complement(solution, eigenvalue, -forces[:, j, :])
    return out


def _inverse_gap(solution: EigenSolution, eigenvalue: float, others: list[int]) -> NDArray[np.float64]:
    """1/(λ_j − λ_h); zero for a mode outside the group that crosses a member exactly, so that no infinity spreads."""
    gap = eigenvalue - solution.eigenvalues[others]
    apart = np.abs(gap) > _REPEATED * (eigenvalue - solution.shift)
    return np.divide(1.0, gap, out=np.zeros_like(gap), where=apart)


def complement(solution: EigenSolution, eigenvalue: float, b: NDArray) -> NDArray:
    """y (n, k) ⟂_M all known modes with (K − λM)y = b, by conjugate gradients with K − σM as preconditioner.

    b (n, k) is freed of its part in the known modes first. On their complement (they are the lowest) K − λM is
    positive definite.

    Raises
    ------
    FemtuneError : ``derivative.not-converged``
    """
    K, M, phi = solution.point.stiffness, solution.point.mass, solution.shapes
    m_phi = M @ phi
    r = b - m_phi @ (phi.T @ b)
    y, z = np.zeros_like(b), _precondition(solution, m_phi, r)
    d, rho = z.copy(), np.einsum("ij,ij->j", r, z)
    # measured by the whole force: where it lies in the known modes, what is left is rounding
    start, best = _energy(solution, b), np.inf
    for _ in range(_MAX_STEPS):
        left = float(np.max(np.abs(rho) / np.where(start > 0.0, start, 1.0), initial=0.0))
        best = min(best, left)
        if left <= _TOLERANCE**2 or (best <= _ENOUGH**2 and left > 100.0 * best):
            return y
        q = K @ d - eigenvalue * (M @ d)
        q -= m_phi @ (phi.T @ q)
        alpha = _ratio(rho, np.einsum("ij,ij->j", d, q))
        y, r = y + alpha * d, r - alpha * q
        z = _precondition(solution, m_phi, r)
        new = np.einsum("ij,ij->j", r, z)
        d, rho = z + _ratio(new, rho) * d, new
    if best <= _ENOUGH**2:
        return y
    raise FemtuneError(
        "derivative.not-converged",
        f"the derivative of the mode at {np.sqrt(max(eigenvalue, 0.0)) / (2 * np.pi):.6g} Hz did not converge",
        hint="ask for more modes than are compared",
    )


def _energy(solution: EigenSolution, b: NDArray) -> NDArray:
    return np.abs(np.einsum("ij,ij->j", b, solution.factor.solve(b)))


def _precondition(solution: EigenSolution, m_phi: NDArray, r: NDArray) -> NDArray:
    z = solution.factor.solve(r)
    return z - solution.shapes @ (m_phi.T @ z)


def _ratio(a: NDArray, b: NDArray) -> NDArray:
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)
