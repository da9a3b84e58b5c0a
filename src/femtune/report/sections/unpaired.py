"""Modes without a partner, all configurations in one table each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.report.document import Block, Cell, Table, columns, row
from femtune.report.numbers import NONE, freq, unit_fraction
from femtune.report.source import STAGE_HEADS, Source
from femtune.study.results_correlation import CorrelationResults


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
    """Model modes without a partner by configuration and number."""
    rows = [r for name in names for r in _model_rows(source.shown(name))]
    heads = columns("Configuration", ">Model mode", ">Hz before", ">Hz after", "Remark")
    return [Table("Model modes without a partner", heads, tuple(_plain(source, r) for r in rows))] if rows else []


def _model_rows(stages: list[CorrelationResults]) -> list[tuple[str, int, dict[str, float], CorrelationResults]]:
    """Configuration, number, frequency by stage, and the last stage where it has no partner."""
    found: dict[int, tuple[dict[str, float], CorrelationResults]] = {}
    for stage in stages:
        for m in stage.unpaired_model:
            known = found[m.model_number][0] if m.model_number in found else {}
            found[m.model_number] = (known | {STAGE_HEADS[stage.stage]: m.model_freq_hz}, stage)
    return [(stage.configuration, number, hz, stage) for number, (hz, stage) in sorted(found.items())]


def _plain(source: Source, entry: tuple[str, int, dict[str, float], CorrelationResults]) -> tuple[Cell, ...]:
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
