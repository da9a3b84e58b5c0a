"""A run of a study in its folder: the part that `update`, `validate`, `bootstrap` and `run` share."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.files.study_file import BootstrapTable
from femtune.steps import run_folder
from femtune.steps.bootstrap.run import forget_bootstrap
from femtune.steps.quantify.run import forget_samples
from femtune.steps.run.result import RunResult
from femtune.steps.run.run import Run
from femtune.steps.run_lock import locked
from femtune.steps.select.run import check_parameters
from femtune.steps.update.starts import forget_starts
from femtune.steps.write.run import check_inputs_safe
from femtune.study.executor import check_executor, with_jobs
from femtune.study.provenance import Stopwatch, call, inputs_of
from femtune.study.solutions import keeping
from femtune.study.study import read_study

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
    from femtune.study.progress import Progress
    from femtune.study.study import Study


def _run(
    source: Path | str | StudyFile,
    word: str,
    output: Path | str | None,
    wide: bool | None,
    fresh: bool,
    progress: Progress,
    jobs: int | None,
) -> RunResult:
    """The run of a study; `word` is the function recorded in the provenance."""
    watch = Stopwatch(call(word, source))
    with watch.step("read"):
        study = read_study(with_jobs(source, jobs), progress, fresh=fresh)
        if word == "bootstrap" and study.file.bootstrap is None:
            study = replace(study, file=study.file.model_copy(update={"bootstrap": BootstrapTable()}))
        study.problem()
        check_parameters(study)
        if study.file.update.starts > 1 or study.file.bootstrap is not None:
            check_executor(study)
        inputs = inputs_of(study)
    folder = _folder(study, output)
    with locked(folder):
        study, journal = keeping(study, folder, fresh)
        if fresh:
            forget_starts(folder)
            forget_bootstrap(folder)
            forget_samples(folder)
        wide = study.file.write.wide if wide is None else wide
        return Run(study, folder, wide, watch, progress, inputs, journal).go()


def _folder(study: Study, output: Path | str | None) -> Path:
    """The run folder, checked to be writable and to contain no input file that would be overwritten."""
    folder = Path(output) if output is not None else study.file.output_folder
    run_folder.check_writable(folder)
    check_inputs_safe(study, folder)
    return folder
