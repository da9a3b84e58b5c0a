"""The comparison of test and model on the terminal: pairs, unpaired modes, MAC, criteria for each configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.document.document import Cell, Paragraph, Section, Table, columns, row
from femtune.document.numbers import NONE, as_sentence, freq, listed, signed_percent, typeset, unit_fraction
from femtune.steps.correlate.page.compared import placement_blocks
from femtune.steps.correlate.page.correlation import (
    contribution_table,
    dropped_sensors,
    highest_hz,
    model_mode_remark,
    others,
    pair_places,
    shown_columns,
)
from femtune.steps.correlate.page.expansion import expansion_table
from femtune.steps.modes.page.modes import cluster_paragraphs, mac_cell, pair_remark
from femtune.steps.report_source import left_out_modes, scores_of
from femtune.steps.run.page.short_form import agreement
from femtune.steps.validate.page import criterion_cells, tested, untested

if TYPE_CHECKING:
    from femtune.document.document import Block, Document
    from femtune.steps.correlate.record.correlation import CorrelationResults, ModePairRecord
    from femtune.steps.report_source import Subject


Arrays = Mapping[str, NDArray[Any]]

_MOST_MATRIX_COLUMNS = 15
"""Columns of a matrix that fit a terminal of 100 columns."""

_MOST_COMAC_VALUES = 5
"""Lowest values of COMAC that are listed; low values point to wrong sensors, high ones say nothing."""


def correlation_document(subject: Subject, correlations: Sequence[CorrelationResults], arrays: Arrays) -> Document:
    """The comparison; `arrays` by the keys that the records refer to."""
    sections = [Section(c.configuration, c.configuration, tuple(_configuration(c, arrays))) for c in correlations]
    out = Section("left_out", "Left out by the study", tuple(_left_out(correlations)))
    verdict = agreement(scores_of(correlations))
    return subject.document(as_sentence(verdict), "info", [*sections, out])


def _left_out(correlations: Sequence[CorrelationResults]) -> list[Block]:
    """Each reason once."""
    left_out = left_out_modes(correlations)
    rows = [row(", ".join(m.configurations), ", ".join(m.labels), m.reason) for m in left_out]
    return [Table("", columns("Configurations", "Test modes", "Reason"), tuple(rows))] if rows else []


def _configuration(c: CorrelationResults, arrays: Arrays) -> list[Block]:
    return [
        *_pairs(c),
        *cluster_paragraphs(c),
        *_unpaired_test(c),
        *_unpaired_model(c, arrays),
        *_mac(c, arrays),
        _comac(c),
        *contribution_table(c, most=5),
        *placement_blocks(c),
        *_orthogonality(c, arrays),
        *(expansion_table(c, c.expansion) if c.expansion is not None else []),
        *_criteria(c),
    ]


def _pairs(c: CorrelationResults) -> list[Block]:
    heads = columns("Test mode", ">Hz", ">Model mode", ">Hz", ">Error %", ">MAC", "Remark")
    rows = tuple(_pair(p) for p in c.pairs)
    return [Table("Pairs", heads, rows)] if rows else [Paragraph("No test mode could be paired.", "poor")]


def _pair(p: ModePairRecord) -> tuple[Cell, ...]:
    return row(
        p.test_label, freq(p.test_freq_hz), str(p.model_number), freq(p.model_freq_hz),
        signed_percent(p.freq_error_percent), mac_cell(p.mac), Cell(pair_remark([p]), tone="muted"),
    )  # fmt: skip


def _unpaired_test(c: CorrelationResults) -> list[Block]:
    rows = tuple(row(m.test_label, freq(m.test_freq_hz), m.reason) for m in (*c.unpaired_test, *c.suspension))
    return [Table("Test modes without a partner", columns("Test mode", ">Hz", "Reason"), rows)] if rows else []


def _unpaired_model(c: CorrelationResults, arrays: Arrays) -> list[Block]:
    mac = arrays[c.mac_key] if c.mac_key else None
    rows = tuple(
        row(str(m.model_number), freq(m.model_freq_hz), model_mode_remark(mac, c, m.model_number))
        for m in c.unpaired_model
        if c.rigid_body_modes < m.model_number and m.model_freq_hz <= highest_hz(c)
    )
    rigid = sum(m.model_number <= c.rigid_body_modes for m in c.unpaired_model)
    note = " ".join(others(c.configuration, c, rigid, len(c.unpaired_model) - rigid - len(rows)))
    if rows:
        return [Table("Model modes without a partner", columns(">Model mode", ">Hz", "Remark"), rows, note)]
    return [Paragraph(note, "muted")] if note else []


def _mac(c: CorrelationResults, arrays: Arrays) -> list[Block]:
    if c.mac_key is None:
        return [Paragraph("MAC: not tested, the test has no mode shapes.", "muted")]
    return [_matrix("MAC, test modes by model modes", c, arrays[c.mac_key])]


def _orthogonality(c: CorrelationResults, arrays: Arrays) -> list[Block]:
    """Of the paired modes, or why not."""
    if c.cross_orthogonality_key is None:
        why = f" ({c.cross_orthogonality_reason})" if c.cross_orthogonality_reason else ""
        return [Paragraph(f"Cross-orthogonality: not tested{why}.", "muted")]
    matrix = _matrix("Cross-orthogonality of the pairs", c, arrays[c.cross_orthogonality_key], paired=True)
    return [matrix, *dropped_sensors(c)]


def _matrix(title: str, c: CorrelationResults, values: NDArray[Any], paired: bool = False) -> Block:
    """Two digits, pairs marked; `paired` leaves out the modes without a partner."""
    framed = pair_places(c)
    rows = sorted({i for i, _ in framed}) if paired else list(range(values.shape[0]))
    cols = sorted({j for _, j in framed}) if paired else shown_columns(c)
    if len(cols) > _MOST_MATRIX_COLUMNS:
        return Paragraph(f"{title}: {len(rows)} by {len(cols)}, too wide for a terminal; the report shows it.", "muted")
    heads = columns("", *(f">{c.mac_model_numbers[j]}" for j in cols))
    lines = [row(c.mac_test_labels[i], *(_entry(values[i, j], (i, j) in framed) for j in cols)) for i in rows]
    return Table(title, heads, tuple(lines))


def _entry(number: float, framed: bool) -> Cell:
    text = typeset(f"{number:.2f}").replace("−0.00", "0.00") if np.isfinite(number) else NONE
    return Cell(text, tone="good" if framed else "")


def _comac(c: CorrelationResults) -> Block:
    if not c.comac:
        return Paragraph("COMAC: not tested (at least two paired modes with shapes are required).", "muted")
    lowest = sorted(c.comac, key=lambda entry: entry.comac)[:_MOST_COMAC_VALUES]
    words = listed(f"{unit_fraction(entry.comac)} at {entry.dof}" for entry in lowest)
    return Paragraph(f"COMAC, lowest of {len(c.comac)} DOFs: {words}.")


def _criteria(c: CorrelationResults) -> list[Block]:
    heads = columns("Criterion", ">Required", ">Measured", "Verdict", "Remark")
    rows = tuple(criterion_cells(criterion) for criterion in tested(c.criteria))
    table: list[Block] = [Table("Criteria", heads, rows)] if rows else []
    missing = [
        Paragraph(f"Not tested: {'; '.join(names)}{f' ({reason})' if reason else ''}.", "muted")
        for reason, names in untested(c.criteria).items()
    ]
    return [*table, *missing] or [Paragraph("Criteria: not tested.", "muted")]
