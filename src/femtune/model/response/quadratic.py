"""Eigenpairs of (λ²M + λC + K + iH)ψ = 0 near the origin, through the inverted linear pencil.

State (x, w) with w = λx/s₀, inverted at s₀ > 0 where Z(s₀) is regular whatever moves freely: one step solves
Z(s₀)x₁ = Cx₀ + s₀M(x₀ + w₀) and takes w₁ = x₁ − x₀/s₀; its eigenvalues are θ = 1/(s₀ − λ).
Source: F. Tisseur, K. Meerbergen, The quadratic eigenvalue problem, SIAM Review 43 (2001), section 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.eigen import EigenSolution
from femtune.model.factorise import SingularMatrixError
from femtune.model.response.dynamic_stiffness import DynamicStiffness, Solve
from femtune.model.response.rigid import is_rigid

Reals = NDArray[np.float64]
Poles = NDArray[np.complex128]

DENSE_UP_TO = 150
_UNTOUCHED, _INFINITE = 1e-8, 1e-13
_ZERO, _LARGEST_ZERO, _EPS = 1e-6, 1e-2, 64 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class QuadraticProblem:
    """The eigenproblem of a dynamic stiffness.

    Parameters
    ----------
    origin : s₀ in rad/s
    free : (n_free, f) rigid-body motions of unit mass that no damping touches; they are taken out
    """

    stiffness: DynamicStiffness
    origin: float
    free: Reals

    @property
    def n(self) -> int:
        """Number of free DOFs."""
        return self.stiffness.point.configured.n_free

    def nearest(self, count: int) -> tuple[Poles, NDArray, bool]:
        """At least min(count, all) poles nearest to the origin s₀, their vectors, and whether they are all.

        Raises
        ------
        FemtuneError : ``complex.no-convergence``
        """
        solve = self._solver()
        every = self.n <= DENSE_UP_TO or count >= 2 * self.n - 2
        theta, y = self._all(solve) if every else self._some(solve, count)
        finite = np.abs(theta) > _INFINITE * np.abs(theta).max(initial=0.0)
        poles, vectors = self.origin - 1.0 / theta[finite], y[: self.n, finite]
        return np.where(np.abs(poles) <= self._rounding(poles, vectors), 0.0, poles), vectors, every

    def _rounding(self, poles: Poles, vectors: NDArray) -> Reals:
        """|λ| below which a pole is the rounding of a rigid-body mode's: what K leaves, over what C does."""
        point, size = self.stiffness.point, np.abs(vectors)
        left = _EPS * np.einsum("ij,ij->j", size, np.abs(point.stiffness) @ size)
        slope = 2.0 * poles * (point.mass @ vectors) + self.stiffness.viscous_times(vectors)
        damped = np.abs(np.einsum("ij,ij->j", vectors.conj(), slope))
        rounding = np.divide(left, damped, out=np.zeros_like(left), where=damped > 0.0)
        return np.asarray(np.clip(rounding, _ZERO * self.origin, _LARGEST_ZERO * self.origin))

    def _solver(self) -> Solve:
        try:
            return self.stiffness.rough_solver(self.origin)
        except (SingularMatrixError, la.LinAlgError) as error:
            raise _no_convergence(str(error)) from error

    def _step(self, solve: Solve, y: NDArray) -> NDArray:
        s, M, n = self.origin, self.stiffness.point.mass, self.n
        y = self._elastic(y)
        x = solve(self.stiffness.viscous_times(y[:n]) + s * (M @ (y[:n] + y[n:])))
        return self._elastic(np.concatenate([x, x - y[:n] / s]))

    def _elastic(self, y: NDArray) -> NDArray:
        if not self.free.shape[1]:
            return y
        M = self.stiffness.point.mass
        parts = [x - self.free @ (self.free.T @ (M @ x)) for x in (y[: self.n], y[self.n :])]
        return np.concatenate(parts)

    def _all(self, solve: Solve) -> tuple[NDArray, NDArray]:
        theta, y = la.eig(self._step(solve, np.eye(2 * self.n)))
        return theta, y

    def _some(self, solve: Solve, count: int) -> tuple[NDArray, NDArray]:
        size = 2 * self.n
        start = self._step(solve, np.random.default_rng(3).standard_normal(size))
        step = spla.LinearOperator((size, size), matvec=lambda y: self._step(solve, y.ravel()), dtype=start.dtype)
        try:
            theta, y = spla.eigs(step, k=min(count, size - 2), v0=start, tol=0.0)
        except spla.ArpackError as error:
            raise _no_convergence(str(error)) from error
        return theta, y


def _no_convergence(why: str) -> FemtuneError:
    return FemtuneError(
        "complex.no-convergence",
        f"the complex modes could not be found: {why}",
        hint="ask for fewer modes; look for nearly loose parts and for dashpots of extreme size",
    )


def quadratic_problem(modes: EigenSolution, stiffness: DynamicStiffness) -> QuadraticProblem:
    """The eigenproblem, inverted at a frequency of the size of the lowest elastic modes."""
    return QuadraticProblem(stiffness, float(np.sqrt(abs(modes.shift))), undamped_rigid(modes, stiffness))


def undamped_rigid(modes: EigenSolution, stiffness: DynamicStiffness) -> Reals:
    """(n_free, f) rigid-body motions of unit mass that neither dashpots nor loss factors touch."""
    rigid = modes.shapes[:, is_rigid(modes)]
    point = stiffness.point
    touched = np.vstack([_touch(A, rigid) for A in (point.viscous, point.hysteretic)])
    if not rigid.shape[1]:
        return rigid
    _, size, turn = la.svd(touched, full_matrices=False)
    return np.asarray(rigid @ turn[size <= _UNTOUCHED].T)


def _touch(matrix: NDArray, rigid: Reals) -> Reals:
    """Damping forces of rigid motions, relative to the parts that cancel."""
    parts = np.linalg.norm(np.abs(matrix) @ np.abs(rigid))
    return np.asarray(matrix @ rigid) / (parts if parts > 0.0 else 1.0)
