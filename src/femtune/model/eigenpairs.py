"""The lowest eigenpairs through (K − σM)⁻¹, densely or by block Lanczos, and how accurate they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.dense_pairs import condensed, dense, finite
from femtune.model.krylov import Basis, Krylov, begin, beside, iterate
from femtune.model.pencil import Inverse, Pencil, pieces
from femtune.model.residuals import energy_residuals
from femtune.model.symmetric import SymmetricMatrix

Reals = NDArray[np.float64]
Pairs = tuple[Reals, Reals]

DENSE_UP_TO = 400
_MOST_ENTRIES = 20_000_000
_ACCURACY = 1e-5
_NEGATIVE = -1e-8
_FAR = 1e-3
"""Residuals of an iteration that has stopped short; nearer ones are left to the check of accuracy."""


@dataclass(frozen=True, eq=False)
class Search:
    """What is asked of one eigenproblem, and what helps.

    Parameters
    ----------
    inverse : (K − σM)⁻¹ for a σ below the spectrum
    start : (n, c) shapes that are nearly those wanted
    basis : a basis that was begun with this factor
    """

    inverse: Inverse
    start: Reals | None = None
    basis: Basis | None = None

    @property
    def pencil(self) -> Pencil:
        """K and M."""
        return self.inverse.pencil

    @property
    def shift(self) -> float:
        """σ."""
        return self.inverse.shift


def lowest(search: Search, count: int, wanted: int, known: Pairs | None = None) -> tuple[Reals, Reals, int]:
    """At most `count` lowest eigenvalues (ascending) and mass-normalised shapes, and how many of them are accurate.

    `known` are eigenvalues and shapes that were found before: others are sought beside them.

    Raises
    ------
    FemtuneError : ``eigen.inaccurate`` where one of the wanted is not, ``eigen.no-convergence``, ``eigen.negative``
    """
    try:
        values, shapes = _pairs(search, count, wanted, known)
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


def _pairs(search: Search, count: int, wanted: int, known: Pairs | None) -> Pairs:
    """Dense for small models, condensed where few DOFs have mass or most modes are wanted, Lanczos else."""
    pencil = search.pencil
    if pencil.n <= DENSE_UP_TO:
        return dense(pencil, search.shift, count)
    if not is_iterative(pencil, count):
        return condensed(search.inverse, count)
    return iterative(search, count, wanted, known)


def method_of(search: Search, count: int) -> str:
    """How `lowest` solves for `count` modes, in words, with the sparse solver whose factors it used."""
    if search.pencil.n <= DENSE_UP_TO:
        return "dense"
    way = "block Lanczos" if is_iterative(search.pencil, count) else "dense, condensed to the DOFs with mass"
    return f"{way}, sparse factors by {search.inverse.solver}"


def is_iterative(pencil: Pencil, count: int) -> bool:
    """True where the iteration is the way."""
    heavy = pencil.heavy.size
    few = heavy <= DENSE_UP_TO and pencil.n * heavy <= _MOST_ENTRIES
    return pencil.n > DENSE_UP_TO and not few and 2 * count < heavy


def iterative(search: Search, count: int, wanted: int, known: Pairs | None = None) -> Pairs:
    """By block Lanczos on (K − σM)⁻¹M."""
    operator = krylov_operator(search.inverse)
    if known is not None:
        missing = count - len(known[0])
        basis = beside(operator, count, 1.0 / (known[0] - search.shift), known[1], missing)
    else:
        basis = search.basis or begin(operator, count, search.start)
    found = iterate(operator, basis, count, wanted)
    left = float(found.error[:wanted].max(initial=0.0))
    if left > _FAR:
        raise _not_converged(count, left)
    theta, shapes = finite(found.theta, found.shapes)
    return search.shift + 1.0 / theta, shapes


def krylov_operator(inverse: Inverse) -> Krylov:
    """S = (K − σM)⁻¹M."""
    return Krylov(inverse.solve, inverse.pencil.mass, inverse.pencil.heavy.size)


def _not_converged(count: int, error: float) -> FemtuneError:
    return FemtuneError(
        "eigen.no-convergence",
        f"the iteration for {count} modes did not converge: its largest relative residual is {error:.1e}",
        hint="ask for fewer modes; look for nearly loose parts",
    )


def _inaccurate(mode: int, value: float, error: float) -> FemtuneError:
    return FemtuneError(
        "eigen.inaccurate",
        f"mode {mode + 1} could not be computed accurately: its relative residual is {error:.1e}",
        values={"frequency (Hz)": f"{np.sqrt(max(value, 0.0)) / (2 * np.pi):.6g}"},
        hint="look for stiffnesses that are many orders of magnitude apart, and for nearly loose parts",
    )


def _indefinite() -> FemtuneError:
    """A matrix that one factorisation found positive definite, another one not."""
    return FemtuneError(
        "eigen.inaccurate",
        "the modes cannot be computed: rounding makes the stiffness matrix indefinite",
        hint="look for stiffnesses that are many orders of magnitude apart, and for nearly loose parts",
    )


def check_negative(pencil: Pencil, values: Reals, shapes: Reals) -> None:
    """Refuse modes of negative strain energy; that of a rigid-body mode is rounding of large parts."""
    below = shapes[:, values < 0.0]
    if not below.shape[1]:
        return
    strain = np.einsum("ij,ij->j", below, pencil.stiffness @ below)
    K = pencil.K
    size = SymmetricMatrix(np.abs(K.data), K.indices, K.indptr)
    parts = [np.einsum("ij,ij->j", u, size @ u) for u in (np.abs(below[:, p]) for p in pieces(0, below.shape[1]))]
    if (strain < _NEGATIVE * np.concatenate(parts)).any():
        raise FemtuneError(
            "eigen.negative",
            f"a mode has negative strain energy: λ = {values.min():.6g} rad²/s²",
            hint="look for negative stiffness or moduli",
        )
