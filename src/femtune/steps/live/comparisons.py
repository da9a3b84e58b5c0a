"""Certificates of one configuration: the live model beside the models that it stands for, at points of both ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune.model.reduce.training import candidates
from femtune.steps.live.certificate import MOST_ERROR, CertifiedLive, FirstModel, FullModel
from femtune.steps.live.frfs import ComparedFunctions, function_percent, live_values
from femtune.steps.live.record import LiveCertificate, LiveFunctionErrors
from femtune.steps.live.region import SEED

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.model import EigenSolution
    from femtune.model.live import LivePorts
    from femtune.steps.live.first import First, Work
    from femtune.steps.live.points import Points

_POINTS = 50
"""Points of the certificate, in the region and within the ranges of the parameters each; there are corners besides."""
FULL_POINTS = 4
"""Points, in the region and in the ranges each, at which the live model of a reduced one is compared with the full one:
the two at which it differs most from the reduced one, and two more."""
MOST_PERCENT = 3.0
"""Error of a frequency, in %, from which no live model is made for these ranges of the parameters."""

Certificates = tuple[LiveCertificate | None, LiveCertificate, LiveCertificate | None, LiveCertificate | None]
FunctionErrors = tuple[LiveFunctionErrors | None, LiveFunctionErrors | None]


def certificates(
    certified: CertifiedLive, first: First, vectors: Reals, full: Reals,
    functions: Sequence[tuple[ComparedFunctions, LivePorts]], points: Points, work: Work,
) -> tuple[Certificates, list[FunctionErrors]]:  # fmt: skip
    """In the region and the ranges, beside the model that the live one is made of, and both beside the full one;
    and the errors of the functions beside the full one."""
    state, corners = certified.state, points.corners()
    case = state.case.on_full_model
    rows = np.asarray(case.sensors.toarray() if first.basis is None else case.sensors @ first.basis)
    other = FirstModel("full model" if first.basis is None else "reduced model", first.model, rows, vectors)
    region = points.in_region(_POINTS, 5, certified=True)
    bounds = np.vstack([candidates(*points.box, _POINTS, 0, SEED + 50), corners])
    inside, inside_errors = certified.beside(other, region, 0)
    wide, wide_errors = certified.beside(other, bounds, len(corners))
    assert wide is not None
    too_large = max(inside_errors.max(initial=0.0), wide_errors.max()) > MOST_PERCENT
    if too_large or (first.basis is None and not functions):
        return (inside, wide, None, None), [(None, None) for _ in functions]
    done = iter(range(2 * FULL_POINTS))
    found: list[list[tuple[float, int]]] = [[] for _ in functions]

    def told() -> None:
        what = f"live model of {state.case.name} beside the full model"
        work.progress.step(what, next(done), 2 * FULL_POINTS)
        work.solutions += 1

    def also(x: Reals, solution: EigenSolution) -> None:
        for (one, ports), percents in zip(functions, found):
            values = live_values(ports, certified.live, x)
            percents.append((MOST_ERROR, 0) if values is None else function_percent(values, one.of_full(solution)))

    # the functions of the full model have modes up to twice the highest line
    least = max((p.count for _, p in functions), default=0)
    whole = FullModel(state, case.configured, full, told, least, also)
    at, beyond = _to_compare(inside_errors, len(region)), _to_compare(wide_errors, _POINTS)
    inside_full, _ = certified.beside(whole, region[at], 0)
    of_region = [_function_errors(one, p) for (one, _), p in zip(functions, found)]
    for percents in found:
        percents.clear()
    wide_full, _ = certified.beside(whole, bounds[beyond], sum(i >= _POINTS for i in beyond))
    errors = list(zip(of_region, [_function_errors(one, p) for (one, _), p in zip(functions, found)]))
    if first.basis is None:
        inside_full = wide_full = None
    return (inside, wide, inside_full, wide_full), errors


def _function_errors(one: ComparedFunctions, found: Sequence[tuple[float, int]]) -> LiveFunctionErrors | None:
    if not found:
        return None
    percent, worst = max(found)
    output, of_input = divmod(worst, len(one.inputs))
    return LiveFunctionErrors(
        points=len(found), percent=min(percent, MOST_ERROR), function=f"{one.outputs[output]} by {one.inputs[of_input]}"
    )


def _to_compare(errors: Reals, inner: int) -> list[int]:
    """Positions of the two points with the largest errors, of the first inner point and of the last one (a corner where
    there are corners), filled up with further inner ones."""
    worst = np.argsort(-errors, kind="stable")[:2].tolist()
    order = [*worst, 0, len(errors) - 1, *range(1, inner)]
    return list(dict.fromkeys(i for i in order if 0 <= i < len(errors)))[:FULL_POINTS]


def too_inaccurate(percent: float, order: int, configuration: str) -> str:
    if percent >= MOST_ERROR:
        return (
            f"at some values of the parameters either the model or a live model of order {order} has no modes, and the "
            f"other one has some ({configuration})"
        )
    return (
        f"a live model of order {order} would have errors of {percent:.2g} % at some values of the parameters, and the "
        f"limit is {MOST_PERCENT:.0f} % ({configuration})"
    )
