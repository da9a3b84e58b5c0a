"""The update with an external solver, by a response surface of runs around a point that moves to each optimum."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError, Notice
from femtune.executor.interface import nothing
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.beside import RIGID_FREQUENCY_RATIO
from femtune.model import parametric_model
from femtune.model.imported.from_runs import seen_modes
from femtune.selection import identifiability, undetermined_sentence
from femtune.status import Status
from femtune.steps.info.facts import alert_of
from femtune.study.cases import on_model
from femtune.study.external import PointRuns, SolverRuns, nominal_point, point_of, solver_runs
from femtune.study.model_runs import FollowedFrequencies, ModelRun
from femtune.study.parameters import assignments, targets
from femtune.study.runs_model import built_of_tables, part_of
from femtune.updating import update
from femtune.updating.sensitivity_method import moving_parameters
from femtune.updating.smallest_change import ALLOWED

if TYPE_CHECKING:
    from femtune.arrays import Integers, Reals
    from femtune.correlation import SensorMap
    from femtune.files.built_model import BuiltModel
    from femtune.files.runs_table import RunsTable
    from femtune.residuals import Evaluation, UpdateProblem
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.record import Alert
    from femtune.study.study import Study
    from femtune.updating import Iteration, SensitivityMethod, UpdateResult

_SETTLED_STEP = 1e-4
"""Largest change of a parameter, in half ranges, up to which the update has converged.

Smaller changes do not matter, and each costs runs of the solver.
"""
_FIRST_RADIUS = 0.5
"""First radius of the trust region, in half ranges.

Half of the box, where a model of the derivatives is still useful.
"""
_LEAST_RADIUS = 1e-3
"""Radius of the trust region, in half ranges, below which the update gives up.

Smaller differences of the solver's frequencies are lost in its printed digits.
"""
_MOST_REJECTED = 2
"""Consecutive steps by the derivatives of the deck that may fail to reduce the misfit.

