"""Frequency errors beside the repeatability of the test."""

from __future__ import annotations

from femtune.study.record import Record


class FrequencyScatter(Record):
    """Frequency errors of the pairs after the update beside the scatter of the test's frequencies, over the pairs whose
    scatter the test or [validate] states."""

    pairs: int
    """Number of these pairs."""
    error_percent: float
    """Root mean square of (model − test)/test, in %."""
    test_percent: float
    """Root mean square of the relative standard deviation of the test's frequencies, in %."""
    limit_percent: float | None
    """Frequency error that the criteria of the study allow, in %; None without such a criterion."""
