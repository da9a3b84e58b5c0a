"""The effect of small added masses on modes, by Rayleigh's quotient and without a further solution.

With λ, φ of the model with the masses, φᵀ(M + ΔM)φ = 1, the quotient of the model without them at the same shape is
λ/(1 − φᵀΔMφ). Its error is of second order in the change of the shape, and it is never too low for the lowest mode.
Source: Rayleigh, The Theory of Sound, 1877, section 88.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.model.configuration import AddedMass, mass_matrices
from femtune.model.eigen.solution import EigenSolution


@dataclass(frozen=True, eq=False)
class MassEffect:
    """Some masses of a configuration and its modes.

    Parameters
    ----------
    shares : (a, m) φᵀΔMφ of each mass and mode: its part of the modal mass
    freq_hz : (m,) Rayleigh's estimate of the frequencies without these masses
    """

    masses: tuple[AddedMass, ...]
    shares: Reals
    freq_hz: Reals


def effect_of_masses(solution: EigenSolution, masses: Sequence[AddedMass]) -> MassEffect:
    """The effect of some masses of the configuration on its wanted modes.

    Parameters
    ----------
    solution : the modes with the masses
    """
    configured = solution.point.configured
    nodes = configured.model.structure.nodes
    at = np.array([nodes.position(mass.node) for mass in masses], np.int64)
    dofs = (6 * at[:, None] + np.arange(6)).ravel()
    shapes = solution.shapes[:, : solution.wanted]
    motion = (configured.transformation[dofs] @ shapes).reshape(len(masses), 6, -1)
    shares = np.einsum("aim,aij,ajm->am", motion, mass_matrices(nodes, tuple(masses)), motion)
    rest = np.maximum(1.0 - shares.sum(axis=0), np.finfo(float).tiny)
    values = np.maximum(solution.eigenvalues[: solution.wanted], 0.0)
    return MassEffect(tuple(masses), shares, np.sqrt(values / rest) / (2.0 * np.pi))