After them these derivatives are taken as misleading and replaced by runs of the solver.
"""
_EQUAL_OBJECTIVE = 1e-6
"""Relative difference of two objectives up to which they are equal: the printed digits of the solver decide below."""
_AT_BOUND = 1e-9
"""Distance from a bound, in normalised parameters, up to which a parameter is at it: rounding of the normalisation."""
_NEGLIGIBLE_DECREASE = 0.5 * ALLOWED
"""Decrease of the objective that the smallest change may cost if the data leave combinations of the parameters
undetermined.
"""
_LOST = "fewer modes that move at the nodes than at the initial values"
_RECOVERABLE_ERRORS = ("external.", "eigen.", "correlate.no-pairs", "runs.")
"""Beginnings of the codes of errors at a point after which the update continues with a shorter step."""


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

    @property
    def highest(self) -> float:
        """Objective up to which another point is no worse: the smallest change may cost what the update allows it."""
        small = self.result.smallest_change
        allowed = 0.0 if small is None else 0.5 * (small.chi_square + small.allowed)
        return max(self.objective, allowed) * (1.0 + _EQUAL_OBJECTIVE)


@contextmanager
def opened_solver(study: Study, progress: Progress) -> Iterator[SolverRuns | None]:
    """The runs of a study of a solver, whose journal is closed at the end; None for another study."""
    if not study.source.needs_runs:
        yield None
        return
    runs = solver_runs(study.file, progress)
    try:
        yield runs
    finally:
        runs.journal.close()


def find_on_solver(
    study: Study,
    runs: SolverRuns,
    method: SensitivityMethod,
    tell: Callable[[Iteration], None],
    at: Evaluation,
    active: Sequence[str] | None = None,
) -> SolverUpdate:
    """Update on the model around a point, run the solver around the result, and so on until it stays.

    The update ends at most a radius away from the point. Where the misfit at its end, by the solver, is not smaller or
    the runs fail, it is repeated within half of that. A part of the same step would not do: the way to points that
    explain the data as well is curved, and a straight step leaves it.

    Parameters
    ----------
    study : on the model around `at`
    active : parameters that move; None for all free ones

    Raises
    ------
    FemtuneError : what `update` raises at the point, ``external.folder``, ``executor.*``
    """
    first = nominal_point(runs.file)
    runs.measure_noise(first, runs.run([first])[0])
    runs.follow_deck(first)
    region = _TrustRegion(runs, method, tell, active, study, at)
    settled = region.go(runs.asked.moves)
    if not settled or region.place.result.status is Status.UNDETERMINED:
        region.open_ = region.open_ or _open_combinations(region.place, active)
    result, told = region.result(settled), [*region.told, *region.ended(settled), *runs.replaced, *runs.remarks]
    return SolverUpdate(replace(result, before=at), region.place.study, tuple(map(alert_of, dict.fromkeys(told))))


class _TrustRegion:
    """The update from point to point, each within a radius that adapts; `radius` and `step` are in half ranges."""

    def __init__(
        self,
        runs: SolverRuns,
        method: SensitivityMethod,
        tell: Callable[[Iteration], None],
        active: Sequence[str] | None,
        study: Study,
        at: Evaluation,
    ) -> None:
        self.runs, self.method, self.tell, self.active = runs, method, tell, active
        self.half = 0.5 * np.subtract(*reversed(study.parameters.bounds))
        self.radius, self.step, self.moves, self.rejected = _FIRST_RADIUS, np.inf, 0, 0
        self.history: list[Iteration] = []
        self.told: list[Notice] = []
        self.open_: list[str] = []
        self.predicted: float | None = None
        self.place = _Place(at.x, study, at, self._updated(study, at, self.radius))

    def go(self, most: int) -> bool:
        """Move until the update stays at its point, or ends without; whether it stays."""
        while self.moves < most:
            self.step = float((np.abs(self.place.result.x - self.place.x) / self.half).max())
            if self._deck_ends():
                if not self._by_differences():
                    return False
            elif self.step <= _SETTLED_STEP or self.radius < _LEAST_RADIUS or not self._move():
                break
        return self.step <= _SETTLED_STEP

    def _updated(self, study: Study, start: Evaluation, radius: float) -> UpdateResult:
        """The update on the model around a point, at most a radius away from it."""
        lower, upper = study.parameters.bounds
        within = np.maximum(lower, start.x - radius * self.half), np.minimum(upper, start.x + radius * self.half)
        return update(study.problem(), self.method, self.tell, start, self.active, within)

    def _deck_ends(self) -> bool:
        """Whether what the deck lacks of the solver's derivatives decides over the rest of the way."""
        small = self.step <= self.runs.relative_step or self.radius < _LEAST_RADIUS
        return self.runs.by_deck and (small or self.rejected == _MOST_REJECTED)

    def _by_differences(self) -> bool:
        """Derivatives by runs of the solver from here on; False where these fail."""
        self.told.append(_led(self.runs, self.moves, self.rejected))
        self.runs.by_deck = False
        there = self._tried(self.place.x, _FIRST_RADIUS)
        if there is None:
            self.step = np.inf
            return False
        self._take(there, _FIRST_RADIUS)
        return True

    def _move(self) -> bool:
        """To where the update ended, or the update again within half of that; False where the data say no more."""
        self.moves += 1
        wider = max(self.radius, 2.0 * self.step)
        there = self._tried(self.place.result.x, wider)
        if there is not None:
            self.predicted = _difference(self.place, there)
            self._take(there, wider)
            return True
        self.open_ = [] if self.runs.by_deck else _open_combinations(self.place, self.active)
        if self.open_:
            return False
        self.radius, self.rejected = 0.5 * self.step, self.rejected + 1
        if self.radius >= _LEAST_RADIUS:
            again = self._updated(self.place.study, self.place.start, self.radius)
            self.place = replace(self.place, result=again)
        return True

    def _take(self, there: _Place, radius: float) -> None:
        self.history += _numbered(self.place.result.history, len(self.history))
        self.place, self.radius = there, radius

    def _tried(self, x: Reals, radius: float) -> _Place | None:
        """The model around a point and the update from there; None where it is no better, or its runs fail."""
        try:
            study = moved_to(self.place.study, self.runs, point_of(self.place.study.parameters, self.runs, x))
            start = study.problem().start(x)
            there = _Place(x, study, start, self._updated(study, start, radius))
        except FemtuneError as error:
            if not error.code.startswith(_RECOVERABLE_ERRORS) or error.code in (
                "external.folder",
                "external.no-program",
            ):
                raise
            self.told.append(Notice("external.step-halved", reason=error.what))
            return None
        return there if there.objective <= self.place.highest else None

    def result(self, settled: bool) -> UpdateResult:
        """Of the whole way."""
        first, place = len(self.history), self.place.result
        history = (*self.history, *_numbered(place.history, first))
        whole = replace(place, history=history, number=first + place.number)
        return whole if settled else _at_place(whole, self.place, first, _status(self.radius, self.open_))

    def ended(self, settled: bool) -> Iterator[Notice]:
        """What is said of the end."""
        if settled:
            yield _told(self.moves, self.runs.started, self.predicted)
        elif not self.open_:
            yield Notice("external.not-settled", moves=self.moves, step=self.step)
        if self.open_:
            yield Notice("external.undetermined", moves=self.moves, combinations=" ".join(self.open_))


