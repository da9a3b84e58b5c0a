"""Natural frequencies of all configurations side by side, on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import Cell, Column, Listing, Section, Table, column_groups, columns, row
from femtune.document.numbers import NONE, NOT_TESTED, freq
from femtune.steps.modes.page.modes import MESH_HEADS, mesh_cells, mesh_sentences, solved_by, sturm_verdict

if TYPE_CHECKING:
    from femtune.document.document import Block, Document
    from femtune.steps.info.record.model import ModelModes
    from femtune.steps.report_source import Subject


_RIGID = "rigid body"
_MODE = "Mode"


def modes_document(subject: Subject, modes: Sequence[ModelModes]) -> Document:
    """One table of frequencies and a sentence each configuration that says whether a mode was missed."""
    verdict, level = sturm_verdict(modes)
    counts = Listing(tuple(f"{m.configuration}: {_sturm(m)}." for m in modes))
    alerts = alert_boxes(a for m in modes for a in m.alerts)
    mesh = mesh_sentences(modes)
    blocks: list[Block] = [*alerts, *_tables(modes), counts, *mesh, *solved_by(modes)]
    return subject.document(verdict, level, [Section("modes", "Natural frequencies, Hz", tuple(blocks))])


def _tables(modes: Sequence[ModelModes]) -> list[Block]:
    names = [m.configuration for m in modes]
    by_name = {m.configuration: m for m in modes}
    return [_table([by_name[n] for n in group]) for group in column_groups(names, len(_MODE), len(_RIGID))]


def _table(modes: Sequence[ModelModes]) -> Table:
    heads = (Column(_MODE, "right"), *(Column(m.configuration, "right") for m in modes))
    most = max(len(m.freq_hz) for m in modes)
    mesh = modes[0].mesh if len(modes) == 1 else None
    if mesh is None or not mesh.modes:
        return Table("", heads, tuple(row(str(i + 1), *(_cell(m, i) for m in modes)) for i in range(most)))
    heads += columns(*(f">{head}" for head in MESH_HEADS))
    rows = (row(str(i + 1), _cell(modes[0], i), *mesh_cells(mesh, i + 1)) for i in range(most))
    return Table("", heads, tuple(rows))


def _cell(m: ModelModes, i: int) -> Cell:
    if i >= len(m.freq_hz):
        return Cell(NONE, tone="muted")
    return Cell(_RIGID, tone="muted") if i < m.rigid_body_modes else Cell(freq(m.freq_hz[i]))


def _sturm(m: ModelModes) -> str:
    return m.sturm_sentence or NOT_TESTED
