"""The end of an update beside the runs that its model was fitted to."""

from __future__ import annotations

from femtune.study.record import Record


class OutsideRuns(Record):
    """A variable whose value at the end of the update lies outside its runs."""

    parameter: str
    """Name of the variable."""
    value: float
    """Its value."""
    low: float
    """Least value in the runs."""
    high: float
    """Largest value in the runs."""


class CoverageResults(Record):
    """Where the end of an update lies in the runs of its model."""

    outside: tuple[OutsideRuns, ...]
    """Variables outside the range of the runs."""
    frequency_sd_percent: float | None = None
    """Largest standard deviation of a frequency that the surrogate states at the end, in % of the frequency; None for
    models that state none."""
    mode: int | None = None
    """Number of the mode that it belongs to."""
    limit_percent: float
    """`tolerance` of [runs], in %."""
