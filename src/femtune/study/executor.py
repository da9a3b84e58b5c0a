"""The executor that a study asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.assembly.error_places import errors_at
from femtune.executor import Cluster, Processes, Serial

if TYPE_CHECKING:
    from femtune.assembly.study import Study
    from femtune.executor import Executor

LARGE = 3000
"""Free DOFs of the largest configuration above which runs take longer than the start of processes."""


def check_executor(study: Study) -> None:
    """Connect to the cluster, if the study names one, before anything is solved; for steps that make runs.

    Raises
    ------
    FemtuneError : ``executor.not-loopback``, ``executor.no-cluster``, ``install.missing``
    """
    executor = executor_of(study)
    if isinstance(executor, Cluster):
        with errors_at(study.file.where("parallel")):
            executor.check()


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
