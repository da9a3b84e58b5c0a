"""A study of an external solver: runs around a point, and the model that is fitted to them. There are two runs for each
parameter, which are made in parallel. The step of these central differences is chosen from the noise of the solver's
results so that their error is smallest.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from femtune.dofs import DIRECTIONS, Dof, DofSet
from femtune.errors import FemtuneError, Notice, Where
from femtune.executor import Cluster, Threads
from femtune.files.nastran.build import build_allowing
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.write import plan_edits, write_deck
from femtune.files.runs_table import RunsTable
from femtune.files.study_file import ConfigurationSolver, RunsModelTable
from femtune.files.whole_file import write_whole
from femtune.journal.run_files import RUNS_FOLDER
from femtune.journal.runs import RunJournal, open_run_journal
from femtune.modal.beside import ModesBeside
from femtune.model import configure, parametric_model, solve_modes
from femtune.runs import (
    ExternalSolver,
    Failure,
    FunctionSolver,
    ResultFile,
    RunOutcome,
    Templates,
    evaluate,
    read_template,
)
from femtune.runs.external import Checks
from femtune.runs.repeatable import compare_repeated, described
from femtune.runs.template import InputFiles, check_names
from femtune.study.beside_deck import DeckDerivatives, modes_beside
from femtune.study.cases import overlay
from femtune.study.error_places import errors_at
from femtune.study.model_source import FromSolver
from femtune.study.own_model import linear
from femtune.study.parameters import assignments, parameter_set, targets
from femtune.study.progress import silent
from femtune.study.runs_model import built_of_tables, part_of

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.executor import Executor
    from femtune.files.built_model import BuiltModel
    from femtune.files.nastran.build import BuiltDeck
    from femtune.files.study_file import StudyFile
    from femtune.files.study_file.solver import SolverTable
    from femtune.model import ConfiguredModel, ParametricModel
    from femtune.parameters import ParameterSet
    from femtune.study.own_model import OwnModel
    from femtune.study.progress import Progress

_RESULT_ROUNDING = 5e-7
"""Relative rounding of results that are written with seven digits."""
_SMALLEST_STEP = 0.01
"""Smallest step that is chosen from the noise, in half ranges of the bounds: noise beyond that of the two runs which
are compared must not spoil the differences."""
_LARGEST_STEP = 0.2
"""Largest such step: beyond it the curvature of the results would spoil the differences."""
_MOST_ROUNDING = 0.01
"""Relative error of the difference between two runs, due to the digits of a placeholder, that is not told."""
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

    built: BuiltDeck
    model: ParametricModel
    folder: Path
    name: str

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.model.parameters.names

    def x_of(self, values: Mapping[str, float]) -> Reals:
        """Normalised parameters of the deck's model."""
        return np.array([(values[p.name] - p.nominal) / p.scale for p in self.model.parameters.free])

    @property
    def version(self) -> str:
        """Digest of all files of the deck; the folder of a run contains only those that change."""
        return sha256("".join(line.text for file in self.built.deck.files for line in file.lines).encode()).hexdigest()

    def texts(self) -> tuple[bytes, ...]:
        """None: `version` has all files of the deck."""
        return ()

    def files(self, values: Mapping[str, float]) -> dict[str, bytes]:
        """See `InputFiles` (errors ``write.*``)."""
        x = self.x_of(values)
        updates = self.model.field_values(x)
        updates = {**updates, **self.model.structure.values.following(updates, self.built.fields)}
        regions = {a.parameter: a.elements for a in self.model.assignments if a.elements is not None}
        # in fields of 16 columns if 8 would round a value
        plan = plan_edits(self.built, updates, regions, wide=True)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with TemporaryDirectory(dir=self.folder, prefix="deck-") as folder:
                return {path.name: path.read_bytes() for path in write_deck(plan.edited, folder, self.name).files}
        except OSError as error:
            raise FemtuneError("external.folder", where=Where(str(self.folder)), reason=error.strerror) from error


def _deck_files(file: StudyFile, deck: str) -> DeckFiles:
    """Errors of the deck, and of fields that the parameters name."""
    plain = file.model_copy(update={"runs": None, "solver": None})
    plain._path, plain._source, plain._given = file._path, file._source, file._given
    built = build_allowing(read_deck(file.path_of(deck)), file.study.allow_ignored)
    parameter_targets = targets(plain, built)
    model = parametric_model(built.structure, parameter_set(parameter_targets, built), assignments(parameter_targets))
    return DeckFiles(built, model, file.output_folder / RUNS_FOLDER, FromSolver(file).solver.deck_name)


