"""One executor for everything that repeats: starts, bootstrap runs, repeats, set-ups, external runs."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.executor.cluster import Cluster
    from femtune.executor.interface import Executor, Serial, finish
    from femtune.executor.processes import Processes
    from femtune.executor.threads import Threads
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = ["Cluster", "Executor", "Processes", "Serial", "Threads", "finish"]
