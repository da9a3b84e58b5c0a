"""What the sections read: the results, their arrays, and the few sums that several sections need."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.study.results import Results
from femtune.study.results_base import Stage
from femtune.study.results_correlation import CorrelationResults, PairedMode

STAGE_WORDS: dict[Stage, str] = {
    "before": "before the update",
    "after": "after the update",
    "after as written": "after the update, as written to the deck",
}


@dataclass(frozen=True)
class Scores:
    """How well paired modes agree: errors in %, the MAC of the worst pair; None where there is nothing to say."""

    pairs: int
    mean_error_percent: float | None
    worst_error_percent: float | None
    worst_label: str
    lowest_mac: float | None
    lowest_label: str


@dataclass(frozen=True)
class Source:
    """Results with their arrays by key."""

    results: Results
    arrays: Mapping[str, NDArray[Any]]

    def array(self, key: str | None) -> NDArray[Any] | None:
        """The array called `key`; None without a key."""
        return None if key is None else self.arrays[key]

    def at(self, configuration: str, stage: Stage) -> CorrelationResults | None:
        """The comparison of one configuration at one stage."""
        found = (c for c in self.results.correlations if (c.configuration, c.stage) == (configuration, stage))
        return next(found, None)

    def before(self, configuration: str) -> CorrelationResults | None:
        """The comparison before the update."""
        return self.at(configuration, "before")

    def after(self, configuration: str) -> CorrelationResults | None:
        """The comparison with the values that were written, else with those of the update."""
        return self.at(configuration, self.final_stage)

    @property
    def final_stage(self) -> Stage:
        """The last stage that was solved."""
        written = any(c.stage == "after as written" for c in self.results.correlations)
        return "after as written" if written else "after"

    def scores(self, stage: Stage) -> Scores | None:
        """Scores over all configurations; None where that stage was not solved."""
        found = [c for c in self.results.correlations if c.stage == stage]
        return _scores([(c.configuration, pair) for c in found for pair in c.pairs]) if found else None


def _scores(pairs: list[tuple[str, PairedMode]]) -> Scores:
    if not pairs:
        return Scores(0, None, None, "", None, "")
    configuration, worst = max(pairs, key=lambda p: abs(p[1].freq_error_percent))
    mean = float(np.mean([abs(p.freq_error_percent) for _, p in pairs]))
    mac, label = _lowest((p.mac, f"{c} mode {p.test_label}") for c, p in pairs if p.mac is not None)
    return Scores(len(pairs), mean, worst.freq_error_percent, f"{configuration} mode {worst.test_label}", mac, label)


def _lowest(values: Iterable[tuple[float, str]]) -> tuple[float | None, str]:
    return min(values, default=(None, ""))


def stages(source: Source) -> tuple[Stage, ...]:
    """The stages that the report shows: before, and the last one where there is one."""
    return ("before", source.final_stage) if source.scores(source.final_stage) else ("before",)
