"""Bushes (CBUSH): six springs and dashpots at one place, held by rigid arms to two grid points, or one and ground."""

from __future__ import annotations

import numpy as np

from femtune.fem.contribution import Contribution, product
from femtune.fem.elements import placement
from femtune.fem.structure import ElementBatch, Structure


def bush(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffnesses K1 to K6 and damping B1 to B6 along and about the axes of ``frame``, with loss factors GE1 to GE6.

    Rigid motion is strain-free with any arms.
    """
    axes = batch.facts["frame"]
    a, b = (
        placement.arm_transform(axes, batch.facts[arm], placement.node_frames(batch, structure, k))
        for k, arm in enumerate(("arm_a", "arm_b"))
    )
    gaps = np.concatenate([-a, b], axis=2)
    out: list[Contribution] = []
    for i in range(6):
        out += _direction(batch, i + 1, placement.outer(gaps[:, i]))
    return out


def _direction(batch: ElementBatch, i: int, matrices: placement.Reals) -> list[Contribution]:
    """Spring and dashpot of a direction from 1 to 6."""
    at = np.arange(len(batch))
    k, b = f"K{i}", f"B{i}"
    spring = Contribution("stiffness", k, at, matrices, (k,), product(k), loss=f"GE{i}")
    return [spring, *([Contribution("viscous", b, at, matrices, (b,), product(b))] if b in batch.roles else [])]
