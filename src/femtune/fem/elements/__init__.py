"""Elements, one small file each: a batch in, a list of contributions out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from femtune.fem.contribution import Contribution, hysteretic
from femtune.fem.elements.bar import bar
from femtune.fem.elements.bush import bush
from femtune.fem.elements.dashpot import dashpot, line_dashpot, line_spring
from femtune.fem.elements.discrete import scalar_mass, spring
from femtune.fem.elements.generic import generic
from femtune.fem.elements.hexa8 import hexa8
from femtune.fem.elements.hexa20 import hexa20
from femtune.fem.elements.moved_ends import has_offsets, with_moved_ends
from femtune.fem.elements.penta6 import penta6
from femtune.fem.elements.penta15 import penta15
from femtune.fem.elements.point_mass import concentrated_mass, general_mass
from femtune.fem.elements.pyram5 import pyram5
from femtune.fem.elements.pyram13 import pyram13
from femtune.fem.elements.quad8 import quad8, quad8_pieces
from femtune.fem.elements.rod import rod
from femtune.fem.elements.shear_panel import shear_panel
from femtune.fem.elements.shell import shell_quad, shell_quad_pieces, shell_tri, shell_tri_pieces
from femtune.fem.elements.tapered_beam import tapered_beam
from femtune.fem.elements.tetra4 import tetra4
from femtune.fem.elements.tetra10 import tetra10
from femtune.fem.elements.tri6 import tri6, tri6_pieces
from femtune.fem.factors import factored
from femtune.fem.structure import ElementBatch, Structure

ElementKernel = Callable[[ElementBatch, Structure], list[Contribution]]

KERNELS: dict[str, ElementKernel] = {
    "bar": bar,
    "tapered-beam": tapered_beam,
    "rod": rod,
    "spring": spring,
    "bush": bush,
    "dashpot": dashpot,
    "line-dashpot": line_dashpot,
    "line-spring": line_spring,
    "scalar-mass": scalar_mass,
    "concentrated-mass": concentrated_mass,
    "general-mass": general_mass,
    "shear-panel": shear_panel,
    "shell-quad": shell_quad,
    "shell-tri": shell_tri,
    "shell-quad8": quad8,
    "shell-tri6": tri6,
    "hexa8": hexa8,
    "hexa20": hexa20,
    "penta15": penta15,
    "tetra10": tetra10,
    "pyram13": pyram13,
    "penta6": penta6,
    "tetra4": tetra4,
    "pyram5": pyram5,
    "generic": generic,
}
"""Kernel of each batch kind."""


PIECES: dict[str, Callable[[ElementBatch, Structure], Iterator[list[Contribution]]]] = {
    "shell-quad": shell_quad_pieces,
    "shell-tri": shell_tri_pieces,
    "shell-quad8": quad8_pieces,
    "shell-tri6": tri6_pieces,
}
"""Kernels that go through a batch themselves, since its elements have something in common."""

# elements whose contributions live at once where the kernel takes them one by one
PIECE = 1024


def contributions(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """All exact terms of a batch; a stiffness whose loss factor is a value of the batch gives a hysteretic one too.

    Factors of whole matrices and offsets of ends are those values of the batch that `with_factors` and `with_offsets`
    made of them.
    """
    kernel = KERNELS[batch.kind]
    parts = with_moved_ends(kernel, batch, structure) if has_offsets(batch) else kernel(batch, structure)
    return _with_losses(parts, batch)


def pieces(batch: ElementBatch, structure: Structure) -> Iterator[list[Contribution]]:
    """The same, a few elements at a time, so that a large batch takes little memory."""
    if batch.kind in PIECES:
        return (_with_losses(parts, batch) for parts in PIECES[batch.kind](batch, structure))
    starts = range(0, len(batch), PIECE)
    return (_piece(_part(batch, slice(start, start + PIECE)), structure, start) for start in starts)


def _piece(batch: ElementBatch, structure: Structure, start: int) -> list[Contribution]:
    return [replace(part, at=part.at + start) for part in contributions(batch, structure)]


def _part(batch: ElementBatch, rows: slice) -> ElementBatch:
    roles, facts = ({name: a[rows] for name, a in arrays.items()} for arrays in (batch.roles, batch.facts))
    return replace(batch, ids=batch.ids[rows], nodes=batch.nodes[rows], dofs=batch.dofs[rows], roles=roles, facts=facts)


def _with_losses(parts: list[Contribution], batch: ElementBatch) -> list[Contribution]:
    parts = factored(parts, batch)
    return [*parts, *(hysteretic(p) for p in parts if p.matrix == "stiffness" and p.loss in batch.roles)]
