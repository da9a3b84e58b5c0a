"""K and M of one eigenproblem with what is derived from them once: products, factors of K − σM, DOFs with mass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.model.linear.sparse_products import Product, product, without_zeros
from femtune.model.linear.symmetric import SymmetricMatrix, symmetric
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import Factor

_USUAL_BLOCK = 8
"""Columns for which products with M are prepared: about as many as a block of the iteration has."""
_COLUMNS_AT_ONCE = 16
"""Columns of shapes that are multiplied together: wide enough to be fast, and a small part of all shapes."""
_MINOR_TOLERANCE = 1.0 + 1e-10
"""Ratio of m_ij² to m_ii·m_jj up to which the minor is not negative but rounded: for a rank-one mass it is exactly
1."""


@dataclass(frozen=True, eq=False)
class Pencil:
    """K φ = λ M φ, both as upper triangles on one pattern."""

    K: SymmetricMatrix
    M: SymmetricMatrix

    @property
    def n(self) -> int:
        """Number of equations."""
        return self.K.shape[0]

    @cached_property
    def stiffness(self) -> Product:
        """K for products."""
        return product(self.K)

    @cached_property
    def mass(self) -> Product:
        """M for many products."""
        return product(self.M, _USUAL_BLOCK)

    @cached_property
    def heavy(self) -> NDArray[np.int64]:
        """DOFs whose row of M has an entry."""
        return np.flatnonzero(absolute_row_sums(self.M) > 0.0)

    @cached_property
    def heavy_mass(self) -> Product:
        """M among the DOFs that have mass."""
        rows = self.heavy
        return product(symmetric(sp.csr_array(without_zeros(self.M)[rows][:, rows])), _USUAL_BLOCK)

    def shifted(self, shift: float) -> SymmetricMatrix:
        """K − σM."""
        return self.K.plus(-shift, self.M)

    def factorise(self, shift: float) -> Factor:
        """Factors of K − σM.

        Raises
        ------
        SingularMatrixError : σ is an eigenvalue, or the pencil is singular
        """
        return factorise(self.shifted(shift))

    def residual(self, values: Reals, shapes: Reals, columns: slice = slice(None)) -> Reals:
        """Kφ − λMφ of some modes."""
        some = np.asfortranarray(shapes[:, columns])
        return np.asarray(self.stiffness @ some - (self.mass @ some) * values[columns])


class Inverse:
    """(K − σM)⁻¹; its factors can be released, and are computed again when they are needed."""

    def __init__(self, pencil: Pencil, shift: float, factor: Factor | None = None) -> None:
        self.pencil, self.shift, self.at_hand = pencil, shift, factor
        self.solver = "" if factor is None else factor.name
        """Sparse solver of the factors; kept after they are released."""

    def solve(self, b: Reals) -> Reals:
        """(K − σM)⁻¹ b for b of shape (n,) or (n, k)."""
        if self.at_hand is None:
            self.at_hand = self.pencil.factorise(self.shift)
            self.solver = self.at_hand.name
        return self.at_hand.solve(b)

    def forget(self) -> None:
        """Give the memory of the factors back."""
        self.at_hand = None


def absolute_row_sums(matrix: SymmetricMatrix) -> Reals:
    """Σ_j |a_ij| of the entries on and above the diagonal, and of those below it."""
    size, n = np.abs(matrix.data), matrix.shape[0]
    rows = np.add.reduceat(size, matrix.indptr[:-1])
    return np.asarray(rows + np.bincount(matrix.indices, size, n) - np.abs(matrix.diagonal()))


def pieces(first: int, last: int) -> list[slice]:
    """Columns `first` to `last` a few at a time, for work on many shapes without further arrays of their size."""
    return [slice(i, min(i + _COLUMNS_AT_ONCE, last)) for i in range(first, last, _COLUMNS_AT_ONCE)]


def indefinite_mass(M: SymmetricMatrix) -> bool:
    """True where a diagonal entry of M, or the smallest minor of two DOFs, is negative: M then has a negative mass."""
    d = M.diagonal()
    if (d < 0.0).any():
        return True
    rows = np.repeat(np.arange(M.shape[0]), np.diff(M.indptr))
    other = rows != M.indices
    # by roots, so that no product of two masses overflows
    root = np.sqrt(d)
    most = root[rows[other]] * root[M.indices[other]] * np.sqrt(_MINOR_TOLERANCE)
    return bool((np.abs(M.data[other]) > most).any())
