"""Elements, one small file each: a batch in, a list of contributions out."""

from __future__ import annotations

from collections.abc import Callable

from femtune.fem.contribution import Contribution
from femtune.fem.structure import ElementBatch, Structure

ElementKernel = Callable[[ElementBatch, Structure], list[Contribution]]

KERNELS: dict[str, ElementKernel] = {}
"""Kernel of each batch kind."""


def contributions(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """All exact terms of a batch."""
    return KERNELS[batch.kind](batch, structure)
