"""Mass and stiffness reduced to the sensors by static condensation, for cross-orthogonality."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.linalg import eigh, qr
from scipy.sparse import csc_array, csr_array, sparray, spmatrix

from femtune.arrays import Reals
from femtune.modal import ModeSet
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.shape_criteria import mac_where_defined
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import SingularMatrixError

Sparse: TypeAlias = spmatrix | sparray
Solve = Callable[[Reals], Reals]

_INDEPENDENT = 1e-10
"""Pivot relative to the largest one, at or below which a sensor repeats what others measure."""
_SHIFT = 1e-2
"""Shift of the eigenvalues of a free structure relative to the lowest elastic one: far above rounding, far below the
elastic eigenvalues."""
_SAME_SHAPE = 0.8
"""Likeness of a mode of the reduced and of the full model, from which they are one."""


@dataclass(frozen=True)
class NotTested:
    """A comparison that was not made, and why."""

    reason: str

    def __str__(self) -> str:
        return f"not tested: {self.reason}"


@dataclass(frozen=True)
class ReducedMass:
    """Mass at the sensors and how well the reduction repeats the full model.

    Parameters
    ----------
    mass, stiffness : (k, k) at the sensors that were kept
    frequency_error : (m,) (reduced − full)/full of each model mode; NaN where no reduced mode resembles it
    labels : (m,) names of the model modes
    kept : (k,) positions of these sensors among all
    dropped : labels of sensors that only repeat combinations of those kept (such as a fourth on a rigid line)
    """

    mass: Reals
    stiffness: Reals
    frequency_error: Reals
    labels: tuple[str, ...]
    kept: tuple[int, ...]
    dropped: tuple[str, ...] = ()


def reduce_mass(
    K: Sparse, M: Sparse, C: Sparse | Reals, model: ModeSet, *, solve: Solve | None = None
) -> ReducedMass | NotTested:
    """Static reduction on what the sensors see: T = A⁻¹Cᵀ(C A⁻¹Cᵀ)⁻¹, M_s = TᵀMT, K_s = TᵀKT, with C T = 1.

    A is K; for a structure with rigid-body modes K + αM with α a hundredth of the lowest elastic eigenvalue.

    Parameters
    ----------
    K, M : (f, f) sparse symmetric, on the free DOFs
    C : (s, f) from free DOFs to sensors
    model : the model's modes at the s sensors (their frequencies and shapes say how good the reduction is)
    solve : solves A x = b for (f, s) right-hand sides where A is factorised already; only without rigid-body modes

    Returns
    -------
    ReducedMass, or NotTested with the reason in words: a sensor that cannot move, a mechanism, no elastic mode to
    set the shift. Sensors that depend on each other (more sensors on a rigid body than it has motions) make
    C A⁻¹Cᵀ singular; the redundant ones are dropped by QR with pivoting, which keeps the most independent.

    Source: Guyan (1965), generalised to sensors that are combinations of DOFs; Golub and Van Loan, Matrix
    Computations, section 5.4.2 (rank by QR with column pivoting).
    """
    rows = csc_array(C)
    shift = _shift(model)
    if shift is None:
        return NotTested("the model has rigid-body modes only")
    still = [label for label, size in zip(model.dofs.labels(), abs(rows).sum(axis=1)) if size == 0.0]
    if still:
        return NotTested(f"sensors that cannot move in the model: {', '.join(still)}")
    static = _static_shapes(K, M, rows, shift, solve)
    if static is None:
        return NotTested("the stiffness matrix is singular: a part of the model is a mechanism")
    flexibility = rows @ static
    kept = _independent(flexibility)
    if isinstance(kept, NotTested):
        return kept
    T = np.linalg.solve(flexibility[np.ix_(kept, kept)].T, static[:, kept].T).T
    return _reduced(K, M, T, model, kept)


def _shift(model: ModeSet) -> float | None:
    """0 for a supported structure; a small positive number where rigid-body modes exist; None without others."""
    eigenvalues = np.sort(model.eigenvalues)
    elastic = eigenvalues[eigenvalues > 1e-6 * eigenvalues.max(initial=0.0)]
    if not len(elastic):
        return None
    return _SHIFT * float(elastic[0]) if len(elastic) < len(eigenvalues) else 0.0


def _static_shapes(K: Sparse, M: Sparse, rows: csc_array, shift: float, solve: Solve | None) -> Reals | None:
    right = rows.T.toarray()
    if solve is not None and shift == 0.0:
        return solve(right)
    try:
        x = factorise(csr_array(K + shift * M)).solve(right)
    except SingularMatrixError:
        return None
    return x if np.isfinite(x).all() else None


def _independent(flexibility: Reals) -> list[int] | NotTested:
    """Positions of the largest set of sensors whose motions are independent, in their order."""
    diagonal = np.diag(flexibility)
    if (diagonal <= 0.0).any():
        return NotTested("the stiffness matrix is not positive definite at the sensors")
    scale = 1.0 / np.sqrt(diagonal)
    R, order = qr(scale[:, None] * flexibility * scale, mode="r", pivoting=True)[-2:]
    pivots = np.abs(np.diag(R))
    return sorted(int(k) for k in order[pivots > _INDEPENDENT * pivots[0]])


def _reduced(K: Sparse, M: Sparse, T: Reals, model: ModeSet, kept: list[int]) -> ReducedMass | NotTested:
    mass, stiffness = T.T @ (M @ T), T.T @ (K @ T)
    mass, stiffness = 0.5 * (mass + mass.T), 0.5 * (stiffness + stiffness.T)
    if np.linalg.eigvalsh(mass)[0] <= 0.0:
        return NotTested("the mass matrix reduced to the sensors is not positive definite: some carry no mass")
    dropped = tuple(label for i, label in enumerate(model.dofs.labels()) if i not in kept)
    error = _frequency_error(stiffness, mass, model, kept)
    return ReducedMass(mass, stiffness, error, model.labels, tuple(kept), dropped)


def _frequency_error(stiffness: Reals, mass: Reals, model: ModeSet, kept: list[int]) -> Reals:
    """Reduced against full frequencies, matched by shape in the reduced mass; rigid-body modes count as exact."""
    eigenvalues, vectors = eigh(stiffness, mass)
    likeness = np.nan_to_num(mac_where_defined(model.shapes[kept], vectors, mass))
    error = np.full(len(model), np.nan)
    full = model.eigenvalues
    for i, j in zip(*linear_sum_assignment(likeness, maximize=True)):
        if likeness[i, j] >= _SAME_SHAPE:
            elastic = full[i] > 1e-6 * full.max()
            error[i] = np.sqrt(max(eigenvalues[j], 0.0) / full[i]) - 1.0 if elastic else 0.0
    return error
