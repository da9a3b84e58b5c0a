"""Rates with their binomial intervals beside limits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from scipy.stats import binomtest

CONFIDENCE = 0.95
"""Of the interval that decides whether a rate meets its limit."""
WIDEST = 0.2
"""Width of an interval from which it decides nothing: that of few models contains nearly every limit."""


@dataclass(frozen=True)
class Rate:
    """How many of how many."""

    count: int
    of: int

    @property
    def share(self) -> float:
        """NaN of none."""
        return self.count / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Clopper and Pearson (1934); everything is possible of none."""
        if not self.of:
            return 0.0, 1.0
        found = binomtest(self.count, self.of).proportion_ci(CONFIDENCE, method="exact")
        return float(found.low), float(found.high)

    def __str__(self) -> str:
        """In %, with the counts: "4.2 % (21 of 500)"."""
        return f"{100 * self.share:.1f} % ({self.count} of {self.of})" if self.of else "–"


def rate(hits: Iterable[bool]) -> Rate:
    """Of some answers."""
    answers = list(hits)
    return Rate(sum(answers), len(answers))


@dataclass(frozen=True)
class Criterion:
    """A rate beside its limits: it meets them if they lie inside its interval or on its right side."""

    text: str
    measured: Rate
    least: float = 0.0
    most: float = 1.0

    @property
    def met(self) -> bool:
        """False where the whole interval is on the wrong side of a limit."""
        low, high = self.measured.interval
        return high >= self.least and low <= self.most

    @property
    def decided(self) -> bool:
        """False where there are too few models for an answer; a rate that fails with few of them fails."""
        low, high = self.measured.interval
        return not self.met or high - low <= WIDEST

    @property
    def inside(self) -> bool:
        """True where the measured rate itself is within the limits."""
        return bool(self.measured.of) and self.least <= self.measured.share <= self.most

    def row(self) -> str:
        """Of the table."""
        limits = [f"≥ {100 * self.least:g} %"] if self.least > 0.0 else []
        limits += [f"≤ {100 * self.most:g} %"] if self.most < 1.0 else []
        low, high = self.measured.interval
        if not self.measured.of:
            return f"| {self.text} | – | | {', '.join(limits)} | not measured |"
        outcome = "met" if self.inside else "met within its interval" if self.met else "**not met**"
        outcome = outcome if self.decided else "too few models"
        between = f"{100 * low:.1f} to {100 * high:.1f} %"
        return f"| {self.text} | {self.measured} | {between} | {', '.join(limits)} | {outcome} |"