def of_solver(file: StudyFile) -> StudyFile:
    """The study with initial values for all parameters, and polynomials of degree two without products."""
    deck = file.study.deck
    known = {} if deck is None else {p.name: p.nominal for p in _deck_files(file, deck).model.parameters.free}
    entries = []
    for entry in file.parameter:
        middle = None if entry.lower is None or entry.upper is None else 0.5 * (entry.lower + entry.upper)
        start = known.get(entry.name, middle)
        entries.append(entry if entry.nominal is not None else entry.model_copy(update={"nominal": start}))
    # the next run, not one that is left out, shows the error of the polynomials
    of_configurations = [name for e in file.configuration if e.solver is not None for name in e.solver.templates or ()]
    templates = [*FromSolver(file).solver.templates, *of_configurations]
    runs = RunsModelTable(file=deck or templates[0], degree=2, crossed=False, tolerance=0.5)
    changed: dict[str, object] = {"parameter": tuple(entries), "runs": runs}
    if deck is not None and file.model.grid is None:
        changed["model"] = file.model.model_copy(update={"grid": deck})
    return file.model_copy(update=changed)


@dataclass(frozen=True, eq=False)
class PointRuns:
    """The runs of a point, one for each of the inputs that the configurations have."""

    parts: tuple[RunOutcome, ...]

    @property
    def failure(self) -> Failure | None:
        """Outcome of the first run that failed finally; None if all have modes."""
        part = self.failed_part
        return None if part is None else self.parts[part].failures[-1]

    @property
    def failed_part(self) -> int | None:
        """Position in `sources` of the first run that failed finally."""
        return next((i for i, outcome in enumerate(self.parts) if outcome.modes is None), None)


