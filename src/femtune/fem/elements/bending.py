"""Bending of a straight bar in one plane, as one or two modes of deformation, with releases at its ends.

In (v_a, θ_a, v_b, θ_b) a bar deforms by pure curvature s = (0, −1, 0, 1), flexibility L/EI, and antisymmetrically,
a = (1, L/2, −1, L/2), flexibility L³/12EI + L/κAG; the stiffness is the sum of both outer products. A released DOF
condenses to one mode that does not load it, so every case is Σ g gᵀ / (bending/EI + shear/κAG) with constant g.
Source: Przemieniecki, Theory of Matrix Structural Analysis (1968), section 5.6, rearranged.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Coefficient
from femtune.parameters.jet import Jet

# rows of (v, θ) at both ends among the element's twelve, and the signs for which θ = dv/dx
PLANES = {
    1: (np.array([1, 5, 7, 11]), np.array([1.0, 1.0, 1.0, 1.0])),
    2: (np.array([2, 4, 8, 10]), np.array([1.0, -1.0, 1.0, -1.0])),
}


@dataclass(frozen=True)
class BendingMode:
    """One mode of m elements: `shape` (m, 4); flexibility bending/EI + shear/κAG, both (m,)."""

    at: NDArray[np.int64]
    shape: Reals
    bending: Reals
    shear: Reals


def bending_modes(length: Reals, released: NDArray[np.bool_]) -> list[BendingMode]:
    """Modes of deformation of bars with `released` (e, 4) DOFs, grouped by pattern of releases."""
    modes = []
    for pattern in np.unique(released, axis=0):
        at = np.flatnonzero((released == pattern).all(axis=1))
        modes += _modes(at, length[at], pattern)
    return modes


def _modes(at: NDArray[np.int64], length: Reals, pattern: NDArray[np.bool_]) -> list[BendingMode]:
    one, zero = np.ones_like(length), np.zeros_like(length)
    curvature = np.stack([zero, -one, zero, one], axis=1)
    antisymmetric = np.stack([one, length / 2, -one, length / 2], axis=1)
    if not pattern.any():
        return [
            BendingMode(at, curvature, length, zero),
            BendingMode(at, antisymmetric, length**3 / 12, length),
        ]
    if pattern.sum() > 1 and not _both_translations(pattern):
        return []
    r = int(np.argmax(pattern))
    b1, b2 = curvature[:, r], antisymmetric[:, r]
    shape = b2[:, None] * curvature - b1[:, None] * antisymmetric
    return [BendingMode(at, shape, b1**2 * length**3 / 12 + b2**2 * length, b1**2 * length)]


def _both_translations(pattern: NDArray[np.bool_]) -> bool:
    """True if only the two transverse displacements are released: they load the same mode."""
    return bool((pattern == [True, False, True, False]).all())


def shapes_on_nodes(mode: BendingMode, plane: int, ends: Reals) -> Reals:
    """(m, 12) shapes of a mode on the nodes' displacements; `ends` (e, 12, 12) is the transformation."""
    rows, signs = PLANES[plane]
    return np.asarray(((mode.shape * signs)[:, None, :] @ ends[np.ix_(mode.at, rows)])[:, 0])


def bending_with_shear(inertia: str, factor: str) -> Coefficient:
    """1 / (bending/(E·I) + shear/(K·A·G)): the stiffness of a mode of bending and shear."""

    def stiffness(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        bending = facts["bending"] / (values["E"] * values[inertia])
        return 1.0 / (bending + facts["shear"] / (values[factor] * values["A"] * values["G"]))

    return stiffness
