"""A global search on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import Section
from femtune.steps.search.page import (
    front_table,
    parameter_table,
    search_verdict,
    seed_table,
    summary_blocks,
    surrogate_blocks,
)

if TYPE_CHECKING:
    from femtune.document.document import Document
    from femtune.steps.info.terminal import Subject
    from femtune.steps.search.record import GlobalSearchResults


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
