"""The eight-node shell."""

from __future__ import annotations

from collections.abc import Iterator

from femtune.fem.contribution import Contribution, joined
from femtune.fem.elements.curved_shape import QUAD8_SHAPE
from femtune.fem.elements.curved_shell import CurvedFormulation, curved_pieces
from femtune.fem.elements.curved_ties import QUAD_SHEAR, QUAD_STRAIN
from femtune.fem.structure import ElementBatch, Structure

QUAD8 = CurvedFormulation(QUAD8_SHAPE, QUAD_STRAIN, QUAD_SHEAR)


def quad8(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CQUAD8; errors as of ``check_curved``."""
    return joined(quad8_pieces(batch, structure))


def quad8_pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same, some elements at a time."""
    return curved_pieces(batch, structure, QUAD8)