@dataclass(eq=False)
class SolverRuns:
    """The runs of a study.

    Parameters
    ----------
    solvers : with the inputs of the configurations, in the order of `sources`
    noise : relative scatter and rounding of the results
    replaced : what was said of runs that failed for good
    rounded : what was said of placeholders that round differences, by parameter
    decks : femtune's own model of each of the inputs, where derivatives come from it, in its configuration
    by_deck : whether they do at the next point
    compared : what was said of both models, at the first point where they were compared
    beside : the modes of both there, by input
    """

    file: StudyFile
    solvers: tuple[ExternalSolver | FunctionSolver, ...]
    executor: Executor
    journal: RunJournal
    progress: Progress = silent
    noise: float = _RESULT_ROUNDING
    started: int = 0
    replaced: list[Notice] = field(default_factory=list)
    decks: tuple[tuple[DeckFiles, ConfiguredModel], ...] = ()
    by_deck: bool = False
    rounded: dict[str, Notice] = field(default_factory=dict)
    compared: list[Notice] = field(default_factory=list)
    beside: list[ModesBeside] = field(default_factory=list)

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
        """(k,) distances of the runs from the central one, at which errors from rounding and from curvature are
        equal."""
        lower, upper = self.bounds
        return 0.5 * self.relative_step * (upper - lower)

    @property
    def asked(self) -> SolverTable:
        """[solver] of the study."""
        return FromSolver(self.file).solver

    @property
    def remarks(self) -> tuple[Notice, ...]:
        """What the journal tells, and files on which the runs depend and which were changed or cannot be compared."""
        read = [solver.watched for solver in self.solvers if isinstance(solver, ExternalSolver)]
        unread, changed = (
            ", ".join(dict.fromkeys(path for one in read for path in paths(one)))
            for paths in (lambda one: one.unread, lambda one: one.changed)
        )
        where = self.file.where("solver")
        told = [Notice("external.not-watched", where=where, level="info", names=unread)] if unread else []
        told += [Notice("external.changed/file", where=where, names=changed)] if changed else []
        return (*told, *self.rounded.values(), *self.journal.notices)

    @property
    def relative_step(self) -> float:
        """These distances as fractions of half the range of the bounds."""
        return self.asked.step or float(np.clip((3.0 * self.noise) ** (1 / 3), _SMALLEST_STEP, _LARGEST_STEP))

    def run(self, points: Sequence[Reals]) -> tuple[PointRuns, ...]:
        """The runs of points; known ones are not repeated."""
        told = [dict(zip(self.names, map(float, point))) for point in points]

        def say(done: int, outcome: RunOutcome) -> None:
            self.progress.step(f"external runs: {outcome.state}", done, len(points))

        columns = []
        for solver in self.solvers:
            evaluated = evaluate(solver, told, self.executor, self.journal, finished=say)
            self.started += evaluated.started
            columns.append(evaluated.outcomes)
        return tuple(map(PointRuns, zip(*columns)))

    def measure_noise(self, point: Reals, known: PointRuns) -> None:
        """Run a point a second time to measure the noise (error ``external.not-repeatable``); the journal keeps that
        run, too."""
        values = dict(zip(self.names, map(float, point)))
        noise = [_RESULT_ROUNDING]
        for solver, first in zip(self.solvers, known.parts):
            again = replace(solver, version=f"{solver.version}, repeated")
            repeated = evaluate(again, [values], self.executor, self.journal)
            self.started += repeated.started
            noise.append(compare_repeated(values, first, repeated.outcomes[0], self.asked.repeat_tolerance))
        self.noise = max(noise)

    def around(self, point: Reals) -> tuple[RunsTable, ...]:
        """Runs at a point and two more for each parameter, by `sources`; one run where derivatives come from the deck.

        Raises
        ------
        FemtuneError : ``external.failed`` where the point itself, or all points beside it for a parameter, fail
        """
        if self.own is not None and self.own.derivatives is not None:
            return self._by_own_derivatives(point, self.own)
        if self.by_deck and (tables := self._by_deck(point)) is not None:
            return tables
        offsets = [_within(i, point, self.steps, self.bounds) for i in range(len(point))]
        self._check_rounding(point, offsets)
        first = [point + o for some in offsets for o in some[:2]]
        outcomes = dict(zip(map(tuple, [point, *first]), self.run([point, *first])))
        centre = outcomes[tuple(point)]
        if centre.failure is not None:
            raise self.failed(point, centre)
        rows = [(point, centre)]
        for i, some in enumerate(offsets):
            rows += self._pair(i, point, some, outcomes)
        return self.tables(rows)

    @property
    def own(self) -> OwnModel | None:
        """The user's own model in place of a solver."""
        return next(iter(self.file.given.own_model.values()), None)

    def _by_own_derivatives(self, point: Reals, own: OwnModel) -> tuple[RunsTable, ...]:
        """One run at a point, and modes on both sides of it by the derivatives of the user's own model.

        The central difference of what is linear is the derivative itself.
        """
        centre = self.run([point])[0]
        modes = centre.parts[0].modes
        if modes is None:
            raise self.failed(point, centre)
        slopes = own.slopes(dict(zip(self.names, map(float, point))), modes, self.names)
        rows = [(point, centre)]
        for i, name in enumerate(self.names):
            for offset in _within(i, point, self.steps, self.bounds)[:2]:
                beside = linear(modes, slopes[name], float(offset[i]))
                rows.append((point + offset, PointRuns((RunOutcome("", beside),))))
        return self.tables(rows)

    def _check_rounding(self, point: Reals, offsets: Sequence[Sequence[Reals]]) -> None:
        """Tell, or refuse, placeholders whose format rounds the difference between two runs (error
        ``external.placeholder/rounded-away``).
        """
        for i, (name, some) in enumerate(zip(self.names, offsets)):
            for offset in some[:2]:
                self._tell_rounding(name, float(point[i]), float(offset[i]))

    def _tell_rounding(self, name: str, value: float, step: float) -> None:
        inputs = [solver.inputs for solver in self.solvers if isinstance(solver, ExternalSolver)]
        templates = [t for files in inputs if isinstance(files, Templates) for t in files.templates]
        fields = [pair for t in templates for pair in zip(t.read_back(name, value), t.read_back(name, value + step))]
        for (where, here), (_, there) in fields:
            if here == there:
                raise FemtuneError(
                    "external.placeholder/rounded-away", where=where, name=name, value=value, other=value + step,
                    written=here,
                )  # fmt: skip
            error = abs((there - here) / step - 1.0)
            if error > _MOST_ROUNDING:
                said = Notice("external.rounding", where=where, name=name, percent=100.0 * error)
                self.rounded.setdefault(name, said)

    def follow_deck(self, point: Reals) -> None:
        """Take derivatives from the deck from now on, if both models agree at a point that was run."""
        self.by_deck = bool(self.decks)
        if self.by_deck:
            self._by_deck(point)

    def _by_deck(self, point: Reals) -> tuple[RunsTable, ...] | None:
        """One run at a point, and modes around it from the derivatives of femtune's model; None if these mislead."""
        centre = self.run([point])[0]
        if centre.failure is not None:
            raise self.failed(point, centre)
        values = dict(zip(self.names, map(float, point)))
        beside = [o for i in range(len(point)) for o in _within(i, point, self.steps, self.bounds)[:2]]
        points = [point, *(point + o for o in beside)]
        tables, told, seen = [], [], []
        for i, ((deck, configured), table) in enumerate(zip(self.decks, self.tables([(point, centre)]))):
            try:
                name = next(e.name for e in self.file.configurations if part_of(self.file, e) == i)
                modes = modes_beside(name, configured, deck.x_of(values), table)
                told.append(_compared(self.file, None if modes is None else modes.modes))
                seen += [] if modes is None else [modes.modes]
                if modes is None or not _alike(modes.modes):
                    self.by_deck = False
                    break
                scales = {p.name: p.scale for p in deck.model.parameters.free}
                tables.append(DeckDerivatives.of(modes, scales, self.names).table(self.names, points))
            except FemtuneError as error:
                self.by_deck = False
                told.append(Notice("external.deck/not-solved", where=self.file.where("solver"), reason=error.what))
                break
        if not self.compared:
            self.compared = told
            self.beside = [replace(each, derivatives=self.by_deck) for each in seen]
        elif not self.by_deck:
            self.compared.append(told[-1])
        return tuple(tables) if self.by_deck else None

    def tables(self, rows: Sequence[tuple[Reals, PointRuns]]) -> tuple[RunsTable, ...]:
        """Tables of runs that have modes, by `sources`."""
        return tuple(
            _table(self.names, [(point, runs.parts[i]) for point, runs in rows]) for i in range(len(self.solvers))
        )

    def failed(self, point: Reals, runs: PointRuns) -> FemtuneError:
        """The error that a point has no modes; it names the configuration if configurations have different inputs."""
        failure, part = runs.failure, runs.failed_part
        assert failure is not None
        assert part is not None
        values = {"point": described(dict(zip(self.names, map(float, point))))}
        if len(self.solvers) > 1:
            entry = next(e for e in self.file.configurations if part_of(self.file, e) == part)
            values["configuration"] = entry.name
        if failure.folder:
            values["folder"] = failure.folder
        if self.own is not None:
            return FemtuneError(
                "external.failed/own-model", values=values, failure=failure.sentence, name=self.own.name
            )
        return FemtuneError("external.failed", values=values, failure=failure)

    def _pair(
        self, i: int, point: Reals, offsets: list[Reals], outcomes: dict[tuple[float, ...], PointRuns]
    ) -> list[tuple[Reals, PointRuns]]:
        """Two runs for a parameter; runs that fail finally are replaced by others."""
        good: list[tuple[Reals, PointRuns]] = []
        bad: list[PointRuns] = []
        for offset in offsets:
            at = point + offset
            outcome = outcomes[tuple(at)] if tuple(at) in outcomes else self.run([at])[0]
            if outcome.failure is not None:
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
                    "external.replaced", parameter=self.names[i], n_failed=len(bad), failure=bad[0].failure,
                    places=", ".join(f"{point[i] + one:.6g}" for one in h),
                    times=abs(h[0] * h[1]) / abs(wanted[0] * wanted[1]),
                )
            )  # fmt: skip
        return good


