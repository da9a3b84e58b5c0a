"""A run of a study in its folder: the part that `update`, `validate`, `bootstrap`, `posterior` and `run` share."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.errors import FemtuneError, Where
from femtune.files.study_file import BootstrapTable, PosteriorTable, StudyFile, is_deck, read_study_file
from femtune.journal.run_files import REPORT_FILE
from femtune.steps.held_folder import held
from femtune.steps.report.function import checked_page
from femtune.steps.run.result import RunResult
from femtune.steps.run.run import Run
from femtune.steps.select.run import check_parameters
from femtune.study.executor import check_executor, with_jobs
from femtune.study.provenance import Stopwatch, call, inputs_of
from femtune.study.solutions import keeping
from femtune.study.study import check_solvers, read_study

if TYPE_CHECKING:
    from femtune.study.progress import Progress


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
    file, folder = opened(source, jobs, output)
    with held(file, folder, word) as place:
        if word == "run":
            checked_page(folder / REPORT_FILE)
        # the folder is held before a solver is started
        with watch.step("read"):
            study = read_study(file, progress, fresh=fresh)
            if word == "bootstrap" and study.file.bootstrap is None:
                study = replace(study, file=study.file.model_copy(update={"bootstrap": BootstrapTable()}))
            if word == "posterior" and study.file.posterior is None:
                study = replace(study, file=study.file.model_copy(update={"posterior": PosteriorTable()}))
            study.problem()
            check_parameters(study)
            if study.file.update.starts > 1 or study.file.bootstrap is not None or study.file.posterior is not None:
                check_executor(study, progress)
            inputs = inputs_of(study)
        place.check(study)
        study, journal = keeping(study, folder, fresh)
        if fresh:
            place.forget()
        wide = study.file.write.wide if wide is None else wide
        return Run(study, place, wide, watch, progress, inputs, journal).go()


def opened(source: Path | str | StudyFile, jobs: int | None, output: Path | str | None) -> tuple[StudyFile, Path]:
    """The study with its run folder, which `output` replaces for all that is kept there."""
    check_solvers()
    given = with_jobs(source, jobs)
    if not isinstance(given, StudyFile):
        if is_deck(given):
            raise FemtuneError("study.deck-alone", where=Where(str(given)))
        given = read_study_file(given)
    if output is None:
        return given, given.output_folder
    table = given.output.model_copy(update={"folder": os.path.abspath(output)})
    return given.model_copy(update={"output": table}), Path(output)
