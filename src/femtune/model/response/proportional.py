"""Whether damping is proportional (classical), so that the complex modes have the shapes of the real ones.

Source: T. K. Caughey, M. E. J. O'Kelly, Journal of Applied Mechanics 32 (1965).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.configured import ModelPoint
from femtune.model.eigen import EigenSolution

_SAME = 1e-7


def is_proportional(modes: EigenSolution) -> bool:
    """True where dashpots and loss factors couple none of the wanted modes with any other motion.

    Then Cφ = cMφ for each: what is left is measured as energy, against the largest Cφ. Modal damping never couples.
    """
    point = modes.point
    return all(_keeps(modes, A) for A in (point.viscous, point.hysteretic) if np.any(A.data))


def _keeps(modes: EigenSolution, damping: sp.csr_array) -> bool:
    phi = modes.shapes[:, : modes.wanted]
    forces, inertia = np.asarray(damping @ phi), np.asarray(modes.point.mass @ phi)
    # close modes are one subspace, in which damping may turn the vectors
    left = forces - inertia @ _near(modes, phi.T @ forces)
    return bool(_energy(modes, left).max() <= _SAME**2 * _energy(modes, forces).max())


def _near(modes: EigenSolution, coupling: NDArray[np.float64]) -> NDArray[np.float64]:
    """The coupling of modes that coincide."""
    values = modes.eigenvalues[: len(coupling)]
    apart = np.abs(values[:, None] - values) > _SAME * (abs(modes.shift) + np.abs(values))
    return np.where(apart, 0.0, coupling)


def _energy(modes: EigenSolution, forces: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(np.einsum("ij,ij->j", forces, modes.factor.solve(forces)))


def may_be_negative(point: ModelPoint) -> bool:
    """True where a dashpot or a loss factor is below zero on the diagonal of its matrix."""
    return any(bool((A.diagonal() < 0.0).any()) for A in (point.viscous, point.hysteretic))
