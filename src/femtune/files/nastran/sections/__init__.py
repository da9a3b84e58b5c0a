"""Cross sections of PBARL and PBEAML: properties as functions of the dimensions, with exact derivatives.

The sections are drawn with y upwards and z to the right; plane 1 is the plane of the element's x and y axes, and
I1 = ∫ y² dA is the moment of inertia for bending in it. `docs/theory/beam-sections.md` has drawings and accuracies.
"""

from __future__ import annotations

from collections.abc import Mapping

from femtune.files.nastran.sections.boxes import BOX_SHAPES
from femtune.files.nastran.sections.open_shapes import OPEN_SHAPES
from femtune.files.nastran.sections.round_shapes import ROUND_SHAPES
from femtune.files.nastran.sections.shape import SECTION_ROLES, Shape
from femtune.files.nastran.sections.solid import SOLID_SHAPES
from femtune.files.nastran.sections.tee_shapes import TEE_SHAPES
from femtune.files.nastran.sections.torsion import box_torsion, rectangle_torsion

SHAPES: Mapping[str, Shape] = {**ROUND_SHAPES, **SOLID_SHAPES, **BOX_SHAPES, **OPEN_SHAPES, **TEE_SHAPES}
"""Sections by the name that the field TYPE gives."""

__all__ = ["SECTION_ROLES", "SHAPES", "Shape", "box_torsion", "rectangle_torsion"]