_MOST_MODES_LISTED = 12
"""Modes that a notice lists; the others are counted."""
_MOST_UNPAIRED = 0.25
"""Fraction of elastic modes without a partner above which the derivatives of the deck are not used."""


def _alike(beside: ModesBeside) -> bool:
    """True if nearly all elastic modes have partners in femtune's model."""
    elastic = beside.elastic
    return bool(elastic.any()) and bool((elastic & ~beside.paired).sum() <= _MOST_UNPAIRED * elastic.sum())


def _compared(file: StudyFile, beside: ModesBeside | None) -> Notice:
    """Both models compared mode by mode; a warning if they differ so much that derivatives mislead."""
    where = file.where("solver", "derivatives")
    if beside is None:
        return Notice("external.deck/no-shapes", where=where)
    assert beside.mac is not None
    rows = zip(beside.freq_hz, 100.0 * beside.difference, beside.mac, beside.elastic)
    lines = [
        f"mode {j} at {hz:.4g} Hz {percent:+.2g} % (MAC {mac:.3f})"
        for j, (hz, percent, mac, elastic) in enumerate(rows, start=1)
        if elastic
    ]
    more = f" and {len(lines) - _MOST_MODES_LISTED} more" if len(lines) > _MOST_MODES_LISTED else ""
    facts = {"configuration": beside.configuration, "modes": ", ".join(lines[:_MOST_MODES_LISTED]) + more}
    alone = int((beside.elastic & ~beside.paired).sum())
    if not alone:
        return Notice("external.deck", where=where, level="info", **facts)
    code = "external.deck/unlike" if _alike(beside) else "external.deck/misleading"
    return Notice(code, where=where, alone=alone, **facts)


