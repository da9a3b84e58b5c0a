"""A screening on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import Section
from femtune.steps.screen.page import (
    contribution_table,
    elementary_table,
    indices_table,
    mode_table,
    screen_verdict,
    summary_blocks,
)

if TYPE_CHECKING:
    from femtune.document.document import Document
    from femtune.steps.info.terminal import Subject
    from femtune.steps.screen.record import ScreenResults


def screen_document(subject: Subject, found: ScreenResults) -> Document:
    """Sentences, effects and modes."""
    verdict, level = screen_verdict(found)
    parts = (
        ("screen", "Effects of the parameters", summary_blocks(found)),
        ("contributions", "Contribution to the variation of each frequency in %", contribution_table(found)),
        ("elementary", "Elementary effects", elementary_table(found)),
        ("indices", "Sobol's indices", indices_table(found)),
        ("modes", "Modes", [mode_table(found)]),
    )
    sections = tuple(Section(name, title, tuple(blocks)) for name, title, blocks in parts if blocks)
    return subject.document(verdict, level, sections)
