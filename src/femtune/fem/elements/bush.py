"""Bushes (CBUSH): six springs at one place, each held by a rigid arm to a grid point; the second may be ground."""

from __future__ import annotations

import numpy as np

from femtune.fem.contribution import Contribution, product
from femtune.fem.elements import placement
from femtune.fem.structure import ElementBatch, Structure


def bush(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffnesses K1 to K6 along and about the axes of ``frame``; rigid motion is strain-free with any arms."""
    axes = batch.facts["frame"]
    a, b = (
        placement.arm_transform(axes, batch.facts[arm], placement.node_frames(batch, structure, k))
        for k, arm in enumerate(("arm_a", "arm_b"))
    )
    gaps = np.concatenate([-a, b], axis=2)
    at = np.arange(len(batch))
    return [
        Contribution("stiffness", f"K{i + 1}", at, placement.outer(gaps[:, i]), (f"K{i + 1}",), product(f"K{i + 1}"))
        for i in range(6)
    ]
