"""The six-node shell."""

from __future__ import annotations

from collections.abc import Iterator

from femtune.fem.contribution import Contribution, joined
from femtune.fem.elements.curved_shape import TRI6_SHAPE, triangle_bubble
from femtune.fem.elements.curved_shell import CurvedFormulation, curved_pieces
from femtune.fem.elements.curved_ties import TRI_SHEAR, TRI_STRAIN
from femtune.fem.structure import ElementBatch, Structure

TRI6 = CurvedFormulation(TRI6_SHAPE, TRI_STRAIN, TRI_SHEAR, triangle_bubble)


def tri6(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CTRIA6; errors as of ``check_curved``."""
    return joined(tri6_pieces(batch, structure))


def tri6_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same, some elements at a time."""
    return curved_pieces(batch, structure, TRI6)
