"""Complex modes beside the real modes that they resemble."""

from __future__ import annotations

from femtune.report.document import Block, Cell, Paragraph, Table, columns, row
from femtune.report.numbers import NONE, freq, percent, signed_percent, unit_fraction
from femtune.report.source import STAGE_WORDS, Source
from femtune.study.results_response import ComplexPole, ResponseResults

_NOTE = (
    "The phase collinearity is 1 where all points move in phase; the less, the more complex the mode. The difference "
    "is (complex − real)/real."
)
_NEARLY_REAL = 0.95


def complex_modes(source: Source) -> list[Block]:
    """A table each configuration and stage, or why there is none; [] where no FRFs were asked for."""
    found = [r for r in source.results.responses if r.frfs is not None]
    return pole_blocks(found)


def pole_blocks(found: list[ResponseResults]) -> list[Block]:
    """The tables of these records."""
    several = len(found) > 1
    blocks: list[Block] = []
    for r in found:
        name = f"{r.configuration}, {STAGE_WORDS[r.stage]}" if several else ""
        if r.poles:
            blocks.append(_table(r, name))
        else:
            blocks.append(Paragraph(f"{name or r.configuration}: no complex modes, {r.poles_reason}.", "muted"))
    return blocks


def _table(r: ResponseResults, title: str) -> Table:
    heads = columns(">No.", ">Hz", ">Damping ratio %", ">Phase collinearity", ">Real mode", ">Hz", ">Difference %")
    return Table(title, heads, tuple(_row(i + 1, p) for i, p in enumerate(r.poles)), _NOTE)


def _row(number: int, p: ComplexPole) -> tuple[Cell, ...]:
    ratio = None if p.damping_ratio is None else 100.0 * p.damping_ratio
    if p.kind == "rigid":
        return row(str(number), Cell("rigid body", tone="muted"), NONE, NONE, str(p.real_mode), NONE, NONE)
    if p.kind == "real":
        word = Cell(f"{freq(p.freq_hz)} (no oscillation)", tone="muted")
        return row(str(number), word, percent(ratio), unit_fraction(p.phase_collinearity), NONE, NONE, NONE)
    shown = Cell(unit_fraction(p.phase_collinearity), tone="poor" if p.phase_collinearity < _NEARLY_REAL else "")
    moved = 100.0 * (p.freq_hz / p.real_freq_hz - 1.0) if p.real_freq_hz > 0.0 else None
    difference = NONE if moved is None else signed_percent(moved)
    return row(str(number), freq(p.freq_hz), percent(ratio), shown, str(p.real_mode), freq(p.real_freq_hz), difference)
