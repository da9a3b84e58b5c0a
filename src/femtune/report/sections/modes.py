"""Frequencies and MAC before and after, a table each configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from femtune.report.document import Bar, Block, Cell, Column, Paragraph, Table, Tone, columns, row
from femtune.report.numbers import NONE, NOT_TESTED, freq, listed, short, signed_percent, unit_fraction
from femtune.report.sections.unpaired import unpaired_model, unpaired_test
from femtune.report.source import STAGE_HEADS, Source
from femtune.study.results_base import Stage
from femtune.study.results_correlation import ClusterMatch, CorrelationResults, PairedMode

_LEFT_OUT = "reason above"


def modes(source: Source) -> list[Block]:
    """One table a configuration: before and after; then all modes without a partner."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    if not names:
        return [Paragraph("Modes were not compared: not run.")]
    scale = max([abs(p.freq_error_percent) for c in source.results.correlations for p in c.pairs], default=1.0) or 1.0
    tables = [block for name in names for block in _configuration(source, name, scale)]
    return [*tables, *source.after_notes, *unpaired_test(source, names), *unpaired_model(source, names)]


def _configuration(source: Source, name: str, scale: float) -> list[Block]:
    before, after = source.before(name), source.after(name)
    assert before is not None
    return [_table(source, name, before, after, scale), *cluster_paragraphs(after or before)]


def _table(
    source: Source, name: str, before: CorrelationResults, after: CorrelationResults | None, scale: float
) -> Block:
    heads = [*columns("Test mode", ">Hz"), *_stage_columns("before")]
    if after:
        heads += _stage_columns(after.stage)
    heads.append(Column("Remark"))
    stages = [before, after] if after else [before]
    kept = _kept(source, name)
    rows = [_row(entry, stages, scale, kept) for entry in _entries(before, after)]
    if not rows:
        return Paragraph(f"{name}: the test has no mode.")
    return Table(name, tuple(heads), tuple(rows))


def _stage_columns(stage: Stage) -> list[Column]:
    return [Column(title, "right", STAGE_HEADS[stage]) for title in ("Model no.", "Hz", "Error %", "MAC")]


@dataclass(frozen=True)
class _Entry:
    label: str
    freq_hz: float
    remark: str = ""


def _entries(before: CorrelationResults, after: CorrelationResults | None) -> list[_Entry]:
    """All test modes, sorted by frequency, each once; those left out marked."""
    stages = [before, after] if after else [before]
    found: dict[str, _Entry] = {}
    for stage in stages:
        modes_ = [*((p.test_label, p.test_freq_hz) for p in stage.pairs)]
        modes_ += [(m.test_label, m.test_freq_hz) for m in stage.unpaired_test]
        found |= {label: _Entry(label, freq_hz) for label, freq_hz in modes_}
    for out in before.left_out:
        found[out.test_label] = _Entry(out.test_label, out.test_freq_hz, _LEFT_OUT)
    return sorted(found.values(), key=lambda e: e.freq_hz)


def _kept(source: Source, name: str) -> set[str]:
    """Test modes of a configuration that the update did not see."""
    found = source.results.validation.predictions if source.results.validation else ()
    return {p.test_label for p in found if p.configuration == name and p.data}


def _row(entry: _Entry, stages: list[CorrelationResults], scale: float, kept: set[str]) -> tuple[Cell, ...]:
    pairs = [next((p for p in s.pairs if p.test_label == entry.label), None) for s in stages]
    cells = [cell for pair in pairs for cell in _pair_cells(pair, scale, bool(entry.remark))]
    tone: Tone = "muted" if entry.remark else ""
    held = "not used in the update" if entry.label in kept else ""
    remark = entry.remark or "; ".join(filter(None, (held, pair_remark(pairs))))
    return row(Cell(entry.label, tone=tone), Cell(freq(entry.freq_hz), tone=tone), *cells, Cell(remark, tone="muted"))


def _pair_cells(pair: PairedMode | None, scale: float, left_out: bool) -> list[Cell]:
    if pair is None:
        word = "left out" if left_out else "no partner"
        return [Cell(word, tone="muted"), *[Cell(NONE, tone="muted")] * 3]
    error = Cell(signed_percent(pair.freq_error_percent), error_bar(pair.freq_error_percent, scale))
    return [Cell(str(pair.model_number)), Cell(freq(pair.model_freq_hz)), error, mac_cell(pair.mac)]


def error_bar(error: float, scale: float) -> Bar:
    """From the middle to the left for negative errors, to the right for positive ones."""
    end = 0.5 + 0.5 * max(-1.0, min(1.0, error / scale))
    return Bar(min(0.5, end), max(0.5, end), 0.5)


def mac_cell(mac: float | None) -> Cell:
    """MAC with a bar; "not tested" where no shape was measured."""
    return (
        Cell(NOT_TESTED, tone="muted") if mac is None else Cell(unit_fraction(mac), Bar(0.0, max(0.0, min(1.0, mac))))
    )


def pair_remark(pairs: Sequence[PairedMode | None]) -> str:
    """What is special about the pair of a test mode, at one stage or several."""
    found = [p for p in pairs if p]
    numbers = {p.model_number for p in found}
    words = [
        "pair fixed by hand" if any(p.fixed_by_hand for p in found) else "",
        f"close modes, cluster {found[-1].cluster}" if found and found[-1].cluster is not None else "",
        "pairing changed" if len(numbers) > 1 else "",
    ]
    return ", ".join(w for w in words if w)


def cluster_paragraphs(stage: CorrelationResults) -> list[Block]:
    """A sentence each cluster of close modes."""
    return [Paragraph(_cluster(c)) for c in stage.clusters]


def _cluster(c: ClusterMatch) -> str:
    tail = f"; {c.sentence.removesuffix('.')}" if c.sentence else ""
    test, model = _named("test", c.test_labels), _named("model", [str(n) for n in c.model_numbers])
    return (
        f"Cluster {c.cluster}: {test} and {model} are close and were compared as subspaces: "
        f"largest angle between the two subspaces {short(c.angle_deg)}°{tail}."
    )


def _named(whose: str, labels: Sequence[str]) -> str:
    return f"{whose} {'mode' if len(labels) == 1 else 'modes'} {listed(labels)}"
