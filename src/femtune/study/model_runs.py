"""Runs of the model at many points: frequencies of modes that are followed by their shape, or residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.modal.assignment import linear_sum_assignment
from femtune.model.response.rigid import is_rigid
from femtune.study.solved import nominal, solve

if TYPE_CHECKING:
    from femtune.executor import Executor
    from femtune.model import ConfiguredModel, EigenSolution
    from femtune.model.full_model import ModelSolver
    from femtune.residuals import Evaluation, UpdateProblem
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study

_FURTHER_MODES = 6
"""Modes that a run has beyond those that are followed, because modes change their order."""


@dataclass(frozen=True)
class ModelRun:
    """Result of a run: values, or the reason why there are none.

    Parameters
    ----------
    values : (m,) NaN if it failed
    mac : (m,) of modes that were followed; empty for residuals
    problem : the reason of the failure; "" if it did not fail
    """

    values: Reals
    mac: Reals
    problem: str = ""


@dataclass(frozen=True, eq=False)
class FollowedFrequencies:
    """The elastic modes of one configuration at a reference point: their numbers, from 1, and frequencies."""

    case: str
    numbers: Integers
    freq_hz: Reals


@dataclass(frozen=True, eq=False)
class FollowedModes(FollowedFrequencies):
    """The elastic modes of one configuration at a reference point, followed to other points."""

    configured: ConfiguredModel
    solver: ModelSolver
    shapes: Reals
    count: int

    def at(self, x: Reals) -> tuple[Reals, Reals]:
        """Frequencies (m,) in Hz at a point, and MAC with the shapes at the reference point, weighted by mass."""
        return self.among(self.solver.modes(self.configured.at(x), self.count, None))

    def among(self, solution: EigenSolution) -> tuple[Reals, Reals]:
        """The same of modes that are solved."""
        M = solution.point.mass
        overlap = (self.shapes.T @ (M @ solution.shapes)) ** 2
        size = np.sum(self.shapes * (M @ self.shapes), axis=0)
        mac = overlap / size[:, None]
        chosen = linear_sum_assignment(-mac)[1]
        hz = np.sqrt(np.maximum(solution.eigenvalues, 0.0)) / (2.0 * np.pi)
        return hz[chosen], mac[np.arange(len(chosen)), chosen]


def followed_modes(study: Study, case: StudyCase, x: Reals | None = None) -> FollowedModes:
    """The elastic modes of a configuration at a point, by default the initial values (error ``screen.no-modes`` if
    there are none)."""
    return followed_from(study, case, solve(study, case, nominal(study) if x is None else x))


def followed_from(study: Study, case: StudyCase, solution: EigenSolution) -> FollowedModes:
    """The elastic modes of a solution of the configuration (error ``screen.no-modes`` if there are none)."""
    elastic = np.flatnonzero(~is_rigid(solution)[: solution.wanted])
    if not len(elastic):
        raise FemtuneError("screen.no-modes", configuration=case.name)
    solver = study.solver if case.compared is None else case.compared.solver
    return FollowedModes(
        case.name,
        elastic + 1,
        solution.freq_hz[elastic],
        case.configured,
        solver,
        np.ascontiguousarray(solution.shapes[:, elastic]),
        min(solution.wanted + _FURTHER_MODES, case.configured.n_free),
    )


@dataclass(frozen=True, eq=False)
class FrequencyRuns:
    """The work of a run: frequencies of the modes of several configurations."""

    followed: tuple[FollowedModes, ...]

    def __call__(self, x: Reals) -> ModelRun:
        try:
            pairs = [modes.at(x) for modes in self.followed]
        except FemtuneError as error:
            size = sum(len(modes.numbers) for modes in self.followed)
            return ModelRun(np.full(size, np.nan), np.full(size, np.nan), f"[{error.code}] {error.what}")
        return ModelRun(np.concatenate([hz for hz, _ in pairs]), np.concatenate([mac for _, mac in pairs]))


@dataclass(frozen=True, eq=False)
class ResidualRuns:
    """The work of a run: the residuals of an update problem, its pairing followed from the initial values."""

    problem: UpdateProblem
    before: Evaluation

    def __getstate__(self) -> dict[str, Any]:
        problem = self.problem.to_send()
        return {"problem": problem, "before": problem.unsolved(self.before)}

    def __call__(self, x: Reals) -> ModelRun:
        none = np.full(len(self.before.residuals), np.nan)
        try:
            evaluation = self.problem.follow(x, self.before, derivatives=False)
            self.problem.check_compared(evaluation)
        except FemtuneError as error:
            return ModelRun(none, np.empty(0), f"[{error.code}] {error.what}")
        if len(evaluation.residuals) != len(none):
            return ModelRun(none, np.empty(0), "another number of residuals than at the initial values")
        return ModelRun(evaluation.residuals, np.empty(0))


class ManyAtOnce(Protocol):
    """Work that makes the runs of many points in parallel by itself."""

    def at_points(self, points: Sequence[Reals]) -> list[ModelRun]:
        """Results of the runs in the order of the points; a run that failed has NaN and states its reason."""
        ...


def runs_at(
    work: FrequencyRuns | ResidualRuns | ManyAtOnce, points: Sequence[Reals], executor: Executor, progress: Progress,
    what: str,
) -> list[ModelRun]:  # fmt: skip
    """The runs of points, by the executor unless the work makes them itself."""
    if not isinstance(work, FrequencyRuns | ResidualRuns):
        return work.at_points(points)
    done: list[int] = []

    def tell(position: int, _: ModelRun) -> None:
        done.append(position)
        progress.step(what, len(done), len(points))

    progress.step(what, 0, len(points))
    return executor.run(work, list(points), name="run", finished=tell)


def alone(study: Study, name: str | None) -> Study:
    """The study with one of its configurations (error ``screen.unknown-configuration``), or with all if none is
    named."""
    if name is None:
        return study
    cases = tuple(case for case in study.cases if case.name == name)
    if not cases:
        known = ", ".join(case.name for case in study.cases)
        raise FemtuneError("screen.unknown-configuration", where=study.file.where("screen"), name=name, known=known)
    return replace(study, cases=cases)


def failures(runs: Sequence[ModelRun]) -> list[tuple[int, str]]:
    """Number, from 1, and reason of each run that failed."""
    return [(i + 1, run.problem) for i, run in enumerate(runs) if run.problem]
