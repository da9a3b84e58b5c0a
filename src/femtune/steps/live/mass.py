"""The mass of a configuration as a sum over the mass matrices of its live model, beside masses that were weighed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune.model.response import mass_response
from femtune.residuals.mass import MassResidual
from femtune.steps.live.record import LiveConfiguration, LiveMass, LiveWeighed

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.model.live import LiveModel
    from femtune.residuals import CaseState, Evaluation
    from femtune.steps.live.points import Points

_MOST_TERMS = 24
"""Mass matrices of a live model up to which the mass is followed: each needs a point with the mass of the model."""
_MOST_DOFS = 50_000
"""Degrees of freedom up to which the mass is followed where nothing was weighed."""
_SAME = 1e-6
"""Difference relative to the mass, or of sums of squares, that is rounding."""


def page_mass(state: CaseState, live: LiveModel, points: Points, at: Evaluation) -> LiveMass | None:
    """The mass; None where it does not change, or is no such sum.

    Parameters
    ----------
    at : the updated point
    """
    case = state.case.on_full_model
    terms = [t for t in live.terms if t.kind == "mass"]
    weighed = _weighed(state, at)
    if not terms or len(terms) > _MOST_TERMS or (case.configured.n_free > _MOST_DOFS and not weighed):
        return None

    def mass(x: Reals) -> float:
        return float(mass_response(case.configured.at(x)).properties.mass)

    updated, places = mass(live.at), points.in_ranges(len(terms) + 4, 9)
    functions = np.array([[t.function.at(x, live.lower, live.upper)[0] for t in terms] for x in places])
    changes = np.array([mass(x) for x in places]) - updated
    slopes = np.linalg.lstsq(functions, changes, rcond=None)[0]
    if np.abs(functions @ slopes - changes).max() > _SAME * updated or not np.abs(changes).max() > _SAME * updated:
        return None
    return LiveMass(updated=updated, slopes=tuple(slopes.tolist()), weighed=weighed)


def _weighed(state: CaseState, at: Evaluation) -> tuple[LiveWeighed, ...]:
    """What was weighed, if its sum of squares is that of the update."""
    found = []
    for residual in state.case.on_full_model.residuals:
        if isinstance(residual, MassResidual) and residual.weights.covariance is None:
            found.append(LiveWeighed(mass=residual.mass, sd=float(np.max(np.asarray(residual.weights.sd)))))
    if not found:
        return ()
    blocks = [b.values for b in at.blocks if b.kind == MassResidual.label and b.configuration == state.case.name]
    model = float(mass_response(state.full).properties.mass)
    own, wanted = sum(((model - w.mass) / w.sd) ** 2 for w in found), sum(float(v @ v) for v in blocks)
    return tuple(found) if abs(own - wanted) <= _SAME * max(1.0, wanted) else ()


def whole_masses(
    configurations: Sequence[LiveConfiguration], at: Evaluation
) -> tuple[list[LiveConfiguration], frozenset[str]]:
    """The kind of weighed masses, if the page computes all of them; without any of them otherwise."""
    wanted = {b.configuration for b in at.blocks if b.kind == MassResidual.label}
    done = {c.configuration for c in configurations if c.mass is not None and c.mass.weighed}
    if wanted == done:
        return list(configurations), frozenset({MassResidual.label} if done else ())
    bare = [
        c.model_copy(update={"mass": None if c.mass is None else c.mass.model_copy(update={"weighed": ()})})
        for c in configurations
    ]
    return bare, frozenset()
