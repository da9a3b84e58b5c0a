"""Many runs side by side: each point once, and none that the journal has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from femtune.errors import FemtuneError, Notice
from femtune.executor import Executor
from femtune.executor.interface import nothing
from femtune.runs.external import Solver, Values
from femtune.runs.outcome import RunOutcome
from femtune.runs.process import begin_runs, end_all


class RunKeeper(Protocol):
    """What keeps outcomes by their key; see `femtune.journal.runs`."""

    def recall(self, key: str) -> RunOutcome | None:
        """The outcome of a key, None where it is not known."""
        ...

    def keep(self, outcome: RunOutcome) -> None:
        """Keep an outcome."""
        ...


@dataclass(frozen=True)
class Evaluated:
    """Outcomes in the order of the points.

    Parameters
    ----------
    outcomes : of the points
    started : number of runs that were made now; the others were known, or are the same as another one
    """

    outcomes: tuple[RunOutcome, ...]
    started: int

    @property
    def failed(self) -> tuple[int, ...]:
        """Positions of points without modes."""
        return tuple(i for i, outcome in enumerate(self.outcomes) if outcome.modes is None)


def evaluate(
    solver: Solver,
    points: Sequence[Values],
    executor: Executor,
    keeper: RunKeeper | None = None,
    *,
    finished: Callable[[int, RunOutcome], None] = nothing,
    remark: Callable[[Notice], None] = nothing,
) -> Evaluated:
    """Run the solver at points.

    Parameters
    ----------
    points : values by name
    executor : makes the runs; how many at a time is its limit
    keeper : what was kept is not run again, failures neither
    finished : is called with the number of runs that have ended, and the outcome of each

    Raises
    ------
    FemtuneError : ``external.no-program``, ``external.folder``, ``external.placeholder``, ``external.changed`` for
        input files that were changed meanwhile, ``executor.*``
    """
    solver.check()
    solver.clean()
    begin_runs()
    keys = [solver.key(values) for values in points]
    known: dict[str, RunOutcome] = {}
    for key in dict.fromkeys(keys):
        outcome = None if keeper is None else keeper.recall(key)
        if outcome is not None:
            known[key] = outcome
    first = {key: i for i, key in reversed(list(enumerate(keys)))}
    wanted = [key for key in dict.fromkeys(keys) if key not in known]

    def keep(at: int, outcome: RunOutcome) -> None:
        if keeper is not None:
            keeper.keep(outcome)
        if outcome.key != wanted[at]:
            raise FemtuneError("external.changed")
        known[outcome.key] = outcome
        finished(len(known), outcome)

    try:
        executor.run(solver.run, [points[first[key]] for key in wanted], name="run", finished=keep, remark=remark)
    except BaseException:
        end_all()
        raise
    finally:
        solver.clean()
    return Evaluated(tuple(known[key] for key in keys), len(wanted))