def _status(radius: float, open_: Sequence[str]) -> Status:
    """How an update ended that did not settle."""
    if open_:
        return Status.UNDETERMINED
    return Status.STALLED if radius < _LEAST_RADIUS else Status.MAX_ITERATIONS


def _open_combinations(place: _Place, active: Sequence[str] | None) -> list[str]:
    """Sentences on what the data leave open at a point that is the minimum in all that they determine.

    There is none where the data determine all, where a side constraint determines the rest, or where a step in what is
    determined would reduce the objective by more than the smallest change may cost.
    """
    problem, at = place.study.problem(), place.start
    if len(place.result.side.matrix):
        return []
    lower, upper = problem.parameters.bounds
    slope = at.jacobian.T @ at.residuals
    blocked = ((at.x <= lower + _AT_BOUND) & (slope > 0.0)) | ((at.x >= upper - _AT_BOUND) & (slope < 0.0))
    moving = moving_parameters(problem, active)
    # at a minimum of all parameters a bound blocks none of them: the slopes are rounding
    for which in (np.flatnonzero(moving), np.flatnonzero(moving & ~blocked)):
        names = tuple(problem.parameters.free[i].name for i in which)
        known = identifiability(at.jacobian[:, which], np.asarray(problem.parameters.prior[1])[which], names)
        left, _, _ = np.linalg.svd(known.scaled_jacobian, full_matrices=False)
        decrease = 0.5 * float(np.sum((left[:, : known.rank].T @ at.residuals) ** 2))
        shown = 2.0 * at.objective / max(len(at.residuals) - known.rank, 1)
        variance = shown if problem.scatter == "estimated" else min(shown, 1.0)
        if decrease <= _NEGLIGIBLE_DECREASE * variance:
            return [undetermined_sentence(known, c) for c in known.undetermined]
    return []


def _at_place(result: UpdateResult, place: _Place, number: int, status: Status) -> UpdateResult:
    """The last point where the solver was run: what lies beyond it is a prediction."""
    return replace(
        result, x=place.x, after=place.start, status=status, history=result.history[: number + 1], number=number,
        certificate=None, smallest_change=None,
    )  # fmt: skip


def moved_to(study: Study, runs: SolverRuns, point: Reals) -> Study:
    """The study on the model around another point, with the same parameters, tests and sensors."""
    return _on(study, built_of_tables(study.file, runs.around(point), 0))


def at_outcome(study: Study, runs: SolverRuns, point: Reals, outcome: PointRuns) -> Study:
    """The study on the model of one run, which no parameter changes: it has the modes of the run."""
    return _on(study, built_of_tables(study.file, runs.tables([(point, outcome)]), 0, degree=0))


def _on(study: Study, built: BuiltModel) -> Study:
    assigned = assignments(targets(study.file, built))
    model = parametric_model(built.structure, study.parameters, assigned)
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
    largest = 0.0
    for old, new in zip(before.study.cases, there.study.cases):
        if old.compared is None or new.compared is None:
            continue
        hz = [
            case.solver.modes(case.configured.at(there.x), case.count, case.max_hz).freq_hz
            for case in (old.compared, new.compared)
        ]
        size = np.maximum(hz[1], 1e-3 * hz[1].max())
        largest = max(largest, float((np.abs(hz[0] - hz[1]) / size).max()))
    return largest


def _told(moves: int, started: int, difference: float | None) -> Notice:
    percent = 100.0 * (difference or 0.0)
    return Notice("external.moved", level="info", moves=moves, percent=percent, started=started)


def _led(runs: SolverRuns, moves: int, rejected: int) -> Notice:
    """How far the derivatives of the deck led; a warning where they misled."""
    if rejected == _MOST_REJECTED:
        return Notice("external.by-deck/misled", moves=moves)
    return Notice("external.by-deck", level="info", moves=moves, percent=100.0 * runs.relative_step)


