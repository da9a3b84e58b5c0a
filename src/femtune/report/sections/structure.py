"""The structure that pictures of modes show, from the arrays of the results."""

from __future__ import annotations

import numpy as np

from femtune.report.figures.shapes import Wireframe
from femtune.report.source import Source
from femtune.study.results_shapes import ModeShapes

_RIGID = 1


def structure_of(source: Source, kept: ModeShapes) -> Wireframe | None:
    """Points, lines and faces; None where they were not kept. Results of before shells were drawn have no faces."""
    points, lines, kinds = map(source.array, (kept.points_key, kept.lines_key, kept.line_kinds_key))
    if points is None or lines is None or kinds is None:
        return None
    faces = source.array(kept.faces_key)
    none = np.zeros((0, 4), np.int64)
    return Wireframe(
        points.astype(float), lines.astype(np.int64), kinds == _RIGID, none if faces is None else faces.astype(np.int64)
    )
