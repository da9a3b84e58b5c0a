"""What pages read: the results with their arrays, what a step was run on, and what several sections need."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.document.document import AlertBox, Document, Paragraph, Section

if TYPE_CHECKING:
    from femtune.document.document import Level
    from femtune.steps.correlate.record.correlation import CorrelationResults, ModePairRecord
    from femtune.steps.results import Results
    from femtune.study.record import ModelVersion


VERSION_WORDS: dict[ModelVersion, str] = {
    "before": "before the update",
    "after": "after the update",
    "after as written": "after the update",
}
VERSION_HEADS: dict[ModelVersion, str] = {"before": "before", "after": "after", "after as written": "after"}
"""For narrow places; a note says which values "after" has."""


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
class ReportSource:
    """Results with their arrays by key."""

    results: Results
    arrays: Mapping[str, NDArray[Any]]

    def array(self, key: str | None) -> NDArray[Any] | None:
        """The array called `key`; None without a key."""
        return None if key is None else self.arrays[key]

    def at(self, configuration: str, version: ModelVersion) -> CorrelationResults | None:
        """The comparison of one configuration at one model version."""
        correlations = (c for c in self.results.correlations if (c.configuration, c.stage) == (configuration, version))
        return next(correlations, None)

    def before(self, configuration: str) -> CorrelationResults | None:
        """The comparison before the update."""
        return self.at(configuration, "before")

    def after(self, configuration: str) -> CorrelationResults | None:
        """The comparison with the values that were written, else with those of the update."""
        return self.at(configuration, self.final_version)

    @property
    def final_version(self) -> ModelVersion:
        """The last model version that was solved."""
        written = any(c.stage == "after as written" for c in self.results.correlations)
        return "after as written" if written else "after"

    @property
    def after_notes(self) -> list[Paragraph]:
        """What "after" means; [] where there is nothing to explain."""
        written = self.final_version == "after as written"
        return [Paragraph("“After” refers to the model with the values of the updated deck.", "muted")] * written

    def shown(self, configuration: str) -> list[CorrelationResults]:
        """What the report shows of a configuration: before, and the last version where there is one."""
        return [c for c in (self.before(configuration), self.after(configuration)) if c is not None]

    def left_out(self) -> list[LeftOut]:
        """Modes that the study leaves out, those with the same reason and the same labels joined."""
        return left_out_modes([c for c in self.results.correlations if c.stage == "before"])

    def scores(self, version: ModelVersion) -> Scores | None:
        """Scores over all configurations; None where that version was not solved."""
        correlations = [c for c in self.results.correlations if c.stage == version]
        return scores_of(correlations) if correlations else None


@dataclass(frozen=True)
class LeftOut:
    """Modes left out for one reason: `configurations` that leave out the same `labels`."""

    configurations: tuple[str, ...]
    labels: tuple[str, ...]
    reason: str


def left_out_modes(correlations: Iterable[CorrelationResults]) -> list[LeftOut]:
    """Modes that the study leaves out, those with the same reason and the same labels joined."""
    by_reason: dict[str, dict[str, list[str]]] = {}
    for c in correlations:
        for m in c.left_out:
            by_reason.setdefault(m.reason, {}).setdefault(c.configuration, []).append(m.test_label)
    return [entry for reason, labels in by_reason.items() for entry in _joined(reason, labels)]


def _joined(reason: str, groups: Mapping[str, list[str]]) -> list[LeftOut]:
    alike: dict[tuple[str, ...], list[str]] = {}
    for configuration, labels in groups.items():
        alike.setdefault(tuple(labels), []).append(configuration)
    return [LeftOut(tuple(names), labels, reason) for labels, names in alike.items()]


def scores_of(correlations: Iterable[CorrelationResults]) -> Scores:
    """Scores over all pairs of these comparisons."""
    return _scores([(c.configuration, pair) for c in correlations for pair in c.pairs])


def _scores(pairs: list[tuple[str, ModePairRecord]]) -> Scores:
    if not pairs:
        return Scores(0, None, None, "", None, "")
    configuration, worst = max(pairs, key=lambda p: abs(p[1].freq_error_percent))
    mean = float(np.mean([abs(p.freq_error_percent) for _, p in pairs]))
    mac, label = _lowest((p.mac, f"mode {p.test_label} ({c})") for c, p in pairs if p.mac is not None)
    return Scores(len(pairs), mean, worst.freq_error_percent, f"mode {worst.test_label} ({configuration})", mac, label)


def _lowest(values: Iterable[tuple[float, str]]) -> tuple[float | None, str]:
    return min(values, default=(None, ""))


def versions(source: ReportSource) -> tuple[ModelVersion, ...]:
    """The model versions that the report shows: before, and the last one where there is one."""
    return ("before", source.final_version) if source.scores(source.final_version) else ("before",)


@dataclass(frozen=True)
class Subject:
    """Title, name of the model with the word before it, and units of length and mass; "" for a deck, which tells none.

    `has_cards` is False for a model without elements.
    """

    title: str
    deck: str
    length_unit: str
    mass_unit: str
    word: str
    has_cards: bool

    def document(self, verdict: str, level: Level, sections: Iterable[Section]) -> Document:
        """A document that has nothing but sections for the terminal."""
        return Document(self.title, verdict, level, (), (), short=tuple(s for s in sections if s.blocks))


def warnings_of(results: Results) -> tuple[Section, ...]:
    """Warnings on deck, test and update, as in the summary of a report."""
    boxes = tuple(AlertBox(a.level, a.code, a.sentence, a.where) for a in results.alerts if a.level != "info")
    return (Section("warnings", "Warnings", boxes),) if boxes else ()
