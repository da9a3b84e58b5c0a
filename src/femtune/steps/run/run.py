"""One run of a whole study: correlate, select, update, write back, correlate again; a failure keeps earlier results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.journal.run_files import (
    ARRAYS_FILE,
    CATALOGUE_FILE,
    EXPANDED_FILE,
    FRFS_FILE,
    HISTORY_FILE,
    RESULTS_FILE,
    VTU_FILE,
)
from femtune.steps.bootstrap.run import bootstrap_at, check_bootstrap
from femtune.steps.correlate.expanded_files import write_expanded_files
from femtune.steps.correlate.versions import as_written, model_records, start
from femtune.steps.equalise.record import MappedDamping
from femtune.steps.equalise.run import mapped_damping
from femtune.steps.info.facts import alert_of, model_facts, sensor_results
from femtune.steps.modes.vtu_files import write_vtu_files
from femtune.steps.quantify.run import check_quantify, quantify_at, repeats_of
from femtune.steps.respond.run import responses_at, uff_paths, write_frf_files
from femtune.steps.results import Results
from femtune.steps.run.alerts import alerts_of
from femtune.steps.run.result import RunResult
from femtune.steps.run_folder import write_results
from femtune.steps.select.fisher import fisher_results
from femtune.steps.select.record.fisher import FisherResults
from femtune.steps.select.run import select_at
from femtune.steps.specimens.facts import Compared, specimen_results
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
from femtune.study.provenance import provenance, study_facts
from femtune.study.record import Alert, alert
from femtune.study.solutions import journal_results
from femtune.study.solved import solutions_of, solved_if_any
from femtune.study.study import on_decks

if TYPE_CHECKING:
    from femtune.journal.journal import Journal
    from femtune.residuals import Evaluation
    from femtune.steps.bootstrap.record import BootstrapResults
    from femtune.steps.correlate.versions import ModelRecords
    from femtune.steps.held_folder import RunFolder
    from femtune.steps.quantify.record import QuantifyResults
    from femtune.steps.select.record.identifiability import SelectionResults
    from femtune.steps.specimens.record import SpecimenResults
    from femtune.steps.update.record.iterations import IterationFrfs
    from femtune.steps.update.record.left_out import ModeLeftOutOfFrfs
    from femtune.steps.update.record.truncation import FrfTruncation
    from femtune.steps.update.run import FoundParameters
    from femtune.steps.validate.frf_validation import UnusedFrfs
    from femtune.steps.validate.record.frf_deviation import FrfDeviations
    from femtune.steps.vibration.record import VibrationResults
    from femtune.steps.write.run import WriteBack
    from femtune.study.progress import Progress
    from femtune.study.provenance import Inputs, Stopwatch
    from femtune.study.repeats import Repeats
    from femtune.study.study import Study

Arrays = dict[str, NDArray]
Outcome = Mapping[str, Any]
"""What a step found, by the names of `Known`."""


_LATER: Any = None
"""In place of what a step that has not run yet will find; the order of the steps sees to it that none reads it."""


@dataclass(frozen=True, eq=False)
class Known:
    """What the steps of a run have found so far.

    Parameters
    ----------
    facts : what is known before anything is solved
    repeats : repeated tests, where the study has them
    start : the update problem at the initial values
    before, after : the model's modes, correlations and responses at the start and at the end of the update
    selection : which parameters the data determine
    parameters : the update
    fisher : information of the FRFs at its result
    mapped_damping : measured damping on the modes of the updated model
    sensitivities : those of the frequencies that the updated model predicts
    truncation : errors of the FRFs of residuals, at start and end of the update
    unused_frfs : measured FRFs that the update did not use, beside those of the updated model
    left_out_modes : modes of the model that FRFs are compared without
    iteration_frfs : compared FRFs at each iteration of the update
    deviations : those of the FRFs at the start and the end of the update
    vibration_tests, vibrations : sweeps and random vibration tests as measured, and beside the model
    quantify : covariance of the parameters from the repeats
    bootstrap : spread of the parameters by a bootstrap of the FRFs
    specimens : nominally identical specimens beside each other
    written, study_as_written, error_as_written, as_written : the updated deck, the study on it, its weighted mean
        error, and what it gives; None where the model has no deck
    arrays : arrays of the records, by key
    files : names of the files that were written into the run folder, but for those that every run has
    alerts : steps that failed
    """

    facts: Results = _LATER
    repeats: Repeats | None = None
    start: Evaluation = _LATER
    before: ModelRecords = _LATER
    selection: SelectionResults = _LATER
    parameters: FoundParameters = _LATER
    fisher: FisherResults | None = None
    mapped_damping: tuple[MappedDamping, ...] = ()
    after: ModelRecords = _LATER
    sensitivities: Sensitivities = _LATER
    truncation: tuple[FrfTruncation, ...] = ()
    left_out_modes: tuple[ModeLeftOutOfFrfs, ...] = ()
    iteration_frfs: tuple[IterationFrfs, ...] = ()
    unused_frfs: tuple[UnusedFrfs, ...] = ()
    deviations: FrfDeviations | None = None
    vibration_tests: VibrationTests = _LATER
    vibrations: tuple[VibrationResults, ...] = ()
    quantify: QuantifyResults | None = None
    bootstrap: BootstrapResults | None = None
    specimens: SpecimenResults | None = None
    written: WriteBack | None = None
    study_as_written: Study = _LATER
    as_written: ModelRecords | None = None
    error_as_written: float | None = None
    arrays: Arrays = field(default_factory=dict)
    files: tuple[str, ...] = ()
    alerts: tuple[Alert, ...] = ()


@dataclass(frozen=True)
class RunStep:
    """A step of a run.

    Parameters
    ----------
    name : under which its time is kept
    work : what it finds from what is known before it; the arrays of its records go into the mapping
    optional : what it finds, in words, where the run goes on without it; "" where its failure ends the run
    """

    name: str
    work: Callable[[Run, Known, Arrays], Outcome]
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
        FemtuneError : ``correlate.no-pairs``, ``eigen.*``, ``write.*``, ``run.unwritable``
        """
        source = self.study.source
        ends = () if source.writes_back else (alert("info", source.no_write_back),)
        known = self._done(UNTIL_UPDATED, Known())
        self._keep(known, *(ends or (alert("problem", "run.unfinished"),)))
        try:
            known = self._done((*ONCE_UPDATED, *(ON_WRITTEN_DECK if source.writes_back else WITHOUT_DECK)), known)
        except FemtuneError as problem:
            problem.values["results so far"] = str(self.folder / RESULTS_FILE)
            raise
        results, catalogue = self._keep(known, *ends)
        deck = results.write_back.files if results.write_back else ()
        files = (*known.files, *catalogue, RESULTS_FILE, ARRAYS_FILE, HISTORY_FILE, *deck)
        self.place.keep(files)
        return RunResult(self.folder, results, known.arrays, files=files)

    def _done(self, steps: Iterable[RunStep], known: Known) -> Known:
        """What is known after some steps, each of them timed; if a step that may fail fails, an alert reports it."""
        for step in steps:
            arrays: Arrays = {}
            try:
                with self.watch.step(step.name):
                    found = step.work(self, known, arrays)
            except FemtuneError as problem:
                if not step.optional:
                    raise
                told = Alert(level="problem", code=problem.code, sentence=f"{step.optional}: {problem.what}")
                known = replace(known, alerts=(*known.alerts, told))
            else:
                known = replace(known, arrays={**known.arrays, **arrays}, **found)
        return known

    def _keep(self, known: Known, *alerts: Alert) -> tuple[Results, tuple[str, ...]]:
        """Write what is known, with its alerts; also the name of the catalogue of damping, if there is one."""
        results = self._results(known)
        of_journal = self.journal.notices if self.journal is not None else ()
        found = (*alerts, *known.alerts, *alerts_of(self.study, results, map(alert_of, of_journal)))
        results = results.model_copy(update={"alerts": found})
        write_results(self.folder, results, known.arrays)
        assert results.update is not None
        if write_damping(self.study, results.update, self.folder) is not None:
            return results, (CATALOGUE_FILE,)
        self.place.drop(self.study, CATALOGUE_FILE)
        return results, ()

    def _results(self, known: Known) -> Results:
        """What every step found, as one record."""
        found, written = known.parameters, known.written
        versions = [v for v in (known.before, known.after, known.as_written) if v is not None]
        values = {} if written is None else written.written
        update = update_results(
            self.study, found.result, values, known.error_as_written, found.reduction, found.starts
        ).model_copy(
            update={
                "stages": stage_results(self.study, found.stages), "frf_truncation": known.truncation,
                "fisher": known.fisher, "left_out_modes": known.left_out_modes,
                "frfs": known.iteration_frfs,
            }
        )  # fmt: skip
        predicted = predictions(self.study, found.result, known.sensitivities)
        parts = {
            "provenance": provenance(self.inputs, self.watch, (m.solver for v in versions for m in v.modes)),
            "modes": tuple(m for v in versions for m in v.modes),
            "correlations": tuple(c for v in versions for c in v.correlations),
            "responses": tuple(r for v in versions for r in v.responses),
            "mode_shapes": tuple(m for v in versions for m in v.shapes),
            "selection": known.selection,
            "update": update,
            "quantify": known.quantify,
            "bootstrap": known.bootstrap,
            "specimens": known.specimens,
            "mapped_damping": known.mapped_damping,
            "write_back": None if written is None else written.record,
            "validation": validation(
                self.study, versions[0], versions[-1], predicted, known.unused_frfs, known.vibrations
            ).model_copy(update={"deviations": known.deviations}),
            "journal": journal_results(self.journal),
        }
        return known.facts.model_copy(update=parts)


