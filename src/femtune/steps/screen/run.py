"""The step screen: which parameters matter for which mode, by designed runs of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError, did_you_mean
from femtune.experiments.variance import constant_responses
from femtune.files.runs_table import read_runs_table
from femtune.files.study_file import StudyFile, is_deck, read_study_file, with_screen
from femtune.steps.held_folder import held_for_solver
from femtune.steps.respond.run import check_places
from femtune.steps.results import Results
from femtune.steps.screen.methods import (
    Findings,
    ResponseLabels,
    ScreenMethod,
    method_of_screen,
    method_of_table,
)
from femtune.steps.screen.record import FailedModelRun, ScreenedMode, ScreenedParameter, ScreenResults
from femtune.steps.screen.result import ScreenResult
from femtune.steps.select.run import check_parameters
from femtune.steps.update.external import SolverFrequencies, opened_solver
from femtune.steps.update.facts.update import citations
from femtune.study.csv_table import write_csv
from femtune.study.error_places import errors_at
from femtune.study.executor import check_executor, executor_of, with_jobs
from femtune.study.model_runs import FrequencyRuns, ModelRun, alone, failures, followed_modes, runs_at
from femtune.study.model_source import FromRuns
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.record import alert
from femtune.study.runs_model import are_by_levels, build_without_fit
from femtune.study.solutions import looking_up
from femtune.study.study import load_study

if TYPE_CHECKING:
    from femtune.files.study_file import ScreenTable
    from femtune.study.external import SolverRuns
    from femtune.study.progress import Progress
    from femtune.study.record import Alert
    from femtune.study.study import Study

_LEAST_FOLLOWED_MAC = 0.5
"""MAC below which a mode is said to be lost: another mode may then resemble the original one as well."""
_MOST_NAMED = 6
"""Runs or modes that an alert lists, so that it stays one sentence."""


def screen_parameters(
    source: Path | str | StudyFile,
    options: Mapping[str, Any],
    progress: Progress = silent,
    *,
    fresh: bool = False,
    jobs: int | None = None,
    table: Path | None = None,
) -> ScreenResult:
    """Designed runs, and the effects of the free parameters on the frequencies.

    Parameters
    ----------
    options : keys of [screen] that take the place of the study's
    fresh : do not take solutions from the journal of the study's run folder
    jobs : maximum number of parallel runs; overrides [parallel]
    table : CSV file for the table of runs

    Raises
    ------
    FemtuneError : ``screen.*``, ``design.*``, ``study.no-parameters``, ``run.unwritable``
    """
    watch = Stopwatch(call("screen", source))
    with held_for_solver(source, "screen"):
        with watch.step("read"):
            source, options = _of_finished_runs(with_jobs(source, jobs), options)
            study = load_study(source, progress, fresh=fresh, around=False)
            check_parameters(study)
            file = with_screen(study.file, options)
            asked = file.screen
            assert asked is not None
            study = alone(study, asked.configuration)
            with errors_at(file.where("screen")):
                method = _method(asked, study)
            if table is not None:
                check_places(study, [table], None)
            check_executor(study, progress)
            inputs = inputs_of(study)
        with (
            watch.step("runs"),
            looking_up(study, fresh) as looked_up,
            opened_solver(looked_up.study, progress) as solver,
        ):
            runs: _Runs | _Finished
            if method is None:
                with errors_at(file.where("screen")):
                    runs = finished_runs(looked_up.study, tuple(dict.fromkeys(asked.responses)))
            else:
                runs = _Runs.of(looked_up.study, method, progress, solver)
            with errors_at(file.where("screen")):
                record = runs.record()
        arrays = {"screen_runs": runs.table}
        if table is not None:
            write_csv(table, [*(p.name for p in study.parameters.free), *runs.labels], runs.table)
    results = Results(
        provenance=provenance(inputs, watch),
        study=study_facts(study),
        screen=record,
        citations=citations(runs.method.papers),
        alerts=record.alerts,
    )
    return ScreenResult(record, results, arrays, tuple(looked_up.remarks), () if table is None else (table,))


def _of_finished_runs(
    source: Path | str | StudyFile, options: Mapping[str, Any]
) -> tuple[Path | str | StudyFile, Mapping[str, Any]]:
    """The study and the options; where finished runs are analysed, which need no fit, with the model of one run.

    Finished runs are analysed where the study or the options ask for this, or where they ask for nothing else and the
    runs are of a design by levels.
    """
    if not isinstance(source, StudyFile):
        if is_deck(source):
            return source, options
        source = read_study_file(source)
    if source.runs is None or source.given.model is not None:
        return source, options
    asked = with_screen(source, options).screen
    assert asked is not None
    if asked.model_fields_set <= {"configuration"} and are_by_levels(source):
        options = {**options, "design": "table"}
    elif asked.design != "table":
        return source, options
    file = source.model_copy()
    file._given = replace(source.given, model=build_without_fit(source))
    return file, options


def _method(asked: ScreenTable, study: Study) -> ScreenMethod | None:
    """The method of the runs to be made; None for finished ones (errors ``screen.design``, ``design.*``)."""
    names = [p.name for p in study.parameters.free]
    if asked.design == "table":
        if study.file.runs is None:
            raise FemtuneError("screen.design/table")
        return None
    unknown = [name for name in asked.levels if name not in names] if isinstance(asked.levels, dict) else []
    if unknown:
        raise FemtuneError("screen.design/parameter", hint=did_you_mean(unknown[0], names), name=unknown[0])
    return method_of_screen(asked, names)


def finished_runs(study: Study, responses: Sequence[str]) -> _Finished:
    """The table of [runs] of the first configuration, analysed as it is.

    Raises
    ------
    FemtuneError : ``screen.no-response``, ``screen.all-failed``, ``runs.*``
    """
    case = study.cases[0]
    entry = next(e for e in study.file.configurations if e.name == case.name)
    table = read_runs_table(study.file.path_of(str(FromRuns(study.file).input_of(entry))))
    names = [p.name for p in study.parameters.free]
    others = [name for name in table.columns if name not in names]
    unknown = [name for name in responses if name not in others]
    if unknown:
        hint = did_you_mean(unknown[0], others)
        raise FemtuneError("screen.no-response", hint=hint, name=unknown[0], known=", ".join(others) or "none")
    points = table.points(names)
    values = np.column_stack([table.freq_hz, *(table.columns[name] for name in responses)])
    good = np.asarray(np.isfinite(values).all(axis=1) & np.isfinite(points).all(axis=1))
    if not good.any():
        raise FemtuneError("screen.all-failed", runs=len(values), reason="no run has all values")
    return _Finished(study, method_of_table(points[good]), points, values, good, case.name, tuple(responses))


@dataclass(frozen=True, eq=False)
class _Finished:
    """Finished runs: points (runs, k) in their units, values (runs, m), and the runs that have all of them."""

    study: Study
    method: ScreenMethod
    points: Reals
    values: Reals
    good: Flags
    case: str
    responses: tuple[str, ...]

    @property
    def labels(self) -> list[str]:
        """Names of the values."""
        hz = self.values.shape[1] - len(self.responses)
        return [*(f"{self.case}, mode {j + 1}, Hz" for j in range(hz)), *self.responses]

    @property
    def table(self) -> Reals:
        """(runs, parameters + values)."""
        return np.hstack([self.points, self.values])

    def record(self) -> ScreenResults:
        """Effects on all values."""
        free, values = self.study.parameters.free, self.values[self.good]
        places = [(self.case, j + 1) for j in range(values.shape[1])]
        findings = self.method.findings(
            values, ResponseLabels(tuple(p.name for p in free), tuple(places), self.responses)
        )
        hz = values.shape[1] - len(self.responses)
        near = np.abs((self.points[self.good] - [p.nominal for p in free]) / [p.upper - p.lower for p in free])
        first = values[int(near.sum(axis=1).argmin())]
        modes = tuple(
            ScreenedMode(
                configuration=self.case, mode=j + 1, freq_hz=float(first[j]), mean_hz=float(values[:, j].mean()),
                error_contribution=None if findings.unexplained is None else float(findings.unexplained[j]),
                least_mac=None, response=self.responses[j - hz] if j >= hz else "",
            )
            for j in range(values.shape[1])
        )  # fmt: skip
        failed = tuple(FailedModelRun(run=int(i) + 1, reason="a value is missing") for i in np.flatnonzero(~self.good))
        alerts = list(findings.alerts)
        if failed:
            listed = ", ".join(str(f.run) for f in failed[:_MOST_NAMED])
            alerts.insert(0, alert("warning", "screen.gaps", count=len(failed), of=len(self.values), runs=listed))
        still = constant_responses(values)
        if still.any():
            names = [label for label, none in zip(self.labels, still) if none]
            alerts.append(alert("info", "screen.constant", names=", ".join(names[:_MOST_NAMED])))
        return ScreenResults(
            design=self.method.name, runs=len(self.values), failed=failed, error_freedom=findings.error_freedom,
            parameters=tuple(
                ScreenedParameter(name=p.name, unit=p.unit, values=tuple(np.unique(self.points[self.good, i]).tolist()))
                for i, p in enumerate(free)
            ),
            modes=modes, effects=findings.effects, table_key="screen_runs", sentences=findings.sentences,
            alerts=tuple(alerts),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Runs:
    """The runs of a design and what they gave."""

    study: Study
    method: ScreenMethod
    work: FrequencyRuns | SolverFrequencies
    found: tuple[ModelRun, ...]

    @classmethod
    def of(cls, study: Study, method: ScreenMethod, progress: Progress, solver: SolverRuns | None) -> _Runs:
        """Make the runs, each point once (errors ``screen.*``)."""
        work: FrequencyRuns | SolverFrequencies
        if solver is None:
            work = FrequencyRuns(tuple(followed_modes(study, case) for case in study.cases))
        else:
            work = SolverFrequencies.of(study, solver)
        lower, upper = study.parameters.bounds
        points = lower + method.points * (upper - lower)
        different = list(dict.fromkeys(map(tuple, points)))
        runs = runs_at(work, [np.array(p) for p in different], executor_of(study), progress, "runs of the design")
        by_point = dict(zip(different, runs, strict=True))
        outcomes = tuple(by_point[point] for point in map(tuple, points))
        if all(run.problem for run in outcomes):
            raise FemtuneError("screen.all-failed", runs=len(outcomes), reason=outcomes[0].problem)
        return cls(study, method, work, outcomes)

    @property
    def labels(self) -> list[str]:
        """Names of the frequencies."""
        return [f"{modes.case}, mode {n}, Hz" for modes in self.work.followed for n in modes.numbers]

    @property
    def table(self) -> Reals:
        """(runs, parameters + modes) values of the free parameters, and frequencies in Hz."""
        lower, upper = self.study.parameters.bounds
        values = self.study.parameters.denormalise(lower + self.method.points * (upper - lower))
        return np.hstack([values, np.array([run.values for run in self.found])])

    def record(self) -> ScreenResults:
        """All of it."""
        free = self.study.parameters.free
        places = [(modes.case, int(n)) for modes in self.work.followed for n in modes.numbers]
        findings = self.method.findings(
            np.array([run.values for run in self.found]), ResponseLabels(tuple(p.name for p in free), tuple(places))
        )
        modes = self._modes(places, findings)
        failed = tuple(FailedModelRun(run=i, reason=reason) for i, reason in failures(self.found))
        return ScreenResults(
            design=self.method.name,
            runs=len(self.found),
            failed=failed,
            error_freedom=findings.error_freedom,
            parameters=tuple(
                ScreenedParameter(
                    name=p.name,
                    unit=p.unit,
                    values=tuple(np.unique(self.table[:, i]).tolist()) if findings.effects else (p.lower, p.upper),
                )
                for i, p in enumerate(free)
            ),
            modes=modes,
            effects=findings.effects,
            elementary=findings.elementary,
            indices=findings.indices,
            table_key="screen_runs",
            sentences=findings.sentences,
            alerts=(*self._alerts(modes, failed), *findings.alerts),
        )

    def _modes(self, places: Sequence[tuple[str, int]], findings: Findings) -> tuple[ScreenedMode, ...]:
        good = [run for run in self.found if not run.problem]
        mean = np.mean([run.values for run in good], axis=0)
        least = np.min([run.mac for run in good], axis=0)
        hz = np.concatenate([modes.freq_hz for modes in self.work.followed])
        return tuple(
            ScreenedMode(
                configuration=case,
                mode=number,
                freq_hz=float(hz[j]),
                mean_hz=float(mean[j]),
                error_contribution=None if findings.unexplained is None else float(findings.unexplained[j]),
                least_mac=float(least[j]),
            )
            for j, (case, number) in enumerate(places)
        )

    def _alerts(self, modes: Sequence[ScreenedMode], failed: Sequence[FailedModelRun]) -> list[Alert]:
        out = []
        if failed:
            listed = ", ".join(str(f.run) for f in failed[:_MOST_NAMED])
            out.append(alert("warning", "screen.failed-runs", count=len(failed), runs=listed, reason=failed[0].reason))
        followed = [(m.mode, m.least_mac) for m in modes if m.least_mac is not None]
        lost = [f"{mode} (MAC {mac:.2f})" for mode, mac in followed if mac < _LEAST_FOLLOWED_MAC]
        if lost:
            out.append(alert("warning", "screen.lost-modes", modes=", ".join(lost[:_MOST_NAMED])))
        return out
