"""Bases that FRFs are superposed from: real modes, and residual vectors as pseudo-modes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.model.configured import ModelPoint
from femtune.model.derivatives.chosen import subspace_derivative
from femtune.model.derivatives.modes import complement
from femtune.model.eigen.pencil import pieces
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.rigid import is_rigid

TIMES_HIGHEST_LINE = 2.0
"""FRFs are superposed from the modes up to this many times the highest frequency line by default."""
_DEPENDENT = 1e-10
"""Energy of a combination of unit vectors, relative to the largest, below which the vectors are dependent."""
_ROUNDING_ENERGY = 1e-17
"""Energy of a residual vector, relative to that of the whole static response, that is rounding of the response."""
_ROUNDING_PART = 1e-8
"""Part of a column that is left after projection and is rounding: half of the digits of a double."""
_SLOPE_ACCURACY = 1e-6
"""Relative accuracy of the derivatives of the basis."""
Slopes = Callable[[Reals], Iterator[Reals]]
"""G (n_free, g) -> Q′ᵀG (r, g) by each parameter, for a basis Q; Q′ without its part in the span of Q.

What is computed on a basis depends on its span only, so that this part has no effect. G has no part in the span of Q in
what it is used for: residuals of equations that the basis solves.
"""
_MOST_DAMPER_RANK = 24
"""Forces of dashpots and loss factors get residual vectors up to this rank, and up to a quarter of the DOFs: each costs
a solution and a vector of the basis."""


def no_slopes(columns: Reals) -> Iterator[Reals]:
    """`Slopes` of a basis of a model without parameters."""
    return iter(())


@dataclass(frozen=True, eq=False)
class ModalBasis:
    """Vectors Q that are orthogonal in K and M.

    Parameters
    ----------
    vectors : Q (n_free, r)
    stiffness, mass : (r,) diagonals of QᵀKQ and QᵀMQ; real modes come first with mass 1, rigid-body ones with
        stiffness 0; residual vectors have stiffness 1, and mass 0 where they move no mass
    n_modes : number of real modes among them
    slopes : how the vectors change with the parameters
    """

    vectors: Reals
    stiffness: Reals
    mass: Reals
    n_modes: int
    slopes: Slopes = no_slopes


def modal_basis(modes: EigenSolution, forces: Reals | None) -> ModalBasis:
    """The wanted modes (and every rigid-body mode), and the static response to `forces` (n_free, k) that they miss."""
    rigid = is_rigid(modes)
    keep = max(modes.wanted, int(rigid.sum()))
    phi, stiffness = modes.shapes[:, :keep], np.where(rigid, 0.0, modes.eigenvalues)[:keep]
    if forces is None or not forces.shape[1]:
        forces = np.zeros((len(phi), 0))
    missed, seen = residual_vectors(modes, keep, forces)
    turn, k, m = ritz_vectors(modes.point, missed)
    extra, pushed = missed @ turn, forces[:, seen] @ turn
    return ModalBasis(
        np.hstack([phi, extra]),
        np.concatenate([stiffness, k]),
        np.concatenate([np.ones(keep), m]),
        keep,
        lambda columns: static_slopes(modes, keep, extra, pushed, columns),
    )


def shifted_basis(modes: EigenSolution, forces: Reals) -> ModalBasis:
    """As `modal_basis`, the responses to the forces taken at the shift of the solution instead of at rest.

    They span nearly the same space and cost one solution per force, whereas the static responses of a free structure
    are computed by iteration. There are no slopes.
    """
    rigid = is_rigid(modes)
    keep = max(modes.wanted, int(rigid.sum()))
    phi, values = modes.shapes[:, :keep], modes.eigenvalues[:keep]
    missed = np.empty(forces.shape)
    energy, whole = np.empty((2, forces.shape[1]))
    for part in pieces(0, forces.shape[1]):
        some = np.asfortranarray(forces[:, part])
        response = modes.factor.solve(some)
        whole[part] = np.einsum("ij,ij->j", some, response)
        missed[:, part] = response - phi @ ((phi.T @ some) / (values - modes.shift)[:, None])
        energy[part] = np.einsum("ij,ij->j", missed[:, part], modes.point.stiffness @ missed[:, part])
    missed = missed[:, energy > _ROUNDING_ENERGY * whole]
    turn, k, m = ritz_vectors(modes.point, missed)
    stiffness = np.concatenate([np.where(rigid, 0.0, modes.eigenvalues)[:keep], k])
    return ModalBasis(np.hstack([phi, missed @ turn]), stiffness, np.concatenate([np.ones(keep), m]), keep)


def modes_alone(modes: EigenSolution, members: Sequence[int]) -> ModalBasis:
    """Some of the modes and nothing else."""
    phi, some = modes.shapes[:, list(members)], np.array(members, dtype=int)
    stiffness = np.where(is_rigid(modes), 0.0, modes.eigenvalues)[some]

    def slopes(columns: Reals) -> Iterator[Reals]:
        few, back = _independent(columns, columns - (modes.point.mass @ phi) @ (phi.T @ columns))
        return (one @ back for one in _outside(modes, members, few))

    return ModalBasis(phi, stiffness, np.ones(len(some)), len(some), slopes)


def static_slopes(modes: EigenSolution, keep: int, vectors: Reals, forces: Reals, columns: Reals) -> Iterator[Reals]:
    """`Slopes` of the first `keep` modes Φ and of their static complements V = A P (n_free, x) of forces P.

    With A = Σ φφᵀ/λ over the other modes, A′ = −A K′ A − A (MΦΦᵀ)′ but for a part in the span of Φ.
    """
    point, phi = modes.point, modes.shapes[:, :keep]
    few, back = _independent(columns, columns - (point.mass @ phi) @ (phi.T @ columns))
    g = few.shape[1]
    static = static_complement(modes, keep, few) if vectors.shape[1] else np.zeros_like(few)
    pushed, inertia = forces.T @ phi, np.asarray(point.mass @ static)
    outside = _outside(modes, range(keep), np.hstack([few, inertia]))
    for i in range(point.n_parameters):
        by_stiffness = vectors.T @ (point.stiffness_derivatives[i] @ static)
        by_modes = pushed @ (phi.T @ (point.mass_derivatives[i] @ static) + outside[i, :, g:])
        yield np.vstack([outside[i, :, :g], -by_stiffness - by_modes]) @ back


def _independent(whole: Reals, columns: Reals) -> tuple[Reals, Reals]:
    """Orthonormal U (n, k) and R (k, g) with `columns` = U R but for what is rounding of the `whole` ones (n, g)."""
    size = np.linalg.norm(whole, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    U, R, order = la.qr(scaled, mode="economic", pivoting=True)
    kept = np.abs(np.diag(R)) > _ROUNDING_PART
    back = np.empty((int(kept.sum()), len(order)))
    back[:, order] = R[: len(back)] * size[order]
    return np.asarray(U[:, : len(back)]), back


def _outside(modes: EigenSolution, members: Sequence[int], rows: Reals) -> Reals:
    """(p, m, r) Φ′ᵀ rows of m modes by each parameter, for rows (n_free, r) that have no part in these modes."""
    p, m, r = modes.point.n_parameters, len(members), rows.shape[1]
    if not (m and r and p):
        return np.zeros((p, m, r))
    size = np.linalg.norm(rows, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    derivative = subspace_derivative(modes, members, sp.csr_array((rows / size).T), _SLOPE_ACCURACY)
    return np.asarray(derivative.outside.transpose(2, 1, 0) * size)


def static_complement(modes: EigenSolution, keep: int, forces: Reals) -> Reals:
    """(n_free, k) part of the static response to forces that the first `keep` modes do not contain.

    These modes include all rigid-body ones, so that the rest is elastic and its stiffness regular: inertia relief.
    """
    rest, values = modes.shapes[:, keep:], modes.eigenvalues[keep:]
    known = rest @ ((rest.T @ forces) / values[:, None])
    return np.asarray(known + complement(modes, 0.0, forces))


def residual_vectors(modes: EigenSolution, keep: int, forces: Reals) -> tuple[Reals, NDArray[np.bool_]]:
    """The columns of the static complement that are more than the rounding of the whole static response; which."""
    missed = static_complement(modes, keep, forces)
    energy = np.einsum("ij,ij->j", missed, modes.point.stiffness @ missed)
    whole = np.einsum("ij,ij->j", forces, modes.factor.solve(forces))
    some = energy > _ROUNDING_ENERGY * whole
    return np.asarray(missed[:, some]), np.asarray(some)


def ritz_vectors(point: ModelPoint, vectors: Reals) -> tuple[Reals, Reals, Reals]:
    """Independent combinations Q = VR of elastic vectors V, orthogonal in K and M, with QᵀKQ = 1 and QᵀMQ = θ.

    Returns R, the ones and θ. A vector that is not independent of the others is dropped.
    """
    k = vectors.T @ (point.stiffness @ vectors)
    size = np.sqrt(np.maximum(np.diag(k), 0.0))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
    energy, turn = la.eigh(scale[:, None] * (0.5 * (k + k.T)) * scale)
    kept = energy > _DEPENDENT * energy.max(initial=1.0)
    unit = scale[:, None] * turn[:, kept] / np.sqrt(energy[kept])
    moved = vectors @ unit
    m = moved.T @ (point.mass @ moved)
    theta, turn = la.eigh(0.5 * (m + m.T))
    return unit @ turn, np.ones(len(theta)), np.maximum(theta, 0.0)


def damping_forces(point: ModelPoint) -> Reals:
    """(n_free, k) independent forces of dashpots and of loss factors that act on few DOFs; none if they act on many."""
    n = point.configured.n_free
    ranges = [_range(matrix) for matrix in (point.viscous, point.hysteretic)]
    some = [one for one in ranges if one.shape[1] <= min(_MOST_DAMPER_RANK, n // 4)]
    return np.hstack([np.zeros((n, 0)), *some])


def _range(matrix: sp.csr_array) -> Reals:
    """Basis of the range of a symmetric matrix with few rows; without columns if these are many."""
    rows = np.flatnonzero(np.abs(matrix).sum(axis=1) > 0.0)
    out = np.zeros((matrix.shape[0], 0))
    if not 0 < len(rows) <= 12 * _MOST_DAMPER_RANK:
        return out
    values, vectors = la.eigh(matrix[rows][:, rows].toarray())
    some = np.abs(values) > _DEPENDENT * np.abs(values).max()
    out = np.zeros((matrix.shape[0], int(some.sum())))
    out[rows] = vectors[:, some]
    return out
