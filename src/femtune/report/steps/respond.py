"""Responses on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from femtune.report.document import AlertBox, Block, Document, Paragraph, Section
from femtune.report.numbers import counted
from femtune.report.sections.complex_modes import pole_blocks
from femtune.report.sections.responses import frf_table, how, ordered_pairs
from femtune.report.sections.static_loads import load_blocks
from femtune.report.steps.subject import Subject
from femtune.report.verdict import responses_verdict
from femtune.study.results_response import ResponseResults

_ROWS = 24


def responses_document(subject: Subject, found: Sequence[ResponseResults]) -> Document:
    """Peaks of the functions, complex modes, displacements."""
    verdict, level = responses_verdict(found)
    blocks = [b for r in found for b in _functions(r, len(found) > 1)]
    sections = (
        Section("functions", "Frequency responses", tuple(blocks)),
        Section("poles", "Complex modes", tuple(pole_blocks([r for r in found if r.frfs is not None]))),
        Section("loads", "Static loads", tuple(load_blocks(list(found), subject.length_unit))),
    )
    return subject.document(verdict, level, sections)


def _functions(r: ResponseResults, named: bool) -> list[Block]:
    if r.frfs is None:
        return []
    order = ordered_pairs(r.frfs)
    name = f"{r.configuration}. " if named else ""
    alerts = [AlertBox(a.level, a.code, a.sentence, a.where) for a in r.alerts]
    more = len(order) - _ROWS
    rest = [Paragraph(f"and {counted(more, 'more function')} in --json and --report", "muted")] if more > 0 else []
    return [*alerts, Paragraph(name + how(r.frfs)), frf_table([r], order[:_ROWS]), *rest]
