"""The lowest eigenpairs through (K − σM)⁻¹, densely or by block Lanczos, and how accurate they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from scipy.linalg import lapack

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.eigen.accuracy import energy_residuals
from femtune.model.eigen.krylov import TOLERANCE, KrylovBasis, begin, beside, iterate
from femtune.model.eigen.mass_space import MassSpace
from femtune.model.eigen.pencil import Inverse, Pencil, pieces
from femtune.model.linear.symmetric import SymmetricMatrix

# ----------------------------------------------------------------------------------------------------
# The lowest eigenpairs of small problems: densely, or from the flexibility of the DOFs that have mass.


_WITHOUT_MASS = 1e-14
"""θ below this fraction of the largest belong to directions without mass: rounding of the largest is 1e-16."""
_POLLUTED = 1e-7
"""θ below this fraction of the largest have lost half of their digits to the large ones, and are solved once more."""


def dense(pencil: Pencil, shift: float, count: int) -> Pairs:
    """By the inverse: eigenvalues θ = 1/(λ − σ) of L⁻¹ML⁻ᵀ; M may be singular."""
    # without the checks of SciPy's own functions, which take longer than the work on a small model
    L, failed = lapack.dpotrf(pencil.shifted(shift).dense().T, lower=1)
    if failed:
        raise la.LinAlgError(f"the leading minor of order {failed} is not positive")
    inverse, _ = lapack.dsygst(pencil.M.dense().T, L, itype=1, lower=1)
    theta, y = finite(*largest(inverse, count))
    shapes = lapack.dtrtrs(L, y, lower=1, trans=1)[0] / np.sqrt(theta)
    return _polished(pencil, shift, theta, shapes)


def condensed(inverse: Inverse, count: int) -> Pairs:
    """All modes from the flexibility G of the DOFs with mass: θ of LᵀML with G = LLᵀ."""
    pencil, heavy = inverse.pencil, inverse.pencil.heavy
    unit = np.zeros((pencil.n, heavy.size), order="F")
    unit[heavy, np.arange(heavy.size)] = 1.0
    X = inverse.solve(unit)
    G, m = X[heavy], pencil.M.full()[heavy][:, heavy].toarray()
    L = la.cholesky(0.5 * (G + G.T), lower=True)
    theta, y = finite(*largest(L.T @ m @ L, count))
    return _polished(pencil, inverse.shift, theta, X @ (m @ (L @ y)) / theta**1.5)


def largest(matrix: Reals, count: int) -> Pairs:
    """At most `count` largest eigenvalues, ascending, and their vectors; of the matrix the lower part is read."""
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


def _polished(pencil: Pencil, shift: float, theta: Reals, shapes: Reals) -> Pairs:
    """Modes far above the lowest, freed of these and solved once more among themselves."""
    values, shapes = shift + 1.0 / theta, shapes.copy()
    high = theta < _POLLUTED * theta.max()
    if not high.any():
        return values, shapes
    good, X = shapes[:, ~high], shapes[:, high]
    for _ in range(2):
        X = X - good @ (good.T @ (pencil.mass @ X))
    values[high], y = la.eigh(X.T @ (pencil.stiffness @ X), X.T @ (pencil.mass @ X))
    shapes[:, high] = X @ y
    return values, shapes


Pairs = tuple[Reals, Reals]

DENSE_UP_TO = 400
"""DOFs up to which dense matrices are solved: there they are as fast as an iteration, and find all modes."""
_MOST_ENTRIES = 20_000_000
"""Entries of the columns of (K − σM)⁻¹ at the DOFs with mass that may be stored: 160 MB."""
_ACCURACY = 1e-5
"""Largest residual in energy of a mode; its eigenvalue then has a relative error of the order of 1e-10."""
_NEGATIVE_ENERGY = -1e-8
"""Strain energy relative to the sum of the magnitudes of its terms that is more than rounding of a rigid-body mode."""
_NOT_CONVERGED = 1e-3
"""Residual of an iteration that has stopped too early; smaller ones are left to the check of accuracy."""


@dataclass(frozen=True, eq=False)
class EigenSearch:
    """What is asked of one eigenproblem, and what helps.

    Parameters
    ----------
    inverse : (K − σM)⁻¹ for a σ below the spectrum
    start : (n, c) shapes that are nearly those wanted
    basis : a basis that was begun with this factor
    solved : the lowest pairs, where they are known
    """

    inverse: Inverse
    start: Reals | None = None
    basis: KrylovBasis | None = None
    solved: Pairs | None = None

    @property
    def pencil(self) -> Pencil:
        """K and M."""
        return self.inverse.pencil

    @property
    def shift(self) -> float:
        """σ."""
        return self.inverse.shift


def lowest(search: EigenSearch, count: int, wanted: int, known: Pairs | None = None) -> tuple[Reals, Reals, int]:
    """At most `count` lowest eigenvalues (ascending) and mass-normalised shapes, and how many of them are accurate.

    Dense for small models, by Lanczos for large ones, condensed where few DOFs have mass or most modes are wanted.
    `known` are eigenvalues and shapes that were found before: others are sought beside them.

    Raises
    ------
    FemtuneError : ``eigen.inaccurate`` where one of the wanted is not, ``eigen.no-convergence``, ``eigen.negative``
    """
    try:
        if search.solved is not None:
            values, shapes = search.solved
        elif search.pencil.n <= DENSE_UP_TO:
            values, shapes = dense(search.pencil, search.shift, count)
        elif is_iterative(search.pencil, count):
            values, shapes = iterative(search, count, wanted, known)
        else:
            values, shapes = condensed(search.inverse, count)
    except la.LinAlgError as broken:
        raise _indefinite() from broken
    if (np.diff(values) < 0.0).any():
        order = np.argsort(values)
        values, shapes = values[order], shapes[:, order]
    check_negative(search.pencil, values, shapes)
    error = energy_residuals(search.inverse, values, shapes, min(wanted, len(values)))
    bad = np.flatnonzero(~(error <= _ACCURACY))
    accurate = int(bad[0]) if bad.size else len(values)
    if accurate < min(wanted, len(values)):
        raise _inaccurate(accurate, float(values[accurate]), float(error[accurate]))
    return values, shapes, accurate


def solved_densely(inverse: Inverse, count: int) -> EigenSearch:
    """A small eigenproblem that is solved for its `count` lowest pairs (error ``eigen.inaccurate``)."""
    try:
        return EigenSearch(inverse, solved=dense(inverse.pencil, inverse.shift, count))
    except la.LinAlgError as broken:
        raise _indefinite() from broken


def method_of(search: EigenSearch, count: int) -> str:
    """How `lowest` solves for `count` modes, in words, with the sparse solver whose factors it used."""
    if search.pencil.n <= DENSE_UP_TO:
        return "dense"
    way = "block Lanczos" if is_iterative(search.pencil, count) else "dense, condensed to the DOFs with mass"
    return f"{way}, sparse factors by {search.inverse.solver}"


def is_iterative(pencil: Pencil, count: int) -> bool:
    """True if the modes are found by iteration."""
    heavy = pencil.heavy.size
    few = heavy <= DENSE_UP_TO and pencil.n * heavy <= _MOST_ENTRIES
    return pencil.n > DENSE_UP_TO and not few and 2 * count < heavy


def iterative(search: EigenSearch, count: int, wanted: int, known: Pairs | None = None) -> Pairs:
    """By block Lanczos on (K − σM)⁻¹M."""
    space = MassSpace(search.pencil, search.inverse.solve)
    operator = space.operator
    if known is not None:
        missing = count - len(known[0])
        basis = beside(operator, count, 1.0 / (known[0] - search.shift), space.start(known[1]), missing)
    else:
        start = None if search.start is None else space.start(search.start)
        basis = search.basis or begin(operator, count, start)
    pairs = space.finished(iterate(operator, basis, count, wanted, space.looser * TOLERANCE))
    left = float(pairs.error[:wanted].max(initial=0.0))
    if left > _NOT_CONVERGED:
        raise _not_converged(count, left)
    theta, shapes = finite(pairs.theta, pairs.shapes)
    return search.shift + 1.0 / theta, shapes


def _not_converged(count: int, error: float) -> FemtuneError:
    return FemtuneError("eigen.no-convergence", count=count, residual=error)


def _inaccurate(mode: int, value: float, error: float) -> FemtuneError:
    return FemtuneError(
        "eigen.inaccurate",
        values={"frequency (Hz)": f"{np.sqrt(max(value, 0.0)) / (2 * np.pi):.6g}"},
        mode=mode + 1,
        residual=error,
    )


def _indefinite() -> FemtuneError:
    """A matrix that one factorisation found positive definite, another one not."""
    return FemtuneError("eigen.inaccurate/indefinite")


def check_negative(pencil: Pencil, values: Reals, shapes: Reals) -> None:
    """Refuse modes of negative strain energy; that of a rigid-body mode is rounding of large parts."""
    below = shapes[:, values < 0.0]
    if not below.shape[1]:
        return
    strain = np.einsum("ij,ij->j", below, pencil.stiffness @ below)
    K = pencil.K
    size = SymmetricMatrix(np.abs(K.data), K.indices, K.indptr)
    parts = [np.einsum("ij,ij->j", u, size @ u) for u in (np.abs(below[:, p]) for p in pieces(0, below.shape[1]))]
    if (strain < _NEGATIVE_ENERGY * np.concatenate(parts)).any():
        raise FemtuneError("eigen.negative", eigenvalue=values.min())
