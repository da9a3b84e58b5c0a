"""What a page draws of a live model, and the points at which it can carry a mass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.live.matrices import solved
from femtune.steps.modes.shapes import shape_rows

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.model.live import LiveModel
    from femtune.steps.live.points import Points
    from femtune.study.cases import StudyCase

DRAWING_BYTES = 700_000
"""Bytes of the vectors that shapes are drawn with."""
_DRAWN = 1e-3
"""Part of a motion that drawing may leave out."""
_MOST_MASS_POINTS = 60
"""Points of a model that is kept whole that can carry a mass: a list of them fits a page."""
_MOST_CARRIED = 8
"""Points of a reduced live model that can carry a mass: each takes three vectors."""
NO_POINTS = "no sensor is at a grid point of the model"
"""Why no mass can be added."""


def drawing(case: StudyCase, full: Reals, model: LiveModel, points: Points, configurations: int) -> dict[str, NDArray]:
    """Vectors in which the shapes of the points lie, in steps of 8 bits, and their parts in the live model."""
    shown = shape_rows(case)
    count = len(shown.mesh.used)
    if not count:
        return {}
    motion = np.asarray(sp.csr_array(shown.matrix[: 3 * count]) @ full)
    where = [model.at, *points.in_region(4, 7), *points.in_ranges(8, 7)]
    shapes = np.hstack([m.shapes for x in where if (m := solved(model, x)) is not None])
    seen = motion @ shapes
    seen /= np.maximum(np.linalg.norm(seen, axis=0), 1e-300)
    left, size, _ = np.linalg.svd(seen, full_matrices=False)
    most = max(model.count, DRAWING_BYTES // (3 * count * max(1, configurations)))
    left = left[:, : min(int((size > _DRAWN * size[0]).sum()), most)]
    steps = np.abs(left).max(axis=0) / 127.0
    return {
        "drawing": np.round(left / steps).astype(np.int8).reshape(count, 3, -1),
        "drawing_weights": np.asarray(steps[:, None] * (left.T @ motion), np.float32),
    }


def mass_points(case: StudyCase, whole: bool) -> list[int]:
    """Grid points of sensors at which a mass can be added: all of a model that is kept whole, else some whose static
    responses the bases have."""
    matches = () if case.sensors is None else case.sensors.matches
    known = set(case.configured.model.structure.nodes.ids.tolist())
    points = [n for n in dict.fromkeys(m.node for m in matches if m.node is not None) if n in known]
    if whole:
        return points[:_MOST_MASS_POINTS]
    spread = np.linspace(0, len(points) - 1, min(len(points), _MOST_CARRIED)).round().astype(int)
    return [points[i] for i in sorted(set(spread.tolist()))]


def mass_rows(points: Sequence[int], case: StudyCase, full: Reals) -> dict[str, NDArray]:
    """Translations of the points that can carry a mass."""
    if not points:
        return {}
    rows = translations(points, case)
    return {"mass_rows": np.asarray(rows @ full, np.float32).reshape(len(points), 3, -1)}


def translations(points: Sequence[int], case: StudyCase) -> sp.csr_array:
    """(3 points, n_free) rows that see the translations of grid points."""
    at = [case.configured.model.structure.nodes.position(n) for n in points]
    return sp.csr_array(case.configured.transformation[(6 * np.array(at)[:, None] + np.arange(3)).ravel()])
