"""Vectors in which responses at a few sensors can be found for any force: powers of (K − σM)⁻¹M on unit forces there.

They span what lies outside the known modes, so that K − σM is positive definite on them wherever σ lies among these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, log10
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.model.derivatives.modes import SubspaceDerivative, deflated_factor, inverse_gaps, pencil_of
from femtune.model.digests import digest
from femtune.model.eigen.krylov import column_products
from femtune.model.eigen.pencil import pieces
from femtune.model.eigen.solution import EigenSolution
from femtune.model.linear.dense_products import transposed_times, turn
from femtune.model.linear.memory import require_memory
from femtune.model.linear.sparse_products import column_major
from femtune.model.products import derivative_projections

_WITHIN_MODES = 1e-12
"""Norm of a force without its part in the known modes, relative to the force, below which it lies within the modes."""
_ROUNDING_ENERGY = 1e-20
"""Energy of a vector without its part in the basis, relative to the vector, that is rounding: amplitudes of 1e-10."""
_DEPENDENT = 1e-11
"""Energy of a combination of unit vectors, relative to the largest, below which they are dependent."""
_ROWS_AT_ONCE = 1 << 13
"""Rows that are updated together, so that no second array of the size of the whole is made."""


class DualBasis:
    """V (n, k) with VᵀMΦ = 0, Vᵀ(K − σM)V = 1 and T = VᵀMV, and what the sensors C see of it.

    Parameters
    ----------
    vectors : arrays (n, at least as many as `used`), Φ in the first columns of the first one, and V after them
    sizes : number of vectors of V after each block
    solves : number of vectors that were solved for
    """

    def __init__(self, solution: EigenSolution, rows: sp.csr_array, blocks: int) -> None:
        self.shift, self._factor = deflated_factor(solution)
        self._pencil, self._phi, self.rows = pencil_of(solution.point), solution.shapes, rows
        self.T, self.seen = np.zeros((0, 0)), np.zeros((rows.shape[0], 0))
        self.sizes: list[int] = []
        self.solves = 0
        self._arrays: list[Reals] = []
        self._ends: list[int] = []
        self._open(solution.shapes, blocks * rows.shape[0])
        self._force = self._free_of_modes(rows.T.toarray(order="F"))
        for _ in range(blocks):
            self.grow()

    def _open(self, begin: Reals, columns: int) -> None:
        """A further array; by rows, since single rows are what products with terms take from it."""
        size = begin.shape[1] + columns
        require_memory(8 * size * len(begin), "model.memory/derivatives", sensors=self.rows.shape[0])
        array = np.empty((len(begin), size))
        array[:, : begin.shape[1]] = begin
        self._arrays.append(array)
        self._ends.append(begin.shape[1])

    @property
    def is_exhausted(self) -> bool:
        """True if the last block added nothing: the space is invariant, and the solution in it is exact."""
        return len(self.sizes) > 1 and self.sizes[-1] == self.sizes[-2]

    @property
    def parts(self) -> list[Reals]:
        """[Φ, V] in pieces."""
        return [array[:, :end] for array, end in zip(self._arrays, self._ends)]

    def extend(self) -> None:
        """One block more, in a piece of its own."""
        self._open(self._phi[:, :0], self.rows.shape[0])
        self.grow()

    def grow(self) -> None:
        """Solve for the next block, and make it orthonormal."""
        if not self._force.shape[1]:
            self.sizes.append(len(self.T))
            return
        W, energy = self._solved()
        G, C = self._energies(W)
        R = _orthonormal(G - C.T @ C, energy)
        self._subtract(W, C)
        self._append(turn(W, R))

    def _solved(self) -> tuple[Reals, Reals]:
        """W = (K − σM)⁻¹b for the next forces b, without V and Φ but for rounding, and the energies Wᵀb of its columns.

        The part in the modes is their inaccuracy: it would grow from block to block.
        """
        b = self._force
        W, inside = np.empty(b.shape, order="F"), self._along(b)
        for some in pieces(0, b.shape[1]):
            W[:, some] = self._factor.solve(b[:, some])
        self.solves += b.shape[1]
        energy = column_products(W, b)
        self._subtract(W, inside)
        subtract_by_rows(W, self._phi, self._in_modes(W))
        return W, energy

    def _energies(self, W: Reals) -> tuple[Reals, Reals]:
        """Wᵀ(K − σM)W and Vᵀ(K − σM)W, some columns at a time."""
        G, C = np.empty((W.shape[1], W.shape[1])), np.empty((len(self.T), W.shape[1]))
        for some in pieces(0, W.shape[1]):
            b = self._pencil.stiffness @ W[:, some]
            b -= self.shift * (self._pencil.mass @ W[:, some])
            G[:, some], C[:, some] = transposed_times(W, b), self._along(b)
        return G, C

    def _in_modes(self, W: Reals) -> Reals:
        """ΦᵀMW, some columns at a time."""
        out = np.empty((self._phi.shape[1], W.shape[1]))
        for some in pieces(0, W.shape[1]):
            out[:, some] = self._phi.T @ (self._pencil.mass @ W[:, some])
        return out

    @property
    def _own(self) -> list[Reals]:
        """V in pieces."""
        first = self._phi.shape[1]
        return [self.parts[0][:, first:], *self.parts[1:]]

    def _along(self, b: Reals) -> Reals:
        """Vᵀb."""
        return np.vstack([part.T @ b for part in self._own])

    def _subtract(self, W: Reals, C: Reals) -> None:
        """W ← W − VC."""
        at = 0
        for part in self._own:
            subtract_by_rows(W, part, C[at : at + part.shape[1]])
            at += part.shape[1]

    def _append(self, Q: Reals) -> None:
        """Take a block into V; its forces MQ are the next ones."""
        subtract_by_rows(Q, self._phi, self._in_modes(Q))
        force = self._force[:, : Q.shape[1]]
        for some in pieces(0, Q.shape[1]):
            force[:, some] = self._pencil.mass @ Q[:, some]
        array, end = self._arrays[-1], self._ends[-1]
        for first in range(0, len(Q), _ROWS_AT_ONCE):
            array[first : first + _ROWS_AT_ONCE, end : end + Q.shape[1]] = Q[first : first + _ROWS_AT_ONCE]
        self._ends[-1] = end + Q.shape[1]
        column = self._along(force)
        k = len(self.T)
        corner = 0.5 * (column[k:] + column[k:].T)
        self.T = np.block([[self.T, column[:k]], [column[:k].T, corner]])
        self.seen = np.hstack([self.seen, self.rows @ Q])
        self.sizes.append(len(self.T))
        self._force = force

    def _free_of_modes(self, forces: Reals) -> Reals:
        """Forces that move no known mode; those that move nothing else are left out."""
        size, parts = la.norm(forces, axis=0), self._phi.T @ forces
        for some in pieces(0, forces.shape[1]):
            forces[:, some] -= self._pencil.mass @ column_major(self._phi @ parts[:, some])
        some = la.norm(forces, axis=0) > _WITHIN_MODES * size
        return forces if some.all() else np.asfortranarray(forces[:, some])


def subtract_by_rows(W: Reals, V: Reals, C: Reals) -> None:
    """W ← W − VC in place, a piece of rows at a time, for V of either order."""
    for first in range(0, len(W), _ROWS_AT_ONCE):
        W[first : first + _ROWS_AT_ONCE] -= V[first : first + _ROWS_AT_ONCE] @ C


def _orthonormal(G: Reals, energy: Reals) -> Reals:
    """R with RᵀGR = 1; directions that are rounding, or were so of a column's `energy` at first, are left out."""
    size = np.diag(G)
    some = size > _ROUNDING_ENERGY * energy
    scale = np.divide(1.0, np.sqrt(np.abs(size)), out=np.zeros_like(size), where=some)
    if not some.any():
        return np.zeros((len(G), 0))
    values, turn = la.eigh(scale[:, None] * (0.5 * (G + G.T)) * scale)
    keep = values > _DEPENDENT * values[-1]
    return np.asarray(scale[:, None] * turn[:, keep] / np.sqrt(values[keep]))


