"""Rigid-body modes: which modes these are, and their names."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import DIRECTIONS
from femtune.fem.checks import rigid_body_modes
from femtune.model.configured import ModelPoint
from femtune.model.eigen.pencil import pieces
from femtune.model.eigen.solution import EigenSolution, solve_modes
from femtune.model.linear.symmetric import SymmetricMatrix

_ZERO = 1e-7
"""λ relative to the shift below which a mode is rigid; the shift has the size of the lowest elastic eigenvalues."""
_ZERO_BY_ROUNDING = 1e-3
"""The same if λ is within the rounding of its own strain energy."""
_ROUNDING = 64 * np.finfo(float).eps
"""Rounding of φᵀKφ relative to the sum of the magnitudes of its terms."""
_STRAIN = 1e-9
_NEGLIGIBLE = 1e-11
"""If the shift is far above the elastic eigenvalues, these must not count as rigid: λ of a rigid mode is below the
first relative to the parts that cancel in the strain energy, or below the second relative to the shift."""
_IN_SPAN = 1e-5
"""Part of a translation or rotation outside the span of the rigid modes, of unit length, up to which it is one of
them."""


def is_rigid(modes: EigenSolution) -> NDArray[np.bool_]:
    """(m,) True for the known modes whose eigenvalue is zero but for rounding."""
    value, shift, parts = np.abs(modes.eigenvalues), abs(modes.shift), _strain_parts(modes)
    unstrained = value <= np.maximum(_STRAIN * parts, _NEGLIGIBLE * shift)
    by_rounding = value <= np.minimum(_ROUNDING * parts, _ZERO_BY_ROUNDING * shift)
    return np.asarray(((value <= _ZERO * shift) & unstrained) | by_rounding)


def _strain_parts(modes: EigenSolution) -> Reals:
    """(m,) |φ|ᵀ|K||φ|: the size of the parts that add up to λ."""
    point = modes.point
    # rigid-body modes are those of the stiffness at rest
    K = (point.at_frequency(0.0) if point.depends_on_frequency else point).symmetric_stiffness
    sizes, phi = SymmetricMatrix(np.abs(K.data), K.indices, K.indptr), np.abs(modes.shapes)
    columns = [np.ascontiguousarray(phi[:, part]) for part in pieces(0, phi.shape[1])]
    return np.concatenate([np.zeros(0), *(np.einsum("ij,ij->j", some, sizes @ some) for some in columns)])


def with_elastic_mode(point: ModelPoint) -> EigenSolution:
    """Modes up to at least one that is elastic, or all that there are."""
    count = 7
    while True:
        modes = solve_modes(point, count)
        if not is_rigid(modes).all() or len(modes.eigenvalues) < count:
            return modes
        count *= 2


def rigid_names(modes: EigenSolution) -> list[str]:
    """Names of the rigid-body motions (translations and rotations about the origin) that are free.

    A free motion that is not one of the six (a hinge, a skew motion) is named by the DOF that moves most.
    """
    configured = modes.point.configured
    motion = configured.transformation @ modes.shapes[:, is_rigid(modes)]
    free = la.orth(motion)
    geometric = rigid_body_modes(configured.model.structure.nodes)
    scaled = geometric / np.maximum(np.linalg.norm(geometric, axis=0), 1e-300)
    left = np.linalg.norm(scaled - free @ (free.T @ scaled), axis=0)
    names = [DIRECTIONS[1 + i] for i in np.flatnonzero(left < _IN_SPAN) if geometric[:, i].any()]
    if len(names) >= free.shape[1]:
        return names
    known = la.orth(scaled[:, left < _IN_SPAN]) if names else np.zeros((len(free), 0))
    rest = la.orth(free - known @ (known.T @ free), rcond=1e-6)
    largest = np.argmax(np.abs(rest), axis=0)
    return names + [str(configured.model.structure.nodes.describe(int(i)))[:-1] for i in largest]
