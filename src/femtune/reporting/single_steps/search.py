"""A global search on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.reporting.document import Section
from femtune.reporting.sections.search import front_table, parameter_table, seed_table, summary_blocks, surrogate_blocks
from femtune.reporting.short_form import search_verdict

if TYPE_CHECKING:
    from femtune.reporting.document import Document
    from femtune.reporting.single_steps.model import Subject
    from femtune.results.global_search import GlobalSearchResults


def search_document(subject: Subject, found: GlobalSearchResults) -> Document:
    """Numbers, parameters, seeds, surrogate."""
    verdict, level = search_verdict(found)
    front = () if found.front is None else (Section("front", "Frequencies against shapes", (front_table(found),)),)
    sections = (
        Section("search", "Global search", tuple(summary_blocks(found))),
        Section("parameters", "Parameters", (parameter_table(found),)),
        Section("seeds", "Searches", (seed_table(found),)),
        *front,
        Section("surrogate", "Surrogate", tuple(surrogate_blocks(found))),
    )
    return subject.document(verdict, level, sections)