# ----------------------------------------------------------------------------------------------------
# Derivatives of all wanted modes at a few sensors by the dual (adjoint) method, without a solution for each mode.
#
# S φ′ is superposed of the known modes, and what they miss is S(K − λM)⁻¹f on their M-orthogonal complement, for
# every mode and parameter another f. Instead of all these f the sensors are solved for, once: (K − σM)⁻¹Sᵀ and its
# powers span a space V in which the equation is projected.


TOLERANCE = 1e-4
"""Error of a derivative relative to the largest entry of its mode at the sensors."""
MOST_BLOCKS = 8
"""Blocks of vectors; each brings about one digit."""
_NEAR = 0.02
"""|λ_j − λ_h| relative to λ_j − σ of modes that may be one cluster: 1 % in frequency."""
_SLOWEST_RATIO = 0.9
_FASTEST_RATIO = 0.1
"""Bounds of the ratio of the geometric series by which the remaining error is extrapolated."""
_SAFETY = 2.0
"""Factor of the extrapolated error."""
_SMALL_ENTRY = 1e-6
_SMALLEST_ENTRY = 1e-10
"""A derivative is rounding below the first, relative to its mode at the sensors, plus the second, relative to the
largest mode there."""
_FLOOR = 1e-8
"""Relative error that the inaccuracy of the further modes may leave."""
KEPT_DERIVATIVES: WeakKeyDictionary[EigenSolution, dict[str, SensorDerivatives]] = WeakKeyDictionary()
Made = TypeVar("Made")


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
    kept = KEPT_DERIVATIVES.setdefault(solution, {})
    key = digest(rows, tolerance)
    if key not in kept:
        kept[key] = _computed(solution, rows, tolerance)
    return kept[key]


