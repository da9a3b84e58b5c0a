"""Modes without a partner, all configurations in one table each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.report.document import Block, Cell, Paragraph, Table, columns, row
from femtune.report.numbers import NONE, counted, freq, unit_fraction
from femtune.report.source import STAGE_HEADS, Source
from femtune.study.results_correlation import CorrelationResults

_Row = tuple[str, int, dict[str, float], CorrelationResults]
"""Configuration, number, frequency by stage, and the last stage where a mode has no partner."""

ABOVE = 1.2
"""Model modes up to so many times the highest test mode are listed one by one."""


def unpaired_test(source: Source, names: list[str]) -> list[Block]:
    """Test modes without a partner with the reason; stages with the same reason share a row."""
    found: dict[tuple[str, str, float, str], list[str]] = {}
    for name in names:
        for stage in source.shown(name):
            for m in stage.unpaired_test:
                key = (name, m.test_label, m.test_freq_hz, m.reason)
                found.setdefault(key, []).append(STAGE_HEADS[stage.stage])
    rows = [
        row(name, label, freq(hz), " and ".join(stages), reason) for (name, label, hz, reason), stages in found.items()
    ]
    heads = columns("Configuration", "Test mode", ">Hz", "When", "Reason")
    return [Table("Test modes without a partner", heads, tuple(rows))] if rows else []


def unpaired_model(source: Source, names: list[str]) -> list[Block]:
    """Model modes without a partner by configuration and number: those that a test up to its highest mode could show.

    How many lie higher is said, and rigid-body motions share a line.
    """
    found = [_model_rows(source.shown(name)) for name in names]
    near = [r for rows in found for r in rows if _in_range(r)]
    if not any(found):
        return []
    heads = columns("Configuration", ">Model mode", ">Hz before", ">Hz after", "Remark")
    notes = [note for rows in found for note in _notes(rows)]
    table = Table("Model modes without a partner", heads, tuple(_plain(source, r) for r in near), " ".join(notes))
    return [table] if near else [Paragraph(f"Model modes without a partner: {note}", "muted") for note in notes]


def _in_range(entry: _Row) -> bool:
    _, number, hz, stage = entry
    return number > stage.rigid_body_modes and min(hz.values()) <= highest_hz(stage)


def highest_hz(stage: CorrelationResults) -> float:
    """Up to where model modes without a partner are listed one by one: a fifth above the highest test mode."""
    return ABOVE * max(stage.mac_test_freq_hz, default=0.0)


def _notes(rows: list[_Row]) -> list[str]:
    """What is not listed one by one, of one configuration."""
    if not rows:
        return []
    name, _, _, stage = rows[-1]
    rigid = sum(number <= stage.rigid_body_modes for _, number, *_ in rows)
    return others(name, stage, rigid, len(rows) - rigid - sum(map(_in_range, rows)))


def others(name: str, stage: CorrelationResults, rigid: int, higher: int) -> list[str]:
    """A sentence on the modes that are not listed one by one; [] where all are."""
    parts = [counted(rigid, "rigid-body motion")] if rigid else []
    parts += [f"{counted(higher, 'mode')} above {freq(highest_hz(stage))} Hz"] if higher else []
    return [f"{name}: besides, {' and '.join(parts)} without a partner."] if parts else []


def _model_rows(stages: list[CorrelationResults]) -> list[_Row]:
    """Configuration, number, frequency by stage, and the last stage where it has no partner."""
    found: dict[int, tuple[dict[str, float], CorrelationResults]] = {}
    for stage in stages:
        for m in stage.unpaired_model:
            known = found[m.model_number][0] if m.model_number in found else {}
            found[m.model_number] = (known | {STAGE_HEADS[stage.stage]: m.model_freq_hz}, stage)
    return [(stage.configuration, number, hz, stage) for number, (hz, stage) in sorted(found.items())]


def _plain(source: Source, entry: _Row) -> tuple[Cell, ...]:
    name, number, hz, stage = entry
    remark = model_mode_remark(source.array(stage.mac_key), stage, number)
    by_head = {STAGE_HEADS[s.stage]: s for s in source.shown(name)}
    cells = (_freq_or_partner(hz.get(when), by_head.get(when), number) for when in ("before", "after"))
    return row(name, str(number), *cells, remark)


def _freq_or_partner(hz: float | None, stage: CorrelationResults | None, number: int) -> Cell:
    """The frequency where the mode has no partner, else its partner at that stage."""
    if hz is not None:
        return Cell(freq(hz))
    labels = [p.test_label for p in stage.pairs if p.model_number == number] if stage else []
    return Cell(f"paired with test mode {labels[0]}" if labels else NONE, tone="muted")


def model_mode_remark(mac: NDArray[Any] | None, stage: CorrelationResults, number: int) -> str:
    """That it resembles a mode that was left out, where its MAC reaches the gate; else the reason of the results."""
    out = [m.test_label for m in stage.left_out if m.test_label in stage.mac_test_labels]
    if mac is not None and out and stage.mac_gate is not None and number in stage.mac_model_numbers:
        column = mac[:, stage.mac_model_numbers.index(number)]
        like = {label: float(column[stage.mac_test_labels.index(label)]) for label in out}
        alike = [label for label in out if np.isfinite(like[label]) and like[label] >= stage.mac_gate]
        if alike:
            return _resembles([f"{label} (MAC {unit_fraction(like[label])})" for label in alike])
    reasons = {m.model_number: m.reason for m in stage.unpaired_model}
    return reasons[number] or "no test mode answers for it"


def _resembles(labels: list[str]) -> str:
    one = len(labels) == 1
    return f"resembles test mode{'' if one else 's'} {' and '.join(labels)}, which {'was' if one else 'were'} left out"
