"""Vectors in which responses at a few sensors can be found for any force: powers of (K − σM)⁻¹M on unit forces there.

They span what lies outside the known modes, so that K − σM is positive definite on them wherever σ lies among these.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.dense_products import transposed_times, turn
from femtune.model.derivatives import deflated_factor, pencil_of
from femtune.model.eigen import EigenSolution
from femtune.model.krylov import column_products
from femtune.model.memory import require_memory
from femtune.model.pencil import pieces
from femtune.model.sparse_products import column_major

Reals = NDArray[np.float64]

_UNSEEN, _ROUNDING, _DEPENDENT = 1e-12, 1e-20, 1e-11
_ROWS = 1 << 13
_HINT = "ask for fewer sensors, or for the derivatives of fewer modes' shapes"


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
        require_memory(8 * size * len(begin), f"derivatives at {self.rows.shape[0]} sensors", _HINT)
        array = np.empty((len(begin), size))
        array[:, : begin.shape[1]] = begin
        self._arrays.append(array)
        self._ends.append(begin.shape[1])

    @property
    def is_exhausted(self) -> bool:
        """True where the last block brought nothing: the space is invariant, and what is found in it exact."""
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
        for first in range(0, len(Q), _ROWS):
            array[first : first + _ROWS, end : end + Q.shape[1]] = Q[first : first + _ROWS]
        self._ends[-1] = end + Q.shape[1]
        column = self._along(force)
        k = len(self.T)
        own = 0.5 * (column[k:] + column[k:].T)
        self.T = np.block([[self.T, column[:k]], [column[:k].T, own]])
        self.seen = np.hstack([self.seen, self.rows @ Q])
        self.sizes.append(len(self.T))
        self._force = force

    def _free_of_modes(self, forces: Reals) -> Reals:
        """Forces that move no known mode; those that move nothing else are left out."""
        size, parts = la.norm(forces, axis=0), self._phi.T @ forces
        for some in pieces(0, forces.shape[1]):
            forces[:, some] -= self._pencil.mass @ column_major(self._phi @ parts[:, some])
        some = la.norm(forces, axis=0) > _UNSEEN * size
        return forces if some.all() else np.asfortranarray(forces[:, some])


def subtract_by_rows(W: Reals, V: Reals, C: Reals) -> None:
    """W ← W − VC in place, a piece of rows at a time, for V of either order."""
    for first in range(0, len(W), _ROWS):
        W[first : first + _ROWS] -= V[first : first + _ROWS] @ C


def _orthonormal(G: Reals, energy: Reals) -> Reals:
    """R with RᵀGR = 1; directions that are rounding, or were so of a column's `energy` at first, are left out."""
    size = np.diag(G)
    some = size > _ROUNDING * energy
    scale = np.divide(1.0, np.sqrt(np.abs(size)), out=np.zeros_like(size), where=some)
    if not some.any():
        return np.zeros((len(G), 0))
    values, turn = la.eigh(scale[:, None] * (0.5 * (G + G.T)) * scale)
    keep = values > _DEPENDENT * values[-1]
    return np.asarray(scale[:, None] * turn[:, keep] / np.sqrt(values[keep]))
