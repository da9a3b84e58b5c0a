"""A model point without the damping of its elements."""

from __future__ import annotations

from dataclasses import replace

from femtune.fem.structure import OverallDamping
from femtune.model.configured import ModelPoint


def without_element_damping(point: ModelPoint) -> ModelPoint:
    """The same stiffness and mass, without dashpots and loss factors."""
    configured = point.configured
    modal_only = OverallDamping(mode_ratios=configured.model.structure.damping.mode_ratios)
    structure = replace(configured.model.structure, damping=modal_only)
    kept = tuple(p for p in configured.projected if p.term.matrix in ("stiffness", "mass"))
    bare = replace(configured, model=replace(configured.model, structure=structure), projected=kept)
    return bare.at(point.x)