@dataclass(frozen=True, eq=False)
class SolverFrequencies:
    """Frequencies of the solver, whose modes are followed by their shapes from the initial values.

    Parameters
    ----------
    known : the run at the initial values
    """

    study: Study
    runs: SolverRuns
    known: PointRuns
    followed: tuple[FollowedFrequencies, ...]

    @classmethod
    def of(cls, study: Study, runs: SolverRuns) -> SolverFrequencies:
        """With the run at the initial values."""
        first = nominal_point(runs.file)
        known = runs.run([first])[0]
        if known.failure is not None:
            raise runs.failed(first, known)
        tables, residuals = runs.tables([(first, known)]), []
        for case in study.cases:
            hz = _seen(tables[part_of(study.file, case.entry)])[0][0]
            elastic = np.flatnonzero(hz > RIGID_FREQUENCY_RATIO * hz.max(initial=0.0))
            if not len(elastic):
                raise FemtuneError("screen.no-modes", configuration=case.name)
            residuals.append(FollowedFrequencies(case.name, elastic + 1, hz[elastic]))
        return cls(study, runs, known, tuple(residuals))

    def at_points(self, points: Sequence[Reals]) -> list[ModelRun]:
        """See `ManyAtOnce`."""
        places = [point_of(self.study.parameters, self.runs, x) for x in points]
        outcomes = self.runs.run(places)
        good = [i for i, outcome in enumerate(outcomes) if outcome.failure is None]
        first = nominal_point(self.runs.file)
        tables = self.runs.tables([(first, self.known), *((places[i], outcomes[i]) for i in good)])
        seen = [_seen(tables[part_of(self.study.file, case.entry)]) for case in self.study.cases]
        size = sum(len(modes.numbers) for modes in self.followed)
        nothing = np.full(size, np.nan)
        model_runs = [ModelRun(nothing, nothing, str(outcome.failure)) for outcome in outcomes]
        for row, i in enumerate(good, start=1):
            ends = [_followed(*solved, row, modes.numbers - 1) for solved, modes in zip(seen, self.followed)]
            values, mac = (np.concatenate(parts) for parts in zip(*ends))
            lost = np.isnan(values).any()
            model_runs[i] = ModelRun(values, mac, _LOST if lost else "")
        return model_runs


def _seen(table: RunsTable) -> tuple[Reals, Reals | None]:
    """Frequencies (n, m) and shapes (n, s, m) of runs, without modes that do not move."""
    if table.shapes is None:
        return table.freq_hz, None
    hz, shapes, _ = seen_modes(table.freq_hz, table.shapes)
    return hz, shapes


def _followed(hz: Reals, shapes: Reals | None, row: int, wanted: Integers) -> tuple[Reals, Reals]:
    """Frequencies of a run in the order of the modes of the first one, and their MAC; NaN beyond those that it has."""
    values, mac = np.full(len(wanted), np.nan), np.zeros(len(wanted))
    there = wanted < hz.shape[1]
    kept = wanted[there]
    if shapes is None:
        values[there], mac[there] = hz[row, kept], 1.0
        return values, mac
    one, other = shapes[0][:, kept], shapes[row]
    every = (one.T @ other) ** 2 / np.outer((one**2).sum(axis=0), (other**2).sum(axis=0))
    chosen = linear_sum_assignment(-every)[1]
    values[there], mac[there] = hz[row, chosen], every[np.arange(len(kept)), chosen]
    return values, mac


@dataclass(frozen=True, eq=False)
class SolverResiduals:
    """The residuals of an update problem at runs of the solver, paired afresh by the shapes of the test."""

    study: Study
    runs: SolverRuns
    problem: UpdateProblem
    before: Evaluation

    def at_points(self, points: Sequence[Reals]) -> list[ModelRun]:
        """See `ManyAtOnce`."""
        places = [point_of(self.study.parameters, self.runs, x) for x in points]
        return [self._at(*each) for each in zip(points, places, self.runs.run(places))]

    def _at(self, x: Reals, place: Reals, outcome: PointRuns) -> ModelRun:
        nothing = np.full(len(self.before.residuals), np.nan)
        if outcome.failure is not None:
            return ModelRun(nothing, np.empty(0), str(outcome.failure))
        try:
            problem = at_outcome(self.study, self.runs, place, outcome).problem()
            point = problem.assess(x, problem.solved(x), derivatives=False)
            problem.check_compared(point)
        except FemtuneError as error:
            return ModelRun(nothing, np.empty(0), f"[{error.code}] {error.what}")
        if len(point.residuals) != len(nothing):
            return ModelRun(nothing, np.empty(0), "another number of residuals than at the initial values")
        return ModelRun(point.residuals, np.empty(0))


def least_squares_on_solver(
    study: Study, runs: SolverRuns, method: SensitivityMethod, x: Reals, active: Sequence[str] | None = None
) -> SolverUpdate:
    """The update with the solver from a point (arguments and errors as of `find_on_solver`)."""
    runs.follow_deck(nominal_point(runs.file))
    there = moved_to(study, runs, point_of(study.parameters, runs, x))
    return find_on_solver(there, runs, method, nothing, there.problem().start(x), active)
