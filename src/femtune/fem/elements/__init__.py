"""Elements, one small file each: a batch in, a list of contributions out."""

from __future__ import annotations

from collections.abc import Callable

from femtune.fem.contribution import Contribution, hysteretic
from femtune.fem.elements.bar import bar
from femtune.fem.elements.bush import bush
from femtune.fem.elements.dashpot import dashpot, line_dashpot, line_spring
from femtune.fem.elements.discrete import scalar_mass, spring
from femtune.fem.elements.point_mass import concentrated_mass, general_mass
from femtune.fem.elements.rod import rod
from femtune.fem.elements.shell import shell_quad, shell_tri
from femtune.fem.elements.tapered_beam import tapered_beam
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
    "shell-quad": shell_quad,
    "shell-tri": shell_tri,
}
"""Kernel of each batch kind."""


def contributions(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """All exact terms of a batch; a stiffness whose loss factor is a value of the batch gives a hysteretic one too."""
    parts = KERNELS[batch.kind](batch, structure)
    return [*parts, *(hysteretic(p) for p in parts if p.matrix == "stiffness" and p.loss in batch.roles)]
