"""From results to a document."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from femtune.report.document import Document, Paragraph, Section
from femtune.report.sections import BUILDERS
from femtune.report.short_form import short_form
from femtune.report.source import Source
from femtune.report.text_file import SectionText, section_texts
from femtune.report.verdict import verdict
from femtune.study.results import Results


def build_report(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """The report of a run as data; `arrays` by the keys that `results` refers to.

    Sections whose data are absent say so. Pictures are drawn when a renderer asks for them.
    """
    source = Source(results, arrays)
    sentence, level = verdict(source)
    sections = tuple(_section(text, source) for text in section_texts())
    return Document(results.study.title, sentence, level, _facts(results), sections, short_form(source))


def _section(text: SectionText, source: Source) -> Section:
    intro = (Paragraph(text.intro, tone="muted"),) if text.intro else ()
    return Section(text.id, text.title, (*intro, *BUILDERS[text.id](source)))


def _facts(results: Results) -> tuple[tuple[str, str], ...]:
    study, origin = results.study, results.provenance
    return (
        ("Deck", study.deck_file),
        ("Configurations", ", ".join(study.configurations)),
        ("Units", study.units),
        ("Run", f"{origin.started_at}, femtune {origin.femtune_version}"),
    )
