"""Records of what is asked of a model before it is updated."""

from __future__ import annotations

from femtune.study.results_base import Record, VerdictWord


class ModelCheck(Record):
    """An error that no parameter mends, beside what is allowed."""

    configuration: str
    """Name of the configuration."""
    check: str
    """"weighed mass", "lumped or consistent mass" or "mesh"."""
    measured: float | None
    """The error in %, with its sign; of frequencies that of the worst mode. None where not tested."""
    limit: float
    """Largest magnitude that passes, in %."""
    verdict: VerdictWord
    """Outcome."""
    sentence: str
    """What was found, or why it was not tested."""
