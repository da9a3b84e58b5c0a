"""A study of an external solver: runs around a point, and the model that is made of them.

Around a point there are two runs for each parameter, for which central differences have the smallest error: the step
is chosen from the noise of the solver's results. All of them are made side by side.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from femtune.assembly.cases import overlay
from femtune.assembly.error_places import errors_at
from femtune.assembly.parameters import assignments, parameter_set, targets
from femtune.assembly.progress import silent
from femtune.assembly.runs_model import built_of_table
from femtune.dofs import DIRECTIONS, Dof, DofSet
from femtune.errors import FemtuneError, Notice, Where
from femtune.executor import Cluster, Threads
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.write import plan_edits, write_deck
from femtune.files.runs_table import RunsTable
from femtune.files.study_file import RunsModelTable
from femtune.files.whole_file import write_whole
from femtune.journal.runs import RunJournal, open_run_journal
from femtune.model import configure, parametric_model, solve_modes
from femtune.runs import ExternalSolver, ResultFile, RunOutcome, Templates, evaluate, read_template
from femtune.runs.external import Checks
from femtune.runs.repeatable import compare_repeated, described
from femtune.runs.template import InputFiles, check_names

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.assembly.progress import Progress
    from femtune.executor import Executor
    from femtune.files.nastran.build import BuiltModel
    from femtune.files.study_file import StudyFile
    from femtune.model import ParametricModel

RUNS_FOLDER = "external"
_DIGITS = 5e-7
"""Rounding of results that have seven digits, relative."""
_LEAST_STEP, _LARGEST_STEP = 0.01, 0.2
_OFFSETS = (1.0, -1.0, 0.5, -0.5, 2.0, -2.0, 0.25, -0.25)
"""Places of the runs beside the central one, in steps; the first two within the bounds that succeed are used."""


@dataclass(frozen=True, eq=False)
class DeckFiles:
    """The deck of a study with the values of parameters in its fields, for a solver that reads decks.

    Parameters
    ----------
    built, model : the deck, and the fields that the parameters set
    folder : beside which the runs are made, so that paths of INCLUDE files are right
    name : of the deck in the folder of a run
    """

    built: BuiltModel
    model: ParametricModel
    folder: Path
    name: str

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.model.parameters.names

    @property
    def version(self) -> str:
        """Digest of all files of the deck, of which a run has only those that are changed."""
        return sha256("".join(line.text for file in self.built.deck.files for line in file.lines).encode()).hexdigest()

    def files(self, values: Mapping[str, float]) -> dict[str, bytes]:
        """See `InputFiles` (errors ``write.*``)."""
        x = np.array([(values[p.name] - p.nominal) / p.scale for p in self.model.parameters.free])
        updates = self.model.field_values(x)
        updates = {**updates, **self.model.structure.values.following(updates, self.built.fields)}
        regions = {a.parameter: a.elements for a in self.model.assignments if a.elements is not None}
        # in fields of 16 columns, where 8 would round a value
        plan = plan_edits(self.built, updates, regions, wide=True)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with TemporaryDirectory(dir=self.folder, prefix="deck-") as folder:
                return {path.name: path.read_bytes() for path in write_deck(plan.edited, folder, self.name).files}
        except OSError as error:
            raise FemtuneError("external.folder", where=Where(str(self.folder)), reason=error.strerror) from error


def _deck_files(file: StudyFile) -> DeckFiles:
    """Errors of the deck, and of fields that the parameters name."""
    assert file.solver is not None
    plain = file.model_copy(update={"runs": None, "solver": None})
    plain._path, plain._source, plain._given = file._path, file._source, file._given
    built = build_structure(read_deck(file.path_of(str(file.study.deck))), bool(file.study.allow_ignored))
    found = targets(plain, built)
    model = parametric_model(built.structure, parameter_set(found, built), assignments(found))
    return DeckFiles(built, model, file.output_folder / RUNS_FOLDER, file.solver.deck_name)


def of_solver(file: StudyFile) -> StudyFile:
    """The study with initial values for all parameters, and polynomials of degree two without products."""
    assert file.solver is not None
    deck = file.study.deck
    known = {} if deck is None else {p.name: p.nominal for p in _deck_files(file).model.parameters.free}
    entries = []
    for entry in file.parameter:
        middle = None if entry.lower is None or entry.upper is None else 0.5 * (entry.lower + entry.upper)
        start = known.get(entry.name, middle)
        entries.append(entry if entry.nominal is not None else entry.model_copy(update={"nominal": start}))
    # what the polynomials are good for is told by the next run, not by one that is left out
    runs = RunsModelTable(file=deck or file.solver.templates[0], degree=2, crossed=False, tolerance=0.5)
    changed: dict[str, object] = {"parameter": tuple(entries), "runs": runs}
    if deck is not None and file.model.grid is None:
        changed["model"] = file.model.model_copy(update={"grid": deck})
    return file.model_copy(update=changed)


@dataclass(eq=False)
class SolverRuns:
    """The runs of a study.

    Parameters
    ----------
    noise : relative scatter and rounding of the results
    replaced : what was said of runs that failed for good
    """

    file: StudyFile
    solver: ExternalSolver
    executor: Executor
    journal: RunJournal
    progress: Progress = silent
    noise: float = _DIGITS
    started: int = 0
    replaced: list[Notice] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(entry.name for entry in self.file.parameter)

    @property
    def bounds(self) -> tuple[Reals, Reals]:
        """Lower and upper bounds of the parameters."""
        pairs = np.array([(entry.lower, entry.upper) for entry in self.file.parameter], float)
        return pairs[:, 0], pairs[:, 1]

    @property
    def steps(self) -> Reals:
        """(k,) distances of the runs from the central one: where rounding and curvature spoil differences alike."""
        assert self.file.solver is not None
        lower, upper = self.bounds
        chosen = self.file.solver.step or float(np.clip((3.0 * self.noise) ** (1 / 3), _LEAST_STEP, _LARGEST_STEP))
        return 0.5 * chosen * (upper - lower)

    def run(self, points: Sequence[Reals]) -> tuple[RunOutcome, ...]:
        """Outcomes at points; what is known is not run again."""
        told = [dict(zip(self.names, map(float, point))) for point in points]

        def say(done: int, outcome: RunOutcome) -> None:
            self.progress.step(f"external runs: {outcome.state}", done, len(points))

        found = evaluate(self.solver, told, self.executor, self.journal, finished=say)
        self.started += found.started
        return found.outcomes

    def measure_noise(self, point: Reals, known: RunOutcome) -> None:
        """Run a point twice (error ``external.not-repeatable``); the second run is kept in the journal, too."""
        assert self.file.solver is not None
        values = dict(zip(self.names, map(float, point)))
        again = replace(self.solver, version=f"{self.solver.version}, repeated")
        found = evaluate(again, [values], self.executor, self.journal)
        self.started += found.started
        tolerance = self.file.solver.repeat_tolerance
        self.noise = max(_DIGITS, compare_repeated(values, known, found.outcomes[0], tolerance))

    def around(self, point: Reals) -> RunsTable:
        """Runs at a point and two more for each parameter.

        Raises
        ------
        FemtuneError : ``external.failed`` where the point itself, or all points beside it for a parameter, fail
        """
        offsets = [_within(i, point, self.steps, self.bounds) for i in range(len(point))]
        first = [point + o for some in offsets for o in some[:2]]
        outcomes = dict(zip(map(tuple, [point, *first]), self.run([point, *first])))
        centre = outcomes[tuple(point)]
        if centre.modes is None:
            raise self.failed(point, centre)
        rows = [(point, centre)]
        for i, some in enumerate(offsets):
            rows += self._pair(i, point, some, outcomes)
        return _table(self.names, rows)

    def failed(self, point: Reals, outcome: RunOutcome) -> FemtuneError:
        """The error that a point has no modes."""
        values = {"point": described(dict(zip(self.names, map(float, point))))}
        folder = outcome.failures[-1].folder
        return FemtuneError(
            "external.failed", values=values | ({"folder": folder} if folder else {}), failure=outcome.failures[-1]
        )

    def _pair(
        self, i: int, point: Reals, offsets: list[Reals], outcomes: dict[tuple[float, ...], RunOutcome]
    ) -> list[tuple[Reals, RunOutcome]]:
        """Two runs for a parameter; those that fail for good are replaced by others."""
        good: list[tuple[Reals, RunOutcome]] = []
        bad: list[RunOutcome] = []
        for offset in offsets:
            at = point + offset
            outcome = outcomes[tuple(at)] if tuple(at) in outcomes else self.run([at])[0]
            if outcome.modes is None:
                bad.append(outcome)
            else:
                good.append((at, outcome))
            if len(good) == 2:
                break
        if len(good) < 2:
            raise self.failed(point + offsets[0], bad[0])
        if bad:
            h = [float(at[i] - point[i]) for at, _ in good]
            wanted = [float(o[i]) for o in offsets[:2]]
            self.replaced.append(
                Notice(
                    "external.replaced", parameter=self.names[i], n_failed=len(bad), failure=bad[0].failures[-1],
                    places=", ".join(f"{point[i] + one:.6g}" for one in h),
                    times=abs(h[0] * h[1]) / abs(wanted[0] * wanted[1]),
                )
            )  # fmt: skip
        return good


def _within(i: int, point: Reals, steps: Reals, bounds: tuple[Reals, Reals]) -> list[Reals]:
    """Offsets of the runs for a parameter that lie within its bounds."""
    found = []
    for factor in _OFFSETS:
        offset = np.zeros(len(point))
        offset[i] = factor * steps[i]
        if bounds[0][i] <= point[i] + offset[i] <= bounds[1][i]:
            found.append(offset)
    return found


def _table(names: Sequence[str], rows: Sequence[tuple[Reals, RunOutcome]]) -> RunsTable:
    """The runs as a table; the DOFs are those that every run has."""
    points = np.array([point for point, _ in rows])
    modes = [outcome.modes for _, outcome in rows if outcome.modes is not None]
    count = min(len(m.freq_hz) for m in modes)
    columns = {name: points[:, j] for j, name in enumerate(names)}
    hz = np.array([m.freq_hz[:count] for m in modes])
    if not all(m.has_shapes for m in modes):
        return RunsTable(columns, hz)
    known = modes[0].nodes
    for m in modes[1:]:
        known = np.intersect1d(known, m.nodes)
    shapes = np.stack([m.shapes[np.searchsorted(m.nodes, known), :, :count] for m in modes])
    there = np.isfinite(shapes).all(axis=(0, 3))
    dofs = DofSet(Dof(int(known[n]), DIRECTIONS[1 + c]) for n, c in zip(*np.nonzero(there)))
    return RunsTable(columns, hz, shapes[:, there], dofs)


def solver_runs(file: StudyFile, progress: Progress = silent, *, fresh: bool = False) -> SolverRuns:
    """The solver of a study, with its journal; `fresh` empties that.

    Raises
    ------
    FemtuneError : ``external.no-program``, ``external.placeholder``, ``external.unreadable``
    """
    entry = file.solver
    assert entry is not None
    inputs = _inputs(file)
    checks = Checks(file.modes.count or 1, entry.mass, entry.mass_tolerance)
    solver = ExternalSolver(
        entry.command, inputs, ResultFile(entry.result, entry.format), file.output_folder / RUNS_FOLDER, checks,
        entry.timeout_s, entry.retries, entry.error_texts, entry.licence_texts, entry.licence_wait_s,
        entry.licence_tries, tuple(sorted(entry.environment.items())), entry.version, entry.keep, entry.keep_most,
    )  # fmt: skip
    with errors_at(file.where("solver", "command")):
        solver.check()
    parallel = file.parallel
    executor: Executor = (
        Cluster(parallel.address, parallel.remote) if parallel.how == "cluster" else Threads(_workers(file))
    )
    return SolverRuns(file, solver, executor, open_run_journal(file.output_folder, fresh=fresh), progress)


def _inputs(file: StudyFile) -> InputFiles:
    """The deck, or templates whose placeholders are the parameters."""
    entry = file.solver
    assert entry is not None
    if file.study.deck is not None:
        return _deck_files(file)
    templates = tuple(read_template(file.path_of(name)) for name in entry.templates)
    found = Templates(templates, tuple(map(file.path_of, entry.files)))
    names = [p.name for p in file.parameter]
    check_names(found.names, names, names, file.where("solver", "templates"))
    return found


def _workers(file: StudyFile) -> int:
    return 1 if file.parallel.how == "serial" else file.parallel.workers


def build_of_solver(file: StudyFile, progress: Progress, fresh: bool) -> BuiltModel:
    """The model around the initial values."""
    runs = solver_runs(file, progress, fresh=fresh)
    try:
        point = nominal_point(file)
        known = runs.run([point])[0]
        if known.modes is None:
            raise runs.failed(point, known)
        runs.measure_noise(point, known)
        table = runs.around(point)
        with errors_at(file.where("solver")):
            built = built_of_table(file, table, 0)
    finally:
        runs.journal.close()
    own = _beside_own(file, runs, known) if isinstance(runs.solver.inputs, DeckFiles) else ()
    # the fit of 2k + 1 runs has nothing to be checked by
    hidden = [notice for notice in built.notices if notice.code == "runs.hidden-modes"]
    return replace(built, notices=(*_facts(runs, table), *hidden, *own, *runs.journal.notices))


def _beside_own(file: StudyFile, runs: SolverRuns, known: RunOutcome) -> tuple[Notice, ...]:
    """How far femtune's own elements are from the solver, mode by mode in their order, where they can be solved."""
    assert isinstance(runs.solver.inputs, DeckFiles)
    assert known.modes is not None
    hz, where = known.modes.freq_hz, file.where("solver")
    try:
        configured = configure(runs.solver.inputs.model, overlay(file.configurations[0]))
        own = solve_modes(configured.at(np.zeros(len(runs.names))), len(hz)).freq_hz[: len(hz)]
    except FemtuneError as error:
        return (Notice("external.own-elements/not-solved", where=where, level="info", reason=error.what),)
    elastic = hz[: len(own)] > 1e-3 * hz.max()
    if not elastic.any():
        return ()
    difference = 100.0 * (own[elastic] / hz[: len(own)][elastic] - 1.0)
    worst = int(np.abs(difference).argmax())
    return (
        Notice(
            "external.own-elements", where=where, level="info", percent=float(difference[worst]),
            mode=int(np.flatnonzero(elastic)[worst]) + 1, count=len(difference),
        ),
    )  # fmt: skip


def nominal_point(file: StudyFile) -> Reals:
    """(k,) initial values."""
    return np.array([entry.nominal for entry in file.parameter], float)


def _facts(runs: SolverRuns, table: RunsTable) -> Iterator[Notice]:
    where = runs.file.where("solver")
    steps = ", ".join(f"{name} ± {step:.4g}" for name, step in zip(runs.names, runs.steps))
    count, noise = len(table.freq_hz), 100.0 * runs.noise
    yield Notice("external.runs", where=where, level="info", runs=count, noise_percent=noise, steps=steps)
    yield from (replace(notice, where=where) for notice in runs.replaced)


UPDATED_FOLDER = "updated"


def write_updated(runs: SolverRuns, values: Mapping[str, float]) -> Path:
    """The input files with some values, beside the folders of the runs (error ``external.folder``)."""
    folder = runs.solver.folder / UPDATED_FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in runs.solver.inputs.files(values).items():
            write_whole(folder / name, content)
    except OSError as error:
        raise FemtuneError("external.folder", where=Where(str(folder)), reason=error.strerror or error) from error
    return folder
