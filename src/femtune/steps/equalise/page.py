"""Measured damping on the modes of the updated model, and FRFs of test and model with it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.document import Cell, Figure, Paragraph, Table, columns, row
from femtune.document.figures.frfs import FrfCurve, FrfPanel, frfs_svg
from femtune.document.numbers import NONE, freq, percent, short, unit_fraction

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.equalise.record import MappedDamping, MappedMode
    from femtune.steps.report_source import ReportSource

_MOST_PANELS = 6
"""FRFs in the figure, the largest ones first: they must stay large enough to be compared."""
_LOW_MAC = 0.9
"""MAC below which a pair is marked.

A model mode with a lower MAC is commonly not accepted as the measured one, so that the damping ratio may belong to
another mode.
"""


def measured_damping(source: ReportSource) -> list[Block]:
    """A table and a picture each configuration; a sentence for studies without [equalise]."""
    records = source.results.mapped_damping
    if not records:
        return [
            Paragraph("Not tested: the study has no [equalise], or no mode of the updated model is paired.", "muted")
        ]
    return [
        block for one in records for block in (damping_table(one), Paragraph(_deviations(one)), *_figure(source, one))
    ]


def damping_table(mapped: MappedDamping) -> Table:
    """Pairs of modes with their damping ratios."""
    heads = columns(">Test Hz", ">Mode", ">Model Hz", ">MAC", ">Measured ζ %", ">Update ζ %", ">Mapped ζ %", "Remark")
    equal = percent(mapped.equalised_percent)
    note = (
        "Update: the damping ratio of test and model in the update. Mapped: that of the modes of the updated model in "
        "the picture; modes without partner have the median of the measured ones."
    )
    return Table(
        f"{mapped.configuration}: damping of the modes", heads, tuple(_row(m, equal) for m in mapped.modes), note
    )


def _row(m: MappedMode, equal: str) -> tuple[Cell, ...]:
    mac = Cell(unit_fraction(m.mac, NONE), tone="poor" if m.mac is not None and m.mac < _LOW_MAC else "")
    remark = m.reason or _remark(m)
    return row(
        freq(m.test_hz), NONE if m.mode is None else str(m.mode), freq(m.model_hz), mac,
        short(m.measured_percent), equal, short(m.mapped_percent), Cell(remark, tone="muted"),
    )  # fmt: skip


def _remark(m: MappedMode) -> str:
    """What is said of a mode that was found later, or has no partner."""
    if m.found_hz is not None:
        return "found near the mode of the model"
    if m.test_hz is not None:
        return ""
    return "no partner in the test" + (f", should be seen in {m.seen_in} FRFs" if m.seen_in else "")


def _deviations(mapped: MappedDamping) -> str:
    before = "not known, since no mode is paired" if mapped.deviation_before is None else short(mapped.deviation_before)
    return (
        f"Deviation δ from the measured FRFs: model before the update {before}, after it "
        f"{short(mapped.deviation_after)}, identified test {short(mapped.deviation_identified)}."
    )


def _figure(source: ReportSource, mapped: MappedDamping) -> list[Block]:
    keys = (
        ("test", mapped.test_values_key), ("before", mapped.before_values_key), ("after", mapped.after_values_key),
        ("identified", mapped.identified_values_key),
    )  # fmt: skip
    lines = source.array(mapped.freq_key)
    values = {look: v for look, key in keys if key and (v := source.array(key)) is not None}
    if lines is None or "test" not in values:
        return []
    # the largest functions, one after another
    size = np.nanmax(np.abs(values["test"]), axis=2)
    order = np.argsort(-size, axis=None, kind="stable")[:_MOST_PANELS]
    panels = []
    for i, j in (np.unravel_index(k, size.shape) for k in order):
        curves = tuple(FrfCurve(look, lines, v[i, j]) for look, v in values.items())
        panels.append(FrfPanel(f"{mapped.outputs[i]} by {mapped.inputs[j]}", mapped.kind, curves))
    caption = (
        "Measured FRFs, identified test, and model before and after the update with the measured damping of the paired "
        "modes. Magnitude (logarithmic) and phase over frequency."
    )
    alt = f"FRFs of {mapped.configuration}: {'; '.join(p.title for p in panels)}"
    return [Figure(partial(frfs_svg, panels), caption, alt, wide=True)]
