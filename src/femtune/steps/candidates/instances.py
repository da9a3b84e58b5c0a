"""Populations of instances of the candidates: those that the test does not falsify, and what they predict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.errors import FemtuneError
from femtune.experiments import latin_hypercube
from femtune.selection.instances import near_instances
from femtune.selection.minimax import smallest_largest
from femtune.steps.candidates.record import InstanceInterval, InstancePrediction, InstanceResults
from femtune.study.executor import executor_of
from femtune.study.model_runs import FrequencyRuns, ResidualRuns, followed_modes, runs_at
from femtune.updating.sensitivity_method import moving_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from femtune.arrays import Flags, Reals
    from femtune.residuals import Evaluation, UpdateProblem
    from femtune.study.progress import Progress
    from femtune.study.study import Study

_ENOUGH = 0.05
"""Part of the instances within the bounds from which those that are not falsified need no second population."""
_WIDER = 1.5
"""Distance of the limit of the linearised residuals of the second population from the smallest possible residual, over
that of the limit itself: room for what the model's curvature changes at the edges of the region."""


@dataclass(frozen=True)
class Limit:
    """What falsifies an instance: a residual above `largest`, or, without it, a mean error above `mean_error`."""

    largest: float | None
    mean_error: float = np.inf

    def keeps(self, residuals: Reals, weights: float) -> Flags:
        """(n,) instances with residuals (n, m) that are not falsified; infinite where one failed."""
        if self.largest is not None:
            return np.asarray(np.abs(residuals).max(axis=1) <= self.largest)
        return np.asarray(np.sqrt(np.sum(residuals**2, axis=1) / weights) <= self.mean_error)


@dataclass(frozen=True, eq=False)
class InstancePopulation:
    """Instances of one candidate.

    Parameters
    ----------
    study : with the ties of the candidate
    names : parameters that move
    end : (k,) all free parameters at the optimum
    """

    study: Study
    problem: UpdateProblem
    names: Sequence[str]
    end: Reals
    limit: Limit
    progress: Progress

    def results(self, count: int, seed: int, key: str, arrays: dict[str, Any]) -> InstanceResults:
        """Draw, falsify, and predict by those that are left (errors of the model at the initial values)."""
        moving = moving_parameters(self.problem, self.names)
        before = self.problem.start(np.zeros(len(moving)))
        lower, upper = (np.asarray(edge)[moving] for edge in self.problem.parameters.bounds)
        x = np.zeros((count, len(moving)))
        x[:, moving] = lower + latin_hypercube(len(lower), count, seed, optimised=False).points * (upper - lower)
        keeps, failed = self._judged(x, before)
        kept, near = x[keeps], np.zeros((0, len(moving)))
        if len(kept) < _ENOUGH * count and (at := self._admissible(before, moving)) is not None:
            near = np.tile(at.x, (count, 1))
            near[:, moving] += self._near(at, moving, lower, upper, count, seed)
            of_near, failed_near = self._judged(near, before)
            failed += failed_near
            kept = np.vstack([kept, near[of_near]])
        values = self.problem.parameters.denormalise(kept) if len(kept) else np.zeros((0, len(moving)))
        at_places = [i for i, moves in enumerate(moving) if moves]
        hz, places = self._predicted(kept)
        arrays[key] = np.hstack([np.atleast_2d(values)[:, at_places], hz])
        return InstanceResults(
            drawn=count, kept=int(keeps.sum()), drawn_near=len(near), kept_near=len(kept) - int(keeps.sum()),
            failed=failed,
            parameters=tuple(
                InstanceInterval(
                    parameter=self.problem.parameters.free[i].name,
                    lower=float(values[:, i].min()), upper=float(values[:, i].max()),
                )
                for i in at_places
            ) if len(kept) else (),
            predictions=tuple(
                InstancePrediction(
                    configuration=case, mode=mode, lower_hz=float(np.nanmin(hz[:, j])),
                    upper_hz=float(np.nanmax(hz[:, j])),
                )
                for j, (case, mode) in enumerate(places)
            ),
            instances_key=key,
        )  # fmt: skip

    def _judged(self, x: Reals, before: Evaluation) -> tuple[Flags, int]:
        """(n,) instances that are not falsified, and the number of those that failed."""
        work, what = ResidualRuns(self.problem, before), "instances of a candidate"
        runs = runs_at(work, list(x), executor_of(self.study), self.progress, what)
        good = np.array([not run.problem for run in runs])
        residuals = np.array([run.values for run in runs])
        return good & self.limit.keeps(np.where(good[:, None], residuals, np.inf), before.weights), int((~good).sum())

    def _admissible(self, before: Evaluation, moving: Flags) -> Evaluation | None:
        """A point that is not falsified, from the optimum; None where none is found."""
        try:
            at = self.problem.follow(self.end, before)
            if self.limit.largest is not None:
                at = smallest_largest(
                    at, self.problem.follow, moving, self.problem.parameters.bounds, self.limit.largest
                )
        except FemtuneError:
            return None
        return at if self.limit.keeps(at.residuals[None], before.weights)[0] else None

    def _near(self, at: Evaluation, moving: Flags, lower: Reals, upper: Reals, count: int, seed: int) -> Reals:
        """(count, moving) changes from a point within the wider limit of the linearised residuals."""
        largest = self.limit.largest
        if largest is None:
            least, limit = float(np.linalg.norm(at.residuals)), self.limit.mean_error * np.sqrt(at.weights)
        else:
            least, limit = float(np.abs(at.residuals).max(initial=0.0)), largest
        wide = least + _WIDER * (limit - least)
        x = at.x[moving]
        return near_instances(
            at.jacobian[:, moving], at.residuals, lower - x, upper - x, wide, count, seed, of_sum=largest is None
        )

    def _predicted(self, kept: Reals) -> tuple[Reals, list[tuple[str, int]]]:
        """(n, m) frequencies in Hz of all configurations by the instances, and configuration and mode of each."""
        if not len(kept):
            return np.zeros((0, 0)), []
        work = FrequencyRuns(tuple(followed_modes(self.study, case) for case in self.study.cases))
        runs = runs_at(work, list(kept), executor_of(self.study), self.progress, "predictions of instances")
        places = [(modes.case, int(n)) for modes in work.followed for n in modes.numbers]
        return np.array([run.values for run in runs]), places
