"""True beside linear χ² along the principal axes of the covariance, where solutions of the model are cheap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.judge.linearity import compare, principal_axes
from femtune.steps.judge.record.linearity import AxisFacts, ValleyResults

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.judge.linearity import AxisPoint
    from femtune.steps.judge.finished_update import FinishedUpdate
    from femtune.updating import UpdateResult

SMALL_DOFS = 1_000
"""Free DOFs of all configurations together up to which the axes are followed."""
MEDIUM_DOFS = 20_000
"""The same up to which the widest axis is followed."""
_MOST_POINTS = 24
"""Solutions of a small model: less than most updates take."""
_LARGE_PART = 0.3
"""Part of a parameter in an axis, relative to its largest one, from which it is named."""
_MOST_NAMED = 3
"""Parameters that name an axis."""


def linearity(fit: FinishedUpdate) -> ValleyResults:
    """The points, or the reason why there are none."""
    result, dofs = fit.result, sum(state.case.configured.n_free for state in fit.result.after.states)
    reason = _not_tested(fit, dofs)
    if reason:
        return ValleyResults(reason=reason)
    side = result.side
    values, rows = side.rows(result.x)
    residuals = np.concatenate([result.after.residuals, values])
    jacobian = np.vstack([result.after.jacobian, rows])
    names = [p.name for p in result.parameters.free]
    spread = result.parameters.prior[1]
    moving = np.isin(names, result.active) & ~np.isin(names, result.at_bound)
    axes = principal_axes(jacobian, spread, moving)
    problem = fit.study.problem()

    def chi_square(x: Reals) -> float:
        there = problem.follow(x, result.after, derivatives=False)
        opinion, _ = side.rows(x)
        return 2.0 * there.objective + float(opinion @ opinion)

    fit.progress.step("χ² along the principal axes of the covariance", 0, None)
    most = _MOST_POINTS if dofs <= SMALL_DOFS else 2
    points, left = compare(result.x, residuals, jacobian, axes, result.parameters.bounds, chi_square, most)
    return ValleyResults(points=tuple(_facts(p, axes[p.axis - 1] / spread, names) for p in points), axes_left=left)


def _not_tested(fit: FinishedUpdate, dofs: int) -> str:
    result: UpdateResult = fit.result
    if fit.study.source.needs_runs:
        return "each point would need a run of the solver"
    if fit.study.file.stage:
        return "the update had stages"
    if not result.status.ok:
        return "the update did not end at an optimum"
    if result.side.renewed is not None or not len(result.after.residuals):
        return "the result is not the minimum of one sum of squares"
    return "the model is large" if dofs > MEDIUM_DOFS else ""


def _facts(point: AxisPoint, parts: Reals, names: list[str]) -> AxisFacts:
    largest = np.abs(parts).max()
    order = [int(i) for i in np.argsort(-np.abs(parts)) if abs(parts[i]) >= _LARGE_PART * largest][:_MOST_NAMED]
    sign = np.sign(parts[order[0]])
    named = ", ".join(f"{'+' if sign * parts[i] > 0 else '−'}{names[i]}" for i in order)
    return AxisFacts(
        axis=named, step=float(sign * point.step), linear=point.linear,
        true=float(point.true) if np.isfinite(point.true) else None, curved=point.curved,
    )  # fmt: skip
