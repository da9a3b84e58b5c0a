"""All eigenpairs of a small pencil from dense matrices, and products with its inverses that follow from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
from scipy.linalg import lapack

from femtune.arrays import Reals
from femtune.model.eigen.pencil import Pencil
from femtune.model.solvers.interface import SingularMatrixError

DENSE_UP_TO = 400
"""DOFs up to which dense matrices are solved: there they are as fast as an iteration, and find all modes."""
_ALL_UP_TO = 100
"""DOFs up to which all eigenpairs cost hardly more than a few."""
_WITHOUT_MASS = 1e-14
"""θ below this fraction of the largest belong to directions without mass: rounding of the largest is 1e-16."""
_POLLUTED = 1e-7
"""θ below this fraction of the largest have lost half of their digits to the large ones, and are solved once more."""

Pairs = tuple[Reals, Reals]


class CholeskyFactor:
    """LLᵀ of a dense positive definite matrix.

    Raises
    ------
    scipy.linalg.LinAlgError : the matrix is not positive definite
    """

    name = "LAPACK"
    negative_pivots = 0

    def __init__(self, matrix: Reals) -> None:
        self.L, info = lapack.dpotrf(matrix, lower=1, clean=1)
        if info:
            raise la.LinAlgError(f"pivot {info} is not positive")

    def solve(self, b: Reals) -> Reals:
        """A⁻¹ b for b of shape (n,) or (n, k), real or complex."""
        if np.iscomplexobj(b):
            return self.solve(b.real) + 1j * self.solve(b.imag)
        if not b.size:
            return np.zeros(b.shape)
        return np.asarray(lapack.dpotrs(self.L, b, lower=1)[0]).reshape(b.shape)


def negative_eigenvalues(matrix: Reals) -> int:
    """Number of negative eigenvalues of a dense symmetric matrix, by Sylvester's law from its LDLᵀ.

    Raises
    ------
    SingularMatrixError : a pivot is exactly zero
    """
    factors, pivots, info = lapack.dsytrf(matrix, lower=1)
    if info:
        raise SingularMatrixError(f"pivot {info} is zero")
    diagonal = factors.diagonal()
    # each block of two rows has one eigenvalue of either sign
    return int(np.count_nonzero(diagonal[pivots > 0] < 0.0) + np.count_nonzero(pivots < 0) // 2)


@dataclass(frozen=True, eq=False)
class DenseSpectrum:
    """Eigenpairs of M y = θ (K − σM) y with θ = 1/(λ − σ), by LAPACK; M may be singular.

    Parameters
    ----------
    shift : σ below the spectrum
    factor : K − σM = LLᵀ
    """

    pencil: Pencil
    shift: float
    factor: CholeskyFactor

    @classmethod
    def of(cls, pencil: Pencil, shift: float) -> DenseSpectrum:
        """At a shift (error of `CholeskyFactor` if it is not below the spectrum)."""
        return cls(pencil, shift, CholeskyFactor(pencil.dense_shifted(shift)))

    @cached_property
    def _inverse(self) -> Reals:
        """L⁻¹ML⁻ᵀ."""
        L = self.factor.L
        half, _ = lapack.dtrtrs(L, self.pencil.dense_mass, lower=1)
        whole, _ = lapack.dtrtrs(L, half.T, lower=1)
        return np.asarray(0.5 * (whole + whole.T))

    @cached_property
    def _pairs(self) -> Pairs:
        """All θ (n,), ascending, and vectors y of L⁻¹ML⁻ᵀ."""
        theta, y = np.linalg.eigh(self._inverse)
        return theta, y

    @cached_property
    def theta(self) -> Reals:
        """(n,) all θ, ascending; those of directions without mass are zero but for rounding."""
        return self._pairs[0] if self.pencil.n <= _ALL_UP_TO else np.asarray(np.linalg.eigvalsh(self._inverse), float)

    @cached_property
    def vectors(self) -> Pairs:
        """All θ (n,) and Z (n, n) with Zᵀ(K − σM)Z = I and ZᵀMZ = diag(θ)."""
        theta, y = self._pairs
        return theta, np.asarray(lapack.dtrtrs(self.factor.L, y, lower=1, trans=1)[0])

    def lowest(self, count: int) -> Pairs:
        """At most `count` lowest eigenvalues λ and mass-normalised shapes."""
        n = self.pencil.n
        if n <= _ALL_UP_TO:
            first = max(0, n - count)
            found = self._pairs[0][first:], self._pairs[1][:, first:]
        else:
            found = largest(self._inverse, count)
        theta, y = finite(*found)
        shapes, _ = lapack.dtrtrs(self.factor.L, y, lower=1, trans=1)
        return polished(self.pencil, self.shift, theta, shapes / np.sqrt(theta))


def largest(matrix: Reals, count: int) -> Pairs:
    """At most `count` largest eigenvalues of a symmetric matrix, ascending, and their vectors."""
    n = len(matrix)
    first = max(0, n - count)
    try:
        theta, y = la.eigh(matrix, subset_by_index=[first, n - 1])
    except la.LinAlgError:
        # LAPACK's xSYEVR can fail on many eigenvalues that are equal but for rounding
        theta, y = la.eigh(matrix, driver="evd")
        theta, y = theta[first:], y[:, first:]
    return theta, y


def finite(theta: Reals, vectors: Reals) -> Pairs:
    """θ that are not zero, and their vectors."""
    some = theta > _WITHOUT_MASS * theta.max()
    if some.all():
        return theta, vectors
    return theta[some], vectors[:, some]


def polished(pencil: Pencil, shift: float, theta: Reals, shapes: Reals) -> Pairs:
    """Modes far above the lowest, freed of these and solved once more among themselves."""
    values = shift + 1.0 / theta
    high = theta < _POLLUTED * theta.max()
    if not high.any():
        return values, shapes
    shapes = shapes.copy()
    good, X = shapes[:, ~high], shapes[:, high]
    for _ in range(2):
        X = X - good @ (good.T @ (pencil.mass @ X))
    values[high], y = la.eigh(X.T @ (pencil.stiffness @ X), X.T @ (pencil.mass @ X))
    shapes[:, high] = X @ y
    return values, shapes
