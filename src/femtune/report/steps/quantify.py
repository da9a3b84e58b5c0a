"""How parameters scatter: verdict, tables."""

from __future__ import annotations

from femtune.report.document import Document, Level, Listing, Section
from femtune.report.sections.quantify import output_table, parameter_table, scatter_blocks
from femtune.report.steps.subject import Subject
from femtune.study.results_quantify import QuantifyResults


def quantify_document(subject: Subject, found: QuantifyResults) -> Document:
    """The verdict is the first sentence."""
    first, *_ = found.sentences
    level: Level = "info" if found.ok and found.agrees else "warning"
    words = tuple(b for b in scatter_blocks(found)[1:] if isinstance(b, Listing))
    how = scatter_blocks(found)[-3]
    sections = (
        Section("words", "How far it can be trusted", words),
        Section("parameters", "Scatter of the parameters", (how, parameter_table(found))),
        Section("outputs", "Forward check", (output_table(found),)),
    )
    return subject.document(first, level, sections)
