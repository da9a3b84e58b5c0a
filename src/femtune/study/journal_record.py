"""Number of solutions in a run, and of those taken from the journal of an earlier run."""

from __future__ import annotations

from femtune.study.record import Record


class SolutionCount(Record):
    """Solutions of one kind."""

    kind: str
    """"modes" or "derivative"."""
    solved: int
    """Number of solutions in this run."""
    recalled: int
    """Number of solutions from the journal of an earlier run."""


class JournalResults(Record):
    """Solutions of the full model, by origin."""

    solved: int
    """Number of solutions in this run."""
    recalled: int
    """Number of solutions from the journal of an earlier run."""
    kinds: tuple[SolutionCount, ...]
    """The same by kind."""
