"""What a run solved, and what it took from the journal of an earlier run."""

from __future__ import annotations

from femtune.results.base import Record


class SolutionCount(Record):
    """Solutions of one kind."""

    kind: str
    """"modes" or "derivative": what was solved on the full model."""
    solved: int
    """How many this run solved."""
    recalled: int
    """How many it took from the journal of an earlier run."""


class JournalResults(Record):
    """Solutions of the full model, and where they came from."""

    solved: int
    """How many this run solved."""
    recalled: int
    """How many it took from the journal of an earlier run."""
    kinds: tuple[SolutionCount, ...]
    """The same by kind."""
