"""Exact derivatives of complex modes.

λ′ = −ψᵀZ′(λ)ψ for modal A = 1. The shape follows from Z(λ)ψ′ = −(Z′ + λ′ dZ/dλ)ψ, which is singular along ψ: one DOF
where ψ is large is held (Nelson's way), and the part along ψ follows from A = 1.
Source: R. B. Nelson, AIAA Journal 14 (1976); for damped systems M. I. Friswell, S. Adhikari, AIAA Journal 38 (2000).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.basis import ModalBasis, residual_vectors, ritz_vectors, static_slopes
from femtune.model.response.complex_eigen import ComplexModes, gradient_by_pole, modes_of
from femtune.model.response.dynamic_stiffness import DynamicStiffness, NoSolutionError, Solve, low_rank_solver
from femtune.model.response.rigid import is_rigid
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import SingularMatrixError

_CLOSE = 1e-6
"""Distance of two poles, relative to their size, below which single modes have no accurate derivatives."""
_DAMPED_NORM = 0.5
"""ψᵀCψ of a rigid-body mode is 1 if damping acts on it and 0 if not: a value between the two."""
_CORRECTIONS = 2
"""Steps of iterative refinement of each solution."""
_LARGEST_RESIDUAL = 1e-7
"""Relative residual of the equation of ψ′ up to which a derivative is accepted."""


@dataclass(frozen=True, eq=False)
class ComplexModeDerivative:
    """First derivatives of one complex mode by p parameters.

    Parameters
    ----------
    pole : (p,) λ′
    shape : (rows, p) C ψ′
    residuals : (p,) largest entry of Zψ′ + (Z′ + λ′ dZ/dλ)ψ over that of the parts that cancel
    """

    pole: NDArray[np.complex128]
    shape: NDArray[np.complex128]
    residuals: NDArray[np.float64]


def complex_mode_derivative(modes: ComplexModes, mode: int, rows: sp.csr_array | None = None) -> ComplexModeDerivative:
    """Derivatives of the pole and of the shape (modal A = 1) of a simple mode.

    Parameters
    ----------
    mode : its position
    rows : C (rows, n_free), the combinations of DOFs that are wanted; None for all free DOFs

    Raises
    ------
    FemtuneError : ``derivative.close-poles`` where another pole coincides with it except for rounding, so that the
        single modes have no derivatives in several parameters; ``derivative.pole-inaccurate``
    """
    _check_simple(modes, mode)
    stiffness, pole, psi = modes.stiffness, complex(modes.poles[mode]), modes.shapes[:, mode]
    forces = _forces(stiffness, pole, psi)
    by_pole = gradient_by_pole(stiffness, pole, psi)
    slope = -(psi @ forces)
    b = -(forces + by_pole[:, None] * slope)
    bent = _held_solver(stiffness, pole, psi)(b)
    along = -0.5 * _normalisation(stiffness, pole, psi, slope) - by_pole @ bent
    shape = bent + psi[:, None] * along
    residuals = relative_residuals(stiffness, pole, shape, b, np.abs(forces) + np.abs(by_pole[:, None] * slope))
    if (residuals > _LARGEST_RESIDUAL).any():
        raise _inaccurate(pole, float(residuals.max()))
    return ComplexModeDerivative(slope, shape if rows is None else np.asarray(rows @ shape), residuals)


def mean_pole_derivative(modes: ComplexModes, members: Sequence[int]) -> NDArray[np.complex128]:
    """(p,) derivatives of the mean of some poles, which exist where these are close to each other or repeat.

    Errors as of `complex_mode_derivative`, for a pole outside `members` that is as near as rounding.
    """
    slopes = []
    for mode in members:
        _check_simple(modes, mode, members)
        psi = modes.shapes[:, mode]
        slopes.append(-(psi @ _forces(modes.stiffness, complex(modes.poles[mode]), psi)))
    return np.asarray(np.mean(slopes, axis=0))


def _check_simple(modes: ComplexModes, mode: int, together: Sequence[int] = ()) -> None:
    """Refuse another pole as near as rounding, but for those of which the mean is wanted."""
    pole = modes.poles[mode]
    gaps = np.abs(modes.poles - pole)
    gaps[list(together)] = np.inf
    gaps[mode] = np.inf if pole.imag == 0.0 else abs(2.0 * pole.imag)
    size = max(abs(pole), 1e-6 * float(np.abs(modes.poles).max(initial=0.0)))
    psi = modes.shapes[:, mode]
    if modes.kinds[mode] == "rigid" and abs(psi @ modes.stiffness.viscous_times(psi)) < _DAMPED_NORM:
        # a rigid-body motion that nothing damps is a double pole; a damped one has A = ψᵀCψ = 1
        gaps[mode] = 0.0
    if gaps.min(initial=np.inf) <= _CLOSE * size:
        raise FemtuneError(
            "derivative.close-poles",
            values={"pole (rad/s)": f"{pole:.6g}", "nearest other": f"{gaps.min(initial=np.inf):.3g} rad/s away"},
            mode=mode + 1,
        )


def _forces(stiffness: DynamicStiffness, pole: complex, psi: NDArray) -> NDArray:
    """Z′(λ)ψ (n_free, p)."""
    parts = [stiffness.derivative_times(i, pole, psi) for i in range(stiffness.point.n_parameters)]
    return np.stack(parts, axis=1) if parts else np.zeros((len(psi), 0), complex)


def _normalisation(stiffness: DynamicStiffness, pole: complex, psi: NDArray, slope: NDArray) -> NDArray:
    """ψᵀ(2λ′M + 2λM′ + C′)ψ (p,)."""
    point, out = stiffness.point, []
    for i in range(point.n_parameters):
        mass = 2.0 * pole * (point.mass_derivatives[i] @ psi)
        out.append(psi @ (mass + stiffness.viscous_derivative_times(i, psi)))
    return np.asarray(np.array(out, complex) + 2.0 * slope * (psi @ (point.mass @ psi)))


def _held_solver(stiffness: DynamicStiffness, pole: complex, psi: NDArray) -> Solve:
    """b -> v with Z(λ)v = b and v = 0 at the DOF that is held, for b that Z can carry."""
    held = int(np.argmax(np.abs(psi) ** 2 * np.abs(stiffness.point.stiffness.diagonal())))
    keep = np.delete(np.arange(len(psi)), held)
    rough = _rough(stiffness, pole, keep)

    def solve(b: NDArray) -> NDArray:
        v = np.zeros(b.shape, complex)
        v[keep] = rough(b[keep])
        for _ in range(_CORRECTIONS):
            v[keep] += rough((b - stiffness.times(pole, v))[keep])
        return v

    return solve


def _rough(stiffness: DynamicStiffness, pole: complex, keep: NDArray) -> Solve:
    if not keep.size:
        return lambda b: b
    try:
        factor = factorise(sp.csr_array(stiffness.sparse(pole)[keep][:, keep]))
        damper = stiffness.damper
        return factor.solve if damper is None else low_rank_solver(factor, damper.momentum[keep], damper.weights(pole))
    except (SingularMatrixError, NoSolutionError) as error:
        raise _inaccurate(pole, np.inf) from error


def relative_residuals(
    stiffness: DynamicStiffness, pole: complex, shape: NDArray, b: NDArray, parts_of_b: NDArray
) -> NDArray[np.float64]:
    """Relative to the parts that cancel in Zψ′ − b: b itself is the rounding of larger parts for a single DOF."""
    if not b.shape[1]:
        return np.zeros(0)
    parts = np.abs(stiffness.sparse(pole)) @ np.abs(shape) + parts_of_b
    left = np.abs(stiffness.times(pole, shape) - b).max(axis=0)
    return np.asarray(left / np.maximum(parts.max(axis=0), np.finfo(float).tiny))


def _inaccurate(pole: complex, error: float) -> FemtuneError:
    return FemtuneError(
        "derivative.pole-inaccurate", values={"pole (rad/s)": f"{pole:.6g}", "relative residual": f"{error:.1e}"}
    )


# ----------------------------------------------------------------------------------------------------
# The basis of FRFs by complex modes: real and imaginary parts of the exact complex modes, and residual vectors.
#
# A complex mode that lies in the basis is a complex mode of the reduced pencil too, with the same pole and residue,
# so that what the reduced pencil adds are the pseudo-modes of the residual vectors.


_ROUNDING_PART = 1e-9
"""Real or imaginary part of a mode, relative to the mode, that is rounding of the other part."""


def complex_basis(modes: EigenSolution, stiffness: DynamicStiffness, forces: NDArray | None) -> ModalBasis:
    """Rigid-body modes, the elastic parts of as many complex modes as there are wanted real ones, residual vectors."""
    rigid = modes.shapes[:, is_rigid(modes)]
    f = rigid.shape[1]
    complex_modes = modes_of(modes, stiffness, max(modes.wanted, f))
    pushed = np.zeros((len(rigid), 0)) if forces is None else forces
    static, seen = residual_vectors(modes, f, pushed)
    parts, kept = _real_parts(complex_modes)
    vectors = _without(np.hstack([parts, static]), rigid, stiffness)
    turn, k, m = ritz_vectors(stiffness.point, vectors)

    def slopes(columns: Reals) -> Iterator[Reals]:
        columns = columns - (stiffness.point.mass @ rigid) @ (rigid.T @ columns)
        of_modes = _slopes_of_parts(complex_modes, kept, columns)
        of_static = static_slopes(modes, f, static, pushed[:, seen], columns)
        for of_poles, others in zip(of_modes, of_static):
            yield np.vstack([others[:f], turn.T @ np.vstack([of_poles, others[f:]])])

    return ModalBasis(
        np.hstack([rigid, vectors @ turn]), np.concatenate([np.zeros(f), k]), np.concatenate([np.ones(f), m]), f, slopes
    )


def _elastic(modes: ComplexModes) -> list[int]:
    return [j for j, kind in enumerate(modes.kinds) if kind != "rigid"]


def _real_parts(modes: ComplexModes) -> tuple[NDArray, NDArray[np.bool_]]:
    """Real and imaginary parts of the elastic modes, but for those that are rounding of the other part; which."""
    elastic = modes.shapes[:, _elastic(modes)] * _turns(modes)
    parts = np.hstack([elastic.real, elastic.imag])
    size = np.linalg.norm(parts, axis=0)
    kept = size > _ROUNDING_PART * np.tile(np.linalg.norm(elastic, axis=0), 2)
    return parts[:, kept], kept


def _turns(modes: ComplexModes) -> NDArray:
    """Factors of unit size that make real and imaginary part of each elastic mode orthogonal in K.

    Modal A = 1 turns lightly damped modes by 45 degrees, which would leave the two parts nearly parallel.
    """
    elastic = modes.shapes[:, _elastic(modes)]
    product = np.einsum("ij,ij->j", elastic, modes.stiffness.point.stiffness @ elastic)
    return np.asarray(np.exp(-0.5j * np.angle(product)))


def _slopes_of_parts(modes: ComplexModes, kept: NDArray[np.bool_], columns: Reals) -> Iterator[Reals]:
    """Derivatives of the kept parts, ᵀG, by each parameter; zero for poles that coincide, which have none."""
    members, p, turns = _elastic(modes), modes.stiffness.point.n_parameters, _turns(modes)
    by_mode = np.zeros((p, len(members), columns.shape[1]), complex)
    for at, mode in enumerate(members):
        try:
            by_mode[:, at] = (complex_mode_derivative(modes, mode).shape.T @ columns) * turns[at]
        except FemtuneError as error:
            if error.code != "derivative.close-poles":
                raise
    for one in by_mode:
        yield np.vstack([one.real, one.imag])[kept]


def _without(vectors: NDArray, rigid: NDArray, stiffness: DynamicStiffness) -> NDArray:
    """Vectors made M-orthogonal to the rigid-body modes, twice."""
    for _ in range(2):
        vectors = vectors - rigid @ (rigid.T @ (stiffness.point.mass @ vectors))
    return vectors
