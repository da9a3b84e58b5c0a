"""The basis of FRFs by complex modes: real and imaginary parts of the exact complex modes, and residual vectors.

A complex mode that lies in the basis is a complex mode of the reduced pencil too, with the same pole and residue, so
that what the reduced pencil adds are the pseudo-modes of the residual vectors.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.model.eigen import EigenSolution
from femtune.model.response.basis import Basis, residual_vectors, ritz_vectors
from femtune.model.response.complex_modes import ComplexModes, modes_of
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from femtune.model.response.rigid import is_rigid

_ROUNDING = 1e-9


def complex_basis(modes: EigenSolution, stiffness: DynamicStiffness, forces: NDArray | None) -> Basis:
    """Rigid-body modes, the elastic parts of as many complex modes as there are wanted real ones, residual vectors."""
    rigid = modes.shapes[:, is_rigid(modes)]
    found = modes_of(modes, stiffness, max(modes.wanted, rigid.shape[1]))
    parts = [_real_parts(found)]
    if forces is not None and forces.shape[1]:
        parts.append(residual_vectors(modes, rigid.shape[1], forces))
    vectors = _without(np.hstack(parts), rigid, stiffness)
    extra, k, m = ritz_vectors(stiffness.point, vectors)
    f = rigid.shape[1]
    return Basis(np.hstack([rigid, extra]), np.concatenate([np.zeros(f), k]), np.concatenate([np.ones(f), m]), f)


def _real_parts(found: ComplexModes) -> NDArray:
    """Real and imaginary parts of the elastic modes, but for those that are rounding of the other part."""
    elastic = found.shapes[:, np.array([kind != "rigid" for kind in found.kinds], dtype=bool)]
    parts = np.hstack([elastic.real, elastic.imag])
    size = np.linalg.norm(parts, axis=0)
    return parts[:, size > _ROUNDING * np.tile(np.linalg.norm(elastic, axis=0), 2)]


def _without(vectors: NDArray, rigid: NDArray, stiffness: DynamicStiffness) -> NDArray:
    """Vectors made M-orthogonal to the rigid-body modes, twice."""
    for _ in range(2):
        vectors = vectors - rigid @ (rigid.T @ (stiffness.point.mass @ vectors))
    return vectors
