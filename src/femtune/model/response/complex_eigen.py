"""Complex modes: poles and shapes of a structure with dashpots, loss factors and modal damping."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Notice
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.dynamic_stiffness import DynamicStiffness, Solve
from femtune.model.response.modal_damping import DampingRatios, modal_damper
from femtune.model.response.rigid import is_rigid
from femtune.model.solvers.interface import SingularMatrixError

# ----------------------------------------------------------------------------------------------------
# Eigenpairs of (λ²M + λC + K + iH)ψ = 0 near the origin, through the inverted linear pencil.
#
# State (x, w) with w = λx/s₀, inverted at s₀ > 0 where Z(s₀) is regular whatever moves freely: one step solves
# Z(s₀)x₁ = Cx₀ + s₀M(x₀ + w₀) and takes w₁ = x₁ − x₀/s₀; its eigenvalues are θ = 1/(s₀ − λ). Source: F. Tisseur, K.
# Meerbergen, The quadratic eigenvalue problem, SIAM Review 43 (2001), section 5.


DENSE_UP_TO = 150
"""DOFs up to which all poles are computed densely, so that none can be missed."""
_UNDAMPED = 1e-8
"""Damping force on a rigid-body motion, relative to the parts that cancel, below which no damping acts on it."""
_INFINITE = 1e-13
"""θ below this fraction of the largest are poles at infinity, of directions without mass."""
_LEAST_POLE = 1e-6
_LARGEST_ROUNDING = 1e-2
"""|λ| relative to s₀: below the first a pole is zero in any case, above the second it is never rounding."""
_ROUNDING_OF_SUMS = 64 * np.finfo(float).eps
"""Rounding of φᵀKφ relative to the sum of the magnitudes of its terms: some units in the last place."""


@dataclass(frozen=True, eq=False)
class QuadraticProblem:
    """The eigenproblem of a dynamic stiffness.

    Parameters
    ----------
    origin : s₀ in rad/s
    free : (n_free, f) rigid-body motions of unit mass on which no damping acts; they are removed
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
        return np.where(np.abs(poles) <= self.rounding_of(poles, vectors), 0.0, poles), vectors, every

    def rounding_of(self, poles: Poles, vectors: NDArray) -> Reals:
        """|λ| below which a pole is the rounding of a rigid-body mode's: what K leaves, over what C does."""
        point, size = self.stiffness.point, np.abs(vectors)
        left = _ROUNDING_OF_SUMS * np.einsum("ij,ij->j", size, np.abs(point.stiffness) @ size)
        slope = 2.0 * poles * (point.mass @ vectors) + self.stiffness.viscous_times(vectors)
        damped = np.abs(np.einsum("ij,ij->j", vectors.conj(), slope))
        rounding = np.divide(left, damped, out=np.zeros_like(left), where=damped > 0.0)
        return np.asarray(np.clip(rounding, _LEAST_POLE * self.origin, _LARGEST_ROUNDING * self.origin))

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
    return FemtuneError("complex.no-convergence", reason=why)


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
    return np.asarray(rigid @ turn[size <= _UNDAMPED].T)


def _touch(matrix: NDArray, rigid: Reals) -> Reals:
    """Damping forces of rigid motions, relative to the parts that cancel."""
    parts = np.linalg.norm(np.abs(matrix) @ np.abs(rigid))
    return np.asarray(matrix @ rigid) / (parts if parts > 0.0 else 1.0)


Poles = NDArray[np.complex128]

_REAL = 1e-8
"""|Im λ| relative to |λ| below which a pole is real: half of the digits of a double."""
_REPEATED = 1e-7
"""Distance of two poles, relative to their size, below which they coincide: as `_DEFECTIVE`."""
_WITHOUT_POLISHING = 1e-11
"""Residual below which a mode needs no further step of inverse iteration."""
_ACCURACY = 1e-8
"""Residual in energy up to which a mode is accepted."""
_BACKWARD_ROUNDING = 1e-12
_LARGEST_RESIDUAL = 1e-5
"""On very fine meshes a residual is the rounding of large parts: if the backward error is below the first, a residual
up to the second is accepted."""
_DEFECTIVE = 1e-7
"""Smallest singular value of modal A, relative to its parts, below which the poles have no independent vectors: at a
defective pole rounding of ε moves poles and vectors by √ε."""
_EXTRA_POLES = 8
"""Poles that are computed beyond twice the wanted ones."""
_JUST_ABOVE = 1.005
"""Factor of the largest |λ| up to which real modes are counted: damping shifts |λ| by little."""


