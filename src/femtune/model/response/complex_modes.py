"""Complex modes: poles and shapes of a structure with dashpots, loss factors and modal damping."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.model.eigen import EigenSolution
from femtune.model.factorise import SingularMatrixError
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from femtune.model.response.modal_damping import DampingRatios, modal_damper
from femtune.model.response.quadratic import QuadraticProblem, quadratic_problem

Poles = NDArray[np.complex128]
Reals = NDArray[np.float64]

_REAL, _REPEATED = 1e-8, 1e-7
_GOOD, _ACCURACY, _ROUNDING, _WORST, _DEFECTIVE = 1e-11, 1e-8, 1e-12, 1e-5, 1e-7
_MARGIN, _JUST_ABOVE = 8, 1.005


@dataclass(frozen=True, eq=False)
class ComplexModes:
    """The complex modes of least |λ|, each pair λ, λ* once by its pole in the upper half plane.

    Parameters
    ----------
    poles : (m,) λ in rad/s; rigid-body modes come first and have λ = 0. With loss factors the poles are those of the
        dynamic stiffness for ω > 0; the response for ω < 0 is its conjugate, and the pencil's other poles mean nothing
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
    """The `count` complex modes of least |λ|; as many as the real modes that are wanted where nothing is said.

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
    residuals = _residuals(modes, stiffness, poles, psi)
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
    asked = 2 * wanted + _MARGIN
    while True:
        poles, vectors, complete = problem.nearest(asked)
        keep = poles.imag >= -_REAL * np.abs(poles)
        # what was found are the poles nearest to the origin of the pencil: only inside this circle none is left out
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
    return FemtuneError(
        "response.defective",
        "two poles coincide and share one vector (critical damping), so that complex modes do not span the motion",
        values={"|pole| (rad/s)": f"{abs(pole):.6g}"},
        hint='use the method "direct" or "real-modes"',
    )


def _residuals(modes: EigenSolution, stiffness: DynamicStiffness, poles: Poles, psi: NDArray) -> Reals:
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
    """Poles far above the lowest, which lose digits to these, by a step of inverse iteration each."""
    poles, vectors = poles.astype(complex), vectors.astype(complex)
    for j in np.flatnonzero((poles != 0.0) & (_residuals(modes, stiffness, poles, vectors) > _GOOD)):
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


def _backward(stiffness: DynamicStiffness, pole: complex, psi: NDArray) -> float:
    """Residual of one mode relative to the parts that cancel in it, DOFs scaled by their own stiffness and mass."""
    point, size = stiffness.point, abs(pole)
    scale = np.sqrt(np.abs(point.stiffness.diagonal()) + size**2 * np.abs(point.mass.diagonal()))
    scale = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    parts = np.abs(stiffness.stiffness) @ np.abs(psi) + size**2 * (np.abs(point.mass) @ np.abs(psi))
    return float(np.linalg.norm(scale * stiffness.times(pole, psi)) / np.linalg.norm(scale * parts))


def _check(stiffness: DynamicStiffness, poles: Poles, psi: NDArray, residuals: Reals) -> None:
    """Refuse a residual above 1e-8 that is not the rounding of large parts, as that of very fine meshes is."""
    for j in np.flatnonzero(~(residuals <= _ACCURACY)):
        rounding = _backward(stiffness, complex(poles[j]), psi[:, j]) <= _ROUNDING
        if not (rounding and residuals[j] <= _WORST):
            raise FemtuneError(
                "complex.inaccurate",
                f"a complex mode could not be computed accurately: its relative residual is {residuals[j]:.1e}",
                values={"pole (rad/s)": f"{poles[j]:.6g}"},
                hint="look for stiffnesses and dashpots that are orders of magnitude apart, and for nearly loose parts",
            )


def _not_proven(modes: EigenSolution, sizes: Reals, rigid: int) -> Notice:
    top = float(sizes.max(initial=0.0))
    real = int((modes.eigenvalues <= (top * _JUST_ABOVE) ** 2).sum())
    return Notice(
        "complex.not-counted",
        f"{len(sizes) + rigid} complex modes were found up to {top / (2.0 * np.pi):.6g} Hz, where {real} real modes "
        "are known; that none is missing is not proven",
        level="info",
    )