def outside_at_sensors(
    solution: EigenSolution,
    rows: sp.csr_array,
    clusters: Sequence[Sequence[int]],
    projected: Callable[[Reals], Reals],
    tolerance: float = TOLERANCE,
) -> tuple[Reals, float]:
    """Su with (K − λ_jM)u = −f_j for k forces on each wanted mode of some clusters, and its estimated error.

    The part in the modes of the own cluster is left out.

    Parameters
    ----------
    rows : S (rows, n_free)
    projected : (n_free, a) -> (k, a, c), leftᵀf_j of all c members of the clusters, one after the other
    tolerance : error relative to the largest entry of each force's motion, see `sensor_derivatives`

    Returns
    -------
    (rows, c, k), and the error of the worst force, relative to its largest entry

    Raises
    ------
    FemtuneError : ``model.memory``
    """
    members = [j for cluster in clusters for j in cluster]
    values, gaps, shapes = solution.eigenvalues[members], inverse_gaps(solution, clusters), rows @ solution.shapes
    m = shapes.shape[1]

    def made(basis: DualBasis, along: Reals) -> tuple[Reals, float]:
        orders = _orders(basis, values, along[:, m:])
        motion = np.moveaxis(shapes @ (along[:, :m] * gaps), 0, 2) + orders[2]
        last, before, size = (np.abs(a).max(axis=(0, 1), initial=0.0) for a in (*np.diff(orders, axis=0)[::-1], motion))
        least = _SMALL_ENTRY * size.max(initial=0.0) + np.finfo(float).tiny
        return motion, float(np.max(_relative(_missing(last, before), size, least), initial=0.0))

    return _with_enough_blocks(solution, rows, projected, made, lambda made: made[1] <= tolerance, tolerance)


def _computed(solution: EigenSolution, rows: sp.csr_array, tolerance: float) -> SensorDerivatives:
    return _with_enough_blocks(
        solution, rows, lambda left: _projected(solution, left), lambda *made: _from_basis(solution, *made),
        lambda made: bool(made.error.max(initial=0.0) <= tolerance), tolerance,
    )  # fmt: skip


def _with_enough_blocks(
    solution: EigenSolution,
    rows: sp.csr_array,
    projected: Callable[[Reals], Reals],
    made: Callable[[DualBasis, Reals], Made],
    is_enough: Callable[[Made], bool],
    tolerance: float,
) -> Made:
    """What is made of the basis and the forces along Φ and it, on the second axis from the end.

    A block brings about one digit.
    """
    first = min(max(ceil(-log10(tolerance)), 2), MOST_BLOCKS)
    basis = DualBasis(solution, rows, first)
    along = projected(basis.parts[0])
    while True:
        out = made(basis, along)
        if len(basis.sizes) >= MOST_BLOCKS or basis.is_exhausted or is_enough(out):
            return out
        basis.extend()
        along = np.concatenate([along, projected(basis.parts[-1])], axis=-2)