def _within(i: int, point: Reals, steps: Reals, bounds: tuple[Reals, Reals]) -> list[Reals]:
    """Offsets of the runs for a parameter that lie within its bounds."""
    offsets = []
    for factor in _OFFSETS:
        offset = np.zeros(len(point))
        offset[i] = factor * steps[i]
        if bounds[0][i] <= point[i] + offset[i] <= bounds[1][i]:
            offsets.append(offset)
    return offsets


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
    own = next(iter(file.given.own_model.values()), None)
    if own is not None:
        names = tuple(entry.name for entry in file.parameter)
        solver = FunctionSolver(own.modes, names, own.version, Checks(file.modes.count or 1))
        return _runs(file, (solver,), progress, fresh)
    inputs = _inputs(file)
    solvers = tuple(_solver(file, overrides, files) for overrides, files in zip(_solver_overrides(file), inputs))
    runs = _runs(file, solvers, progress, fresh)
    if FromSolver(file).solver.derivatives == "deck":
        runs.decks = tuple(
            _deck_of(file, i, overrides, files)
            for i, (overrides, files) in enumerate(zip(_solver_overrides(file), inputs))
        )
        runs.by_deck = True
    return runs


def _deck_of(
    file: StudyFile, part: int, overrides: ConfigurationSolver, inputs: InputFiles
) -> tuple[DeckFiles, ConfiguredModel]:
    """femtune's model of the deck that belongs to some inputs, in the first configuration with these inputs."""
    name = overrides.deck or file.study.deck
    assert name is not None
    deck = inputs if isinstance(inputs, DeckFiles) else _deck_files(file, name)
    entry = next(e for e in file.configurations if part_of(file, e) == part)
    return deck, configure(deck.model, overlay(entry))


def own_runs(file: StudyFile, overrides: ConfigurationSolver, where: Where) -> SolverRuns:
    """The runs of one set of input files, such as those of a vibration test, in the journal of the study.

    Parameters
    ----------
    where : place in the study that names them

    Raises
    ------
    FemtuneError : ``external.no-program``, ``external.placeholder``, ``external.unreadable``
    """
    files = _input_files(file, overrides)
    if isinstance(files, Templates):
        check_names(files.names, [p.name for p in file.parameter], (), where)
    return _runs(file, (_solver(file, overrides, files),))


def _runs(
    file: StudyFile,
    solvers: tuple[ExternalSolver | FunctionSolver, ...],
    progress: Progress = silent,
    fresh: bool = False,
) -> SolverRuns:
    parallel = file.parallel
    executor: Executor = (
        Cluster(parallel.address, parallel.remote) if parallel.how == "cluster" else Threads(_workers(file))
    )

    def wait() -> None:
        progress.step("waiting for the journal of the runs, which another program has locked", 0, None)

    return SolverRuns(
        file, solvers, executor, open_run_journal(file.output_folder, fresh=fresh, waiting=wait), progress
    )


def _solver_overrides(file: StudyFile) -> tuple[ConfigurationSolver, ...]:
    """The keys of [solver] that configurations override, in the order of `sources`."""
    distinct: dict[str, ConfigurationSolver] = {}
    for entry in file.configurations:
        overrides = entry.solver or ConfigurationSolver()
        distinct.setdefault(overrides.model_dump_json(), overrides)
    return tuple(distinct.values())


