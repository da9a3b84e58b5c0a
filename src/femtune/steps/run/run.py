"""One run of a whole study: correlate, select, update, write back, correlate again; a failure keeps earlier results."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.journal.run_files import (
    ARRAYS_FILE,
    CATALOGUE_FILE,
    DECK_FILE,
    EXPANDED_FILE,
    FRFS_FILE,
    HISTORY_FILE,
    RESULTS_FILE,
    VTU_FILE,
    Role,
    made_by,
    numbered,
)
from femtune.steps.bootstrap.record import BootstrapResults
from femtune.steps.bootstrap.run import bootstrap_at, check_bootstrap
from femtune.steps.correlate.expanded_files import write_expanded_files
from femtune.steps.correlate.versions import as_written, model_records, start
from femtune.steps.equalise.run import mapped_damping
from femtune.steps.info.facts import alert_of, model_facts, sensor_results
from femtune.steps.judge.finished_update import FinishedUpdate
from femtune.steps.judge.run import JudgedTopics, judged_topics
from femtune.steps.judge.same_data import check_independent
from femtune.steps.judge.verdict import judgement
from femtune.steps.modes.vtu_files import write_vtu_files
from femtune.steps.quantify.record import QuantifyResults
from femtune.steps.quantify.run import check_quantify, quantify_at, repeats_of
from femtune.steps.respond.run import responses_at, write_frf_files
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
from femtune.steps.select.fisher import fisher_results
from femtune.steps.select.record.identifiability import SelectionResults
from femtune.steps.select.run import select_at
from femtune.steps.specimens.facts import Compared, specimen_results
from femtune.steps.specimens.record import SpecimenResults
from femtune.steps.specimens.run import calibrate_each
from femtune.steps.update.damping_values import write_damping
from femtune.steps.update.facts.iterations import iteration_frfs
from femtune.steps.update.facts.left_out import left_out_mode_records
from femtune.steps.update.facts.stages import stage_results
from femtune.steps.update.facts.truncation import frf_truncations
from femtune.steps.update.facts.update import parameter_facts, update_results, what_ran
from femtune.steps.update.run import find_parameters
from femtune.steps.validate.facts import Sensitivities, predictions, validation
from femtune.steps.validate.frf_deviation import frf_deviations
from femtune.steps.validate.frf_validation import check_frf_band, unused_frfs
from femtune.steps.vibration.run import VibrationTests
from femtune.steps.write.run import check_writable_fields, check_written, write_back
from femtune.steps.write.verify import check_same, frequency_differences, named_if_same
from femtune.study.provenance import provenance, study_facts
from femtune.study.record import Alert, alert
from femtune.study.solutions import journal_results
from femtune.study.solved import solutions_of, solved_if_any
from femtune.study.study import on_decks

if TYPE_CHECKING:
    from femtune.journal.journal import Journal
    from femtune.steps.held_folder import RunFolder
    from femtune.study.progress import Progress
    from femtune.study.provenance import Inputs, Stopwatch
    from femtune.study.study import Study


@dataclass(frozen=True)
class RunStep:
    """A step of a run.

    Parameters
    ----------
    name : under which its time is kept
    work : its outcome, from those of earlier steps; None if it has none. Arrays and files are entered as made
    optional : what it finds, in words, if the run goes on without it; "" if its failure ends the run
    """

    name: str
    work: Callable[[Run, Outcomes, Made], object | None]
    optional: str = ""


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
        outcomes = self._done(UNTIL_UPDATED, Outcomes())
        self._keep(outcomes, *(ends or (alert("problem", "run.unfinished"),)))
        try:
            last = ON_WRITTEN_DECK if study.writes_deck else WITHOUT_DECK
            outcomes = self._done((*ONCE_UPDATED, *last, JUDGE), outcomes)
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

    def _done(self, steps: Iterable[RunStep], outcomes: Outcomes) -> Outcomes:
        """The outcomes after some steps, each of them timed; if a step that may fail fails, an alert reports it."""
        for step in steps:
            made = Made()
            try:
                with self.watch.step(step.name):
                    outcome = step.work(self, outcomes, made)
            except FemtuneError as problem:
                if not step.optional:
                    raise
                failure = Alert(level="problem", code=problem.code, sentence=f"{step.optional}: {problem.what}")
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
            found = judgement(results, topics.records, topics.not_computed)
            results = results.model_copy(update={"judgement": found})
        write_results(self.folder, results, outcomes.arrays)
        assert results.update is not None
        if write_damping(self.study, results.update, self.folder) is not None:
            return results, (CATALOGUE_FILE,)
        self.place.drop(self.study, CATALOGUE_FILE)
        return results, ()

    def results(self, outcomes: Outcomes) -> Results:
        """All outcomes as one record, without alerts and verdict."""
        updated, final, unused = outcomes.of(Updated), outcomes.of(Final), outcomes.of(Unused)
        parameters, result = updated.parameters, updated.parameters.result
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
            "specimens": outcomes.find(SpecimenResults),
            "mapped_damping": () if damped is None else damped.records,
            "write_back": None if written is None else written.deck.record,
            "validation": validated.model_copy(update={"deviations": unused.deviations}),
            "journal": journal_results(self.journal),
        }
        return outcomes.of(Prepared).facts.model_copy(update=parts)


def _model(run: Run, outcomes: Outcomes, made: Made) -> Prepared:
    """Before anything is solved; what later steps read and write is checked, so that errors are reported at once."""
    study = run.study
    repeats, vibration_tests = repeats_of(study), VibrationTests.of(study)
    check_frf_band(study)
    check_independent(study)
    if study.writes_deck:
        check_writable_fields(study, run.wide)
    run.progress.step("mass and rigid-body check", 0, None)
    facts = Results(
        provenance=provenance(run.inputs, run.watch),
        study=study_facts(study),
        model=model_facts(study),
        sensors=tuple(s for s in (sensor_results(study, c) for c in study.cases) if s is not None),
        parameters=parameter_facts(study),
        citations=what_ran(study),
    )
    return Prepared(facts, repeats, vibration_tests)


def _check_later(run: Run, outcomes: Outcomes, made: Made) -> None:
    """What the steps after the update require of the model and the data, at the initial values."""
    study, at, prepared = run.study, outcomes.of(Initial).at, outcomes.of(Prepared)
    prepared.vibration_tests.check(study, at.x, solutions_of(at))
    if study.file.bootstrap is not None:
        check_bootstrap(study, at)
    if prepared.repeats is not None:
        check_quantify(study, prepared.repeats, at.x)


def _correlate(run: Run, outcomes: Outcomes, made: Made) -> Initial:
    at = start(run.study, run.progress)
    return Initial(at, model_records(run.study, "before", at.x, solutions_of(at), made.arrays, run.progress))


def _respond(run: Run, outcomes: Outcomes, made: Made) -> Initial:
    initial = outcomes.of(Initial)
    responses = responses_at(run.study, "before", initial.at.x, made.arrays, run.progress)
    return replace(initial, records=replace(initial.records, responses=responses))


def _select(run: Run, outcomes: Outcomes, made: Made) -> SelectionResults:
    return select_at(run.study, outcomes.of(Initial).at, made.arrays, run.progress)


def _update(run: Run, outcomes: Outcomes, made: Made) -> Updated:
    parameters = find_parameters(run.study, run.folder, outcomes.of(Initial).at, run.progress)
    study, result = parameters.study or run.study, parameters.result
    fisher = fisher_results(study, result.after, "after", parameters.known, result.active)
    units = study.file.study.unit_system if study.units_known else None
    identified = {c.name: c.test for c in study.cases if c.test is not None} if study.file.equalise is None else {}
    return Updated(parameters, fisher, iteration_frfs(result.history, units, made.arrays, identified))


def _truncation(run: Run, outcomes: Outcomes, made: Made) -> TruncationErrors:
    """At the start as the update saw it; the end may be that of other cases, if it was reached in stages."""
    before = frf_truncations(outcomes.of(Initial).at, "before", run.progress)
    return TruncationErrors((*before, *frf_truncations(outcomes.of(Updated).at, "after", run.progress)))


def _left_out_modes(run: Run, outcomes: Outcomes, made: Made) -> ModesLeftOut:
    return ModesLeftOut(left_out_mode_records(outcomes.of(Initial).at, outcomes.of(Updated).at))


def _mapped_damping(run: Run, outcomes: Outcomes, made: Made) -> Damped:
    return Damped(mapped_damping(outcomes.of(Initial).at, outcomes.of(Updated).at, made.arrays))


def _correlate_after(run: Run, outcomes: Outcomes, made: Made) -> Final:
    updated, sensitivities = outcomes.of(Updated), Sensitivities()
    study, at = updated.study(run.study), updated.at
    records = model_records(study, "after", at.x, solutions_of(at), made.arrays, run.progress, sensitivities.add)
    return Final(records, sensitivities)


def _unused_frfs(run: Run, outcomes: Outcomes, made: Made) -> Unused:
    """Beside the model at both ends; before the update only for their deviation."""
    initial, updated = outcomes.of(Initial), outcomes.of(Updated)
    after = unused_frfs(run.study, updated.parameters.result.x, made.arrays, run.progress)
    some = any(one.found is not None for one in after)
    before = unused_frfs(run.study, initial.at.x, {}, run.progress) if some else ()
    return Unused(after, frf_deviations(initial.at, updated.at, before, after))


def _vibrations(run: Run, outcomes: Outcomes, made: Made) -> Vibrated:
    before, after = outcomes.of(Initial).at.x, outcomes.of(Updated).parameters.result.x
    return Vibrated(outcomes.of(Prepared).vibration_tests.beside(run.study, before, after, made.arrays))


def _quantify(run: Run, outcomes: Outcomes, made: Made) -> QuantifyResults | None:
    repeats, updated = outcomes.of(Prepared).repeats, outcomes.of(Updated)
    if repeats is None:
        return None
    study, x = updated.study(run.study), updated.parameters.result.x
    return quantify_at(study, repeats, x, made.arrays, run.progress, run.folder)


def _bootstrap(run: Run, outcomes: Outcomes, made: Made) -> BootstrapResults | None:
    if run.study.file.bootstrap is None:
        return None
    updated = outcomes.of(Updated)
    study, parameters = updated.study(run.study), updated.parameters
    return bootstrap_at(study, parameters.result, run.folder, made.arrays, run.progress, parameters.search)


def _specimens(run: Run, outcomes: Outcomes, made: Made) -> SpecimenResults | None:
    parameters = outcomes.of(Updated).parameters
    before, after = outcomes.of(Initial).records, outcomes.of(Final).records
    separate = calibrate_each(run.study, parameters, run.progress)
    compared = Compared(before.correlations, after.correlations, before.modes, after.modes)
    return specimen_results(run.study, parameters.result, separate, compared)


def _write_back(run: Run, outcomes: Outcomes, made: Made) -> Written:
    run.progress.step("writing the updated deck", 0, None)
    # that of an earlier run must not be taken for the one of this run
    for _, name in made_by("update", run.study.file, Role.RESULT):
        if Path(name).name == DECK_FILE:
            run.place.drop(run.study, name)
    deck = write_back(run.study, outcomes.of(Updated).parameters.result, run.folder, run.wide)
    for built in deck.built.values():
        check_written(built, run.study)
    return Written(deck, on_decks(run.study, deck.built))


def _correlate_as_written(run: Run, outcomes: Outcomes, made: Made) -> AsWritten:
    study = outcomes.of(Written).study
    at = as_written(study, outcomes.of(Updated).at)
    records = model_records(study, "after as written", at.x, solutions_of(at), made.arrays, run.progress)
    return AsWritten(records, at.mean_error)


def _verify(run: Run, outcomes: Outcomes, made: Made) -> Written:
    """The written deck gets its name if it has the frequencies of the update."""
    written, final, deck = outcomes.of(Written), outcomes.of(Final), outcomes.of(AsWritten)
    pairs = zip(final.records.modes, deck.records.modes, strict=True)
    differences = [
        d for after, there in pairs for d in frequency_differences(there.configuration, after.freq_hz, there.freq_hz)
    ]
    return replace(
        written, deck=replace(written.deck, record=named_if_same(written.deck.record, differences, run.folder))
    )


def _respond_as_written(run: Run, outcomes: Outcomes, made: Made) -> AsWritten:
    study, deck = outcomes.of(Written).study, outcomes.of(AsWritten)
    # the written deck has no parameters
    responses = responses_at(study, "after as written", np.zeros(0), made.arrays, run.progress)
    _add(made, write_frf_files(study, responses, made.arrays, numbered(run.folder / FRFS_FILE, len(study.cases))))
    return replace(deck, records=replace(deck.records, responses=responses))


def _respond_after(run: Run, outcomes: Outcomes, made: Made) -> Final:
    final, x = outcomes.of(Final), outcomes.of(Updated).parameters.result.x
    responses = responses_at(run.study, "after", x, made.arrays, run.progress)
    files = numbered(run.folder / FRFS_FILE, len(run.study.cases))
    _add(made, write_frf_files(run.study, responses, made.arrays, files))
    return replace(final, records=replace(final.records, responses=responses))


def _add(made: Made, written: Iterable[Path]) -> None:
    """Enter the names of files that were written."""
    made.files.extend(path.name for path in written)


def _write_expanded(run: Run, outcomes: Outcomes, made: Made) -> None:
    """The test shapes expanded to the model at its last version."""
    study = outcomes.of(Updated).study(run.study)
    records = (outcomes.find(AsWritten) or outcomes.of(Final)).records
    paths = numbered(run.folder / EXPANDED_FILE, len(study.cases))
    _add(made, write_expanded_files(study, records.correlations, outcomes.arrays, paths))


def _write_vtu(run: Run, outcomes: Outcomes, made: Made) -> None:
    """Mesh, modes and parameters after the update."""
    if not run.study.file.output.vtu:
        return
    updated = outcomes.of(Updated)
    study, x = updated.study(run.study), updated.parameters.result.x
    solved = solutions_of(updated.at)
    for case in study.cases:
        if case.name not in solved and (solution := solved_if_any(study, case, x)) is not None:
            solved[case.name] = solution
    _add(made, write_vtu_files(study, x, solved, run.folder / VTU_FILE))


def _judge(run: Run, outcomes: Outcomes, made: Made) -> JudgedTopics:
    updated = outcomes.of(Updated)
    study, result, results = updated.study(run.study), updated.parameters.result, run.results(outcomes)
    made.arrays.update(outcomes.arrays)
    initial, search = outcomes.of(Initial).at, updated.parameters.search
    return judged_topics(FinishedUpdate(study, initial, result, results, made.arrays, run.progress, search))


JUDGE = RunStep("judge", _judge)
WRITE_EXPANDED = RunStep("expanded shapes", _write_expanded, optional="file of the expanded test shapes")
UNTIL_UPDATED = (
    RunStep("model", _model),
    RunStep("correlate", _correlate),
    RunStep("checks of later steps", _check_later),
    RunStep("respond", _respond),
    RunStep("select", _select),
    RunStep("update", _update),
    RunStep("truncation", _truncation, optional="error of the FRFs by truncation of the modes"),
    RunStep("left-out modes", _left_out_modes),
    RunStep("correlate after", _correlate_after),
    RunStep("file for ParaView", _write_vtu, optional="file for ParaView"),
    RunStep("measured damping", _mapped_damping, optional="measured damping on the modes of the updated model"),
    RunStep("unused FRFs", _unused_frfs),
    RunStep("vibration tests", _vibrations),
)
ONCE_UPDATED = (
    RunStep("specimens", _specimens, optional="comparison of the specimens"),
    RunStep("quantify", _quantify, optional="variability of the parameters"),
    RunStep("bootstrap", _bootstrap, optional="bootstrap"),
)
ON_WRITTEN_DECK = (
    RunStep("write back", _write_back),
    RunStep("correlate as written", _correlate_as_written),
    RunStep("compare the deck as written", _verify),
    WRITE_EXPANDED,
    RunStep("respond", _respond_as_written),
)
WITHOUT_DECK = (WRITE_EXPANDED, RunStep("respond", _respond_after))
"""Where nothing can be written back, the run ends with the responses at the updated values."""
