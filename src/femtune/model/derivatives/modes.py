"""Exact derivatives of eigenvalues and eigenvectors, for single modes and for clusters of close or repeated ones.

A mode is a cluster of one. What is differentiated is the invariant subspace: inside it the vectors are fixed only
up to a rotation, so functions of the subspace (aligned shapes, Φ̂ᵀKΦ̂) are what residuals are made of.
Sources: Fox and Kapoor 1968 (modal superposition), Dailey 1989 (repeated eigenvalues).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.eigen.pencil import Pencil
from femtune.model.eigen.solution import EigenSolution
from femtune.model.solvers.interface import Factor
from femtune.model.solvers.small import DENSE_UP_TO as SMALL_UP_TO

_TOLERANCE = 1e-13
"""Residual in energy, relative to the force, at which the conjugate gradients stop."""
ENOUGH = 1e-7
"""The same that is accepted if rounding prevents a smaller one."""
_LEAST_PART = 1e-12
"""Energy of a force, relative to the whole force, below which the rest of a second pass is rounding."""
MOST_STEPS = 400
"""Steps of the conjugate gradients."""
_REPEATED = 1e-9
"""|λ_j − λ_h| relative to λ_j − σ below which two modes cross exactly: the quotient would have no digits."""
STURM_FACTOR_FROM = 60_000
"""DOFs from which on a solution keeps the factors of the Sturm count, and not those of its own shift."""
_PENCILS: WeakKeyDictionary[ModelPoint, Pencil] = WeakKeyDictionary()
_FACTORS: WeakKeyDictionary[EigenSolution, Factor] = WeakKeyDictionary()


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
    error : estimated error of `outside` relative to the largest entry of each mode's derivative at these rows, the
        worst mode's; 0 where the equations were solved to rounding, None where it was not kept

    Then CΦ′ = outside + CΦ(−½ΦᵀM′Φ + Ω) with a skew Ω that the choice of vectors in the subspace decides, and
    λ′ = (stiffness − λ·mass)_jj for a single mode.
    """

    eigenvalues: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    mass: NDArray[np.float64]
    outside: NDArray[np.float64]
    shapes: NDArray[np.float64]
    error: float | None = None

    @property
    def eigenvalue_gradient(self) -> NDArray[np.float64]:
        """(k,) derivative of λ of a single mode."""
        return self.stiffness[:, 0, 0] - self.eigenvalues[0] * self.mass[:, 0, 0]

    @property
    def shape_gradient(self) -> NDArray[np.float64]:
        """(rows, k) derivative of C φ of a single mass-normalised mode."""
        return self.outside[:, 0, :] - 0.5 * self.shapes[:, :1] * self.mass[None, :, 0, 0]


def exact_derivative(
    solution: EigenSolution, members: Sequence[int], rows: sp.csr_array | None = None
) -> SubspaceDerivative:
    """Derivatives of the subspace of some modes through ∂K/∂x and ∂M/∂x as matrices: for small models.

    All parameters are solved for at once. Arguments and errors as of `subspace_derivative`.
    """
    members = list(members)
    if len(members) == 1 and members[0] < solution.wanted and len(solution.shapes) <= SMALL_UP_TO:
        if solution not in _SINGLE:
            _SINGLE[solution] = _SingleModes(solution)
        return _SINGLE[solution].of(members[0], rows)
    phi = solution.shapes[:, members]
    forces, k, m = _forces(solution, members)
    outside = _outside(solution, members, forces)
    n, c, p = outside.shape
    observe = rows if rows is not None else sp.eye_array(n, format="csr")
    seen = (observe @ outside.reshape(n, c * p)).reshape(observe.shape[0], c, p)
    return SubspaceDerivative(solution.eigenvalues[members], k, m, seen, observe @ phi, 0.0)


