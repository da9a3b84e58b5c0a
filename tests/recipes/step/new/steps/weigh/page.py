"""Mass properties on a page and on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import Section, Table, columns, row
from femtune.document.numbers import value

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.report_source import ReportSource, Subject
    from femtune.steps.weigh.record import WeighResults


def weigh_verdict(found: WeighResults) -> tuple[str, Level]:
    """Whether the masses are within the budget."""
    if not found.configurations:
        return "Not tested: the model has no structure.", "warning"
    heaviest = max(found.configurations, key=lambda c: c.mass)
    mass = f"{heaviest.configuration}: mass {value(heaviest.mass)}"
    if found.budget is None:
        return f"{mass}, no budget is stated.", "info"
    return f"{mass} of {value(found.budget)}.", "info" if found.within else "problem"


def weigh_masses(source: ReportSource) -> list[Block]:
    """The table of masses."""
    assert source.results.weigh is not None
    return [_table(source.results.weigh)]


def weigh_document(subject: Subject, found: WeighResults) -> Document:
    """The table of masses on the terminal."""
    verdict, level = weigh_verdict(found)
    return subject.document(verdict, level, [Section("weigh", "Mass properties", (_table(found),))])


def _table(found: WeighResults) -> Table:
    heads = columns("Configuration", ">Mass", ">X", ">Y", ">Z", ">Ixx", ">Iyy", ">Izz")
    rows = tuple(
        row(c.configuration, value(c.mass), *map(value, (*c.centre, *c.moments))) for c in found.configurations
    )
    about = ", ".join(map(value, found.about))
    return Table("", heads, rows, note=f"X, Y, Z: centre of gravity. Moments of inertia about ({about}).")
