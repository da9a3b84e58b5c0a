"""The mass reduced to the sensors by a page, for criteria of orthogonality: whether it is that of the full model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from femtune.correlation import NotTested, ReducedMass, reduce_mass
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.modal.shape_criteria import cross_orthogonality
from femtune.model.live.matrices import solved
from femtune.steps.correlate.criteria import of_whole_tests
from femtune.steps.live.record import LiveReducedMass
from femtune.validation.criteria import DIAGONAL, OFF_DIAGONAL, SELF

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.arrays import Reals
    from femtune.model.live import LiveModel
    from femtune.residuals import CaseState
    from femtune.steps.live.first import First
    from femtune.steps.live.points import Points
    from femtune.study.study import Study

ORTHOGONALITY = (DIAGONAL, OFF_DIAGONAL, SELF)
"""Quantities of criteria that need the mass at the sensors."""
_MOST_SENSORS = 40
"""Sensors at most: each takes a static response into the second basis."""
_MOST_DIFFERENCE = 5e-3
"""Difference of an orthogonality from that of the full model from which the page does not compute it."""
_UNSEEN = 1e-9
"""Motion of the sensors in a mode, relative to that of the others, below which they do not see it."""


def wants_reduced_mass(study: Study, state: CaseState, first: First) -> bool:
    """Whether the criteria of a study need the mass at the sensors, and a page can have it: of full matrices, and for
    shapes that were measured at all of the sensors."""
    test = state.case.test
    return (
        first.basis is None
        and 2 <= len(test.dofs) <= _MOST_SENSORS
        and not np.iscomplexobj(test.shapes)
        and bool(np.isfinite(test.shapes).all())
        and any(c.quantity in ORTHOGONALITY for c in of_whole_tests(study))
    )


def page_reduced_mass(state: CaseState, live: LiveModel, sensors: NDArray, points: Points) -> LiveReducedMass | None:
    """Its sensors, and the largest difference from the full model; None where that is too large.

    Parameters
    ----------
    sensors : (s, q) their motion in the coordinates of the live model
    """
    case, test, sensors = state.case.on_full_model, state.case.test, np.asarray(sensors, float)
    kept: tuple[int, ...] | None = None
    worst, count = 0.0, 0
    for x in [live.at, *points.in_region(4, 8), *points.in_ranges(6, 8)]:
        modes = solved(live, x)
        if modes is None:
            continue
        seen = sensors @ modes.shapes
        model = ModeSet(modes.freq_hz, seen, test.dofs)
        shifted, mass = live.matrices(x)
        point = case.configured.at(x)
        K, M, C = (sp.csc_array(m) for m in (shifted + live.shift * mass, mass, sensors))
        own = reduce_mass(K, M, C, model)
        full = reduce_mass(point.stiffness, point.mass, case.sensors, model)
        if isinstance(own, NotTested) or isinstance(full, NotTested):
            return None
        kept = kept or full.kept
        if own.kept != kept or full.kept != kept:
            return None
        try:
            worst, count = max(worst, _difference(own, full, test.shapes, seen)), count + 1
        except FemtuneError:
            # a test shape that is zero at the sensors: its orthogonality is not tested either
            return None
    if kept is None or worst > _MOST_DIFFERENCE:
        return None
    return LiveReducedMass(sensors=kept, points=count, difference=worst)


def _difference(own: ReducedMass, full: ReducedMass, tests: NDArray, seen: Reals) -> float:
    """Largest difference of an orthogonality of test shapes with each other and with those of the model."""
    rows = list(own.kept)
    size = np.abs(seen[rows]).max(axis=0)
    shapes = np.hstack([tests[rows], seen[rows][:, size > _UNSEEN * size.max()]])
    found, wanted = (cross_orthogonality(tests[rows], shapes, m.mass) for m in (own, full))
    return float(np.abs(found - wanted).max())
