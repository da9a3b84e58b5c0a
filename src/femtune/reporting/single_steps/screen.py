"""A screening on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.reporting.document import Section
from femtune.reporting.sections.screen import contribution_table, mode_table, summary_blocks
from femtune.reporting.short_form import screen_verdict

if TYPE_CHECKING:
    from femtune.reporting.document import Document
    from femtune.reporting.single_steps.model import Subject
    from femtune.results.screen import ScreenResults


def screen_document(subject: Subject, found: ScreenResults) -> Document:
    """Sentences, contributions and modes."""
    verdict, level = screen_verdict(found)
    sections = (
        Section("screen", "Effects of the parameters", tuple(summary_blocks(found))),
        Section("contributions", "Contribution to the variation of each frequency in %", (contribution_table(found),)),
        Section("modes", "Modes", (mode_table(found),)),
    )
    return subject.document(verdict, level, sections)
