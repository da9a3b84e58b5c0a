"""Runs in threads of this process, for work that waits for other programs and computes little itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import TypeVar

from femtune.errors import FemtuneError, Notice
from femtune.executor.interface import failed, nothing, of_run, usable_cores

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Threads:
    """As many runs at a time as there are threads.

    Parameters
    ----------
    workers : how many; one a core that this process may use where it is zero

    Examples
    --------
    >>> Threads(2).run(abs, [-1, 2, -3])
    [1, 2, 3]
    """

    workers: int = 0

    @property
    def words(self) -> str:
        """Name in results and reports."""
        number = self.workers or usable_cores()
        return f"{number} run{'' if number == 1 else 's'} at a time on this machine"

    def run(
        self,
        work: Callable[[T], R],
        tasks: Sequence[T],
        *,
        name: str = "run",
        finished: Callable[[int, R], None] = nothing,
        remark: Callable[[Notice], None] = nothing,
    ) -> list[R]:
        """See `Executor`."""
        results: dict[int, R] = {}
        pool = ThreadPoolExecutor(self.workers or usable_cores())
        try:
            places = {pool.submit(work, task): i for i, task in enumerate(tasks)}
            for future in as_completed(places):
                at = places[future]
                try:
                    results[at] = future.result()
                except FemtuneError as error:
                    raise of_run(error, name, at) from error
                except Exception as error:
                    raise failed(name, at, f"{type(error).__name__}: {error}") from error
                finished(at, results[at])
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
        return [results[i] for i in range(len(tasks))]
