"""One run of a whole study: correlate, select, update, write back, correlate again; a failure keeps earlier results."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.errors import FemtuneError
from femtune.journal.run_files import (
    ARRAYS_FILE,
    CATALOGUE_FILE,
    HISTORY_FILE,
    RESULTS_FILE,
)
from femtune.steps import all_steps
from femtune.steps.bootstrap.record import BootstrapResults
from femtune.steps.info.facts import alert_of
from femtune.steps.judge.narrowing import with_honest_intervals
from femtune.steps.judge.run import JudgedTopics
from femtune.steps.judge.verdict import judgement
from femtune.steps.live.record import LiveResults
from femtune.steps.posterior.record import PosteriorResults
from femtune.steps.quantify.record import QuantifyResults
from femtune.steps.results import Results
from femtune.steps.run.alerts import alerts_of
from femtune.steps.run.outcomes import (
    AsWritten,
    Damped,
    Final,
    Initial,
    Made,
    ModesLeftOut,
    Outcomes,
    Prepared,
    TruncationErrors,
    Unused,
    Updated,
    Vibrated,
    Written,
)
from femtune.steps.run.result import RunResult
from femtune.steps.run_folder import write_results
from femtune.steps.select.record.identifiability import SelectionResults
from femtune.steps.specimens.record import SpecimenResults
from femtune.steps.step import InRun, load
from femtune.steps.update.damping_values import write_damping
from femtune.steps.update.facts.raw import raw_results
from femtune.steps.update.facts.stages import stage_results
from femtune.steps.update.facts.update import update_results
from femtune.steps.validate.facts import predictions, validation
from femtune.steps.write.verify import check_same
from femtune.study.provenance import provenance
from femtune.study.record import Alert, alert
from femtune.study.solutions import journal_results

if TYPE_CHECKING:
    from femtune.journal.journal import Journal
    from femtune.steps.held_folder import RunFolder
    from femtune.study.progress import Progress
    from femtune.study.provenance import Inputs, Stopwatch
    from femtune.study.study import Study


_LAST_BEFORE_SAVED = 130
"""Place of the part after which the results are saved for the first time: the update is done and compared."""


def parts_of_run(with_deck: bool) -> tuple[InRun, ...]:
    """The parts of a run in their order; `with_deck` if it writes an updated deck."""
    parts = (part for step in all_steps() for part in step.in_run if part.with_deck in (None, with_deck))
    return tuple(sorted(parts, key=lambda part: part.place))


@dataclass(frozen=True, eq=False)
class Run:
    """One run of a whole study into a folder."""

    study: Study
    place: RunFolder
    wide: bool
    watch: Stopwatch
    progress: Progress
    inputs: Inputs
    journal: Journal | None = None

    @property
    def folder(self) -> Path:
        """The run folder."""
        return self.place.path

    def go(self) -> RunResult:
        """All steps. The results are on disk once the update is done, and again when all is done.

        Raises
        ------
        FemtuneError : ``correlate.no-pairs``, ``eigen.*``, ``write.*``, ``run.unwritable``; ``write.differs`` after all
            results are on disk
        """
        study = self.study
        ends = () if study.writes_deck else (alert("info", study.source.no_write_back or "write.no-deck/not-wanted"),)
        parts = parts_of_run(study.writes_deck)
        outcomes = self._done((part for part in parts if part.place <= _LAST_BEFORE_SAVED), Outcomes())
        self._keep(outcomes, *(ends or (alert("problem", "run.unfinished"),)))
        try:
            outcomes = self._done((part for part in parts if part.place > _LAST_BEFORE_SAVED), outcomes)
        except FemtuneError as problem:
            problem.values["results so far"] = str(self.folder / RESULTS_FILE)
            raise
        results, catalogue = self._keep(outcomes, *ends)
        deck = results.write_back.files if results.write_back else ()
        files = (*outcomes.files, *catalogue, RESULTS_FILE, ARRAYS_FILE, HISTORY_FILE, *deck)
        self.place.keep(files)
        if results.write_back:
            check_same(results.write_back, self.folder)
        return RunResult(self.folder, results, outcomes.arrays, files=files)

    def _done(self, parts: Iterable[InRun], outcomes: Outcomes) -> Outcomes:
        """The outcomes after some parts, each of them timed; if a part that may fail fails, an alert reports it."""
        for part in parts:
            made = Made()
            try:
                with self.watch.step(part.name):
                    outcome = load(part.work)(self, outcomes, made)
            except FemtuneError as problem:
                if not part.optional:
                    raise
                failure = Alert(level="problem", code=problem.code, sentence=f"{part.optional}: {problem.what}")
                outcomes = replace(outcomes, alerts=(*outcomes.alerts, failure))
            else:
                outcomes = outcomes.with_outcome(outcome, made)
        return outcomes

    def _keep(self, outcomes: Outcomes, *alerts: Alert) -> tuple[Results, tuple[str, ...]]:
        """Write the outcomes, with their alerts; also the name of the catalogue of damping, if there is one."""
        results = self.results(outcomes)
        of_journal = self.journal.notices if self.journal is not None else ()
        of_update = outcomes.of(Updated).parameters.alerts
        of_results = alerts_of(self.study, results, map(alert_of, of_journal))
        results = results.model_copy(update={"alerts": (*alerts, *of_update, *outcomes.alerts, *of_results)})
        topics = outcomes.find(JudgedTopics)
        if topics is not None:
            judged = judgement(results, topics.records, topics.not_computed)
            results = results.model_copy(update={"judgement": judged})
        write_results(self.folder, results, outcomes.arrays)
        assert results.update is not None
        if write_damping(self.study, results.update, self.folder) is not None:
            return results, (CATALOGUE_FILE,)
        self.place.drop(self.study, CATALOGUE_FILE)
        return results, ()

    def results(self, outcomes: Outcomes) -> Results:
        """All outcomes as one record, without alerts and verdict."""
        updated, final, unused = outcomes.of(Updated), outcomes.of(Final), outcomes.of(Unused)
        parameters = updated.parameters
        result = with_honest_intervals(updated.study(self.study), parameters.result, outcomes.find(JudgedTopics))
        written, as_written = outcomes.find(Written), outcomes.find(AsWritten)
        truncated = outcomes.find(TruncationErrors)
        versions = [outcomes.of(Initial).records, final.records, *([] if as_written is None else [as_written.records])]
        values = {} if written is None else written.deck.written
        error = None if as_written is None else as_written.error
        update = update_results(
            self.study, result, values, error, parameters.reduction, parameters.starts
        ).model_copy(
            update={
                "stages": stage_results(self.study, parameters.stages),
                "frf_truncation": () if truncated is None else truncated.records,
                "fisher": updated.fisher,
                "left_out_modes": outcomes.of(ModesLeftOut).records,
                "frfs": updated.iteration_frfs,
                "raw": raw_results(parameters.raw, result),
            }
        )  # fmt: skip
        damped = outcomes.find(Damped)
        predicted = predictions(self.study, result, final.sensitivities)
        validated = validation(
            self.study, versions[0], versions[-1], predicted, unused.frfs, outcomes.of(Vibrated).records
        )
        parts = {
            "provenance": provenance(self.inputs, self.watch, (m.solver for v in versions for m in v.modes)),
            "modes": tuple(m for v in versions for m in v.modes),
            "correlations": tuple(c for v in versions for c in v.correlations),
            "responses": tuple(r for v in versions for r in v.responses),
            "mode_shapes": tuple(m for v in versions for m in v.shapes),
            "selection": outcomes.of(SelectionResults),
            "update": update,
            "quantify": outcomes.find(QuantifyResults),
            "bootstrap": outcomes.find(BootstrapResults),
            "posterior": outcomes.find(PosteriorResults),
            "live": outcomes.find(LiveResults),
            "specimens": outcomes.find(SpecimenResults),
            "mapped_damping": () if damped is None else damped.records,
            "write_back": None if written is None else written.deck.record,
            "validation": validated.model_copy(update={"deviations": unused.deviations}),
            "journal": journal_results(self.journal),
        }
        return outcomes.of(Prepared).facts.model_copy(update=parts)
