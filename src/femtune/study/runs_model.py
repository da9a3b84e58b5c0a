"""The model of a study of runs: its table read and fitted, and measured frequencies without shapes as a test."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError, Notice, did_you_mean
from femtune.fem import NodeTable
from femtune.files.built_model import BuiltModel
from femtune.files.matrices.placement import read_points
from femtune.files.runs_table import RunsTable, read_runs_table
from femtune.files.study_file import MEASURED, ModesTable
from femtune.modal import ModeSet
from femtune.model.imported.from_runs import FittedRuns, Runs, fit_configurations, seen_modes
from femtune.study.error_places import errors_at
from femtune.study.model_source import FromRuns, model_source
from femtune.surrogates import ChaosRules, KrigingRules, RadialRules
from femtune.surrogates.kinds import SURROGATES, TRENDS
from femtune.testdata import ModalTest

if TYPE_CHECKING:
    from femtune.files.study_file import ConfigurationEntry, StudyFile
    from femtune.files.study_file.runs import RunsModelTable
    from femtune.surrogates import SurrogateRules


_RUNS_KEPT = 0.9
"""Fraction of the runs of a table that have as many visible modes as are used; the other runs are left out."""


_LEAST_LEVELS = 2
"""Values of a parameter in runs of a design by levels."""
_FOR_MEAN_AND_ERROR = 2
"""Degrees of freedom of runs beside those of effects."""


def build_of_runs(file: StudyFile) -> BuiltModel:
    """The model of a study of runs, as `build_structure` gives that of a deck.

    Raises
    ------
    FemtuneError : ``runs.*``, ``matrices.points`` for the grid points
    """
    tables = [read_runs_table(file.path_of(str(name))) for name in sources(file)]
    with errors_at(file.where("runs")):
        return built_of_tables(file, tables)


def build_without_fit(file: StudyFile) -> BuiltModel:
    """The model of one run of each table, the one nearest the middle: for what analyses the runs as they are.

    Raises
    ------
    FemtuneError : as `build_of_runs`, without those of a fit
    """
    tables = [read_runs_table(file.path_of(str(name))) for name in sources(file)]
    with errors_at(file.where("runs")):
        names = _columns(file, tables)
        return built_of_tables(file, [_middle_run(table, names) for table in tables], 0, degree=0)


def are_by_levels(file: StudyFile) -> bool:
    """Whether the runs of each table are enough to separate the effects of the values that each parameter has in them.

    Raises
    ------
    FemtuneError : as `read_runs_table`
    """
    for name in sources(file):
        table = read_runs_table(file.path_of(str(name)))
        points = table.points([entry.name for entry in file.parameter if entry.name in table.columns])
        points = points[table.usable & np.isfinite(points).all(axis=1)]
        levels = [len(np.unique(column)) for column in points.T]
        # a degree of freedom for the error at least
        if min(levels, default=1) < _LEAST_LEVELS or len(points) < _FOR_MEAN_AND_ERROR + sum(levels) - len(levels):
            return False
    return True


def _middle_run(table: RunsTable, names: Sequence[str]) -> RunsTable:
    """The usable run nearest the middle of the ranges of the parameters; all runs where none is usable."""
    points = table.points([name for name in names if name in table.columns])
    usable = np.flatnonzero(table.usable & np.isfinite(points).all(axis=1))
    if not usable.size:
        return table
    low, high = points[usable].min(axis=0), points[usable].max(axis=0)
    width = np.where(high > low, high - low, 1.0)
    away = np.abs((points[usable] - 0.5 * (low + high)) / width).sum(axis=1)
    at = usable[[int(away.argmin())]]
    columns = {name: values[at] for name, values in table.columns.items()}
    return replace(table, columns=columns, freq_hz=table.freq_hz[at], states=(),
                   shapes=None if table.shapes is None else table.shapes[at])  # fmt: skip


def sources(file: StudyFile) -> tuple[Hashable, ...]:
    """The tables, or the input files of a solver, from which the configurations take their runs; each once."""
    return tuple(dict.fromkeys(map(model_source(file).input_of, file.configurations)))


def part_of(file: StudyFile, entry: ConfigurationEntry) -> int:
    """Position in `sources` of what a configuration takes its runs from."""
    return sources(file).index(model_source(file).input_of(entry))


def built_of_tables(
    file: StudyFile, tables: Sequence[RunsTable], centre: int | None = None, degree: int | None = None
) -> BuiltModel:
    """The model of tables in memory, one for each of `sources`; `centre` and `degree` as in `fit_configurations`."""
    names, asked = _columns(file, tables), FromRuns(file).table
    tables = _at_common_dofs(tables)
    nodes, dofs = _nodes(file, tables[0])
    selected = [_used(file, table, names, dofs, centre) for table in tables]
    parts = [used.runs for used in selected]
    # the central run is the first one, and it is usable
    order = asked.order if degree is None else degree
    rules = None if degree == 0 else _rules(asked)
    fitted = fit_configurations(parts, nodes, order, asked.crossed, centre, rules)
    notices = [n for used, f in zip(selected, fitted) for n in _notices(file, used, f)]
    count = min(runs.freq_hz.shape[1] for runs in parts)
    files = tuple(map(str, model_source(file).files))
    coverage = tuple(f.coverage for f in fitted)
    return BuiltModel(files, fitted[0].structure, tuple(notices), mode_count=count, coverage=coverage)


def _rules(table: RunsModelTable) -> SurrogateRules | None:
    """Settings of the surrogates of a table; None for polynomials."""
    if table.method == "kriging":
        return KrigingRules(tuple(TRENDS)[table.order], table.correlation)
    if table.method == "radial-basis":
        return RadialRules(table.kernel)
    return ChaosRules(table.order) if table.method == "chaos" else None


@dataclass(frozen=True, eq=False)
class _Used:
    """The runs of a table that are used, the rows that have them, and the number of modes without motion at its
    DOFs."""

    runs: Runs
    usable: np.ndarray
    count: int
    hidden: int


def _used(
    file: StudyFile, table: RunsTable, names: Sequence[str], dofs: np.ndarray | None, centre: int | None
) -> _Used:
    columns = tuple(name for name in names if name in table.columns)
    usable = table.usable & np.isfinite(table.points(columns)).all(axis=1)
    hz, shapes, hidden = table.freq_hz[usable], None if table.shapes is None else table.shapes[usable], 0
    if shapes is not None:
        hz, shapes, hidden = seen_modes(hz, shapes, 1.0 if centre is not None else _RUNS_KEPT)
    count = min(file.modes.count or hz.shape[1], hz.shape[1])
    hz, shapes = hz[:, :count], None if shapes is None else shapes[:, :, :count]
    if shapes is not None and shapes.shape[1] < count:
        raise FemtuneError("runs.few-dofs", n_dofs=shapes.shape[1], n_modes=count)
    runs = Runs(columns, table.points(columns)[usable], hz, shapes, dofs)
    return _Used(runs, usable, table.freq_hz.shape[1], hidden)


def _at_common_dofs(tables: Sequence[RunsTable]) -> Sequence[RunsTable]:
    """Shapes at the DOFs that all tables have (errors ``runs.study/shapes``, ``runs.few-dofs/none``)."""
    if len(tables) == 1:
        return tables
    if any(table.shapes is None for table in tables):
        raise FemtuneError("runs.study/shapes")
    known = set.intersection(*(set(map(str, table.dofs)) for table in tables))
    if not known:
        raise FemtuneError("runs.few-dofs/none")
    wanted = [dof for dof in tables[0].dofs if str(dof) in known]
    out = []
    for table in tables:
        at = {str(dof): i for i, dof in enumerate(table.dofs)}
        assert table.shapes is not None
        shapes = table.shapes[:, [at[str(dof)] for dof in wanted]]
        out.append(RunsTable(table.columns, table.freq_hz, shapes, DofSet(wanted)))
    return out


def _columns(file: StudyFile, tables: Sequence[RunsTable]) -> tuple[str, ...]:
    """Parameters that are columns of a table; a free parameter that is not a column must be used by a tie."""
    used = {name for p in file.parameter if p.tie is not None for name in _names_in(p.tie)}
    known = tuple(dict.fromkeys(name for table in tables for name in table.columns))
    columns = []
    for i, entry in enumerate(file.parameter):
        if entry.name in known:
            columns.append(entry.name)
        elif entry.tie is not None or entry.name not in used:
            raise FemtuneError(
                "runs.no-column",
                where=file.where("parameter", i, "name"),
                hint=did_you_mean(entry.name, known) or "name the parameter as its column in the table",
                name=entry.name,
            )
    return tuple(columns)


def _names_in(tie: str) -> tuple[str, ...]:
    from femtune.parameters import parse_expression  # noqa: PLC0415  few studies have ties

    return parse_expression(tie).names


def _nodes(file: StudyFile, table: RunsTable) -> tuple[NodeTable, np.ndarray | None]:
    """Grid points of the shapes, with coordinates where [model] grid gives them."""
    if table.shapes is None:
        return NodeTable(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3))), None
    wanted = np.unique(table.dofs.nodes)
    if file.model.grid is None:
        frames = np.tile(np.eye(3), (len(wanted), 1, 1))
        nodes = NodeTable(wanted, np.zeros((len(wanted), 3)), frames, has_coordinates=False)
    else:
        points = read_points(file.path_of(file.model.grid))
        missing = np.setdiff1d(wanted, points.ids)
        if missing.size:
            raise FemtuneError(
                "matrices.no-coordinates",
                where=file.where("model", "grid"),
                values={"nodes": ", ".join(map(str, missing[:10]))},
                n_missing=missing.size,
                n=len(wanted),
            )
        at = np.searchsorted(points.ids, wanted)
        nodes = NodeTable(wanted, points.xyz[at], points.frames[at])
    dofs = np.array([nodes.dof(dof.node, dof.component) for dof in table.dofs], np.int64)
    return nodes, dofs


def _notices(file: StudyFile, table: _Used, fitted: FittedRuns) -> list[Notice]:
    asked, where, usable = FromRuns(file).table, file.where("runs"), table.usable
    notices = []
    if table.hidden:
        facts: dict[str, Any] = {"hidden": table.hidden, "count": table.count}
        notices.append(Notice("runs.hidden-modes", where=where, level="info", **facts))
    failed = int((~usable).sum())
    if failed:
        notices.append(Notice("runs.left-out", where=where, failed=failed, runs=len(usable)))
    other = int((~fitted.used).sum())
    if other:
        notices.append(Notice("runs.other-modes", where=where, other=other, runs=len(fitted.used)))
    used, error = int(fitted.used.sum()), fitted.error
    known = np.isfinite(error).all(axis=1)
    if not np.isinf(error).any() and not known.any():
        return [*notices, Notice("runs.fitted/unchecked", where=where, level="info", runs=used, n=fitted.coefficients)]
    with np.errstate(invalid="ignore"):
        size = np.sqrt(np.nanmean(error**2, axis=0))
    worst = int(np.argmax(size))
    facts = {
        "runs": used,
        "n": fitted.coefficients,
        "percent": 100.0 * float(size.max()),
        "mode": worst + 1,
    }
    poor = not size.max() <= asked.tolerance
    if asked.method in SURROGATES:
        code = "runs.poor-fit/surrogate" if poor else "runs.fitted/surrogate"
        facts["method"] = SURROGATES[asked.method].label
    else:
        code = "runs.poor-fit" if poor else "runs.fitted"
    return [*notices, Notice(code, where=where, level="warning" if poor else "info", **facts)]


def with_modes_of_runs(file: StudyFile, built: BuiltModel) -> StudyFile:
    """The study with the modes that the runs have, and its measured frequencies as a test."""
    given, nodes = file.given, built.structure.nodes
    count = built.mode_count or len(nodes.scalar_points)
    changed: dict[str, object] = {"modes": ModesTable(count=count)}
    if file.test is not None and file.test.freq_hz:
        given = replace(given, tests={**given.tests, MEASURED: _measured(file, nodes, count)})
        changed["sensors"] = file.sensors.model_copy(update={"by_id": True})
    known = sources(file)
    if len(known) > 1:
        # the support set of a configuration holds the coordinates of all others
        changed["configuration"] = tuple(
            entry.model_copy(update={"spc": part_of(file, entry) + 1}) for entry in file.configuration
        )
    file = file.model_copy(update=changed)
    file._given = given
    return file


def _measured(file: StudyFile, nodes: NodeTable, count: int) -> ModalTest:
    """Frequencies without shapes: each mode of the runs is a scalar point, the only one that its shape moves."""
    assert file.test is not None
    hz = np.array(file.test.freq_hz)
    if len(nodes.ids):
        raise FemtuneError("runs.measured/shapes", where=file.where("test", "freq_hz"))
    if len(hz) > count:
        raise FemtuneError("runs.measured", where=file.where("test", "freq_hz"), measured=len(hz), modes=count)
    dofs = DofSet(Dof(int(node), "S") for node in nodes.scalar_points)
    sd = np.array(file.test.freq_sd_hz) if file.test.freq_sd_hz else None
    modes = ModeSet(hz, np.eye(count)[:, : len(hz)], dofs, freq_sd_hz=sd, source="frequencies of the study")
    return ModalTest(MEASURED, file.study.unit_system, modes=modes)
