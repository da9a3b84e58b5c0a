"""The shift σ below the spectrum at which the eigenproblem is inverted."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.eigen.krylov import KrylovBasis, begin
from femtune.model.eigen.mass_space import MassSpace
from femtune.model.eigen.pairs import EigenSearch
from femtune.model.eigen.pencil import Inverse, Pencil
from femtune.model.mechanisms import check_mechanisms
from femtune.model.solvers.interface import Factor, SingularMatrixError

# λ of single DOFs, so many times smaller, has the size of the lowest elastic modes of meshes of a thousand DOFs; in
# finer ones single DOFs grow stiffer, with an exponent of 1 for shells and 2/3 for solids
_START, _DOFS, _FINE = 1e-4, 1000.0, 10_000
_FARTHER, _TRIES = 1e3, 4
_LEAST, _MOST = 5e-3, 1e3
"""A shift so many times the lowest elastic eigenvalue is good enough: another factorisation would cost more."""
_BEST, _ZERO = 1.0, 1e-6
_NEAREST = 1e6 * np.finfo(float).eps
"""Part of the largest λ of single DOFs: a shift nearer to zero may be lost in the rounding of K."""
_FAR, _FALLING, _NEARER = 0.02, 0.7, 1e-2


def spectral_shift(point: ModelPoint, pencil: Pencil, count: int) -> EigenSearch:
    """A shift below zero of the size of the lowest elastic eigenvalues, the factors of K − σM, and a basis begun.

    A shift much nearer to zero loses digits of the higher modes to the rigid-body ones; one much further away
    slows the iteration.

    Raises
    ------
    FemtuneError : ``eigen.mechanism``, ``eigen.negative``
    """
    size = first_guess(pencil)
    for _ in range(_TRIES):
        size, factor = _factor_below(point, pencil, size)
        inverse = Inverse(pencil, -size, factor)
        better, basis = _better_size(inverse, count)
        if better == size:
            return EigenSearch(inverse, None, basis)
        start, size = np.array(basis.vectors), better
        del basis, inverse, factor
    size, factor = _factor_below(point, pencil, size)
    return EigenSearch(Inverse(pencil, -size, factor), start)


def near_shift(point: ModelPoint, pencil: Pencil, known: Reals, shift: float, start: Reals) -> EigenSearch:
    """The same from eigenvalues and shapes of a model nearby, and the shift that they were found with."""
    elastic = known[known > _ZERO * known.max(initial=0.0)]
    best = _BEST * float(elastic.min()) if elastic.size else -shift
    if not _LEAST < -shift / best < _MOST:
        # rigid-body modes that rounding lifts from zero look elastic, and so near to zero nothing is accurate
        shift = -max(best, min(-shift, _NEAREST * float((pencil.K.diagonal() / _masses(pencil)).max())))
    size = -shift
    size, factor = _factor_below(point, pencil, size)
    return EigenSearch(Inverse(pencil, -size, factor), start)


def _masses(pencil: Pencil) -> Reals:
    """Diagonal of M, infinite where there is no mass."""
    m = pencil.M.diagonal()
    return np.where(m > 0.0, m, np.inf)


def first_guess(pencil: Pencil) -> float:
    """Size of the lowest elastic eigenvalues as far as single DOFs show it."""
    k, m = pencil.K.diagonal(), pencil.M.diagonal()
    ratios = k[m > 0] / m[m > 0]
    positive = ratios[ratios > 0]
    if not positive.size:
        return 1.0
    # the softest DOFs of a fine mesh may be those of a few masses on it, and tell nothing of the mesh
    single = np.median(positive) if pencil.n > _FINE else positive.min()
    return float(_START * min(1.0, _DOFS / pencil.n) * single)


def _factor_below(point: ModelPoint, pencil: Pencil, size: float) -> tuple[float, Factor]:
    """Factors of K + size·M, positive definite; a rounding of stiff members may ask for a larger size."""
    for _ in range(_TRIES):
        shifted = pencil.shifted(-size)
        try:
            factor = pencil.factorise(-size)
        except SingularMatrixError:
            factor = None
        check_mechanisms(point, shifted, factor)
        if factor is not None and not factor.negative_pivots:
            return size, factor
        size *= _FARTHER
    raise negative_stiffness(point)


def negative_stiffness(point: ModelPoint) -> FemtuneError:
    """The error that a motion has negative strain energy."""
    return FemtuneError(
        "eigen.negative/negative-stiffness", values={"configuration": point.configured.configuration.name}
    )


def _better_size(inverse: Inverse, count: int) -> tuple[float, KrylovBasis]:
    """A size of the shift that is worth another factorisation, or the same, by the first steps of the iteration."""
    size, operator = -inverse.shift, MassSpace(inverse.pencil, inverse.solve).operator
    basis = begin(operator, count)
    before, values = np.zeros(0), _step(basis, size)
    if basis.k < operator.rank and len(basis.B):
        before, values = values, _step(basis, size)
    if before.size and _FAR * size < values[0] < _FALLING * before[0]:
        # all modes look alike from here
        return _NEARER * size, basis
    if not (values > 1e-3 * size).any() and basis.k < operator.rank:
        # rigid-body motions are so far above the rest that the start holds nothing else
        return _FARTHER * size, basis
    positive = values[values > 1e-6 * values.max(initial=0.0)]
    # far below the shift a rigid-body mode looks elastic by rounding, or where the iteration has not got to it
    elastic = positive[positive > 1e-3 * size] if (positive > 1e-3 * size).any() else positive
    lowest = float(elastic.min()) if elastic.size else size
    return (size if _LEAST < size / lowest < _MOST else _BEST * lowest), basis


def _step(basis: KrylovBasis, size: float) -> Reals:
    """Estimates of the lowest eigenvalues, ascending, after one more step."""
    if not len(basis.B):
        return np.zeros(0)
    basis.step()
    theta = la.eigvalsh(basis.T)
    return np.asarray(1.0 / theta[theta > 1e-8 * theta[-1]][::-1] - size)