def _model(run: Run, known: Known, arrays: Arrays) -> Outcome:
    """Before anything is solved; what later steps read and write is checked, so that errors are reported at once."""
    study = run.study
    repeats, vibration_tests = repeats_of(study), VibrationTests.of(study)
    check_frf_band(study)
    if study.source.writes_back:
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
    return {"facts": facts, "repeats": repeats, "vibration_tests": vibration_tests}


def _check_later(run: Run, known: Known, arrays: Arrays) -> Outcome:
    """What the steps after the update require of the model and the data, at the initial values."""
    study, at = run.study, known.start
    known.vibration_tests.check(study, at.x, solutions_of(at))
    if study.file.bootstrap is not None:
        check_bootstrap(study, at)
    if known.repeats is not None:
        check_quantify(study, known.repeats, at.x)
    return {}


def _correlate(run: Run, known: Known, arrays: Arrays) -> Outcome:
    at = start(run.study, run.progress)
    return {
        "start": at,
        "before": model_records(run.study, "before", at.x, solutions_of(at), arrays, run.progress),
    }


def _respond(run: Run, known: Known, arrays: Arrays) -> Outcome:
    found = responses_at(run.study, "before", known.start.x, arrays, run.progress)
    return {"before": replace(known.before, responses=found)}


def _select(run: Run, known: Known, arrays: Arrays) -> Outcome:
    return {"selection": select_at(run.study, known.start, arrays, run.progress)}


