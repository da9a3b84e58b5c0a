"""The facts that stay the same while an update goes on, and what they make of a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.residuals import Evaluation, UpdateProblem
from femtune.select import identifiability
from femtune.status import Status
from femtune.update.regularise import LinearModel, SideConstraint
from femtune.update.regularise.names import position
from femtune.update.search import LocalModel

Reals = NDArray[np.float64]
Flags = NDArray[np.bool_]

_ROUNDING = 1e-7


@dataclass(frozen=True)
class Point:
    """An evaluation with the rows of the side constraint."""

    evaluation: Evaluation
    residuals: Reals
    jacobian: Reals

    @property
    def objective(self) -> float:
        """½ rᵀr, side constraint included."""
        return 0.5 * float(self.residuals @ self.residuals)

    @property
    def x(self) -> Reals:
        """Normalised parameters."""
        return self.evaluation.x


@dataclass(frozen=True)
class Walk:
    """A problem, the parameters that move and the side constraint."""

    problem: UpdateProblem
    moving: Flags
    side: SideConstraint

    def point(self, evaluation: Evaluation) -> Point:
        """The evaluation with the side constraint."""
        extra, rows = self.side.rows(evaluation.x)
        residuals = np.concatenate([evaluation.residuals, extra])
        return Point(evaluation, residuals, np.vstack([evaluation.jacobian, rows]))

    def objective(self, evaluation: Evaluation) -> float:
        """½ rᵀr of an evaluation that may lack derivatives, side constraint included."""
        extra, _ = self.side.rows(evaluation.x)
        return evaluation.objective + 0.5 * float(extra @ extra)

    def local(self, point: Point) -> LocalModel:
        """The linear model there, with the room that bounds leave; none where a parameter rests."""
        lower, upper = self.problem.parameters.bounds
        room = np.where(self.moving, lower - point.x, 0.0), np.where(self.moving, upper - point.x, 0.0)
        return LocalModel(point.residuals, point.jacobian, *room, self.problem.parameters.prior[1], self.side.held)

    def moved(self, x: Reals, d: Reals) -> Reals:
        """x + d, kept from leaving the bounds by rounding."""
        lower, upper = self.problem.parameters.bounds
        return np.where(self.moving, np.clip(x + d, lower, upper), x)

    def at_bound(self, x: Reals) -> Flags:
        """Moving parameters that touch a bound."""
        lower, upper = self.problem.parameters.bounds
        near = 1e-9 * (upper - lower)
        return np.asarray(((x <= lower + near) | (x >= upper - near)) & self.moving)

    def optimum(self, point: Point) -> Status:
        """What kind of an optimum a point is where nothing changes any more."""
        bound = self.at_bound(point.x)
        free = self.moving & ~bound
        _, sd = self.problem.parameters.prior
        names = tuple(p.name for p in self.problem.parameters.free)
        known = identifiability(point.jacobian[:, free], sd[free], tuple(n for n, f in zip(names, free) if f))
        if known.undetermined:
            return Status.UNDETERMINED
        if bound.any():
            return Status.CONVERGED_AT_BOUNDS
        return Status.EXACT if point.objective < max(1e-16, self.rounding(point)) else Status.CONVERGED

    def rounding(self, point: Point) -> float:
        """Objectives that are rounding: 1e-7 of what a prior standard deviation of the parameters does to residuals."""
        spread = self.problem.parameters.prior[1] * self.moving
        return 0.5 * float(np.sum((_ROUNDING * point.jacobian * spread) ** 2))


def moving_parameters(problem: UpdateProblem, active: Sequence[str] | None) -> Flags:
    """(k,) which free parameters move: all of them where `active` is None.

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``, ``update.nothing-moves``
    """
    moving = np.full(len(problem.parameters.free), active is None)
    for name in active or ():
        moving[position(problem.parameters, name)] = True
    if active is not None and not moving.any():
        raise FemtuneError(
            "update.nothing-moves",
            "no parameter is named that the update may move",
            values={"free parameters": ", ".join(p.name for p in problem.parameters.free)},
            hint="name one or more, or leave `active` out to move all",
        )
    return moving


def linear_model(problem: UpdateProblem, at: Evaluation, moving: Flags) -> LinearModel:
    """What a regularisation is settled on."""
    return LinearModel(problem.parameters, at.x, at.residuals, at.jacobian, moving)
