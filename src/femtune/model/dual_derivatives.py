"""Derivatives of all wanted modes at a few sensors, without solving for one of them: the dual way.

S φ′ is superposed of the known modes, and what they miss is S(K − λM)⁻¹f on their M-orthogonal complement, for every
mode and parameter another f. Instead of all these f the sensors are solved for, once: (K − σM)⁻¹Sᵀ and its powers span
a space V in which the equation is projected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, log10
from weakref import WeakKeyDictionary

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.derivatives import SubspaceDerivative, inverse_gaps
from femtune.model.digest import digest
from femtune.model.dual_basis import DualBasis
from femtune.model.eigen import EigenSolution
from femtune.model.products import derivative_projections

Reals = NDArray[np.float64]

TOLERANCE = 1e-4
_MOST_BLOCKS = 8
_NEAR = 0.02
_SLOWEST, _FASTEST, _SAFETY = 0.9, 0.1, 2.0
_SMALL, _SMALLEST, _FLOOR = 1e-6, 1e-10, 1e-8
"""The last one is what the inaccuracy of the further modes may leave."""
_KEPT: WeakKeyDictionary[EigenSolution, dict[str, SensorDerivatives]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class SensorDerivatives:
    """What the derivatives of the wanted modes at some sensors are made of; m modes are known, w of them wanted.

    Parameters
    ----------
    eigenvalues : (w,)
    stiffness, mass : (k, m, w) ΦᵀK′φ_j and ΦᵀM′φ_j by every parameter
    gaps : (m, w) 1/(λ_j − λ_h), zero where they are equal
    shapes : (rows, m) SΦ
    rest : (rows, w, k) part of Sφ_j′ outside all known modes
    missing : (w,) estimated error of `rest`, the largest over sensors and parameters
    error : (w,) the same relative to the largest entry of each mode's derivative
    solves : number of vectors that were solved for
    """

    eigenvalues: Reals
    stiffness: Reals
    mass: Reals
    gaps: Reals
    shapes: Reals
    rest: Reals
    missing: Reals
    error: Reals
    solves: int

    def subspace(self, members: Sequence[int]) -> SubspaceDerivative:
        """Derivative of the subspace of some wanted modes."""
        chosen = list(members)
        inside = np.ix_(range(len(self.stiffness)), chosen, chosen)
        gaps = self.gaps[:, chosen]
        gaps[chosen] = 0.0
        outside = _superposed(self, gaps, chosen) + self.rest[:, chosen]
        mass, shapes = self.mass[inside], self.shapes[:, chosen]
        size = _largest(outside - 0.5 * np.einsum("ri,kij->rjk", shapes, mass))
        error = float(np.max(_relative(self.missing[chosen], size, _floor(self.shapes)[chosen]), initial=0.0))
        return SubspaceDerivative(self.eigenvalues[chosen], self.stiffness[inside], mass, outside, shapes, error)


def sensor_derivatives(solution: EigenSolution, rows: sp.csr_array, tolerance: float = TOLERANCE) -> SensorDerivatives:
    """Derivatives of all wanted modes at some rows, computed once for a solution and its rows.

    Blocks are added until the estimated error is within the tolerance, or does not get there in eight: `error` tells.

    Parameters
    ----------
    rows : S (rows, n_free), the combinations of DOFs that are wanted
    tolerance : error relative to the largest entry of each mode's derivative at these rows

    Raises
    ------
    FemtuneError : ``model.memory``
    """
    kept = _KEPT.setdefault(solution, {})
    key = digest(rows, tolerance)
    if key not in kept:
        kept[key] = _computed(solution, rows, tolerance)
    return kept[key]


def _computed(solution: EigenSolution, rows: sp.csr_array, tolerance: float) -> SensorDerivatives:
    """A block brings about one digit."""
    first = min(max(ceil(-log10(tolerance)), 2), _MOST_BLOCKS)
    basis = DualBasis(solution, rows, first)
    forces = _projected(solution, basis.parts[0])
    while True:
        found = _from_basis(solution, basis, forces)
        if len(basis.sizes) >= _MOST_BLOCKS or basis.is_exhausted or found.error.max(initial=0.0) <= tolerance:
            return found
        basis.extend()
        more = _projected(solution, basis.parts[-1])
        forces = np.concatenate([forces[0], more[0]], axis=1), np.concatenate([forces[1], more[1]], axis=1)


def _projected(solution: EigenSolution, left: Reals) -> tuple[Reals, Reals]:
    """(k, a, w) leftᵀK′φ_j and leftᵀM′φ_j."""
    point, wanted = solution.point, solution.shapes[:, : solution.wanted]
    stiffness = derivative_projections(point, "stiffness", left, wanted)
    return stiffness, derivative_projections(point, "mass", left, wanted)


def _from_basis(solution: EigenSolution, basis: DualBasis, forces: tuple[Reals, Reals]) -> SensorDerivatives:
    m, w = solution.shapes.shape[1], solution.wanted
    values, (stiffness, mass) = solution.eigenvalues[:w], forces
    outer = stiffness[:, m:] - mass[:, m:] * values
    # the difference of the last two orders, and the one before it
    orders = [_rest(basis, size, values, outer) for size in [0, 0, *basis.sizes][-3:]]
    missing = _missing(_largest(orders[2] - orders[1]), _largest(orders[1] - orders[0]))
    gaps = inverse_gaps(solution, [[j] for j in range(w)])
    shapes = np.asarray(basis.rows @ solution.shapes)
    made = SensorDerivatives(
        values, stiffness[:, :m], mass[:, :m], gaps, shapes, orders[2], missing, missing, basis.solves
    )
    return replace(made, error=_relative(missing, _sizes(made, solution), _floor(shapes)[:w]))


def _rest(basis: DualBasis, size: int, values: Reals, outer: Reals) -> Reals:
    """(rows, w, k) −SV(1 − (λ_j − σ)T)⁻¹Vᵀ(K′ − λ_jM′)φ_j in the first `size` vectors of V."""
    theta, turn = la.eigh(basis.T[:size, :size]) if size else (np.zeros(0), np.zeros((0, 0)))
    amplitude = turn.T @ outer[:, :size] / (1.0 - theta[:, None] * (values - basis.shift))
    return -np.moveaxis((basis.seen[:, :size] @ turn) @ amplitude, 0, 2)


def _missing(last: Reals, before: Reals) -> Reals:
    """What further orders would add, from the differences of the last ones as of a geometric series."""
    ratio = np.divide(last, before, out=np.full(len(last), _SLOWEST), where=before > 0.0)
    ratio = np.clip(ratio, _FASTEST, _SLOWEST)
    return np.asarray(_SAFETY * last * ratio / (1.0 - ratio))


def _sizes(made: SensorDerivatives, solution: EigenSolution) -> Reals:
    """(w,) largest entries of the derivatives without the part that lies in near modes.

    That part is left out where they are one cluster, which is not known here.
    """
    values, w = solution.eigenvalues, solution.wanted
    near = np.abs(values[:w] - values[:, None]) <= _NEAR * (values[:w] - solution.shift)
    own = 0.5 * made.shapes[:, :w, None] * np.einsum("kjj->jk", made.mass[:, :w])
    found = _superposed(made, np.where(near, 0.0, made.gaps), list(range(w))) + made.rest - own
    return _largest(found)


def _relative(missing: Reals, size: Reals, floor: Reals) -> Reals:
    return np.asarray(_FLOOR + missing / np.maximum(size, floor))


def _superposed(made: SensorDerivatives, gaps: Reals, chosen: list[int]) -> Reals:
    """(rows, c, k) SΦ diag(1/(λ_j − λ_h)) Φᵀ(K′ − λ_jM′)φ_j."""
    forces = made.stiffness[:, :, chosen] - made.mass[:, :, chosen] * made.eigenvalues[chosen]
    return np.moveaxis(made.shapes @ (forces * gaps), 0, 2)


def _floor(shapes: Reals) -> Reals:
    """(m,) entries below which a mode's derivative at the sensors is rounding."""
    own = np.abs(shapes).max(axis=0, initial=0.0)
    return np.asarray(_SMALL * own + _SMALLEST * own.max(initial=0.0) + np.finfo(float).tiny)


def _largest(entries: Reals) -> Reals:
    """(c,) largest entry of (rows, c, k) of each mode."""
    return np.asarray(np.abs(entries).max(axis=(0, 2), initial=0.0))