def _update(run: Run, known: Known, arrays: Arrays) -> Outcome:
    found = find_parameters(run.study, run.folder, known.start, run.progress)
    study = found.study or run.study
    known_after = fisher_results(study, found.result.after, "after", found.known, found.result.active)
    units = study.file.study.unit_system if study.units_known else None
    identified = {c.name: c.test for c in study.cases if c.test is not None} if study.file.equalise is None else {}
    frfs = iteration_frfs(found.result.history, units, arrays, identified)
    alerts = (*known.alerts, *found.alerts)
    return {"parameters": found, "fisher": known_after, "iteration_frfs": frfs, "alerts": alerts}


def _truncation(run: Run, known: Known, arrays: Arrays) -> Outcome:
    """At the start as the update saw it; the end may be that of other cases, if it was reached in stages."""
    before = frf_truncations(known.start, "before", run.progress)
    return {"truncation": (*before, *frf_truncations(known.parameters.result.after, "after", run.progress))}


def _left_out_modes(run: Run, known: Known, arrays: Arrays) -> Outcome:
    return {"left_out_modes": left_out_mode_records(known.start, known.parameters.result.after)}


def _mapped_damping(run: Run, known: Known, arrays: Arrays) -> Outcome:
    return {"mapped_damping": mapped_damping(known.start, known.parameters.result.after, arrays)}


def _correlate_after(run: Run, known: Known, arrays: Arrays) -> Outcome:
    at, sensitivities = known.parameters.result.after, Sensitivities()
    study = known.parameters.study or run.study
    records = model_records(study, "after", at.x, solutions_of(at), arrays, run.progress, sensitivities.add)
    return {"after": records, "sensitivities": sensitivities}