def _projected(solution: EigenSolution, left: Reals) -> Reals:
    """(2, k, a, w) leftᵀK′φ_j and leftᵀM′φ_j."""
    point, wanted = solution.point, solution.shapes[:, : solution.wanted]
    return np.array([derivative_projections(point, of, left, wanted) for of in ("stiffness", "mass")])


def _from_basis(solution: EigenSolution, basis: DualBasis, forces: Reals) -> SensorDerivatives:
    m, w = solution.shapes.shape[1], solution.wanted
    values, (stiffness, mass) = solution.eigenvalues[:w], forces
    outer = stiffness[:, m:] - mass[:, m:] * values
    orders = _orders(basis, values, outer)
    missing = _missing(_largest(orders[2] - orders[1]), _largest(orders[1] - orders[0]))
    gaps = inverse_gaps(solution, [[j] for j in range(w)])
    shapes = np.asarray(basis.rows @ solution.shapes)
    made = SensorDerivatives(
        eigenvalues=values,
        stiffness=stiffness[:, :m],
        mass=mass[:, :m],
        gaps=gaps,
        shapes=shapes,
        rest=orders[2],
        missing=missing,
        error=missing,
        solves=basis.solves,
    )
    return replace(made, error=_relative(missing, _sizes(made, solution), _floor(shapes)[:w]))


def _orders(basis: DualBasis, values: Reals, outer: Reals) -> list[Reals]:
    """`_rest` by all blocks, last; by one less, and by two less."""
    return [_rest(basis, size, values, outer) for size in [0, 0, *basis.sizes][-3:]]


def _rest(basis: DualBasis, size: int, values: Reals, outer: Reals) -> Reals:
    """(rows, w, k) −SV(1 − (λ_j − σ)T)⁻¹Vᵀ(K′ − λ_jM′)φ_j in the first `size` vectors of V."""
    theta, turn = la.eigh(basis.T[:size, :size]) if size else (np.zeros(0), np.zeros((0, 0)))
    amplitude = turn.T @ outer[:, :size] / (1.0 - theta[:, None] * (values - basis.shift))
    return -np.moveaxis((basis.seen[:, :size] @ turn) @ amplitude, 0, 2)


def _missing(last: Reals, before: Reals) -> Reals:
    """What further orders would add, from the differences of the last ones as of a geometric series."""
    ratio = np.divide(last, before, out=np.full(len(last), _SLOWEST_RATIO), where=before > 0.0)
    ratio = np.clip(ratio, _FASTEST_RATIO, _SLOWEST_RATIO)
    return np.asarray(_SAFETY * last * ratio / (1.0 - ratio))


def _sizes(made: SensorDerivatives, solution: EigenSolution) -> Reals:
    """(w,) largest entries of the derivatives without the part that lies in near modes.

    That part is left out where they are one cluster, which is not known here.
    """
    values, w = solution.eigenvalues, solution.wanted
    near = np.abs(values[:w] - values[:, None]) <= _NEAR * (values[:w] - solution.shift)
    normalisation = 0.5 * made.shapes[:, :w, None] * np.einsum("kjj->jk", made.mass[:, :w])
    derivatives = _superposed(made, np.where(near, 0.0, made.gaps), list(range(w))) + made.rest - normalisation
    return _largest(derivatives)


def _relative(missing: Reals, size: Reals, floor: Reals) -> Reals:
    return np.asarray(_FLOOR + missing / np.maximum(size, floor))


def _superposed(made: SensorDerivatives, gaps: Reals, chosen: list[int]) -> Reals:
    """(rows, c, k) SΦ diag(1/(λ_j − λ_h)) Φᵀ(K′ − λ_jM′)φ_j."""
    forces = made.stiffness[:, :, chosen] - made.mass[:, :, chosen] * made.eigenvalues[chosen]
    return np.moveaxis(made.shapes @ (forces * gaps), 0, 2)


def _floor(shapes: Reals) -> Reals:
    """(m,) entries below which a mode's derivative at the sensors is rounding."""
    largest = np.abs(shapes).max(axis=0, initial=0.0)
    return np.asarray(_SMALL_ENTRY * largest + _SMALLEST_ENTRY * largest.max(initial=0.0) + np.finfo(float).tiny)


def _largest(entries: Reals) -> Reals:
    """(c,) largest entry of (rows, c, k) of each mode."""
    return np.asarray(np.abs(entries).max(axis=(0, 2), initial=0.0))
