"""One run of a whole study: correlate, select, update, write back, correlate again; nothing computed is lost."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.residuals import Evaluation
from femtune.select import identifiability
from femtune.study.alerts import alerts_of
from femtune.study.bottom_up import bottom_up
from femtune.study.damping_values import write_damping
from femtune.study.history import History
from femtune.study.journal import Journal
from femtune.study.load import Study, on_deck
from femtune.study.located import located
from femtune.study.predict import Sensitivities, predictions
from femtune.study.progress import Progress
from femtune.study.provenance import Inputs, Stopwatch, provenance, study_facts
from femtune.study.quantify import quantify_at, repeats_of
from femtune.study.record_checks import model_checks
from femtune.study.record_model import alert_of, model_facts, sensor_results
from femtune.study.record_select import selection_measures
from femtune.study.record_stages import stage_results
from femtune.study.record_update import parameter_facts, selection_results, update_results, what_ran
from femtune.study.record_validation import validation
from femtune.study.reduction import find_on_reduced
from femtune.study.repeats import Repeats
from femtune.study.respond import FRFS_FILE, responses_at, uff_paths, write_frf_files
from femtune.study.results import Results
from femtune.study.results_base import Alert, Stage
from femtune.study.results_reduction import ReductionResults
from femtune.study.results_update import SelectionResults, UpdateResults, WrittenValue
from femtune.study.run_folder import RESULTS_FILE, write_results
from femtune.study.stages import Solved, StageRecords, as_written, nothing, solutions_of, stage_records, start
from femtune.study.starts import find_from_starts
from femtune.study.update_method import method_of
from femtune.study.with_journal import journal_results
from femtune.study.write_back import WriteBack, check_written, write_back
from femtune.update import Iteration, MultiStart, SensitivityMethod, StageResult, UpdateResult
from femtune.update import update as find_parameters

Arrays = dict[str, NDArray]
T = TypeVar("T")

_UNFINISHED = Alert(
    level="problem",
    code="run.unfinished",
    sentence="the run ended before the updated deck was written and checked; an updated deck in this folder may be "
    "of an earlier run",
)
NO_DECK = Alert(
    level="info",
    code="write.no-deck",
    sentence="the model is made of matrices, so there is no deck to write: give the values of the parameters to the "
    "solver that wrote the matrices",
)


@dataclass(frozen=True, eq=False)
class RunFolder:
    """A run folder and what is in it."""

    folder: Path
    results: Results
    arrays: Mapping[str, NDArray] = field(repr=False)
    report: Path | None = None


@dataclass(frozen=True, eq=False)
class Run:
    """One run of a whole study into a folder."""

    study: Study
    folder: Path
    wide: bool
    watch: Stopwatch
    progress: Progress
    inputs: Inputs
    journal: Journal | None = None
    arrays: Arrays = field(default_factory=dict)
    reductions: list[ReductionResults] = field(default_factory=list)
    stages: list[StageResult] = field(default_factory=list)
    searches: list[MultiStart] = field(default_factory=list)
    sensitivities: Sensitivities = field(default_factory=Sensitivities)
    troubles: list[Alert] = field(default_factory=list)

    def go(self) -> RunFolder:
        """All steps. The results are on disk once the update is done, and again when all is done.

        Raises
        ------
        FemtuneError : ``correlate.no-pairs``, ``eigen.*``, ``write.*``, ``run.unwritable``
        """
        facts = self._timed("model", self._facts)
        repeats = repeats_of(self.study)
        at = self._timed("correlate", lambda: start(self.study, self.progress))
        before = self._timed("correlate", lambda: self._stage(self.study, "before", at))
        before = self._timed("respond", lambda: self._responding(self.study, "before", at.x, before))
        selection = self._timed("select", lambda: select_at(self.study, at, self.arrays, self.progress))
        result = self._timed("update", lambda: self._update(at))
        after = self._timed(
            "correlate after", lambda: self._stage(self.study, "after", result.after, self.sensitivities.add)
        )
        facts = self._timed("quantify", lambda: self._quantified(facts, repeats, result))
        if self.study.file.imported:
            return self._without_deck(facts, [before, after], selection, result)
        self._keep(self._results(facts, [before, after], selection, result), _UNFINISHED)
        try:
            written, last, error = self._written(result)
        except FemtuneError as problem:
            problem.values["results so far"] = str(self.folder / RESULTS_FILE)
            raise
        results = self._results(facts, [before, after, last], selection, result, written, error)
        return RunFolder(self.folder, self._keep(results), self.arrays)

    def _without_deck(
        self, facts: Results, stages: list[StageRecords], selection: SelectionResults, result: UpdateResult
    ) -> RunFolder:
        """A model of matrices has no deck that could be written: the run ends with the updated values."""
        after = self._timed("respond", lambda: self._responding(self.study, "after", result.x, stages[-1]))
        if self.study.file.response is not None:
            write_frf_files(self.study, after.responses, self.arrays, uff_paths(self.folder / FRFS_FILE, self.study))
        results = self._results(facts, [*stages[:-1], after], selection, result)
        return RunFolder(self.folder, self._keep(results, NO_DECK), self.arrays)

    def _quantified(self, facts: Results, repeats: Repeats | None, result: UpdateResult) -> Results:
        """With the scatter of the parameters, where the study has repeats; a failure is told and stops nothing."""
        if repeats is None:
            return facts
        try:
            found = quantify_at(self.study, repeats, result.x, self.arrays, self.progress)
        except FemtuneError as problem:
            self.troubles.append(
                Alert(level="problem", code=problem.code, sentence=f"scatter of the parameters: {problem.what}")
            )
            return facts
        return facts.model_copy(update={"quantify": found})

    def _written(self, result: UpdateResult) -> tuple[WriteBack, StageRecords, float]:
        """The updated deck, read again, with its correlation and mean error."""
        written = self._timed("write back", lambda: self._write(result))
        again = on_deck(self.study, written.built)
        evaluation = self._timed("correlate as written", lambda: as_written(again, result.after))
        records = self._timed("correlate as written", lambda: self._stage(again, "after as written", evaluation))
        # the written deck has no parameters
        whole = self._timed("respond", lambda: self._responding(again, "after as written", np.zeros(0), records))
        if self.study.file.response is not None:
            write_frf_files(again, whole.responses, self.arrays, uff_paths(self.folder / FRFS_FILE, again))
        return written, whole, evaluation.mean_error

    def _responding(self, study: Study, stage: Stage, x: NDArray[np.float64], records: StageRecords) -> StageRecords:
        """The records with the responses that the study asks for."""
        return replace(records, responses=responses_at(study, stage, x, self.arrays, self.progress))

    def _timed(self, name: str, work: Callable[[], T]) -> T:
        with self.watch.step(name):
            return work()

    def _facts(self) -> Results:
        """What is known before anything is solved."""
        study = self.study
        self.progress.step("mass and rigid-body check", 0, None)
        return Results(
            provenance=provenance(self.inputs, self.watch),
            study=study_facts(study),
            model=model_facts(study),
            sensors=tuple(s for s in (sensor_results(study, c) for c in study.cases) if s is not None),
            parameters=parameter_facts(study),
            citations=what_ran(study),
        )

    def _stage(self, study: Study, stage: Stage, at: Evaluation, solved: Solved = nothing) -> StageRecords:
        return stage_records(study, stage, at.x, solutions_of(at), self.arrays, self.progress, solved)

    def _update(self, at: Evaluation) -> UpdateResult:
        table = self.study.file.update
        with located(self.study.file.where("update", "regularisation")):
            method = method_of(table, self.study.parameters)
        history = History(self.folder, self.study.parameters)
        history.begin()

        def report(iteration: Iteration) -> None:
            # kept before it is shown: whoever shows it may be interrupted
            history.add(iteration)
            text = f"update: weighted mean error {100 * iteration.mean_error:.4g} %"
            self.progress.step(text, iteration.number, table.max_iterations)

        if self.study.file.stage:
            return self._bottom_up(at, history)
        if table.starts > 1:
            return self._from_starts(method, at, history)
        reduction = self.study.file.reduction
        if reduction is None:
            return find_parameters(self.study.problem(), method, report, at)
        result, facts = find_on_reduced(self.study, reduction, method, report, at, self.progress)
        self.reductions.append(facts)
        return result

    def _bottom_up(self, at: Evaluation, history: History) -> UpdateResult:
        """The stages of the study, as one update."""

        def tell(stage: str, seed: int, iteration: Iteration) -> None:
            history.add(iteration)
            start = f", seed {seed}" if seed else ""
            text = f"stage {stage}{start}: weighted mean error {100 * iteration.mean_error:.4g} %"
            self.progress.step(text, iteration.number, None)

        found = bottom_up(self.study, at, tell)
        self.stages.extend(found.stages)
        return found.result

    def _from_starts(self, method: SensitivityMethod, at: Evaluation, history: History) -> UpdateResult:
        """The best of many starts; its iterations go into the history at the end."""
        found, facts = find_from_starts(self.study, method, self.folder, at, self.progress)
        self.searches.append(found)
        self.reductions.extend(() if facts is None else (facts,))
        for iteration in found.best.history:
            history.add(iteration)
        return found.best

    def _write(self, result: UpdateResult) -> WriteBack:
        self.progress.step("writing the updated deck", 0, None)
        written = write_back(self.study, result, self.folder, self.wide)
        check_written(written.built, self.study)
        return written

    def _results(
        self,
        facts: Results,
        stages: list[StageRecords],
        selection: SelectionResults,
        result: UpdateResult,
        written: WriteBack | None = None,
        error: float | None = None,
    ) -> Results:
        values = {} if written is None else written.written
        predicted = predictions(self.study, result, self.sensitivities)
        parts = {
            "provenance": provenance(self.inputs, self.watch, (m for s in stages for m in s.modes)),
            "modes": tuple(m for s in stages for m in s.modes),
            "correlations": tuple(c for s in stages for c in s.correlations),
            "responses": tuple(r for s in stages for r in s.responses),
            "mode_shapes": tuple(m for s in stages for m in s.shapes),
            "selection": selection,
            "update": self._update_record(result, values, error),
            "write_back": None if written is None else written.record,
            "validation": validation(self.study, stages[0], stages[-1], predicted),
            "journal": journal_results(self.journal),
        }
        return facts.model_copy(update=parts)

    def _update_record(
        self, result: UpdateResult, written: dict[str, tuple[WrittenValue, ...]], error: float | None
    ) -> UpdateResults:
        reduction, starts = next(iter(self.reductions), None), next(iter(self.searches), None)
        record = update_results(self.study, result, written, error, reduction, starts)
        return record.model_copy(update={"stages": stage_results(self.study, self.stages)})

    def _keep(self, results: Results, *alerts: Alert) -> Results:
        """Write the results with their alerts."""
        of_journal = self.journal.notices if self.journal is not None else ()
        found = (*alerts, *self.troubles, *alerts_of(self.study, results, map(alert_of, of_journal)))
        results = results.model_copy(update={"alerts": found})
        write_results(self.folder, results, self.arrays)
        if results.update is not None:
            write_damping(self.study, results.update, self.folder)
        return results


def check_parameters(study: Study) -> None:
    """Refuse a study without free parameters (error ``study.no-parameters``)."""
    if not study.parameters.free:
        raise FemtuneError(
            "study.no-parameters",
            "the study has no free parameter",
            where=study.file.where("parameter") if study.file.parameter else study.file.where("study"),
            hint="add a [[parameter]] with fields and bounds",
        )


def select_at(study: Study, at: Evaluation, arrays: Arrays, progress: Progress) -> SelectionResults:
    """Which parameters, and which combinations of them, the data determine at an evaluation."""
    progress.step("sensitivities", 0, None)
    names = tuple(p.name for p in study.parameters.free)
    known = identifiability(at.jacobian, np.asarray(study.parameters.prior[1]), names)
    found = selection_results(study, known, at, arrays)
    progress.step("measures of the parameters", 0, None)
    more = {"measures": selection_measures(study, known, at)}
    return found.model_copy(update={"model_checks": model_checks(study, solutions_of(at), progress), **more})
