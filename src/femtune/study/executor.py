"""The executor that a study asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.executor import Cluster, Processes, Serial

if TYPE_CHECKING:
    from femtune.assembly.study import Study
    from femtune.executor import Executor

LARGE = 3000
"""Free DOFs of the largest configuration above which runs take longer than the start of processes."""


def executor_of(study: Study) -> Executor:
    """Processes for large models, this process for small ones, unless [parallel] says which."""
    table = study.file.parallel
    if table.how == "cluster":
        return Cluster(table.address, table.remote)
    large = max((c.configured.n_free for c in study.cases), default=0) > LARGE
    if table.how == "processes" or (table.how == "auto" and (large or table.workers > 1)):
        return Processes(table.workers)
    return Serial()
