"""The update with an external solver: on a model of the runs around a point, which moves to where the update ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.assembly.cases import on_model
from femtune.assembly.external import SolverRuns, nominal_point, solver_runs, write_updated
from femtune.assembly.parameters import assignments, targets
from femtune.assembly.runs_model import built_of_table
from femtune.errors import FemtuneError, Notice
from femtune.model import parametric_model
from femtune.results.model import alert_of
from femtune.status import Status
from femtune.updating import update

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.assembly.cases import StudyCase
    from femtune.assembly.progress import Progress
    from femtune.assembly.study import Study
    from femtune.correlation import SensorMap
    from femtune.residuals import Evaluation
    from femtune.results.base import Alert
    from femtune.updating import Iteration, SensitivityMethod, UpdateResult

_SETTLED = 1e-4
"""Largest change of a parameter, in half ranges, that moves the model no more."""
_FIRST_RADIUS, _LEAST_RADIUS = 0.5, 1e-3
_SAME = 1e-6
_PASSED = ("external.", "eigen.", "correlate.no-pairs", "runs.")
"""Codes of errors at a point from which the way back is shorter steps."""


@dataclass(frozen=True, eq=False)
class SolverUpdate:
    """The update, the study on the model around its result, and what is said of it."""

    result: UpdateResult
    study: Study
    alerts: tuple[Alert, ...]


@dataclass(frozen=True, eq=False)
class _Place:
    """The model around a point, and the update on it that starts there."""

    x: Reals
    study: Study
    start: Evaluation
    result: UpdateResult

    @property
    def objective(self) -> float:
        """At the point itself, where the model is exact."""
        return self.result.history[0].objective


def find_on_solver(
    study: Study,
    method: SensitivityMethod,
    tell: Callable[[Iteration], None],
    at: Evaluation,
    progress: Progress,
) -> SolverUpdate:
    """Update on the model around the initial values, run the solver around the result, and so on until it stays.

    A step after which the misfit at the point itself has not become smaller, or whose runs fail, is halved.

    Raises
    ------
    FemtuneError : what `update` raises at the initial values, ``external.folder``, ``executor.*``
    """
    assert study.file.solver is not None
    runs = solver_runs(study.file, progress)
    try:
        first = nominal_point(study.file)
        runs.measure_noise(first, runs.run([first])[0])
        place = _Place(at.x, study, at, update(study.problem(), method, tell, at))
        history = list(place.result.history)
        told: list[Notice] = []
        radius, moves, step, predicted = _FIRST_RADIUS, 0, np.inf, None
        half = 0.5 * np.subtract(*reversed(study.parameters.bounds))
        while moves < study.file.solver.moves:
            change = place.result.x - place.x
            step = float((np.abs(change) / half).max())
            if step <= _SETTLED or radius < _LEAST_RADIUS:
                break
            moves += 1
            short = min(1.0, radius / step)
            there = _tried(runs, place, method, tell, place.x + short * change, told)
            if there is None:
                radius = 0.5 * short * step
                continue
            predicted = _difference(place, there)
            place, radius = there, max(radius, 2.0 * short * step)
            history += _numbered(place.result.history, len(history))
        settled = step <= _SETTLED
        told.append(_told(moves, runs.started, predicted) if settled else _stopped(moves, step))
        told += [*runs.replaced, *runs.journal.notices]
    finally:
        runs.journal.close()
    # the journal is closed, and nothing is run any more
    first_number = len(history) - len(place.result.history)
    result = replace(place.result, before=at, history=tuple(history), number=first_number + place.result.number)
    if not settled:
        result = _at_place(result, place, first_number, radius)
    write_updated(runs, result.values)
    return SolverUpdate(result, place.study, tuple(map(alert_of, dict.fromkeys(told))))


def _at_place(result: UpdateResult, place: _Place, number: int, radius: float) -> UpdateResult:
    """The last point where the solver was run: what lies beyond it is a prediction."""
    status = Status.STALLED if radius < _LEAST_RADIUS else Status.MAX_ITERATIONS
    return replace(
        result, x=place.x, after=place.start, status=status, history=result.history[: number + 1], number=number,
        certificate=None, smallest_change=None,
    )  # fmt: skip


def _tried(
    runs: SolverRuns, place: _Place, method: SensitivityMethod, tell: Callable[[Iteration], None], x: Reals,
    told: list[Notice],
) -> _Place | None:  # fmt: skip
    """The model around a point and the update from there; None where it is no better, or its runs fail."""
    parameters = place.study.parameters
    point = np.array([parameters.values(x)[name] for name in runs.names])
    lower, upper = runs.bounds
    try:
        study = _moved_to(place.study, runs, np.clip(point, lower, upper))
        start = study.problem().start(x)
        there = _Place(x, study, start, update(study.problem(), method, tell, start))
    except FemtuneError as error:
        if not error.code.startswith(_PASSED) or error.code in ("external.folder", "external.no-program"):
            raise
        told.append(Notice("external.step-halved", reason=error.what))
        return None
    return there if there.objective <= place.objective * (1.0 + _SAME) else None


def _moved_to(study: Study, runs: SolverRuns, point: Reals) -> Study:
    """The study on the model around another point, with the same parameters, tests and sensors."""
    built = built_of_table(study.file, runs.around(point), 0)
    found = assignments(targets(study.file, built))
    model = parametric_model(built.structure, study.parameters, found)
    size = built.structure.nodes.n_dofs
    cases = tuple(on_model(_resized(case, size), model) for case in study.cases)
    return replace(study, built=replace(built, notices=study.built.notices), model=model, cases=cases)


def _resized(case: StudyCase, size: int) -> StudyCase:
    """Sensors on another number of scalar points, which no sensor of shapes has."""

    def on(sensors: SensorMap | None) -> SensorMap | None:
        if sensors is None or sensors.matrix.shape[1] == size:
            return sensors
        matrix = sensors.matrix.copy()
        matrix.resize((matrix.shape[0], size))
        return replace(sensors, matrix=matrix)

    return replace(case, sensors=on(case.sensors), all_sensors=on(case.all_sensors))


def _numbered(history: Sequence[Iteration], first: int) -> list[Iteration]:
    return [replace(iteration, number=first + i) for i, iteration in enumerate(history)]


def _difference(before: _Place, there: _Place) -> float:
    """Largest relative difference at a point between the frequencies of the last model and those of the runs."""
    found = 0.0
    for old, new in zip(before.study.cases, there.study.cases):
        if old.compared is None or new.compared is None:
            continue
        hz = [
            case.solver.modes(case.configured.at(there.x), case.count, case.max_hz).freq_hz
            for case in (old.compared, new.compared)
        ]
        size = np.maximum(hz[1], 1e-3 * hz[1].max())
        found = max(found, float((np.abs(hz[0] - hz[1]) / size).max()))
    return found


def _told(moves: int, started: int, difference: float | None) -> Notice:
    percent = 100.0 * (difference or 0.0)
    return Notice("external.moved", level="info", moves=moves, percent=percent, started=started)


def _stopped(moves: int, step: float) -> Notice:
    return Notice("external.not-settled", moves=moves, step=step)
