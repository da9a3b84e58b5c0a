"""Scalar springs and masses (CELAS1/2, CMASS1/2): one value between two DOFs, or between one and ground."""

from __future__ import annotations

import numpy as np

from femtune.fem.contribution import Contribution, product
from femtune.fem.structure import ElementBatch, Structure

PAIR = np.array([[1.0, -1.0], [-1.0, 1.0]])


def spring(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness K between the two DOFs."""
    matrices = np.tile(PAIR, (len(batch), 1, 1))
    return [Contribution("stiffness", "spring", np.arange(len(batch)), matrices, ("K",), product("K"))]


def scalar_mass(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Mass M that feels the difference of the two DOFs' accelerations."""
    matrices = np.tile(PAIR * structure.mass_factor, (len(batch), 1, 1))
    return [Contribution("mass", "scalar-mass", np.arange(len(batch)), matrices, ("M",), product("M"))]
