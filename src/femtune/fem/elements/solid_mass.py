"""Mass of solids for a unit density: consistent, or lumped in proportion to the diagonal of the consistent one.

Source of the lumping: Hinton, Rock and Zienkiewicz, Earthq. Engng Struct. Dyn. 4 (1976) 245-249.
"""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.solid_strains import Reals
from femtune.fem.structure import Structure


def mass_matrices(shares: Reals, frames: Reals | None, structure: Structure) -> Reals:
    """(m, 3n, 3n) from the integrals (m, n, n) of products of shape functions and the nodes' frames (m, n, 3, 3)."""
    shares = shares * structure.mass_factor
    if not structure.consistent_mass:
        shares, frames = lumped(shares), None
    m, n = shares.shape[:2]
    if frames is None:
        return np.asarray((shares[:, :, None, :, None] * np.eye(3)[:, None, :]).reshape(m, 3 * n, 3 * n))
    turn = np.swapaxes(frames, 2, 3).reshape(m, 3 * n, 3)
    between = turn @ np.swapaxes(turn, 1, 2)
    spread = np.repeat(np.repeat(shares, 3, axis=1), 3, axis=2)
    return np.asarray(0.5 * (between + np.swapaxes(between, 1, 2)) * spread)


def lumped(shares: Reals) -> Reals:
    """(m, n, n) diagonal shares in proportion to the consistent ones, with the same sum."""
    own = np.einsum("mii->mi", shares)
    whole = shares.sum(axis=(1, 2)) / own.sum(axis=1)
    return np.asarray(np.eye(shares.shape[1]) * (own * whole[:, None])[:, None, :])
