"""The steps of a study, in the words of the command line: info, modes, correlate, select, update."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from femtune.correlate import Correlation
from femtune.errors import FemtuneError
from femtune.model import EigenSolution, solve_modes
from femtune.residuals import UpdateProblem, solve_case
from femtune.select import identifiability
from femtune.study.alerts import alerts_of
from femtune.study.load import Study, StudyCase, load_study, without_parameters
from femtune.study.progress import Progress, silent
from femtune.study.provenance import Stopwatch, provenance, study_facts
from femtune.study.record_correlation import correlate_case, correlation_results, prediction
from femtune.study.record_model import model_facts, model_modes, sensor_results
from femtune.study.record_update import citations, parameter_facts, selection_results, update_results
from femtune.study.results import Results
from femtune.study.results_base import Stage
from femtune.study.results_correlation import CorrelationResults, ValidationResults
from femtune.study.results_model import ModelFacts, ModelModes
from femtune.study.results_update import SelectionResults
from femtune.study.run_folder import check_writable, write_results
from femtune.study.write_back import WriteBack, check_written, write_back
from femtune.update import Iteration, Regularisation, SensitivityMethod, UpdateResult
from femtune.update import update as find_parameters

Arrays = dict[str, NDArray]
T = TypeVar("T")

_NOT_TESTED = (
    "damping and forced response: only natural frequencies and mode shapes were compared",
    "linearity: the test's modes were taken as those of one linear structure",
    "mesh convergence: the deck's mesh was taken as it is",
)


@dataclass(frozen=True, eq=False)
class RunFolder:
    """A run folder and what is in it."""

    folder: Path
    results: Results
    arrays: Mapping[str, NDArray] = field(repr=False)
    report: Path | None = None


@dataclass(frozen=True, eq=False)
class _Stage:
    """Modes and correlations of all configurations at one parameter vector."""

    modes: tuple[ModelModes, ...]
    correlations: tuple[CorrelationResults, ...]
    raw: dict[str, Correlation]


def info(path: Path | str, progress: Progress = silent) -> ModelFacts:
    """What is in the deck of a study (or in a deck): cards, mass, rigid-body check, supports."""
    return model_facts(load_study(path, progress))


def modes(path: Path | str, progress: Progress = silent) -> tuple[ModelModes, ...]:
    """Natural frequencies of each configuration of a study, or of a deck, at the deck's values."""
    study = load_study(path, progress)
    return tuple(_modes_of(study, "before", progress))


def correlate(path: Path | str, progress: Progress = silent) -> tuple[CorrelationResults, ...]:
    """Test against model, each configuration that has a test."""
    study = load_study(path, progress)
    study.problem()
    return _stage(study, "before", _nominal(study), {}, progress).correlations


def select(path: Path | str, progress: Progress = silent) -> SelectionResults:
    """Which parameters, and which combinations of them, the data determine."""
    return _select(load_study(path, progress), {}, progress)


def update(
    path: Path | str, output: Path | str | None = None, wide: bool | None = None, progress: Progress = silent
) -> RunFolder:
    """All steps of a study: results and updated deck in its run folder (the report is made of them).

    Parameters
    ----------
    path : the study file
    output : run folder instead of the study's
    wide : write changed cards in large field; the study decides where None

    Raises
    ------
    FemtuneError : whatever is wrong with the study, its files or the run folder
    """
    watch = Stopwatch(f"femtune.update({str(path)!r})")
    with watch.step("read"):
        study = load_study(path, progress)
        problem = study.problem()
    folder = Path(output) if output is not None else study.file.output_folder
    check_writable(folder)
    return _Run(study, problem, folder, study.file.write.wide if wide is None else wide, watch, progress).go()


