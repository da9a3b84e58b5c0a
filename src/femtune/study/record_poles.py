"""Complex modes beside the frequency responses: whether they are worth a table, and their records."""

from __future__ import annotations

import numpy as np

from femtune.errors import FemtuneError, Notice
from femtune.model import ModelPoint
from femtune.model.response.proportional import is_proportional, may_be_negative
from femtune.study.load import Study
from femtune.study.response_request import ResponseRequest
from femtune.study.response_solver import PoleTable, Solve, solved_poles
from femtune.study.results_response import ComplexPole

_ROUNDING = 1e-12
_SHOWN = 6


def listed_poles(
    study: Study, request: ResponseRequest, point: ModelPoint, modes: Solve, *, damped: bool
) -> tuple[PoleTable | None, str]:
    """Complex modes, or why there are none; where FRFs do without them their failure is no reason to stop."""
    if reason := _not_listed(request, point, modes, damped):
        return None, reason
    try:
        return solved_poles(study, request, point, modes), ""
    except FemtuneError as error:
        if not error.code.startswith(("complex.", "response.defective")):
            raise
        return None, f"{error.what} ({error.code})"


def _not_listed(request: ResponseRequest, point: ModelPoint, modes: Solve, damped: bool) -> str:
    """Why complex modes would say nothing that the real ones do not, or are not asked for; "" where they are listed."""
    if not damped:
        return "nothing damps the model"
    if _may_grow(request, point):
        return ""
    if not np.any(point.viscous.data) and not np.any(point.hysteretic.data):
        return "with modal damping they are the real modes"
    if request.method == "direct":
        return 'they are computed by the methods "real modes" and "complex modes"'
    if request.method == "real-modes" and is_proportional(modes()):
        return "damping is proportional, so they have the shapes of the real modes"
    return ""


def _may_grow(request: ResponseRequest, point: ModelPoint) -> bool:
    """Negative damping has no frequency response, whatever the method: only the poles tell."""
    return may_be_negative(point) or (request.damping is not None and bool((request.damping.values < 0.0).any()))


def unstable(request: ResponseRequest, poles: PoleTable | None) -> tuple[Notice, ...]:
    """The notice that the motion grows by itself."""
    growing = (
        [] if poles is None else [f"{f:.6g}" for f, z in zip(poles.freq_hz, poles.damping_ratio) if z < -_ROUNDING]
    )
    if not growing:
        return ()
    more = f" and {len(growing) - _SHOWN} more" if len(growing) > _SHOWN else ""
    what = (
        f"{request.case.name}: damping is negative at {', '.join(growing[:_SHOWN])} Hz{more}, so the motion grows by "
        "itself and has no frequency response; look for dashpots and loss factors below zero"
    )
    return (Notice("response.unstable", what),)


def pole_records(table: PoleTable) -> tuple[ComplexPole, ...]:
    """A record of each complex mode."""
    columns = zip(table.kind_words(), table.freq_hz, table.damping_ratio, table.phase_collinearity,
                  table.real_mode, table.real_freq_hz)  # fmt: skip
    return tuple(
        ComplexPole(
            kind=kind, freq_hz=float(f), damping_ratio=float(z) if np.isfinite(z) else None, real_mode=int(mode) + 1,
            phase_collinearity=min(1.0, float(c)), real_freq_hz=float(natural),
        )
        for kind, f, z, c, mode, natural in columns
    )  # fmt: skip