def _solver(file: StudyFile, overrides: ConfigurationSolver, inputs: InputFiles) -> ExternalSolver:
    """[solver] with the keys that a configuration overrides (error ``external.no-program``)."""
    entry = FromSolver(file).solver.model_copy(update={k: v for k, v in overrides if v is not None and k != "deck"})
    checks = Checks(file.modes.count or 1, entry.mass, entry.mass_tolerance)
    solver = ExternalSolver(
        command=entry.command,
        inputs=inputs,
        result=ResultFile(entry.result, entry.format),
        folder=file.output_folder / RUNS_FOLDER,
        checks=checks,
        timeout_s=entry.timeout_s,
        retries=entry.retries,
        error_texts=entry.error_texts,
        licence_texts=entry.licence_texts,
        licence_wait_s=entry.licence_wait_s,
        licence_tries=entry.licence_tries,
        environment=tuple(sorted(entry.environment.items())),
        version=entry.version,
        keep=entry.keep,
        keep_most=entry.keep_most,
    )
    place: tuple[str | int, ...] = ("solver", "command")
    if overrides.command is not None:
        known = [("configuration", i, c.solver) for i, c in enumerate(file.configurations)]
        known += [("vibration", i, v.solver) for i, v in enumerate(file.vibration)]
        place = (*next((table, i) for table, i, solver in known if solver == overrides), *place)
    with errors_at(file.where(*place)):
        solver.check()
    return solver


def _inputs(file: StudyFile) -> tuple[InputFiles, ...]:
    """Decks, or templates whose placeholders are the parameters; each parameter must occur in at least one of them."""
    files: list[InputFiles] = []
    names = [p.name for p in file.parameter]
    placeholders: dict[str, None] = {}
    for overrides in _solver_overrides(file):
        files.append(_input_files(file, overrides))
        check_names(files[-1].names, names, (), _place_of_templates(file, overrides))
        placeholders |= dict.fromkeys(files[-1].names)
    used = ConfigurationSolver() if FromSolver(file).solver.templates else _solver_overrides(file)[0]
    check_names(tuple(placeholders), names, names, _place_of_templates(file, used))
    return tuple(files)


def _place_of_templates(file: StudyFile, overrides: ConfigurationSolver) -> Where:
    """The line of the templates: those of a configuration, or of all."""
    if overrides.templates is None:
        return file.where("solver", "templates")
    at = next(i for i, entry in enumerate(file.configurations) if entry.solver == overrides)
    return file.where("configuration", at, "solver", "templates")


def _input_files(file: StudyFile, overrides: ConfigurationSolver) -> DeckFiles | Templates:
    asked = FromSolver(file).solver
    deck = overrides.deck or file.study.deck
    templates = asked.templates if overrides.templates is None else overrides.templates
    if deck is not None and not templates:
        return _deck_files(file, deck)
    files = asked.files if overrides.files is None else overrides.files
    return Templates(tuple(read_template(file.path_of(name)) for name in templates), tuple(map(file.path_of, files)))


def _workers(file: StudyFile) -> int:
    return 1 if file.parallel.how == "serial" else file.parallel.workers


def build_of_solver(file: StudyFile, progress: Progress, fresh: bool, around: bool = True) -> BuiltModel:
    """The model around the initial values; with `around` = False that of the run at these alone.

    Raises
    ------
    FemtuneError : ``study.no-parameters``, and those of `solver_runs`
    """
    if not file.parameter:
        raise FemtuneError("study.no-parameters/of-solver", where=file.where("solver"))
    runs = solver_runs(file, progress, fresh=fresh)
    try:
        point = nominal_point(file)
        known = runs.run([point])[0]
        if known.failure is not None:
            raise runs.failed(point, known)
        if not around:
            return _of_one_run(file, runs, runs.tables([(point, known)]))
        runs.measure_noise(point, known)
        tables = runs.around(point)
        with errors_at(file.where("solver")):
            built = built_of_tables(file, tables, 0)
    finally:
        runs.journal.close()
    deck_notices, beside = tuple(runs.compared), tuple(runs.beside)
    if not runs.decks and isinstance(getattr(runs.solvers[0], "inputs", None), DeckFiles):
        deck_notices, beside = _beside_own(file, runs, known)
    notices = (*_facts(runs, tables), *_hidden(built), *deck_notices, *runs.remarks)
    return replace(built, notices=notices, beside=beside)


