"""Effect of the position of the mass of beams whose neutral axis differs from the line of shear centres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.fem.assemble import offset_mass
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.linear.sparse_products import column_major
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.resembling import resembling_hz
from femtune.model.response.rigid import is_rigid

_DEPENDENT = 1e-8
"""Singular value of unit vectors, relative to the largest, below which they are dependent: half of the digits."""


@dataclass(frozen=True)
class OffsetMassChange:
    """Frequencies with the structural mass of beams on the line of their shear centres.

    Parameters
    ----------
    beams : number of beams with mass and a neutral axis (N1, N2) beside the shear centre
    freq_hz, moved_hz : (m,) of the modes, and of those of the same shape with the mass moved; NaN for rigid-body modes
        and where no mode resembles
    """

    beams: int
    freq_hz: Reals
    moved_hz: Reals

    @property
    def change(self) -> Reals:
        """(m,) relative change of each frequency; NaN for rigid-body modes and where no mode resembles."""
        return np.asarray(self.moved_hz / self.freq_hz - 1.0)


def offset_beams(point: ModelPoint) -> int:
    """Number of beams with mass whose neutral axis is beside the shear centre."""
    return _offset_mass(point)[1]


def offset_mass_change(solution: EigenSolution) -> OffsetMassChange | None:
    """The effect of the other place of the mass; None without such beams.

    Ritz vectors in the span of all computed modes and of the static responses to the inertia forces that move: for a
    small change this is one step of inverse iteration, and no further factorisation is needed.
    """
    point, shapes = solution.point, solution.shapes
    part, beams = _offset_mass(point)
    if not beams:
        return None
    T = point.configured.transformation
    mass = _Less(point.symmetric_mass, T.T @ part @ T)
    # any shift will do
    factor = solution.known_factor or solution.sturm_factor or solution.factor
    further = factor.solve(column_major(mass.part @ shapes))
    further = further - shapes @ (shapes.T @ (mass.whole @ column_major(further)))
    size = np.linalg.norm(further, axis=0)
    U, strength, _ = la.svd(further / np.where(size > 0.0, size, 1.0), full_matrices=False)
    basis = np.hstack([shapes, U[:, strength > _DEPENDENT * strength.max(initial=0.0)]])
    rigid = is_rigid(solution)[: solution.wanted]
    moved_hz = resembling_hz(shapes[:, : solution.wanted], column_major(basis), point.symmetric_stiffness, mass)
    return OffsetMassChange(beams, np.where(rigid, np.nan, solution.freq_hz), np.where(rigid, np.nan, moved_hz))


@dataclass(frozen=True)
class _Less:
    """The whole less a part of it, as they multiply vectors."""

    whole: SymmetricMatrix
    part: sp.csr_array

    def __matmul__(self, vectors: Reals) -> Reals:
        return np.asarray(self.whole @ column_major(vectors) - self.part @ vectors)


def _offset_mass(point: ModelPoint) -> tuple[sp.csr_array, int]:
    """The part of the mass matrix on all DOFs, and the number of beams."""
    return offset_mass(point.structure, point.configured.configuration.elements_off)