@dataclass(frozen=True, eq=False)
class ComplexModes:
    """The complex modes of least |λ|, each pair λ, λ* once by its pole in the upper half plane.

    Parameters
    ----------
    poles : (m,) λ in rad/s; rigid-body modes come first and have λ = 0. With loss factors the poles are those of the
        dynamic stiffness for ω > 0; the response for ω < 0 is its conjugate, and other poles have no meaning
    shapes : (n_free, m), ψᵀ(2λM + C)ψ = 1 (modal A = 1, so that H = Σ ψψᵀ/(iω − λ) + …), the largest entry with a
        positive real part; rigid-body modes that no damping touches have ψᵀMψ = 1 instead, because their A is zero
    kinds : "rigid", "oscillating", or "real" for an overdamped motion or the creep of a dashpot and a spring
    residuals : (m,) relative residual of (λ²M + λC + K + iH)ψ = 0, measured as energy
    complete : True where all poles of the model were computed, so that none can be missing
    """

    stiffness: DynamicStiffness = field(repr=False)
    poles: Poles
    shapes: NDArray[np.complex128] = field(repr=False)
    kinds: tuple[str, ...]
    residuals: Reals
    complete: bool
    notices: tuple[Notice, ...] = ()

    def __len__(self) -> int:
        return len(self.poles)

    @property
    def freq_hz(self) -> Reals:
        """(m,) |λ|/2π."""
        return np.asarray(np.abs(self.poles) / (2.0 * np.pi))

    @property
    def damping_ratio(self) -> Reals:
        """(m,) −Re λ/|λ|; 1 for real poles of a stable motion, NaN for rigid-body modes."""
        size = np.abs(self.poles)
        return np.divide(-self.poles.real, size, out=np.full(len(size), np.nan), where=size > 0.0)

    @property
    def phase_collinearity(self) -> Reals:
        """(m,) |ψᵀMψ|²/(ψᴴMψ)²: 1 where all points move in phase or opposite phase."""
        m_psi = self.stiffness.point.mass @ self.shapes
        bilinear = np.abs(np.einsum("ij,ij->j", self.shapes, m_psi))
        return np.asarray((bilinear / np.einsum("ij,ij->j", self.shapes.conj(), m_psi).real) ** 2)


def complex_modes(modes: EigenSolution, count: int | None = None, damping: DampingRatios | None = None) -> ComplexModes:
    """The `count` complex modes of least |λ|; by default as many as the wanted real modes.

    Small models are solved densely, so that no pole is missing; of larger ones the poles are found by iteration about
    a point on the positive real axis, and a notice compares their number with that of the real modes.

    Raises
    ------
    FemtuneError : ``complex.no-convergence``, ``complex.inaccurate``, ``response.defective``,
        ``response.damping-ratio``
    """
    stiffness = DynamicStiffness(modes.point, modal_damper(modes, damping))
    return modes_of(modes, stiffness, modes.wanted if count is None else max(count, 1))


def modes_of(modes: EigenSolution, stiffness: DynamicStiffness, count: int) -> ComplexModes:
    """The complex modes of a dynamic stiffness; see `complex_modes`."""
    problem = quadratic_problem(modes, stiffness)
    wanted = max(count - problem.free.shape[1], 0)
    poles, vectors, complete = _upper(problem, wanted)
    poles, vectors = _polished(modes, stiffness, poles, vectors)
    psi = _normalised(stiffness, poles, vectors)
    residuals = energy_residuals_of(modes, stiffness, poles, psi)
    _check(stiffness, poles, psi, residuals)
    f = problem.free.shape[1]
    kinds = ("rigid",) * f + tuple(_kind(p) for p in poles)
    notices = () if complete else (_not_proven(modes, np.abs(poles), f),)
    return ComplexModes(
        stiffness, np.concatenate([np.zeros(f), poles]), np.hstack([problem.free, psi]), kinds,
        np.concatenate([np.zeros(f), residuals]), complete, notices,
    )  # fmt: skip


def _upper(problem: QuadraticProblem, wanted: int) -> tuple[Poles, NDArray, bool]:
    """The wanted poles of least |λ| in the upper half plane and on the real axis, and whether all were computed."""
    asked = 2 * wanted + _EXTRA_POLES
    while True:
        poles, vectors, complete = problem.nearest(asked)
        keep = poles.imag >= -_REAL * np.abs(poles)
        # these are the poles nearest to the origin of the pencil: only inside this circle none is missing
        radius = np.inf if complete else float(np.abs(poles - problem.origin).max()) - problem.origin
        keep &= np.abs(poles) < radius
        if complete or keep.sum() >= wanted:
            break
        asked *= 2
    order = np.flatnonzero(keep)[np.argsort(np.abs(poles[keep]), kind="stable")][:wanted]
    real = np.abs(poles[order].imag) <= _REAL * np.abs(poles[order])
    return np.where(real, poles[order].real, poles[order]), vectors[:, order], complete


def _kind(pole: complex) -> str:
    if pole == 0.0:
        return "rigid"
    return "real" if pole.imag == 0.0 else "oscillating"


def _normalised(stiffness: DynamicStiffness, poles: Poles, vectors: NDArray) -> NDArray:
    """Vectors with modal A = 1, bilinearly orthogonal where poles coincide."""
    out = vectors.astype(complex)
    for first, last in _groups(poles):
        v, pole = out[:, first:last], complex(poles[first])
        a = v.T @ gradient_by_pole(stiffness, pole, v)
        size = _size_of_a(stiffness, pole, v)
        if la.svdvals(a / size)[-1] <= _DEFECTIVE:
            raise _defective(pole)
        out[:, first:last] = v @ la.sqrtm(la.inv(a))
    largest = out[np.argmax(np.abs(out), axis=0), np.arange(out.shape[1])]
    return np.asarray(np.where(largest.real < 0.0, -out, out))


