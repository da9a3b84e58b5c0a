"""The step screen: which parameters matter for which mode, by designed runs of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.files.study_file import with_screen
from femtune.steps.held_folder import held_for_solver
from femtune.steps.respond.run import check_places
from femtune.steps.results import Results
from femtune.steps.screen.methods import Findings, ResponseLabels, ScreenMethod, method_of_screen
from femtune.steps.screen.record import FailedModelRun, ScreenedMode, ScreenedParameter, ScreenResults
from femtune.steps.screen.result import ScreenResult
from femtune.steps.select.run import check_parameters
from femtune.steps.update.external import SolverFrequencies, opened_solver
from femtune.steps.update.facts.update import citations
from femtune.study.csv_table import write_csv
from femtune.study.error_places import errors_at
from femtune.study.executor import check_executor, executor_of, with_jobs
from femtune.study.model_runs import FrequencyRuns, ModelRun, alone, failures, followed_modes, runs_at
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.record import alert
from femtune.study.solutions import looking_up
from femtune.study.study import load_study

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
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
            study = load_study(with_jobs(source, jobs), progress, fresh=fresh, around=False)
            check_parameters(study)
            file = with_screen(study.file, options)
            asked = file.screen
            assert asked is not None
            study = alone(study, asked.configuration)
            with errors_at(file.where("screen")):
                method = method_of_screen(asked, len(study.parameters.free))
            if table is not None:
                check_places(study, [table], None)
            check_executor(study, progress)
            inputs = inputs_of(study)
        with (
            watch.step("runs"),
            looking_up(study, fresh) as looked_up,
            opened_solver(looked_up.study, progress) as solver,
        ):
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
        citations=citations(method.papers),
        alerts=record.alerts,
    )
    return ScreenResult(record, results, arrays, tuple(looked_up.remarks), () if table is None else (table,))


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
        lost = [f"{m.mode} (MAC {m.least_mac:.2f})" for m in modes if m.least_mac < _LEAST_FOLLOWED_MAC]
        if lost:
            out.append(alert("warning", "screen.lost-modes", modes=", ".join(lost[:_MOST_NAMED])))
        return out
