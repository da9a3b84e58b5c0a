"""Solutions of the step posterior, each on disk as soon as it has ended."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from femtune.executor import finish
from femtune.steps.run_folder import unwritable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.errors import Notice
    from femtune.executor import Executor
    from femtune.journal.finished import FinishedRuns
    from femtune.study.progress import Progress

T = TypeVar("T")
R = TypeVar("R")


def as_text(values: NDArray[Any]) -> str:
    """Floating-point numbers as text in a line of JSON, to the last bit."""
    return base64.b64encode(np.ascontiguousarray(values, f"<f{values.itemsize}").tobytes()).decode()


def from_text(text: str, count: int, kind: str = "<f8") -> NDArray[Any]:
    """So many finite numbers from their text (error ValueError)."""
    values = np.frombuffer(base64.b64decode(text, validate=True), kind)
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"{len(values)} numbers instead of {count}, or some that are not finite")
    return values.astype(values.dtype.newbyteorder("="))


@dataclass(eq=False)
class KeptSolutions(Generic[R]):
    """Solutions by the executor, or from the journal of an earlier run.

    Parameters
    ----------
    line, of_line : a solution as a line of the journal, and back; None for a line that cannot be read, whose solution
        is made again
    recalled : number of solutions from an earlier run
    remarks : what did not stop the runs
    """

    executor: Executor
    file: FinishedRuns
    progress: Progress
    line: Callable[[R], Mapping[str, object]]
    of_line: Callable[[Mapping[str, Any]], R | None]
    known: dict[str, R] = field(default_factory=dict)
    earlier: frozenset[str] = frozenset()
    recalled: int = 0
    remarks: list[Notice] = field(default_factory=list)

    def begin(self, resume: bool) -> None:
        """Take over what an earlier run has solved (error ``run.unwritable``)."""
        try:
            lines = self.file.begin(resume)
        except OSError as error:
            raise unwritable(self.file.path.parent, error) from error
        from_journal = ((str(line.get("run")), self.of_line(line)) for line in lines)
        self.known = {run: solved for run, solved in from_journal if solved is not None}
        self.earlier = frozenset(self.known)

    def solved(self, work: Callable[[T], R], tasks: Sequence[T], keys: Sequence[str], what: str, name: str) -> list[R]:
        """The solutions of tasks.

        Parameters
        ----------
        keys : of the tasks in the journal
        what, name : of all, for whoever waits; and of one, in messages

        Raises
        ------
        FemtuneError : ``run.unwritable``, ``executor.*``
        """
        known = {i: self.known[key] for i, key in enumerate(keys) if key in self.known}
        done = len(known)
        self.recalled += sum(key in self.earlier for key in keys)
        self.progress.step(what, done, len(keys))

        def keep(number: int, solved: R) -> None:
            nonlocal done
            try:
                # kept before it is shown: whoever shows it may be interrupted
                self.file.add({"run": keys[number], **self.line(solved)})
            except OSError as error:
                raise unwritable(self.file.path.parent, error) from error
            self.known[keys[number]] = solved
            done += 1
            self.progress.step(what, done, len(keys))

        return finish(self.executor, work, tasks, known, name=name, finished=keep, remark=self.remarks.append)