class _SingleModes:
    """Derivatives of all wanted modes of a small model as single modes: one by one, calls would take most of the time.

    Parameters
    ----------
    solution : of no more than `SMALL_UP_TO` free DOFs
    """

    def __init__(self, solution: EigenSolution) -> None:
        # without the solution itself, which owns what is kept here
        count, point = solution.wanted, solution.point
        values, phi = solution.eigenvalues[:count], solution.shapes[:, :count]
        k, m = (stack @ phi for stack in point.small_derivatives)
        self._stiffness, self._mass = (np.einsum("nc,knc->ck", phi, one) for one in (k, m))
        forces = np.moveaxis(k - m * values, 0, -1).reshape(len(phi), -1)
        acts = np.flatnonzero(forces.any(axis=0))
        mode = acts // max(point.n_parameters, 1)
        gaps = inverse_gaps(solution, [[j] for j in range(count)])
        self._outside = np.zeros_like(forces)
        self._outside[:, acts] = outside(solution, values[mode], gaps[:, mode], forces[:, acts])
        self._values, self._phi, self._k = values, phi, point.n_parameters
        self._seen: tuple[sp.csr_array | None, Reals, Reals] = (None, self._outside, phi)

    def of(self, mode: int, rows: sp.csr_array | None) -> SubspaceDerivative:
        """Of one of them, at some rows."""
        # read and replaced whole, since threads ask for modes of one solution
        known = self._seen
        if rows is not known[0]:
            at = (self._outside, self._phi) if rows is None else (rows @ self._outside, rows @ self._phi)
            known = self._seen = (rows, *at)
        _, seen, shapes = known
        by_mode = seen.reshape(len(seen), len(self._values), self._k)
        k, m = (one[mode][:, None, None] for one in (self._stiffness, self._mass))
        column = slice(mode, mode + 1)
        return SubspaceDerivative(self._values[column], k, m, by_mode[:, column], shapes[:, column], 0.0)


_SINGLE: WeakKeyDictionary[EigenSolution, _SingleModes] = WeakKeyDictionary()


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
    """Part of Φ′ outside the cluster, (n, c, k)."""
    gaps, out = inverse_gaps(solution, [members]), np.zeros_like(forces)
    # a damping, or a parameter of another part of the structure, does not change the modes
    acts = np.flatnonzero(forces.any(axis=(0, 1)))
    for j, member in enumerate(members):
        out[:, j, acts] = outside(solution, solution.eigenvalues[[member]], gaps[:, [j]], forces[:, j, acts])
    return out


def outside(solution: EigenSolution, eigenvalues: Reals, gaps: Reals, forces: Reals) -> Reals:
    """u (n, k) with (K − λM)u = −f, without the part in the modes whose gap is zero.

    The part in known modes is superposed, the rest is solved for by iteration. This is repeated for the residual, since
    the further modes are less accurate than the wanted ones.

    Parameters
    ----------
    eigenvalues : λ of each column, or one for all
    gaps : (m, k) or (m, 1) from `inverse_gaps`
    forces : f (n, k)
    """
    known, pencil, phi = Complement(solution), pencil_of(solution.point), solution.shapes
    # relative to the whole force: if it lies in the known modes, the rest is rounding
    size = known.energy(forces)
    rest, out = forces, np.zeros_like(forces)
    for least in (size, _LEAST_PART * size):
        out += phi @ ((phi.T @ rest) * gaps) + known.solve(eigenvalues, -rest, least, ENOUGH)
        rest = forces + pencil.stiffness @ out - eigenvalues * (pencil.mass @ out)
    return out


def inverse_gaps(solution: EigenSolution, clusters: Sequence[Sequence[int]]) -> Reals:
    """(m, c) 1/(λ_j − λ_h) of all known modes h and the modes j of the clusters, one after the other.

    Zero for modes of one cluster, and for a mode outside that crosses a member exactly, so that no infinity spreads.
    """
    members = [j for cluster in clusters for j in cluster]
    values = solution.eigenvalues
    gap = values[members] - values[:, None]
    apart = np.abs(gap) > _REPEATED * (values[members] - solution.shift)
    at = 0
    for cluster in clusters:
        apart[list(cluster), at : at + len(cluster)] = False
        at += len(cluster)
    return np.divide(1.0, gap, out=np.zeros_like(gap), where=apart)


def complement(solution: EigenSolution, eigenvalue: float, b: Reals) -> Reals:
    """y (n, k) ⟂_M all known modes with (K − λM)y = b, where b (n, k) is freed of its part in them first.

    Raises
    ------
    FemtuneError : ``derivative.not-converged``
    """
    known = Complement(solution)
    return known.solve(eigenvalue, b, known.energy(b))


