"""The dynamic stiffness Z(s) = s²M + sC + K + iH at a complex frequency s, and solves with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.configured import ModelPoint
from femtune.model.response.modal_damping import ModalDamper
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import Factor, SingularMatrixError

_CORRECTIONS = 4
"""Steps of iterative refinement at most."""
_REFINED = 1e-13
"""Relative correction after which a solution is as accurate as rounding allows."""
_LOST = 1e-5
"""Relative correction above which a solution is lost: the refinement does not converge for a singular Z."""
_NEAR_RESONANCE = 1e-2
"""Below this fraction of |s²|, |λ + s²| is so small that modal damping alone keeps Z regular."""

Solve = Callable[[NDArray], NDArray]


class NoSolutionError(la.LinAlgError):
    """Z(s) is singular to working precision."""


@dataclass(frozen=True, eq=False)
class DynamicStiffness:
    """Z(s) of a model point; `damper` adds modal damping. iH holds for the half Im s > 0 (e^{iωt}, ω > 0)."""

    point: ModelPoint
    damper: ModalDamper | None = None

    @cached_property
    def stiffness(self) -> sp.csr_array:
        """K + iH; real where no loss factor acts."""
        K, H = self.point.stiffness, self.point.hysteretic
        return sp.csr_array(K + 1j * H) if np.any(H.data) else K

    @cached_property
    def has_viscous(self) -> bool:
        """True where C is not zero."""
        return bool(np.any(self.point.viscous.data))

    def viscous_times(self, x: NDArray) -> NDArray:
        """(C + viscous modal damping) x."""
        out = np.asarray(self.point.viscous @ x)
        return out if self.damper is None or self.damper.hysteretic else out + self.damper.times(x)

    def stiffness_times(self, x: NDArray) -> NDArray:
        """(K + iH + hysteretic modal damping) x."""
        out = np.asarray(self.stiffness @ x)
        return out + 1j * self.damper.times(x) if self.damper is not None and self.damper.hysteretic else out

    def sparse(self, s: complex) -> sp.csr_array:
        """Z(s) without modal damping; real where it can be."""
        matrix = self.stiffness + _plain(s * s) * self.point.mass
        return sp.csr_array(matrix + _plain(s) * self.point.viscous if self.has_viscous else matrix)

    def times(self, s: complex, x: NDArray) -> NDArray:
        """Z(s) x."""
        out = self.stiffness_times(x) + s * s * (self.point.mass @ x)
        return np.asarray(out + s * self.viscous_times(x))

    def derivative_between(self, i: int, s: complex, y: NDArray, x: NDArray) -> NDArray:
        """yᵀ Z′(s) x by parameter i, for y (n, a) and x (n, b)."""
        return np.asarray(y.T @ self.derivative_times(i, s, x))

    def derivative_times(self, i: int, s: complex, x: NDArray) -> NDArray:
        """Z′(s) x by parameter i."""
        point = self.point
        out = self.stiffness_derivative_times(i, x) + s * s * (point.mass_derivatives[i] @ x)
        return np.asarray(out + s * self.viscous_derivative_times(i, x))

    def stiffness_derivative_times(self, i: int, x: NDArray) -> NDArray:
        """(K + iH + hysteretic modal damping)′ x by parameter i."""
        point = self.point
        out = np.asarray(point.stiffness_derivatives[i] @ x + 1j * (point.hysteretic_derivatives[i] @ x))
        damps = self.damper is not None and self.damper.hysteretic
        return out + 1j * self.damper.derivative_times(i, x) if damps else out  # type: ignore[union-attr]

    def viscous_derivative_times(self, i: int, x: NDArray) -> NDArray:
        """(C + viscous modal damping)′ x by parameter i."""
        out = np.asarray(self.point.viscous_derivatives[i] @ x)
        damps = self.damper is not None and not self.damper.hysteretic
        return out + self.damper.derivative_times(i, x) if damps else out  # type: ignore[union-attr]

    def solver(self, s: complex) -> Solve:
        """b -> Z(s)⁻¹ b, refined until the correction vanishes.

        Raises
        ------
        NoSolutionError : Z(s) is singular to working precision, seen from a correction that does not vanish
        """
        try:
            rough = self.rough_solver(s)
        except (SingularMatrixError, la.LinAlgError) as error:
            raise NoSolutionError(str(error)) from error

        def solve(b: NDArray) -> NDArray:
            return _refined(rough, lambda x: self.times(s, x), b)

        return solve

    def rough_solver(self, s: complex) -> Solve:
        """b -> Z(s)⁻¹ b, not refined (SingularMatrixError where a pivot is zero)."""
        if self.damper is None or not self.damper.rates.any():
            return factorise(self.sparse(s)).solve
        base, damped = self.sparse(s), self.damper.weights(complex(s))
        props, weights = self.grounded_dofs(s)
        if not len(props):
            return low_rank_solver(factorise(base), self.damper.momentum, damped)
        base = sp.csr_array(base + sp.diags_array(1j * np.bincount(props, weights, base.shape[0])))
        unit = np.zeros((base.shape[0], len(props)))
        unit[props, np.arange(len(props))] = 1.0
        columns = np.hstack([self.damper.momentum, unit])
        return low_rank_solver(factorise(base), columns, np.concatenate([damped, -1j * weights]))

    def grounded_dofs(self, s: complex) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """DOFs that are tied to ground by imaginary springs in the sparse part, and taken off again in the low rank.

        Near a resonance the sparse part alone would be singular: only the modal damping holds it.
        """
        assert self.damper is not None
        m = len(self.damper.rates)
        values = self.damper.modes.eigenvalues[:m]
        near = np.flatnonzero(np.abs(values + s * s) <= _NEAR_RESONANCE * abs(s * s))
        if not near.size:
            return near, np.zeros(0)
        size = np.abs(self.point.stiffness.diagonal())
        scaled = np.sqrt(size)[:, None] * self.damper.modes.shapes[:, near]
        order = la.qr(scaled.T, mode="r", pivoting=True)[1][: near.size]
        return np.asarray(order, dtype=np.int64), size[order]


def sparse_solver(matrix: sp.csr_array) -> Solve:
    """b -> A⁻¹b of a symmetric matrix, refined (NoSolutionError where A is singular to working precision)."""
    try:
        factor = factorise(matrix)
    except SingularMatrixError as error:
        raise NoSolutionError(str(error)) from error
    return lambda b: _refined(factor.solve, lambda x: np.asarray(matrix @ x), b)


def low_rank_solver(factor: Factor, columns: NDArray, weights: NDArray) -> Solve:
    """b -> (A + U diag(w) Uᵀ)⁻¹ b from the factors of A, U (n, m) and w (m,), by Woodbury's formula.

    Raises
    ------
    NoSolutionError : a pivot is zero; the function raises it too, where the factors of A give no finite solution
    """
    inverse = _finite(factor.solve(columns))
    small = _small_factor(_finite(np.eye(len(weights)) + weights[:, None] * (columns.T @ inverse)))

    def solve(b: NDArray) -> NDArray:
        x = _finite(factor.solve(b))
        return np.asarray(x - inverse @ la.lu_solve(small, (weights * (columns.T @ x).T).T))

    return solve


def _finite(values: NDArray) -> NDArray:
    if not np.isfinite(values).all():
        raise NoSolutionError("the factors give no finite solution")
    return values


def _small_factor(matrix: NDArray) -> tuple[NDArray, NDArray]:
    """As `scipy.linalg.lu_factor`, which only warns of a zero pivot."""
    lu, pivots, info = la.get_lapack_funcs("getrf", (matrix,))(matrix)
    if info:
        raise NoSolutionError("a pivot is zero")
    return lu, pivots


def _refined(rough: Solve, times: Solve, b: NDArray) -> NDArray:
    x = rough(b)
    size, last = _norms(x), np.inf
    for _ in range(_CORRECTIONS):
        step = rough(b - times(x))
        change = float(np.max(_norms(step) / np.where(size > 0.0, size, 1.0), initial=0.0))
        if not change < last:
            break
        x, last = x + step, change
        if change <= _REFINED:
            break
    if not (np.isfinite(x).all() and last <= _LOST):
        raise NoSolutionError("the solution is lost to rounding")
    return x


def _norms(x: NDArray) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(x, axis=0))


def _plain(s: complex) -> complex | float:
    return s.real if complex(s).imag == 0.0 else s
