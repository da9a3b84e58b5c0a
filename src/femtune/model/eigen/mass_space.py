"""The iteration on the DOFs that have mass; the shapes on all DOFs come from a last solve, which refines the pairs too.

(K − σM)⁻¹M depends on the DOFs with mass only. If half of the DOFs have none, as the rotations of shells, the basis
takes half of the memory and half of the work.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from femtune.arrays import Integers, Reals
from femtune.model.eigen.krylov import Krylov, KrylovPairs
from femtune.model.eigen.pencil import Pencil
from femtune.model.linear.blocks import empty_block
from femtune.model.linear.dense_products import transposed_times, turn

Solve = Callable[[Reals], Reals]

_WORTHWHILE_FRACTION = 0.75
"""Fraction of DOFs with mass above which the last solve costs more than the smaller basis saves."""
_REFINEMENT = 10.0
"""Factor by which the tolerance of the iteration is looser: the last solve refines the pairs by at least as much."""
_COLUMNS_OF_A_SOLVE = 32
"""Columns solved together at the end: each costs half of what it costs in the narrower blocks of the iteration."""


@dataclass(frozen=True, eq=False)
class MassSpace:
    """The space of an iteration on (K − σM)⁻¹M.

    Parameters
    ----------
    solve : b (n, k) ↦ (K − σM)⁻¹b, or its negative
    """

    pencil: Pencil
    solve: Solve

    @property
    def is_part(self) -> bool:
        """True if the iteration leaves out the DOFs without mass."""
        return self.pencil.heavy.size <= _WORTHWHILE_FRACTION * self.pencil.n

    @property
    def looser(self) -> float:
        """Factor of the tolerance of the iteration: the last solve refines the pairs by at least as much."""
        return _REFINEMENT if self.is_part else 1.0

    @property
    def operator(self) -> Krylov:
        """What the iteration needs."""
        heavy = self.pencil.heavy.size
        if self.is_part:
            return Krylov(self._on_heavy, self.pencil.heavy_mass, heavy)
        return Krylov(self.solve, self.pencil.mass, heavy)

    def start(self, shapes: Reals) -> Reals:
        """Shapes (n, m) as the iteration starts from them."""
        return shapes[self.pencil.heavy] if self.is_part else shapes

    def finished(self, pairs: KrylovPairs) -> KrylovPairs:
        """Pairs with shapes on all DOFs, by Rayleigh and Ritz among Sφ.

        Where SY' = Y and the columns of Y' are known on the DOFs with mass, YᵀS⁻¹Y in the M-product is YᵀMY': a product
        with K is not needed.
        """
        if not self.is_part or not len(pairs.theta):
            return pairs
        mass, root = self.pencil.heavy_mass, 1.0 / np.sqrt(pairs.theta)
        before = np.multiply(pairs.shapes, root, out=pairs.shapes)
        Y, count = np.empty((self.pencil.n, len(root)), order="F"), len(root)
        inverted, squared = np.empty((2, count, count))
        parts = [slice(i, i + _COLUMNS_OF_A_SOLVE) for i in range(0, count, _COLUMNS_OF_A_SOLVE)]
        for part in parts:
            Y[:, part] = self.solve(self._spread(mass @ before[:, part]))
        on_heavy = _rows(Y, self.pencil.heavy)
        for part in parts:
            heavy = mass @ on_heavy[:, part]
            inverted[:, part], squared[:, part] = transposed_times(before, heavy), transposed_times(on_heavy, heavy)
        theta, vectors = la.eigh(0.5 * (squared + squared.T), 0.5 * (inverted + inverted.T))
        theta, vectors = theta[::-1], vectors[:, ::-1] / np.sqrt(theta[::-1])
        return replace(pairs, theta=theta, shapes=turn(Y, vectors))

    def _on_heavy(self, b: Reals) -> Reals:
        return _rows(self.solve(self._spread(b)), self.pencil.heavy)

    def _spread(self, b: Reals) -> Reals:
        """(n, k) in Fortran's order, zero where there is no mass."""
        out = empty_block(self.pencil.n, b.shape[1])
        out[...] = 0.0
        for column, with_mass in zip(out.T, b.T):
            column[self.pencil.heavy] = with_mass
        return out


def _rows(x: Reals, rows: Integers) -> Reals:
    """Some rows of a block in Fortran's order, column by column."""
    out = empty_block(len(rows), x.shape[1])
    for target, column in zip(out.T, x.T):
        np.take(column, rows, out=target, mode="clip")
    return out
