"""The sections by the name that the field TYPE gives."""

from __future__ import annotations

from collections.abc import Mapping

from femtune.files.nastran.sections.closed_shapes import BOX_SHAPES, ROUND_SHAPES, SOLID_SHAPES
from femtune.files.nastran.sections.open_shapes import OPEN_SHAPES, TEE_SHAPES
from femtune.files.nastran.sections.shape import Shape

SHAPES: Mapping[str, Shape] = {**ROUND_SHAPES, **SOLID_SHAPES, **BOX_SHAPES, **OPEN_SHAPES, **TEE_SHAPES}
