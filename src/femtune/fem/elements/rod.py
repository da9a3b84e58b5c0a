"""Rods (CROD, CONROD): stretching and twisting between two grid points."""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.differential import Differential, of_rod
from femtune.fem.elements.kind import ElementKind
from femtune.fem.elements.line_mass import line_mass
from femtune.fem.structure import ElementBatch, Structure


def rod(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness E·A and G·J, and mass, of rods.

    Raises
    ------
    FemtuneError : ``element.zero-length``
    """
    length, ends = _placed(batch, structure)
    at = np.arange(len(batch))
    stretch, twist = (placement.outer(ends[:, r + 6] - ends[:, r]) / length[:, None, None] for r in (0, 3))
    return [
        Contribution("stiffness", "axial", at, stretch, ("E", "A"), product("E", "A")),
        Contribution("stiffness", "torsion", at, twist, ("G", "J"), product("G", "J")),
        *line_mass(batch, structure, ends, length, bending=False),
    ]


def _placed(batch: ElementBatch, structure: Structure) -> tuple[Reals, Reals]:
    """Lengths (e,) and the transformation (e, 12, 12) onto the nodes' displacements."""
    start, end = (placement.node_positions(batch, structure, k) for k in (0, 1))
    x, length = placement.line_axes(batch, start, end)
    axes, still = placement.any_axes(x), 0.0 * x
    a, b = (placement.arm_transform(axes, still, placement.node_frames(batch, structure, k)) for k in (0, 1))
    return length, placement.join_ends(a, b)


def rod_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """Differential stiffness of the axial force; errors as of `rod`."""
    length, ends = _placed(batch, structure)
    return of_rod(ends, length)


ROD = ElementKind("rod", rod, line=True, differential=rod_differential)