def _unused_frfs(run: Run, known: Known, arrays: Arrays) -> Outcome:
    """Beside the model at both ends; before the update only for their deviation."""
    found = unused_frfs(run.study, known.parameters.result.x, arrays, run.progress)
    some = any(one.found is not None for one in found)
    before = unused_frfs(run.study, known.start.x, {}, run.progress) if some else ()
    deviations = frf_deviations(known.start, known.parameters.result.after, before, found)
    return {"unused_frfs": found, "deviations": deviations}


def _vibrations(run: Run, known: Known, arrays: Arrays) -> Outcome:
    before, after = known.start.x, known.parameters.result.x
    return {"vibrations": known.vibration_tests.beside(run.study, before, after, arrays)}


def _quantify(run: Run, known: Known, arrays: Arrays) -> Outcome:
    if known.repeats is None:
        return {}
    study, x = known.parameters.study or run.study, known.parameters.result.x
    return {"quantify": quantify_at(study, known.repeats, x, arrays, run.progress, run.folder)}


def _bootstrap(run: Run, known: Known, arrays: Arrays) -> Outcome:
    if run.study.file.bootstrap is None:
        return {}
    study, result, search = known.parameters.study or run.study, known.parameters.result, known.parameters.search
    return {"bootstrap": bootstrap_at(study, result, run.folder, arrays, run.progress, search)}


def _specimens(run: Run, known: Known, arrays: Arrays) -> Outcome:
    separate = calibrate_each(run.study, known.parameters, run.progress)
    compared = Compared(known.before.correlations, known.after.correlations, known.before.modes, known.after.modes)
    return {"specimens": specimen_results(run.study, known.parameters.result, separate, compared)}


def _write_back(run: Run, known: Known, arrays: Arrays) -> Outcome:
    run.progress.step("writing the updated deck", 0, None)
    written = write_back(run.study, known.parameters.result, run.folder, run.wide)
    for built in written.built.values():
        check_written(built, run.study)
    return {"written": written, "study_as_written": on_decks(run.study, written.built)}


def _correlate_as_written(run: Run, known: Known, arrays: Arrays) -> Outcome:
    study = known.study_as_written
    at = as_written(study, known.parameters.result.after)
    records = model_records(study, "after as written", at.x, solutions_of(at), arrays, run.progress)
    return {"as_written": records, "error_as_written": at.mean_error}


def _respond_as_written(run: Run, known: Known, arrays: Arrays) -> Outcome:
    study, records = known.study_as_written, known.as_written
    assert records is not None
    # the written deck has no parameters
    found = responses_at(study, "after as written", np.zeros(0), arrays, run.progress)
    written = write_frf_files(study, found, arrays, uff_paths(run.folder / FRFS_FILE, study))
    return {"as_written": replace(records, responses=found), "files": _with(known, written)}


def _respond_after(run: Run, known: Known, arrays: Arrays) -> Outcome:
    found = responses_at(run.study, "after", known.parameters.result.x, arrays, run.progress)
    written = write_frf_files(run.study, found, arrays, uff_paths(run.folder / FRFS_FILE, run.study))
    return {"after": replace(known.after, responses=found), "files": _with(known, written)}


def _with(known: Known, written: Iterable[Path]) -> tuple[str, ...]:
    """Names of the files of a run, with those of a step."""
    return (*known.files, *(path.name for path in written))


def _write_expanded(run: Run, known: Known, arrays: Arrays) -> Outcome:
    """The test shapes expanded to the model at its last version."""
    study, records = known.parameters.study or run.study, known.as_written or known.after
    paths = uff_paths(run.folder / EXPANDED_FILE, study)
    return {"files": _with(known, write_expanded_files(study, records.correlations, known.arrays, paths))}


def _write_vtu(run: Run, known: Known, arrays: Arrays) -> Outcome:
    """Mesh, modes and parameters after the update."""
    if not run.study.file.output.vtu:
        return {}
    result = known.parameters.result
    study = known.parameters.study or run.study
    solved = solutions_of(result.after)
    for case in study.cases:
        if case.name not in solved and (solution := solved_if_any(study, case, result.x)) is not None:
            solved[case.name] = solution
    return {"files": _with(known, write_vtu_files(study, result.x, solved, run.folder / VTU_FILE))}


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
    WRITE_EXPANDED,
    RunStep("respond", _respond_as_written),
)
WITHOUT_DECK = (WRITE_EXPANDED, RunStep("respond", _respond_after))
"""Where nothing can be written back, the run ends with the responses at the updated values."""
