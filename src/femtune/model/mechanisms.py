"""Massless mechanisms: motions with neither stiffness nor mass make the eigenproblem singular."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import Factor

_SUSPECT = 1e-9
"""Smallest eigenvalue of the scaled matrix below which its motion is examined."""
_NO_ENERGY = 1e-12
"""Energy of a motion, relative to the sum of the magnitudes of its terms, that is rounding of zero."""
_PERTURBATION = 1e-13
"""Relative change of the diagonal by which a singular matrix can be factorised: some roundings of it."""
_INVERSE_ITERATIONS = 3
"""They separate a mechanism, which is nine decades below the other eigenvalues, completely."""
_MOVES_MOST = 0.3
"""Displacement relative to the largest one of DOFs that are named."""


def check_mechanisms(point: ModelPoint, shifted: SymmetricMatrix, factor: Factor | None) -> None:
    """Refuse K − σM (σ < 0) when it is singular to working precision, naming the DOFs that move.

    `factor` is None where the factorisation itself met a zero pivot.

    Raises
    ------
    FemtuneError : ``eigen.mechanism``
    """
    diagonal = shifted.diagonal()
    empty = np.flatnonzero(diagonal == 0.0)
    if empty.size:
        raise _mechanism(point, empty)
    if (diagonal < 0.0).any():
        return
    scale = 1.0 / np.sqrt(diagonal)
    smallest, motion = _smallest(factor or _nearly(shifted, diagonal), scale)
    if smallest < _SUSPECT and _is_massless_mechanism(point, motion * scale):
        raise _mechanism(point, _largest(motion))


def _nearly(shifted: SymmetricMatrix, diagonal: NDArray) -> Factor:
    """Factors of a matrix that differs from the singular one by rounding."""
    data = shifted.data.copy()
    data[shifted.indptr[:-1]] += _PERTURBATION * diagonal
    return factorise(SymmetricMatrix(data, shifted.indices, shifted.indptr))


def _smallest(factor: Factor, scale: NDArray) -> tuple[float, NDArray]:
    """Smallest eigenvalue of D^-½ A D^-½ and its vector, by three inverse iterations."""
    v = np.random.default_rng(2).standard_normal(len(scale))
    value = np.inf
    for _ in range(_INVERSE_ITERATIONS):
        v /= np.linalg.norm(v)
        w = factor.solve(v / scale) / scale
        value, v = float(1.0 / np.linalg.norm(w)), w
    return value, v / np.linalg.norm(v)


def _is_massless_mechanism(point: ModelPoint, v: NDArray) -> bool:
    """True where a motion has no energy of either kind; a rigid-body motion has kinetic energy."""
    K, M = point.symmetric_stiffness, point.symmetric_mass
    u = np.abs(v)
    strain, strain_parts = v @ (K @ v), u @ (SymmetricMatrix(np.abs(K.data), K.indices, K.indptr) @ u)
    kinetic, kinetic_size = v @ (M @ v), (u.max() ** 2) * M.diagonal().max()
    return bool(strain <= _NO_ENERGY * strain_parts and kinetic <= _NO_ENERGY * kinetic_size)


def _largest(motion: NDArray) -> NDArray[np.int64]:
    size = np.abs(motion)
    return np.flatnonzero(size > _MOVES_MOST * size.max())


def _mechanism(point: ModelPoint, free: NDArray[np.int64]) -> FemtuneError:
    configured = point.configured
    moving = [configured.free_dof(int(i)) for i in free[:6]]
    names = [str(dof)[:-1] for dof in moving]
    return FemtuneError(
        "eigen.mechanism",
        values={"DOFs that move": ", ".join(names) + (" …" if len(free) > 6 else "")},
        configuration=configured.configuration.name,
        grid=moving[0].node,
    )
