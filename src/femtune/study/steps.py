"""The steps of a study, in the words of the command line: info, modes, correlate, select, update, validate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.study.cases import StudyCase
from femtune.study.load import Study, load_study, read_study, with_modes_asked
from femtune.study.progress import Progress, silent
from femtune.study.provenance import Stopwatch, inputs_of
from femtune.study.quantify import quantify_at, repeats_of
from femtune.study.record_model import model_facts, model_modes
from femtune.study.results_correlation import CorrelationResults
from femtune.study.results_model import ModelFacts, ModelModes
from femtune.study.results_quantify import QuantifyResults
from femtune.study.results_update import SelectionResults
from femtune.study.run import Run, RunFolder, check_parameters, select_at
from femtune.study.run_folder import check_writable
from femtune.study.run_lock import locked
from femtune.study.simulated_test import SimulatedTest, check_simulated, write_simulated
from femtune.study.stages import nominal, solve, solved_cases, stage_records, start
from femtune.study.starts import forget_starts
from femtune.study.with_journal import keeping, looking_up
from femtune.study.write_back import check_inputs_safe

__all__ = [
    "RunFolder",
    "SimulatedTest",
    "correlate",
    "info",
    "mode_sets",
    "modes",
    "quantify",
    "select",
    "update",
    "validate",
]


def info(path: Path | str, progress: Progress = silent) -> ModelFacts:
    """What is in the deck of a study (or in a deck): cards, mass, rigid-body check, supports."""
    study = load_study(path, progress)
    progress.step("mass and rigid-body check", 0, None)
    return model_facts(study)


def modes(
    path: Path | str,
    progress: Progress = silent,
    *,
    fresh: bool = False,
    remarks: list[str] | None = None,
    count: int | None = None,
    max_hz: float | None = None,
    simulate: SimulatedTest | None = None,
) -> tuple[ModelModes, ...]:
    """Natural frequencies of each configuration of a study, or of a deck, at the start values of the parameters.

    Solutions in the journal of the study's run folder are used, not so if `fresh`; `remarks` is told how many.
    `count` or `max_hz` takes the place of [modes] of the study and of METHOD of the deck. `simulate` writes the modes
    as a test would have measured them.
    """
    loaded = with_modes_asked(load_study(path, progress), count, max_hz)
    if simulate is not None:
        check_simulated(loaded, simulate)
    with looking_up(loaded, fresh, remarks) as study:
        solved = list(solved_cases(study, progress))
    if simulate is not None:
        write_simulated(loaded, simulate, solved)
    return tuple(model_modes(case.name, "before", solution) for case, solution in solved)


def mode_sets(path: Path | str, progress: Progress = silent, *, fresh: bool = False) -> dict[str, ModeSet]:
    """Natural modes by configuration, with shapes at all DOFs of the model in its displacement frames.

    For what the other steps do not do: planning sensors, simulating tests, drawing. The shapes are mass-normalised.
    """
    with looking_up(load_study(path, progress), fresh, None) as study:
        dofs = study.model.structure.nodes.dof_set()
        return {case.name: _mode_set(study, case, dofs) for case in study.cases}


def _mode_set(study: Study, case: StudyCase, dofs: DofSet) -> ModeSet:
    solution = solve(study, case, nominal(study))
    shapes = case.configured.transformation @ solution.shapes[:, : solution.wanted]
    return ModeSet(solution.freq_hz, shapes, dofs, normalisation="mass", source=f"model, {case.name}")


def correlate(
    path: Path | str,
    progress: Progress = silent,
    arrays: dict[str, NDArray] | None = None,
    *,
    fresh: bool = False,
    remarks: list[str] | None = None,
) -> tuple[CorrelationResults, ...]:
    """Test against model, each configuration that has a test.

    The matrices that the records refer to by key are put into `arrays`, where it is given; `fresh` and `remarks` as
    for `modes`.
    """
    study = read_study(path, progress)
    if all(case.modal is None for case in study.cases):
        raise study.no_test("can be compared")
    found = {} if arrays is None else arrays
    with looking_up(study, fresh, remarks) as study:
        return stage_records(study, "before", nominal(study), {}, found, progress).correlations


def select(
    path: Path | str, progress: Progress = silent, *, fresh: bool = False, remarks: list[str] | None = None
) -> SelectionResults:
    """Which parameters, and which combinations of them, the data determine; `fresh` and `remarks` as for `modes`."""
    study = read_study(path, progress)
    check_parameters(study)
    with looking_up(study, fresh, remarks) as study:
        return select_at(study, start(study, progress), {}, progress)


def quantify(
    path: Path | str,
    progress: Progress = silent,
    arrays: dict[str, NDArray] | None = None,
    *,
    fresh: bool = False,
    remarks: list[str] | None = None,
) -> QuantifyResults:
    """How the free parameters scatter over repeated tests, from their start values; `run` does it after the update.

    Matrices that the record refers to by key are put into `arrays`, where it is given; `fresh` and `remarks` as for
    `modes`.

    Raises
    ------
    FemtuneError : ``quantify.no-repeats`` without [quantify], and others of ``quantify.*``
    """
    study = read_study(path, progress)
    check_parameters(study)
    found = repeats_of(study)
    if found is None:
        raise FemtuneError(
            "quantify.no-repeats",
            "the study names no repeated tests",
            where=study.file.where("study"),
            hint='add a table [quantify] with repeats = "repeats.csv", or one Universal File for each repeat',
        )
    with looking_up(study, fresh, remarks) as study:
        repeats = replace(found, case=next(c for c in study.cases if c.name == found.case.name))
        kept = {} if arrays is None else arrays
        return quantify_at(study, repeats, nominal(study), kept, progress)


def update(
    path: Path | str,
    output: Path | str | None = None,
    wide: bool | None = None,
    progress: Progress = silent,
    *,
    fresh: bool = False,
    word: str = "update",
) -> RunFolder:
    """All steps of a study: results and updated deck in its run folder (the report is made of them).

    What an earlier run in the folder has solved, interrupted or not, is taken from its journal.

    Parameters
    ----------
    path : the study file
    output : run folder instead of the study's
    wide : write changed cards in large field; the study decides where None
    fresh : empty the journal and solve everything again
    word : function of `femtune.steps` that the provenance names: ``run`` where the report follows

    Raises
    ------
    FemtuneError : whatever is wrong with the study, its files or the run folder; ``run.locked`` where another run is
        at work there. Once the parameters are found results.json is written, whatever happens to the deck afterwards
    """
    watch = Stopwatch(f"femtune.steps.{word}({str(path)!r})")
    with watch.step("read"):
        study = read_study(path, progress)
        study.problem()
        check_parameters(study)
        inputs = inputs_of(study)
    folder = _folder(study, output)
    with locked(folder):
        study, journal = keeping(study, folder, fresh)
        if fresh:
            forget_starts(folder)
        wide = study.file.write.wide if wide is None else wide
        return Run(study, folder, wide, watch, progress, inputs, journal).go()


def validate(
    path: Path | str,
    output: Path | str | None = None,
    progress: Progress = silent,
    *,
    fresh: bool = False,
) -> RunFolder:
    """The updated model on data that the update did not use: `update`, then ``results.validation`` of the run folder.

    What an earlier run has solved is taken from its journal; parameters and errors as of `update`.
    """
    return update(path, output, None, progress, fresh=fresh, word="validate")


def _folder(study: Study, output: Path | str | None) -> Path:
    """The run folder, proven to be writable and to hold no input that would be overwritten."""
    folder = Path(output) if output is not None else study.file.output_folder
    check_writable(folder)
    check_inputs_safe(study, folder)
    return folder