def _groups(poles: Poles) -> list[tuple[int, int]]:
    """Runs of poles that coincide."""
    apart = np.flatnonzero(np.abs(np.diff(poles)) > _REPEATED * np.abs(poles[1:])) + 1
    ends = [0, *apart.tolist(), len(poles)]
    return [(a, b) for a, b in itertools.pairwise(ends) if b > a]


def gradient_by_pole(stiffness: DynamicStiffness, pole: complex, v: NDArray) -> NDArray:
    """dZ/dλ v = (2λM + C) v."""
    return np.asarray(2.0 * pole * (stiffness.point.mass @ v) + stiffness.viscous_times(v))


def _size_of_a(stiffness: DynamicStiffness, pole: complex, v: NDArray) -> float:
    mass = np.einsum("ij,ij->j", v.conj(), stiffness.point.mass @ v)
    viscous = np.einsum("ij,ij->j", v.conj(), stiffness.viscous_times(v))
    return float(np.max(2.0 * abs(pole) * np.abs(mass) + np.abs(viscous)))


def _defective(pole: complex) -> FemtuneError:
    return FemtuneError("response.defective", values={"|pole| (rad/s)": f"{abs(pole):.6g}"})


def energy_residuals_of(modes: EigenSolution, stiffness: DynamicStiffness, poles: Poles, psi: NDArray) -> Reals:
    """√(rᴴ(K − σM)⁻¹r / ψᴴ(K − σM)ψ) of each mode, with the real modes' shift σ."""
    if not len(poles):
        return np.zeros(0)
    r = np.column_stack([stiffness.times(complex(p), psi[:, j]) for j, p in enumerate(poles)])
    shifted = modes.point.stiffness @ psi - modes.shift * (modes.point.mass @ psi)
    left = np.einsum("ij,ij->j", r.conj(), modes.factor.solve(r)).real
    return np.asarray(np.sqrt(np.abs(left) / np.einsum("ij,ij->j", psi.conj(), shifted).real))


def _polished(
    modes: EigenSolution, stiffness: DynamicStiffness, poles: Poles, vectors: NDArray
) -> tuple[Poles, NDArray]:
    """Poles far above the lowest lose digits to these: each is refined by a step of inverse iteration."""
    poles, vectors = poles.astype(complex), vectors.astype(complex)
    for j in np.flatnonzero(
        (poles != 0.0) & (energy_residuals_of(modes, stiffness, poles, vectors) > _WITHOUT_POLISHING)
    ):
        poles[j], vectors[:, j] = _inverse_step(stiffness, complex(poles[j]), vectors[:, j])
    return poles, vectors


def _inverse_step(stiffness: DynamicStiffness, pole: complex, v: NDArray) -> tuple[complex, NDArray]:
    try:
        y = stiffness.rough_solver(pole)(gradient_by_pole(stiffness, pole, v))
    except (SingularMatrixError, la.LinAlgError):
        return pole, v
    away = (v @ gradient_by_pole(stiffness, pole, v)) / (gradient_by_pole(stiffness, pole, v) @ y)
    better = pole - complex(away)
    moved = y / np.linalg.norm(y)
    return (complex(better.real) if pole.imag == 0.0 else better), moved


def backward_error(stiffness: DynamicStiffness, pole: complex, psi: NDArray) -> float:
    """Residual of one mode relative to the parts that cancel in it, DOFs scaled by their own stiffness and mass."""
    point, size = stiffness.point, abs(pole)
    scale = np.sqrt(np.abs(point.stiffness.diagonal()) + size**2 * np.abs(point.mass.diagonal()))
    scale = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    parts = np.abs(stiffness.stiffness) @ np.abs(psi) + size**2 * (np.abs(point.mass) @ np.abs(psi))
    return float(np.linalg.norm(scale * stiffness.times(pole, psi)) / np.linalg.norm(scale * parts))


def _check(stiffness: DynamicStiffness, poles: Poles, psi: NDArray, residuals: Reals) -> None:
    """Refuse a residual above 1e-8 that is not the rounding of large parts, as that of very fine meshes is."""
    for j in np.flatnonzero(~(residuals <= _ACCURACY)):
        rounding = backward_error(stiffness, complex(poles[j]), psi[:, j]) <= _BACKWARD_ROUNDING
        if not (rounding and residuals[j] <= _LARGEST_RESIDUAL):
            raise FemtuneError("complex.inaccurate", values={"pole (rad/s)": f"{poles[j]:.6g}"}, residual=residuals[j])


def _not_proven(modes: EigenSolution, sizes: Reals, rigid: int) -> Notice:
    top = float(sizes.max(initial=0.0))
    real = int((modes.eigenvalues <= (top * _JUST_ABOVE) ** 2).sum())
    return Notice("complex.not-counted", level="info", count=len(sizes) + rigid, top_hz=top / (2.0 * np.pi), real=real)
