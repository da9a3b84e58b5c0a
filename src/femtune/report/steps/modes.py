"""Natural frequencies of all configurations side by side."""

from __future__ import annotations

from collections.abc import Sequence

from femtune.report.document import Block, Cell, Column, Document, Listing, Section, Table, row
from femtune.report.numbers import NONE, NOT_TESTED, freq
from femtune.report.sections.sturm import solved_by
from femtune.report.steps.layout import column_groups
from femtune.report.steps.subject import Subject
from femtune.report.verdict import sturm_verdict
from femtune.study.results_model import ModelModes

_RIGID = "rigid body"
_MODE = "Mode"


def modes_document(subject: Subject, modes: Sequence[ModelModes]) -> Document:
    """One table of frequencies and a sentence each configuration that says whether a mode was missed."""
    verdict, level = sturm_verdict(modes)
    counts = Listing(tuple(f"{m.configuration}: {_sturm(m)}." for m in modes))
    blocks: list[Block] = [*_tables(modes), counts, *solved_by(modes)]
    return subject.document(verdict, level, [Section("modes", "Natural frequencies, Hz", tuple(blocks))])


def _tables(modes: Sequence[ModelModes]) -> list[Block]:
    names = [m.configuration for m in modes]
    by_name = {m.configuration: m for m in modes}
    return [_table([by_name[n] for n in group]) for group in column_groups(names, len(_MODE), len(_RIGID))]


def _table(modes: Sequence[ModelModes]) -> Table:
    heads = (Column(_MODE, "right"), *(Column(m.configuration, "right") for m in modes))
    most = max(len(m.freq_hz) for m in modes)
    return Table("", heads, tuple(row(str(i + 1), *(_cell(m, i) for m in modes)) for i in range(most)))


def _cell(m: ModelModes, i: int) -> Cell:
    if i >= len(m.freq_hz):
        return Cell(NONE, tone="muted")
    return Cell(_RIGID, tone="muted") if i < m.rigid_body_modes else Cell(freq(m.freq_hz[i]))


def _sturm(m: ModelModes) -> str:
    return m.sturm_sentence or NOT_TESTED
