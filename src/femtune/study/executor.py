"""The executor that a study asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from femtune.errors import FemtuneError
from femtune.executor import Cluster, Processes, Serial
from femtune.executor.worker import packed
from femtune.files.study_file import ParallelTable, StudyFile, read_study_file
from femtune.files.study_file.reading import is_deck
from femtune.study.error_places import errors_at

if TYPE_CHECKING:
    from pathlib import Path

    from femtune.executor import Executor
    from femtune.study.progress import Progress
    from femtune.study.study import Study

LARGE = 3000
"""Free DOFs of the largest configuration above which runs take longer than the start of processes."""

MOST_JOBS = 1024
"""Largest number of parallel runs: a larger one is a mistyped number."""


def check_jobs(jobs: int | None) -> None:
    """Check the number of parallel runs (error ``executor.jobs``); None if it is not given."""
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise FemtuneError("executor.jobs", values={"jobs": jobs}, most=MOST_JOBS)


def with_jobs(source: Path | str | StudyFile, jobs: int | None) -> Path | str | StudyFile:
    """The study with a maximum number of parallel runs on this machine, which overrides [parallel].

    Raises
    ------
    FemtuneError : ``executor.jobs``, and errors in the study file
    """
    check_jobs(jobs)
    if jobs is None or (not isinstance(source, StudyFile) and is_deck(source)):
        return source
    file = source if isinstance(source, StudyFile) else read_study_file(source)
    how: Literal["processes", "serial"] = "processes" if jobs > 1 else "serial"
    return file.model_copy(update={"parallel": ParallelTable(how=how, workers=jobs)})


def check_executor(study: Study, progress: Progress) -> None:
    """Check, before anything is solved, that the runs of a study can be made where it wants them.

    The model and the residuals are packed as for another process. A cluster is asked for its workers, and the first one
    is waited for: the jobs that start them may be in a queue. Only steps that make runs need it.

    Raises
    ------
    FemtuneError : ``executor.not-loopback``, ``executor.no-cluster``, ``executor.not-sent``, ``install.missing``
    """
    executor = executor_of(study)
    if isinstance(executor, Serial):
        return
    from femtune.residuals.frf.model_way import AtFirstState  # noqa: PLC0415  many steps do without

    with errors_at(study.file.where("parallel")):
        used = [case.used for case in study.cases if case.used is not None]
        # those that are made of the first state are not there yet
        residuals = [r for case in used for r in case.residuals if not isinstance(r, AtFirstState)]
        packed(([case.configured for case in study.cases], residuals))
        if isinstance(executor, Cluster):
            executor.check(lambda: progress.step(f"waiting for a worker of {executor.words}", 0, None))


def executor_of(study: Study, *, reduced: bool = False) -> Executor:
    """Processes for large models, this process for small ones, unless [parallel] says which.

    Parameters
    ----------
    reduced : whether the runs are on reduced models, which are small; processes are started only if [parallel] says so
    """
    table = study.file.parallel
    if table.how == "cluster":
        return Cluster(table.address, table.remote)
    large = not reduced and max((c.configured.n_free for c in study.cases), default=0) > LARGE
    if table.how == "processes" or (table.how == "auto" and (large or table.workers > 1)):
        return Processes(table.workers)
    return Serial()
