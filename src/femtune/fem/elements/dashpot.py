"""Dashpots (CDAMP1 to 4), and springs and dashpots along a line (CVISC, CBUSH1D)."""

from __future__ import annotations

import numpy as np

from femtune.fem.contribution import Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.discrete import PAIR
from femtune.fem.structure import ElementBatch, Structure

Reals = placement.Reals


def dashpot(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Damping coefficient B between two DOFs, or between one and ground."""
    matrices = np.tile(PAIR, (len(batch), 1, 1))
    return [Contribution("viscous", "dashpot", np.arange(len(batch)), matrices, ("B",), product("B"))]


def line_dashpot(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Damping of stretching, CE, and of twisting, CR, along the unit vectors ``axis`` (e, 3) in the basic frame."""
    at = np.arange(len(batch))
    stretch, twist = _along(batch, structure)
    return [
        Contribution("viscous", "stretching", at, stretch, ("CE",), product("CE")),
        Contribution("viscous", "twisting", at, twist, ("CR",), product("CR")),
    ]


def line_spring(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness K and damping C of stretching along the unit vectors ``axis`` (e, 3) in the basic frame."""
    at = np.arange(len(batch))
    stretch, _ = _along(batch, structure)
    return [
        Contribution("stiffness", "spring", at, stretch, ("K",), product("K")),
        Contribution("viscous", "dashpot", at, stretch, ("C",), product("C")),
    ]


def _along(batch: ElementBatch, structure: Structure) -> tuple[Reals, Reals]:
    """(e, 12, 12) matrices of unit stiffness against stretching and against twisting."""
    axis = batch.facts["axis"]
    axes, still = placement.any_axes(axis), 0.0 * axis
    a, b = (placement.arm_transform(axes, still, placement.node_frames(batch, structure, k)) for k in (0, 1))
    gaps = np.concatenate([-a, b], axis=2)
    return placement.outer(gaps[:, 0]), placement.outer(gaps[:, 3])
