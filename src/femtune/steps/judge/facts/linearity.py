"""True beside linear χ² along the principal axes of the covariance, where solutions of the model are cheap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.judge.linearity import compare, principal_axes
from femtune.residuals import OfPairs, state_at
from femtune.residuals.frf.on_reduced import ReducedFrfs
from femtune.steps.judge.record.linearity import AxisFacts, ValleyResults

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.judge.linearity import AxisPoint
    from femtune.residuals import ComparedCase, Evaluation, UpdateProblem
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
    result = fit.result
    reason = _not_applicable(fit)
    if reason:
        return ValleyResults(reason=reason)
    problem, at = _cheapest(fit)
    dofs = sum(_full_dofs(case) for case in problem.cases)
    if dofs > MEDIUM_DOFS:
        return ValleyResults(reason="the model is large")
    side = result.side
    values, rows = side.rows(result.x)
    residuals, jacobian = np.concatenate([at.residuals, values]), np.vstack([at.jacobian, rows])
    names = [p.name for p in result.parameters.free]
    spread = result.parameters.prior[1]
    moving = np.isin(names, result.active) & ~np.isin(names, result.at_bound)
    axes = principal_axes(jacobian, spread, moving)

    def chi_square(x: Reals) -> float:
        there = problem.follow(x, at, derivatives=False)
        opinion, _ = side.rows(x)
        return 2.0 * there.objective + float(opinion @ opinion)

    fit.progress.step("χ² along the principal axes of the covariance", 0, None)
    most = _MOST_POINTS if dofs <= SMALL_DOFS else 2
    points, left = compare(result.x, residuals, jacobian, axes, result.parameters.bounds, chi_square, most)
    return ValleyResults(points=tuple(_facts(p, axes[p.axis - 1] / spread, names) for p in points), axes_left=left)


def _cheapest(fit: FinishedUpdate) -> tuple[UpdateProblem, Evaluation]:
    """The update problem on its reduced models where it has them, and its evaluation at the result.

    Both χ² are then of the reduced models, so that their errors at the result do not count as curvature.
    """
    full = fit.study.problem()
    if fit.search is None:
        return full, fit.result.after
    problem = fit.search.reduced_problem()
    states = [state_at(case, fit.result.x) for case in problem.cases]
    paired = [s.with_groups(a.groups) if a.groups else s for s, a in zip(states, fit.result.after.states)]
    return problem, problem.assess(fit.result.x, paired)


def _full_dofs(case: ComparedCase) -> int:
    """Free DOFs of the full model that each point solves; none where a reduced model serves all residuals."""
    served = case.full is not None and all(isinstance(r, (OfPairs, ReducedFrfs)) for r in case.residuals)
    return 0 if served else (case.full or case).configured.n_free


def _not_applicable(fit: FinishedUpdate) -> str:
    result: UpdateResult = fit.result
    if fit.study.source.needs_runs:
        return "each point would need a run of the solver"
    if fit.study.file.stage:
        return "the update had stages"
    if not result.status.ok:
        return "the update did not end at an optimum"
    if result.side.renewed is not None or not len(result.after.residuals):
        return "the result is not the minimum of one sum of squares"
    return ""


def _facts(point: AxisPoint, parts: Reals, names: list[str]) -> AxisFacts:
    largest = np.abs(parts).max()
    order = [int(i) for i in np.argsort(-np.abs(parts)) if abs(parts[i]) >= _LARGE_PART * largest][:_MOST_NAMED]
    sign = np.sign(parts[order[0]])
    named = ", ".join(f"{'+' if sign * parts[i] > 0 else '−'}{names[i]}" for i in order)
    return AxisFacts(
        axis=named, step=float(sign * point.step), linear=point.linear,
        true=float(point.true) if np.isfinite(point.true) else None, curved=point.curved,
    )  # fmt: skip
