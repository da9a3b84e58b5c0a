"""The shift σ below the spectrum at which the eigenproblem is inverted."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.factorise import Factor, SingularMatrixError, factorise
from femtune.model.mechanisms import check_mechanisms

# a start this far below the stiffest single DOFs is below the lowest elastic modes of ordinary meshes
_START = 1e-4
_FARTHER, _TRIES = 1e3, 4


def spectral_shift(point: ModelPoint, K: sp.csr_array, M: sp.csr_array) -> tuple[float, Factor]:
    """A shift below zero of the size of the lowest elastic eigenvalues, and the factors of K − σM.

    A shift much nearer to zero loses digits of the higher modes to the rigid-body ones; one much further away
    slows the iteration.

    Raises
    ------
    FemtuneError : ``eigen.mechanism``, ``eigen.negative``
    """
    k, m = K.diagonal(), M.diagonal()
    ratios = k[m > 0] / m[m > 0]
    positive = ratios[ratios > 0]
    size, factor = _factor_below(point, K, M, _START * positive.min() if positive.size else 1.0)
    better = _elastic_size(K, M, factor, size)
    if not 1e-3 < size / better < 1e2:
        size, factor = _factor_below(point, K, M, better)
    return -size, factor


def _factor_below(point: ModelPoint, K: sp.csr_array, M: sp.csr_array, size: float) -> tuple[float, Factor]:
    """Factors of K + size·M, positive definite; a rounding of stiff members may ask for a larger size."""
    for _ in range(_TRIES):
        shifted = sp.csr_array(K + size * M)
        try:
            factor = factorise(shifted)
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
        "eigen.negative",
        "the stiffness or mass matrix has negative eigenvalues",
        values={"configuration": point.configured.configuration.name},
        hint="look for negative stiffness, moduli, inertia or masses",
    )


def _elastic_size(K: sp.csr_array, M: sp.csr_array, factor: Factor, size: float) -> float:
    """Rough size of the lowest elastic eigenvalue, by a few inverse iterations on a small block."""
    n = K.shape[0]
    block: NDArray = np.random.default_rng(0).standard_normal((n, min(n, 8)))
    for _ in range(3):
        block = la.qr(factor.solve(M @ block), mode="economic")[0]
    k, m = block.T @ (K @ block), block.T @ (M @ block)
    try:
        theta = la.eigvalsh(m, k + size * m)
    except la.LinAlgError:  # numbers of too many sizes; the modes are checked when they are found
        return size
    values = 1.0 / theta[theta > 1e-8 * theta[-1]] - size
    positive = values[values > 1e-6 * values.max(initial=0.0)]
    # far below the shift a rigid-body mode of little inertia looks elastic by rounding
    elastic = positive[positive > 1e-3 * size] if (positive > 1e-3 * size).any() else positive
    return float(elastic.min()) if elastic.size else size