@dataclass(frozen=True, eq=False)
class _Run:
    """One run of a whole study."""

    study: Study
    problem: UpdateProblem
    folder: Path
    wide: bool
    watch: Stopwatch
    progress: Progress
    arrays: Arrays = field(default_factory=dict)

    def go(self) -> RunFolder:
        """Correlate, select, update, write back, correlate again."""
        before = self._timed("correlate", lambda: self._stage(self.study, "before", _nominal(self.study)))
        selection = self._timed("select", lambda: _select(self.study, self.arrays, self.progress))
        result = self._timed("update", self._update)
        after = self._timed("correlate after", lambda: self._stage(self.study, "after", result.x))
        written = self._timed("write back", lambda: self._write(result))
        again = without_parameters(self.study, written.built)
        last = self._timed("correlate as written", lambda: self._stage(again, "after as written", np.zeros(0)))
        error = again.problem().start(np.zeros(0)).mean_error
        results = self._results([before, after, last], selection, result, written, error)
        write_results(self.folder, results, self.arrays)
        return RunFolder(self.folder, results, self.arrays)

    def _timed(self, name: str, work: Callable[[], T]) -> T:
        with self.watch.step(name):
            return work()

    def _stage(self, study: Study, stage: Stage, x: NDArray) -> _Stage:
        return _stage(study, stage, x, self.arrays, self.progress)

    def _update(self) -> UpdateResult:
        table = self.study.file.update
        method = SensitivityMethod(
            table.max_iterations, table.tolerance, Regularisation(table.regularisation, table.weight)
        )
        history = self.folder / "history.jsonl"
        history.write_text("")

        def report(iteration: Iteration) -> None:
            self.progress.step(
                f"update: mean error {100 * iteration.mean_error:.4g} %", iteration.number, table.max_iterations
            )
            values = self.study.parameters.values(iteration.x)
            line = {"iteration": iteration.number, "mean_error": iteration.mean_error, "parameters": values}
            with history.open("a") as stream:
                stream.write(json.dumps(line) + "\n")

        return find_parameters(self.problem, method, report)

    def _write(self, result: UpdateResult) -> WriteBack:
        self.progress.step("writing the updated deck", 0, None)
        written = write_back(self.study, result, self.folder, self.wide)
        check_written(written.built, self.study)
        return written

    def _results(
        self, stages: list[_Stage], selection: SelectionResults, result: UpdateResult, written: WriteBack, error: float
    ) -> Results:
        study = self.study
        results = Results(
            provenance=provenance(study, self.watch),
            study=study_facts(study),
            model=model_facts(study),
            sensors=tuple(s for s in (sensor_results(study, c) for c in study.cases) if s is not None),
            parameters=parameter_facts(study),
            modes=tuple(m for s in stages for m in s.modes),
            correlations=tuple(c for s in stages for c in s.correlations),
            selection=selection,
            update=update_results(study, result, written.written, error),
            write_back=written.record,
            validation=_validation(study, stages[0], stages[-1]),
            citations=citations(("allemang1982", "lieven1988", "guyan1965")),
        )
        return results.model_copy(update={"alerts": alerts_of(study, results)})


def _nominal(study: Study) -> NDArray:
    return np.zeros(len(study.parameters.free))


def _solve(study: Study, case: StudyCase, x: NDArray) -> EigenSolution:
    if case.modal is not None:
        return solve_case(case.modal, x)
    table = study.file.modes
    return solve_modes(case.configured.at(x), table.wanted, table.max_hz)


def _modes_of(study: Study, stage: Stage, progress: Progress) -> list[ModelModes]:
    out = []
    for i, case in enumerate(study.cases):
        name = case.configured.configuration.name
        progress.step(f"modes of {name}", i, len(study.cases))
        out.append(model_modes(name, stage, _solve(study, case, _nominal(study))))
    return out


def _stage(study: Study, stage: Stage, x: NDArray, arrays: Arrays, progress: Progress) -> _Stage:
    found, records, raw = [], [], {}
    for i, case in enumerate(study.cases):
        name = case.configured.configuration.name
        progress.step(f"modes and correlation {stage} the update: {name}", i, len(study.cases))
        solution = _solve(study, case, x)
        found.append(model_modes(name, stage, solution))
        if case.modal is not None:
            raw[name] = correlate_case(case.modal, solution)
            records.append(correlation_results(name, stage, raw[name], arrays))
    return _Stage(tuple(found), tuple(records), raw)


def _select(study: Study, arrays: Arrays, progress: Progress) -> SelectionResults:
    problem = study.problem()
    if not study.parameters.free:
        raise FemtuneError(
            "study.no-parameters", "the study has no free parameter", hint="add a [[parameter]] with fields and bounds"
        )
    progress.step("sensitivities", 0, None)
    start = problem.start(_nominal(study))
    names = tuple(p.name for p in study.parameters.free)
    known = identifiability(start.jacobian, study.parameters.prior[1], names)
    return selection_results(known, start, arrays)


def _validation(study: Study, before: _Stage, after: _Stage) -> ValidationResults:
    predictions = []
    for case in study.cases:
        name = case.configured.configuration.name
        if case.modal is None:
            continue
        held = range(len(case.modal.test)) if case.entry.use == "validation" else ()
        for i in {*held, *case.modal.left_out}:
            remark = case.modal.left_out.get(i, "this configuration was not used in the update")
            predictions.append(prediction(name, after.raw[name], i, remark, before.raw[name]))
    untested = [f"{c.configured.configuration.name}: it has no test" for c in study.cases if c.modal is None]
    if not any(c.entry.use == "validation" for c in study.cases):
        untested.append("the updated model on data that were not used: the study keeps no configuration for validation")
    return ValidationResults(predictions=tuple(predictions), not_tested=(*untested, *_NOT_TESTED))

