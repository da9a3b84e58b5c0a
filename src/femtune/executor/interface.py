"""The interface of executors, and the one that makes run after run in this process.

A run is ``work(task)``. The work holds what all runs share and must not change from run to run; a task is small: the
number of the run, or a start. What a run returns depends on both only, so that neither the order of the runs nor the
executor matters.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from femtune.errors import FemtuneError, Notice

T = TypeVar("T")
R = TypeVar("R")


def nothing(*_: object) -> None:
    """Ignores what it is told."""


class Executor(Protocol):
    """Makes runs that do not depend on each other."""

    @property
    def words(self) -> str:
        """Name in results and reports."""
        ...

    def run(
        self,
        work: Callable[[T], R],
        tasks: Sequence[T],
        *,
        name: str = "run",
        finished: Callable[[int, R], None] = nothing,
        remark: Callable[[Notice], None] = nothing,
    ) -> list[R]:
        """Results of the runs, in the order of the tasks.

        Parameters
        ----------
        name : what a run is called in messages; its number follows
        finished : is called with the position and the result of every run when it ends, in the order in which they end
        remark : is called with what did not stop the runs, such as a worker that died

        Raises
        ------
        FemtuneError : the first error of a run, with the run in its values; ``executor.failed`` for other exceptions
        """
        ...


@dataclass(frozen=True)
class Serial:
    """Run after run in this process.

    Examples
    --------
    >>> Serial().run(abs, [-1, 2, -3])
    [1, 2, 3]
    """

    words: str = "one run after another"

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
        results = []
        for i, task in enumerate(tasks):
            try:
                results.append(work(task))
            except FemtuneError as error:
                raise of_run(error, name, i) from error
            except Exception as error:
                raise failed(name, i, f"{type(error).__name__}: {error}") from error
            finished(i, results[-1])
        return results


def of_run(error: FemtuneError, name: str, position: int) -> FemtuneError:
    """The error with the run in its values."""
    error.values = {name: position + 1, **error.values}
    return error


def failed(name: str, position: int, reason: str) -> FemtuneError:
    """The error that a run ended in an exception that is none of femtune's."""
    return FemtuneError("executor.failed", run=f"{name} {position + 1}", reason=reason)


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def finish(
    executor: Executor,
    work: Callable[[T], R],
    tasks: Sequence[T],
    known: Mapping[int, R],
    *,
    name: str = "run",
    finished: Callable[[int, R], None] = nothing,
    remark: Callable[[Notice], None] = nothing,
) -> list[R]:
    """As `Executor.run`, without the runs that are known by their position; `finished` is not told of these.

    Examples
    --------
    >>> finish(Serial(), abs, [-1, 2, -3], {0: 1}, finished=lambda i, r: print(i, r))
    1 2
    2 3
    [1, 2, 3]
    """
    left = [i for i in range(len(tasks)) if i not in known]

    def tell(position: int, result: R) -> None:
        finished(left[position], result)

    new: Mapping[int, Any] = dict(
        zip(left, executor.run(work, [tasks[i] for i in left], name=name, finished=tell, remark=remark))
    )
    return [known[i] if i in known else new[i] for i in range(len(tasks))]
