"""Section of the report: test shapes expanded to the model, with errors at left-out sensors and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.correlation.kinds import EXPANSION_METHODS
from femtune.document.document import Cell, Figure, Heading, Paragraph, Table, columns, row
from femtune.document.figures.shapes import ShapePanel, Wireframe, shapes_svg
from femtune.document.numbers import NONE, counted, freq, percent
from femtune.steps.modes.page.mode_shapes import parts_of, structure_of
from femtune.steps.report_source import VERSION_HEADS, VERSION_WORDS

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.document.document import Block
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.correlate.record.expansion import ExpandedMode, ExpansionResults
    from femtune.steps.report_source import ReportSource

_SHAPES_PER_FIGURE = 6
"""Shapes in one figure: they must stay large enough to be compared."""
_MOST_DRAWN_PARTS = 24_000
"""Lines and faces in all pictures of a configuration: the page must stay small enough to be sent."""


def expansion(source: ReportSource) -> list[Block]:
    """A table for each model version and pictures of the last one; a sentence where nothing was expanded."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    shown = {name: [c for c in source.shown(name) if c.expansion is not None] for name in names}
    blocks = [block for name, modes in shown.items() if modes for block in _configuration(source, name, modes)]
    return blocks or [Paragraph("Not computed: the study does not request an expansion (expand in [correlate]).")]


def _configuration(source: ReportSource, name: str, correlations: Sequence[CorrelationResults]) -> list[Block]:
    last = correlations[-1]
    assert last.expansion is not None
    return [
        Heading(name),
        *(block for c in correlations if c.expansion is not None for block in expansion_table(c, c.expansion)),
        *_pictures(source, last, last.expansion),
    ]


def expansion_table(comparison: CorrelationResults, record: ExpansionResults) -> list[Block]:
    """Errors of the methods mode by mode, for page and terminal."""
    methods = [e.method for e in record.modes[0].errors] if record.modes else []
    heads = columns("Test mode", ">Hz", ">At sensors", *(f">{EXPANSION_METHODS[m].label}" for m in methods))
    rows = tuple(_row(m, record.method) for m in record.modes)
    title = f"Expansion by {EXPANSION_METHODS[record.method].text}, {VERSION_HEADS[comparison.stage]}: errors in %"
    return [Table(title, heads, rows, _note(record))] if rows else []


def _row(mode: ExpandedMode, method: str) -> tuple[Cell, ...]:
    errors = (Cell(percent(e.error_percent), tone="good" if e.method == method else "") for e in mode.errors)
    return row(mode.test_label, freq(mode.test_freq_hz), percent(mode.misfit_percent), *errors)


def _note(record: ExpansionResults) -> str:
    words = "At sensors: misfit of the expanded shape at all sensors. "
    if record.groups:
        words += (
            f"Methods: error at sensors that were left out, in {counted(record.groups, 'group')}, "
            "relative to the shape. "
        )
    else:
        words += "The error at sensors that are left out is not tested: there is only one sensor. "
    modes = ", ".join(map(str, record.serep_modes)) or NONE
    words += f"SEREP uses model modes {modes}."
    unknown = {e.method for m in record.modes for e in m.errors if e.error_percent is None}
    if record.groups and unknown:
        words += f" {NONE}: the other sensors do not determine the shape"
        words += "; for SEREP use fewer modes (expand_modes)." if "serep" in unknown else "."
    return words


def _pictures(source: ReportSource, comparison: CorrelationResults, record: ExpansionResults) -> list[Block]:
    kept = [
        m
        for m in source.results.mode_shapes
        if (m.configuration, m.stage) == (comparison.configuration, comparison.stage)
    ]
    frame = structure_of(source, kept[0]) if kept and not kept[0].reason else None
    shapes, rows = source.array(record.shapes_key), source.array(record.drawn_key)
    known = [j for j, mode in enumerate(record.modes) if mode.misfit_percent is not None]
    if frame is None or shapes is None or rows is None or not known:
        return [Paragraph("The expanded shapes are not drawn.", "muted")]
    drawn = known[: max(1, _MOST_DRAWN_PARTS // parts_of(frame))]
    groups = [drawn[i : i + _SHAPES_PER_FIGURE] for i in range(0, len(drawn), _SHAPES_PER_FIGURE)]
    motion = shapes[rows, :3].astype(float)
    figures = [_figure(comparison, record, frame, motion, group, axes=group is groups[0]) for group in groups]
    left = len(known) - len(drawn)
    rest = [Paragraph(f"{counted(left, 'more expanded shape')} not drawn, to keep the page small.", "muted")]
    return [*figures, *(rest if left else [])]


def _figure(
    comparison: CorrelationResults,
    record: ExpansionResults,
    frame: Wireframe,
    motion: Reals,
    group: Sequence[int],
    *,
    axes: bool,
) -> Figure:
    titles = [f"{record.modes[j].test_label}: {freq(record.modes[j].test_freq_hz)} Hz" for j in group]
    draw = partial(_draw, frame, np.ascontiguousarray(motion[:, :, list(group)]), tuple(titles), axes)
    where = f"{comparison.configuration} {VERSION_WORDS[comparison.stage]}"
    return Figure(draw, "", f"Expanded test shapes of {where}. {'; '.join(titles)}", wide=True)


def _draw(frame: Wireframe, motion: Reals, titles: Sequence[str], axes: bool) -> str:
    return shapes_svg(frame, [ShapePanel(t, motion[:, :, k]) for k, t in enumerate(titles)], axes=axes)