def _of_one_run(file: StudyFile, runs: SolverRuns, tables: tuple[RunsTable, ...]) -> BuiltModel:
    with errors_at(file.where("solver")):
        built = built_of_tables(file, tables, 0, degree=0)
    return replace(built, notices=(*_hidden(built), *runs.remarks))


def _hidden(built: BuiltModel) -> tuple[Notice, ...]:
    """Notices of modes that are not visible; those of the fit do not apply, since no run checks it."""
    return tuple(notice for notice in built.notices if notice.code == "runs.hidden-modes")


def _beside_own(
    file: StudyFile, runs: SolverRuns, known: PointRuns
) -> tuple[tuple[Notice, ...], tuple[ModesBeside, ...]]:
    """Differences between femtune's elements and the solver, mode by mode in their order, if femtune can solve the
    model."""
    first, modes = runs.solvers[0], known.parts[0].modes
    assert isinstance(first, ExternalSolver)
    inputs = first.inputs
    assert isinstance(inputs, DeckFiles)
    assert modes is not None
    hz, where = modes.freq_hz, file.where("solver")
    try:
        configured = configure(inputs.model, overlay(file.configurations[0]))
        deck_hz = solve_modes(configured.at(np.zeros(len(runs.names))), len(hz)).freq_hz[: len(hz)]
    except FemtuneError as error:
        return (Notice("external.own-elements/not-solved", where=where, level="info", reason=error.what),), ()
    beside = ModesBeside(file.configurations[0].name, hz[: len(deck_hz)], deck_hz, None)
    if not beside.elastic.any():
        return (), ()
    difference = 100.0 * beside.difference
    worst = int(np.abs(difference).argmax())
    said = Notice(
        "external.own-elements", where=where, level="info", percent=float(difference[worst]), mode=worst + 1,
        count=int(beside.elastic.sum()),
    )  # fmt: skip
    return (said,), (beside,)


def point_of(parameters: ParameterSet, runs: SolverRuns, x: Reals) -> Reals:
    """Values of the parameters of the runs at normalised parameters, within their bounds."""
    values = parameters.values(x)
    lower, upper = runs.bounds
    return np.clip(np.array([values[name] for name in runs.names]), lower, upper)


def nominal_point(file: StudyFile) -> Reals:
    """(k,) initial values."""
    return np.array([entry.nominal for entry in file.parameter], float)


def _facts(runs: SolverRuns, tables: Sequence[RunsTable]) -> Iterator[Notice]:
    where = runs.file.where("solver")
    steps = ", ".join(f"{name} ± {step:.4g}" for name, step in zip(runs.names, runs.steps))
    count, noise = sum(len(table.freq_hz) for table in tables), 100.0 * runs.noise
    if runs.by_deck:
        yield Notice("external.runs/deck", where=where, level="info", runs=len(tables), noise_percent=noise)
        return
    yield Notice("external.runs", where=where, level="info", runs=count, noise_percent=noise, steps=steps)
    yield from (replace(notice, where=where) for notice in runs.replaced)


UPDATED_FOLDER = "updated"
"""Folder of the input files with the updated values, beside the folders of the runs."""


def write_updated(runs: SolverRuns, values: Mapping[str, float]) -> Path:
    """Write the input files with given values, beside the folders of the runs (error ``external.folder``)."""
    solvers = [solver for solver in runs.solvers if isinstance(solver, ExternalSolver)]
    folder = runs.file.output_folder / RUNS_FOLDER / UPDATED_FOLDER
    try:
        for i, solver in enumerate(solvers):
            subfolder = folder if len(runs.solvers) == 1 else folder / _folder_name(runs.file, i)
            subfolder.mkdir(parents=True, exist_ok=True)
            for name, content in solver.inputs.files(values).items():
                write_whole(subfolder / name, content)
    except OSError as error:
        raise FemtuneError("external.folder", where=Where(str(folder)), reason=error.strerror or error) from error
    return folder


def _folder_name(file: StudyFile, part: int) -> str:
    """Name of the first configuration with these inputs, without characters that a file system may refuse."""
    asked = _solver_overrides(file)[part].model_dump_json()
    first = next(c.name for c in file.configurations if (c.solver or ConfigurationSolver()).model_dump_json() == asked)
    return f"{part + 1}-" + re.sub(r"[^A-Za-z0-9_-]", "_", first)[:60]
