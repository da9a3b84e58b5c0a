"""The steps of a study, in the words of the command line: info, modes, correlate, select, update."""

from __future__ import annotations

from pathlib import Path

from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.study.cases import StudyCase
from femtune.study.load import Study, load_study, read_study
from femtune.study.progress import Progress, silent
from femtune.study.provenance import Stopwatch, inputs_of
from femtune.study.record_model import model_facts
from femtune.study.results_correlation import CorrelationResults
from femtune.study.results_model import ModelFacts, ModelModes
from femtune.study.results_update import SelectionResults
from femtune.study.run import Run, RunFolder, check_parameters, select_at
from femtune.study.run_folder import check_writable
from femtune.study.stages import modes_of, nominal, solve, stage_records, start
from femtune.study.write_back import check_inputs_safe

__all__ = ["RunFolder", "correlate", "info", "mode_sets", "modes", "select", "update"]


def info(path: Path | str, progress: Progress = silent) -> ModelFacts:
    """What is in the deck of a study (or in a deck): cards, mass, rigid-body check, supports."""
    study = load_study(path, progress)
    progress.step("mass and rigid-body check", 0, None)
    return model_facts(study)


def modes(path: Path | str, progress: Progress = silent) -> tuple[ModelModes, ...]:
    """Natural frequencies of each configuration of a study, or of a deck, at the start values of the parameters."""
    return tuple(modes_of(load_study(path, progress), "before", progress))


def mode_sets(path: Path | str, progress: Progress = silent) -> dict[str, ModeSet]:
    """Natural modes by configuration, with shapes at all DOFs of the model in its displacement frames.

    For what the other steps do not do: planning sensors, simulating tests, drawing. The shapes are mass-normalised.
    """
    study = load_study(path, progress)
    dofs = study.model.structure.nodes.dof_set()
    return {case.name: _mode_set(study, case, dofs) for case in study.cases}


def _mode_set(study: Study, case: StudyCase, dofs: DofSet) -> ModeSet:
    solution = solve(study, case, nominal(study))
    shapes = case.configured.transformation @ solution.shapes[:, : solution.wanted]
    return ModeSet(solution.freq_hz, shapes, dofs, normalisation="mass", source=f"model, {case.name}")


def correlate(
    path: Path | str, progress: Progress = silent, arrays: dict[str, NDArray] | None = None
) -> tuple[CorrelationResults, ...]:
    """Test against model, each configuration that has a test.

    The matrices that the records refer to by key are put into `arrays`, where it is given.
    """
    study = read_study(path, progress)
    if all(case.modal is None for case in study.cases):
        raise study.no_test("can be compared")
    found = {} if arrays is None else arrays
    return stage_records(study, "before", nominal(study), {}, found, progress).correlations


def select(path: Path | str, progress: Progress = silent) -> SelectionResults:
    """Which parameters, and which combinations of them, the data determine."""
    study = read_study(path, progress)
    check_parameters(study)
    return select_at(study, start(study, progress), {}, progress)


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
    FemtuneError : whatever is wrong with the study, its files or the run folder. Once the parameters are found
        results.json is written, whatever happens to the deck afterwards
    """
    watch = Stopwatch(f"femtune.update({str(path)!r})")
    with watch.step("read"):
        study = read_study(path, progress)
        study.problem()
        check_parameters(study)
        inputs = inputs_of(study)
    folder = _folder(study, output)
    return Run(study, folder, study.file.write.wide if wide is None else wide, watch, progress, inputs).go()


def _folder(study: Study, output: Path | str | None) -> Path:
    """The run folder, proven to be writable and to hold no input that would be overwritten."""
    folder = Path(output) if output is not None else study.file.output_folder
    check_writable(folder)
    check_inputs_safe(study, folder)
    return folder
