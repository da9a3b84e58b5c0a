"""Intervals on a page and on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import Listing, Section, Table, columns, row
from femtune.document.numbers import NONE, value

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.intervals.record import IntervalPredictions
    from femtune.steps.report_source import ReportSource, Subject


def intervals_verdict(found: IntervalPredictions) -> tuple[str, Level]:
    """The first sentence."""
    return found.sentences[0], "info" if found.ok else "warning"


def intervals_box(source: ReportSource) -> list[Block]:
    """Sentences and the box."""
    assert source.results.intervals is not None
    return [Listing(source.results.intervals.sentences), _box(source.results.intervals)]


def intervals_frequencies(source: ReportSource) -> list[Block]:
    """The extreme frequencies."""
    assert source.results.intervals is not None
    return [_frequencies(source.results.intervals)]


def intervals_document(subject: Subject, found: IntervalPredictions) -> Document:
    """Sentences, box and frequencies on the terminal."""
    verdict, level = intervals_verdict(found)
    sections = (
        Section("intervals_box", "Box of the parameters", (Listing(found.sentences), _box(found))),
        Section("intervals_frequencies", "Frequencies", (_frequencies(found),)),
    )
    return subject.document(verdict, level, sections)


def _box(found: IntervalPredictions) -> Table:
    rows = tuple(row(p.parameter, value(p.lower), value(p.upper)) for p in found.parameters)
    return Table("", columns("Parameter", ">Lower", ">Upper"), rows)


def _frequencies(found: IntervalPredictions) -> Table:
    heads = columns("Configuration", ">Frequency", ">Lowest Hz", ">Highest Hz", ">Limits Hz", "Inside the box")
    rows = tuple(
        row(
            f.configuration, str(f.mode), f"{f.lower_hz:.6g}", f"{f.upper_hz:.6g}",
            NONE if f.limits_hz is None else f"{f.limits_hz[0]:.6g} … {f.limits_hz[1]:.6g}",
            "yes" if f.inside else "no",
        )
        for f in found.frequencies
    )  # fmt: skip
    note = "Frequencies in ascending order, whatever their shape. Inside: an extreme is not at a corner of the box."
    return Table("", heads, rows, note)
