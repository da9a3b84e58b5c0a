"""The shift σ below the spectrum at which the eigenproblem is inverted."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.eigen.krylov import KrylovBasis, begin
from femtune.model.eigen.mass_space import MassSpace
from femtune.model.eigen.pairs import DENSE_UP_TO, EigenSearch, solved_densely
from femtune.model.eigen.pencil import Inverse, Pencil
from femtune.model.mechanisms import check_mechanisms
from femtune.model.solvers.interface import Factor, SingularMatrixError

_LOWEST_OF_SINGLE = 1e-4
"""Lowest elastic eigenvalue relative to k_ii/m_ii of the softest DOF, for a mesh of a thousand DOFs."""
_REFERENCE_DOFS = 1000.0
"""In finer meshes single DOFs are stiffer, with an exponent of 1 in the number of DOFs for shells and 2/3 for
solids."""
_FINE_MESH_DOFS = 10_000
"""DOFs from which on the softest DOF may be that of a mass on the mesh, and the median is taken."""
_FARTHER = 1e3
"""Factor of the next trial of a shift that did not make the matrix positive definite, or is far too near to zero."""
_MOST_TRIALS = 4
"""Trials of a shift: with a factor of 1000 each they cover twelve decades."""
_NEAREST_USABLE = 5e-3
_FARTHEST_USABLE = 1e3
"""Shift over the lowest elastic eigenvalue between which it is good enough: another factorisation would cost more."""
_BEST = 1.0
"""Shift over the lowest elastic eigenvalue that is chosen."""
_RIGID = 1e-6
"""Eigenvalue relative to the largest known one below which a mode counts as a rigid-body mode."""
_NEAREST = 1e6 * np.finfo(float).eps
"""Part of the largest λ of single DOFs: a shift nearer to zero may be lost in the rounding of K."""
_TOO_FAR = 0.02
_STILL_FALLING = 0.7
_NEARER = 1e-2
"""A lowest estimate between the first, as a part of the shift, and the second, as a part of the estimate before, has
not converged, because all modes look alike from so far away: the third is the factor of the next shift."""
_LOST = 1e8
"""Largest θ = 1/(λ − σ) over the smallest one that has half of its digits."""
_ELASTIC_PART = 1e-3
"""Estimates below this part of the shift may be rigid-body modes that rounding lifts from zero."""


def spectral_shift(point: ModelPoint, pencil: Pencil, count: int) -> EigenSearch:
    """A shift below zero of the size of the lowest elastic eigenvalues, the factors of K − σM, and a basis begun.

    A shift much nearer to zero loses digits of the higher modes to the rigid-body ones; one much further away
    slows the iteration.

    Raises
    ------
    FemtuneError : ``eigen.mechanism``, ``eigen.negative``
    """
    size = first_guess(pencil)
    if pencil.n <= DENSE_UP_TO:
        return _small_search(point, pencil, count, size)
    for _ in range(_MOST_TRIALS):
        size, factor = _factor_below(point, pencil, size)
        inverse = Inverse(pencil, -size, factor)
        better, basis = _better_size(inverse, count)
        if better == size:
            return EigenSearch(inverse, None, basis)
        start, size = np.array(basis.vectors), better
        del basis, inverse, factor
    size, factor = _factor_below(point, pencil, size)
    return EigenSearch(Inverse(pencil, -size, factor), start)


def _small_search(point: ModelPoint, pencil: Pencil, count: int, size: float) -> EigenSearch:
    """The same by the modes themselves, which take no longer than the first steps of an iteration."""
    count = min(count, pencil.heavy.size)
    for _ in range(_MOST_TRIALS):
        size, factor = _factor_below(point, pencil, size)
        search = solved_densely(Inverse(pencil, -size, factor), count)
        assert search.solved is not None
        values = search.solved[0]
        # far above the lowest nothing tells where these are
        better = _size_for(values[values + size < _LOST * (values.min() + size)], size)
        if better == size and len(values) < count and not (values > _ELASTIC_PART * size).any():
            # those of the rigid-body motions are so far above the rest that this is lost in rounding
            better = _FARTHER * size
        if better == size:
            break
        size = better
    return search


def near_shift(point: ModelPoint, pencil: Pencil, known: Reals, shift: float, start: Reals) -> EigenSearch:
    """The same from eigenvalues and shapes of a model nearby, and the shift that they were found with."""
    elastic = known[known > _RIGID * known.max(initial=0.0)]
    best = _BEST * float(elastic.min()) if elastic.size else -shift
    if not _NEAREST_USABLE < -shift / best < _FARTHEST_USABLE:
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
    # the softest DOFs of a fine mesh may be those of a few masses on it, and do not represent the mesh
    single = np.median(positive) if pencil.n > _FINE_MESH_DOFS else positive.min()
    return float(_LOWEST_OF_SINGLE * min(1.0, _REFERENCE_DOFS / pencil.n) * single)


def _factor_below(point: ModelPoint, pencil: Pencil, size: float) -> tuple[float, Factor]:
    """Factors of K + size·M, positive definite; a rounding of stiff members may ask for a larger size."""
    for _ in range(_MOST_TRIALS):
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
    if before.size and _TOO_FAR * size < values[0] < _STILL_FALLING * before[0]:
        # all modes look alike from here
        return _NEARER * size, basis
    if not (values > _ELASTIC_PART * size).any() and basis.k < operator.rank:
        # θ of the rigid-body motions is so far above the rest that the start contains nothing else
        return _FARTHER * size, basis
    return _size_for(values, size), basis


def _size_for(values: Reals, size: float) -> float:
    """The size again if it suits the lowest eigenvalues, or a better one."""
    positive = values[values > _RIGID * values.max(initial=0.0)]
    # far below the shift a rigid-body mode looks elastic by rounding, or because the iteration has not converged to it
    elastic = positive[positive > _ELASTIC_PART * size] if (positive > _ELASTIC_PART * size).any() else positive
    lowest = float(elastic.min()) if elastic.size else size
    return size if _NEAREST_USABLE < size / lowest < _FARTHEST_USABLE else _BEST * lowest


def _step(basis: KrylovBasis, size: float) -> Reals:
    """Estimates of the lowest eigenvalues, ascending, after one more step."""
    if not len(basis.B):
        return np.zeros(0)
    basis.step()
    theta = la.eigvalsh(basis.T)
    return np.asarray(1.0 / theta[theta * _LOST > theta[-1]][::-1] - size)
