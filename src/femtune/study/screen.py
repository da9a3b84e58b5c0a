"""The step screen: which parameters matter for which mode, by designed runs of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.assembly.error_places import errors_at
from femtune.assembly.progress import silent
from femtune.assembly.study import load_study
from femtune.errors import FemtuneError
from femtune.experiments import Design, Effects, full_factorial, main_effects, orthogonal_design, plackett_burman
from femtune.files.study_file import with_screen
from femtune.results.base import alert
from femtune.results.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.results.results import Results
from femtune.results.screen import FailedModelRun, MainEffect, ScreenedMode, ScreenedParameter, ScreenResults
from femtune.results.step_results import ScreenResult
from femtune.results.update import citations
from femtune.study.executor import check_executor, executor_of, with_jobs
from femtune.study.external import SolverFrequencies, opened_solver
from femtune.study.model_runs import FrequencyRuns, ModelRun, alone, failures, followed_modes, runs_at
from femtune.study.respond import check_places
from femtune.study.select import check_parameters
from femtune.study.solutions import looking_up
from femtune.study.tables import write_csv

if TYPE_CHECKING:
    from femtune.assembly.external import SolverRuns
    from femtune.assembly.progress import Progress
    from femtune.assembly.study import Study
    from femtune.files.study_file import ScreenTable, StudyFile
    from femtune.results.base import Alert

_LITTLE = 0.01
"""Contribution to every mode below which a parameter is said to matter little."""
_MUCH = 0.1
"""Contribution from which a parameter is said to matter for a mode."""
_FOLLOWED = 0.5
"""MAC below which a mode is said to be lost."""
_INTERACTION = 0.05
"""Part of the variation that main effects do not explain from which an alert says so."""
_MOST_NAMED = 6


def screen_parameters(
    source: Path | str | StudyFile,
    options: Mapping[str, Any],
    progress: Progress = silent,
    *,
    fresh: bool = False,
    jobs: int | None = None,
    table: Path | None = None,
) -> ScreenResult:
    """Runs of a design by levels, and the main effects of the free parameters on the frequencies.

    Parameters
    ----------
    options : keys of [screen] that take the place of the study's
    fresh : do not take solutions from the journal of the study's run folder
    jobs : the most runs at a time, in place of [parallel]
    table : CSV file for the table of runs

    Raises
    ------
    FemtuneError : ``screen.*``, ``design.*``, ``study.no-parameters``, ``run.unwritable``
    """
    watch = Stopwatch(call("screen", source))
    with watch.step("read"):
        study = load_study(with_jobs(source, jobs), progress, fresh=fresh, around=False)
        check_parameters(study)
        file = with_screen(study.file, options)
        asked = file.screen
        assert asked is not None
        study = alone(study, asked.configuration)
        with errors_at(file.where("screen")):
            design = design_of(asked, len(study.parameters.free))
        if table is not None:
            check_places(study, [table], None)
        check_executor(study)
        inputs = inputs_of(study)
    with watch.step("runs"), looking_up(study, fresh) as found, opened_solver(found.study, progress) as solver:
        runs = _Runs.of(found.study, design, progress, solver)
    arrays = {"screen_runs": runs.table}
    if table is not None:
        write_csv(table, [*(p.name for p in study.parameters.free), *runs.labels], runs.table)
    record = runs.record()
    results = Results(
        provenance=provenance(inputs, watch),
        study=study_facts(study),
        screen=record,
        citations=citations(_papers(design)),
        alerts=record.alerts,
    )
    return ScreenResult(record, results, arrays, tuple(found.remarks), () if table is None else (table,))


def design_of(table: ScreenTable, parameters: int) -> Design:
    """The design that a table asks for (errors ``design.*``)."""
    if table.design == "plackett-burman":
        return plackett_burman(parameters)
    counts = [table.levels] * parameters
    return full_factorial(counts) if table.design == "factorial" else orthogonal_design(counts, table.array)


def _papers(design: Design) -> list[str]:
    array = design.name.startswith("L")
    return [
        "montgomery2017",
        *(["hedayat1999"] if array else []),
        *(["plackett1946"] if "Burman" in design.name else []),
    ]


@dataclass(frozen=True, eq=False)
class _Runs:
    """The runs of a design and what they gave."""

    study: Study
    design: Design
    levels: Integers
    work: FrequencyRuns | SolverFrequencies
    found: tuple[ModelRun, ...]
    effects: Effects

    @classmethod
    def of(cls, study: Study, design: Design, progress: Progress, solver: SolverRuns | None) -> _Runs:
        """Make the runs (errors ``screen.*``)."""
        assert design.levels is not None
        work: FrequencyRuns | SolverFrequencies
        if solver is None:
            work = FrequencyRuns(tuple(followed_modes(study, case) for case in study.cases))
        else:
            work = SolverFrequencies.of(study, solver)
        lower, upper = study.parameters.bounds
        points = list(lower + design.points * (upper - lower))
        found = runs_at(work, points, executor_of(study), progress, "runs of the design")
        good = [i for i, run in enumerate(found) if not run.problem]
        if not good:
            raise FemtuneError("screen.all-failed", runs=len(found), reason=found[0].problem)
        effects = main_effects(design.levels[good], np.array([found[i].values for i in good]))
        return cls(study, design, design.levels, work, tuple(found), effects)

    @property
    def labels(self) -> list[str]:
        """Names of the frequencies."""
        return [f"{modes.case}, mode {n}, Hz" for modes in self.work.followed for n in modes.numbers]

    @property
    def table(self) -> Reals:
        """(runs, parameters + modes) values of the free parameters, and frequencies in Hz."""
        lower, upper = self.study.parameters.bounds
        values = self.study.parameters.denormalise(lower + self.design.points * (upper - lower))
        return np.hstack([values, np.array([run.values for run in self.found])])

    def record(self) -> ScreenResults:
        """All of it."""
        free = self.study.parameters.free
        places = [(modes.case, int(n)) for modes in self.work.followed for n in modes.numbers]
        modes = self._modes(places)
        failed = tuple(FailedModelRun(run=i, reason=reason) for i, reason in failures(self.found))
        return ScreenResults(
            design=self.design.name,
            runs=len(self.found),
            failed=failed,
            error_freedom=self.effects.error_freedom,
            parameters=tuple(
                ScreenedParameter(name=p.name, unit=p.unit, values=tuple(np.unique(self.table[:, i]).tolist()))
                for i, p in enumerate(free)
            ),
            modes=modes,
            effects=tuple(self._effect(i, j, places[j]) for i in range(len(free)) for j in range(len(places))),
            table_key="screen_runs",
            sentences=tuple(self._sentences(modes)),
            alerts=tuple(self._alerts(modes, failed)),
        )

    def _modes(self, places: Sequence[tuple[str, int]]) -> tuple[ScreenedMode, ...]:
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
                error_contribution=float(self.effects.error_contribution[j]),
                least_mac=float(least[j]),
            )
            for j, (case, number) in enumerate(places)
        )

    def _effect(self, i: int, j: int, place: tuple[str, int]) -> MainEffect:
        effects = self.effects
        return MainEffect(
            parameter=self.study.parameters.free[i].name,
            configuration=place[0],
            mode=place[1],
            contribution=float(effects.contribution[i, j]),
            f_value=_finite(effects.f_values[i, j]),
            p_value=_finite(effects.p_values[i, j]),
            range_hz=float(effects.ranges[i, j]),
            means_hz=tuple(effects.level_means[i][:, j].tolist()),
        )

    def _sentences(self, modes: Sequence[ScreenedMode]) -> list[str]:
        names = [p.name for p in self.study.parameters.free]
        largest = self.effects.contribution.max(axis=1)
        order = np.argsort(-largest, kind="stable")
        much = [names[i] for i in order if largest[i] >= _MUCH]
        little = [names[i] for i in order if largest[i] < _LITTLE]
        between = [names[i] for i in order if _LITTLE <= largest[i] < _MUCH]
        out = [f"More than {100 * _MUCH:.0f} % of the variation of at least one frequency: {_named(much)}."]
        if between:
            out.append(f"Between {100 * _LITTLE:.0f} and {100 * _MUCH:.0f} %: {_named(between)}.")
        if little:
            out.append(f"Less than {100 * _LITTLE:.0f} % of the variation of every frequency: {_named(little)}.")
        error = max(mode.error_contribution for mode in modes)
        return [*out, f"Main effects explain at least {100 * (1 - error):.1f} % of the variation of each frequency."]

    def _alerts(self, modes: Sequence[ScreenedMode], failed: Sequence[FailedModelRun]) -> list[Alert]:
        out = []
        if failed:
            listed = ", ".join(str(f.run) for f in failed[:_MOST_NAMED])
            out.append(alert("warning", "screen.failed-runs", count=len(failed), runs=listed, reason=failed[0].reason))
        lost = [f"{m.mode} (MAC {m.least_mac:.2f})" for m in modes if m.least_mac < _FOLLOWED]
        if lost:
            out.append(alert("warning", "screen.lost-modes", modes=", ".join(lost[:_MOST_NAMED])))
        mixed = [f"{m.mode} ({100 * m.error_contribution:.0f} %)" for m in modes if m.error_contribution > _INTERACTION]
        if mixed:
            out.append(alert("info", "screen.interactions", modes=", ".join(mixed[:_MOST_NAMED])))
        if self.effects.error_freedom == 0:
            out.append(alert("info", "screen.saturated", runs=len(self.found)))
        return out


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _named(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
