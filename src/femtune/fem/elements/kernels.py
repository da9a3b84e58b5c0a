"""All kinds of elements, and the terms of a batch of any kind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from femtune.fem.contribution import Contribution, hysteretic
from femtune.fem.elements.bar import BAR
from femtune.fem.elements.connector import FASTENER, WELD
from femtune.fem.elements.curved_bar import CURVED_BAR
from femtune.fem.elements.discrete import (
    BUSH,
    CONCENTRATED_MASS,
    DASHPOT,
    GENERAL_MASS,
    LINE_DASHPOT,
    LINE_SPRING,
    SCALAR_MASS,
    SPRING,
)
from femtune.fem.elements.generic import GENERIC
from femtune.fem.elements.kind import KINDS
from femtune.fem.elements.moving_ends import has_offsets, with_moved_ends
from femtune.fem.elements.rod import ROD
from femtune.fem.elements.shear_panel import SHEAR_PANEL
from femtune.fem.elements.shells.curved import SHELL_QUAD8, SHELL_TRI6
from femtune.fem.elements.shells.flat import SHELL_QUAD, SHELL_ROTATION_TRI, SHELL_TRI
from femtune.fem.elements.solids.hexa8 import HEXA8_KIND
from femtune.fem.elements.solids.penta6 import PENTA6_KIND
from femtune.fem.elements.solids.pyram5 import PYRAM5_KIND
from femtune.fem.elements.solids.quadratic import HEXA20_KIND, PENTA15_KIND, PYRAM13_KIND, TETRA10_KIND
from femtune.fem.elements.solids.tetra4 import TETRA4_KIND
from femtune.fem.elements.tapered_beam import TAPERED_BEAM
from femtune.fem.factors import factored
from femtune.fem.structure import ElementBatch, Structure

KINDS.update(
    (kind.key, kind)
    for kind in (
        BAR,
        TAPERED_BEAM,
        CURVED_BAR,
        ROD,
        SPRING,
        BUSH,
        WELD,
        FASTENER,
        DASHPOT,
        LINE_DASHPOT,
        LINE_SPRING,
        SCALAR_MASS,
        CONCENTRATED_MASS,
        GENERAL_MASS,
        SHEAR_PANEL,
        SHELL_QUAD,
        SHELL_TRI,
        SHELL_ROTATION_TRI,
        SHELL_QUAD8,
        SHELL_TRI6,
        HEXA8_KIND,
        HEXA20_KIND,
        PENTA6_KIND,
        PENTA15_KIND,
        TETRA4_KIND,
        TETRA10_KIND,
        PYRAM5_KIND,
        PYRAM13_KIND,
        GENERIC,
    )
)

ELEMENTS_PER_PIECE = 1024
"""Elements whose contributions are in memory at the same time.

A matrix of 24 DOFs of each takes 5 MB, so that all terms of a piece need some ten MB; the cost of a call is spread over
enough elements.
"""


def contributions(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """All exact terms of a batch; a stiffness whose loss factor is a value of the batch also gives a hysteretic term.

    Factors of whole matrices and offsets of ends are values of the batch if `with_factors` and `with_offsets` have
    added them.
    """
    kernel, structure = KINDS[batch.kind].kernel, batch.within(structure)
    parts = with_moved_ends(kernel, batch, structure) if has_offsets(batch) else kernel(batch, structure)
    return _with_losses(parts, batch)


def pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same, a few elements at a time, so that a large batch takes little memory."""
    by_pieces = KINDS[batch.kind].pieces
    if by_pieces is not None:
        return (_with_losses(parts, batch) for parts in by_pieces(batch, batch.within(structure)))
    starts = range(0, len(batch), ELEMENTS_PER_PIECE)
    return (_piece(batch.some(slice(start, start + ELEMENTS_PER_PIECE)), structure, start) for start in starts)


def _piece(batch: ElementBatch, structure: Structure, start: int) -> list[Contribution]:
    return [replace(part, at=part.at + start) for part in contributions(batch, structure)]


def _with_losses(parts: list[Contribution], batch: ElementBatch) -> list[Contribution]:
    parts = factored(parts, batch)
    return [*parts, *(hysteretic(p) for p in parts if p.matrix == "stiffness" and p.loss in batch.roles)]
