"""Candidate models on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import AlertBox, Listing, Section
from femtune.steps.candidates.page import (
    candidate_numbers,
    candidates_verdict,
    criteria_table,
    parameter_table,
    undetermined_blocks,
)

if TYPE_CHECKING:
    from femtune.document.document import Document
    from femtune.steps.candidates.record import CandidatesResults
    from femtune.steps.info.terminal import Subject


def candidates_document(subject: Subject, found: CandidatesResults) -> Document:
    """Sentences, criteria, parameters, and what is undetermined."""
    verdict, level = candidates_verdict(found)
    alerts = tuple(AlertBox(a.level, a.code, a.sentence, a.where) for a in found.alerts)
    sections = (
        Section("candidates", "Candidate models", (candidate_numbers(found), Listing(found.sentences), *alerts)),
        Section("criteria", "Criteria", (criteria_table(found),)),
        Section("parameters", "Parameters", (parameter_table(found),)),
        Section("open", "What the data do not determine", tuple(undetermined_blocks(found.solved))),
    )
    return subject.document(verdict, level, sections)