class Complement:
    """The M-orthogonal complement of all known modes, which are the lowest.

    K − λM is positive definite there, and so is the preconditioner K − τM, even where its shift τ lies among the
    known modes.
    """

    def __init__(self, solution: EigenSolution) -> None:
        self._pencil, self._phi = pencil_of(solution.point), solution.shapes
        shift, self._factor = deflated_factor(solution)
        self._weights = 1.0 / np.abs(solution.eigenvalues - shift)
        self._m_phi = self._pencil.mass @ self._phi

    def energy(self, b: Reals) -> Reals:
        """(k,) bᵀ(K − τM)⁻¹b, the known modes' parts with their size."""
        r = self._without_modes(b)
        inside = ((self._phi.T @ b) ** 2).T @ self._weights
        return np.asarray(inside + np.abs(np.einsum("ij,ij->j", r, self._precondition(r))))

    def solve(self, eigenvalue: float | Reals, b: Reals, least: Reals, tolerance: float = _TOLERANCE) -> Reals:
        """y (n, k) in the complement with (K − λM)y = b there, by conjugate gradients.

        Parameters
        ----------
        eigenvalue : λ, or one for each column (k,)
        least : (k,) energies of forces, to which at least the tolerance is relative

        Raises
        ------
        FemtuneError : ``derivative.not-converged``
        """
        r = self._without_modes(b)
        y, z = np.zeros_like(b), self._precondition(r)
        d, rho = z.copy(), np.einsum("ij,ij->j", r, z)
        progress = SeriesProgress(np.maximum(np.abs(rho), least), tolerance)
        for _ in range(MOST_STEPS):
            if progress.is_done(rho):
                return y
            q = self._pencil.stiffness @ d - eigenvalue * (self._pencil.mass @ d)
            q -= self._m_phi @ (self._phi.T @ q)
            alpha = np.where(progress.done, 0.0, _ratio(rho, np.einsum("ij,ij->j", d, q)))
            y, r = y + alpha * d, r - alpha * q
            z = self._precondition(r)
            new = np.einsum("ij,ij->j", r, z)
            d, rho = z + _ratio(new, rho) * d, new
        if progress.is_enough:
            return y
        raise not_converged(float(np.max(eigenvalue)))

    def _without_modes(self, b: Reals) -> Reals:
        return np.asarray(b - self._m_phi @ (self._phi.T @ b))

    def _precondition(self, r: Reals) -> Reals:
        z = self._factor.solve(r)
        return np.asarray(z - self._phi @ (self._m_phi.T @ z))


class SeriesProgress:
    """Which columns have converged: further steps on them would accumulate rounding."""

    def __init__(self, start: Reals, tolerance: float) -> None:
        self._start, self._aim = np.where(start > 0.0, start, 1.0), tolerance**2
        self._best, self.done = np.full(len(start), np.inf), np.zeros(len(start), bool)

    def is_done(self, rho: Reals) -> bool:
        """True where no column is left, at the energies rho of the residuals."""
        left = np.abs(rho) / self._start
        self._best = np.minimum(self._best, left)
        self.done |= (left <= self._aim) | ((self._best <= ENOUGH**2) & (left > 100.0 * self._best))
        return bool(self.done.all())

    @property
    def is_enough(self) -> bool:
        """True where all columns came near at least."""
        return bool((self._best <= ENOUGH**2).all())


def not_converged(eigenvalue: float) -> FemtuneError:
    """The error that the part of a derivative outside the known modes was not found."""
    return FemtuneError("derivative.not-converged", frequency_hz=np.sqrt(max(eigenvalue, 0.0)) / (2 * np.pi))


def pencil_of(point: ModelPoint) -> Pencil:
    """K and M of a point ready for products, made once."""
    if point not in _PENCILS:
        _PENCILS[point] = Pencil(point.symmetric_stiffness, point.symmetric_mass)
    return _PENCILS[point]


def deflated_factor(solution: EigenSolution) -> tuple[float, Factor]:
    """A shift τ and factors of K − τM, which is positive definite on the M-orthogonal complement of the known modes.

    Which of the solution's two shifts it is depends on what every copy of the solution knows, and not on the factors
    that are available, so that a solution that was read from a file gives the same numbers. Large solutions have the
    factors of the Sturm count.
    """
    if len(solution.shapes) < STURM_FACTOR_FROM or solution.sturm_count < 0:
        return solution.shift, solution.factor
    factor = _sturm_factor(solution)
    # a solver that does not exchange pivots is not accurate if the matrix is indefinite
    return (solution.shift, solution.factor) if factor.name == "SuperLU" else (solution.sturm_shift, factor)


def _sturm_factor(solution: EigenSolution) -> Factor:
    if solution.sturm_factor is not None:
        return solution.sturm_factor
    if solution not in _FACTORS:
        _FACTORS[solution] = pencil_of(solution.point).factorise(solution.sturm_shift)
    return _FACTORS[solution]


def _ratio(a: Reals, b: Reals) -> Reals:
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)
