"""Natural frequencies with effective masses, a table each configuration, and whether a mode was missed."""

from __future__ import annotations

import numpy as np

from femtune.report.document import Bar, Block, Cell, Column, Heading, Listing, Paragraph, Table, row
from femtune.report.numbers import NONE, NOT_TESTED, freq, percent, value, with_unit
from femtune.report.sections.sturm import solved_by
from femtune.report.source import Source
from femtune.study.results_model import EffectiveMasses, ModelModes

_DIRECTIONS = ("X", "Y", "Z", "RX", "RY", "RZ")
_SHOWN = 5e-5
"""Parts below this are no more than a dash: a table of zeros hides what matters."""
_NOTE = (
    "Modal effective mass: the part of the structure's mass (X, Y, Z) and inertia about its centre of gravity (RX, RY, "
    "RZ) that a mode moves when the supports move as a rigid body, in %. A dash is less than .005 %. What all modes "
    "listed leave to 100 % belongs to higher modes, and to mass on the supports themselves."
)

_FREE = (
    "The structure is free: its rigid-body motions carry all of its mass, and the modal effective mass of the other "
    "modes is nothing."
)


def natural_modes(source: Source) -> list[Block]:
    """A table each configuration; then the sentences on missed modes."""
    found = source.results.modes
    if not found:
        return [Paragraph("Modes were not solved: not run.")]
    units = _units(source.results.study.units)
    tables = [block for m in found for block in _configuration(m, len(found) > 1, units)]
    note = [Paragraph(_NOTE, "muted")] if any(m.effective_masses for m in found) else []
    return [*tables, *note, Heading("Was a mode missed?"), Listing(tuple(map(_sturm, found))), *solved_by(found)]


def _units(units: str) -> tuple[str, str]:
    """Of mass and of inertia; "" where nobody declares any."""
    length, mass, *_ = (*units.split("-"), "")
    return (mass, f"{mass}·{length}²") if mass else ("", "")


def _configuration(m: ModelModes, named: bool, units: tuple[str, str]) -> list[Block]:
    masses = m.effective_masses
    if masses is None:
        heads: tuple[Column, ...] = (Column("Mode", "right"), Column("Hz", "right"))
        return [Table(m.configuration if named else "", heads, tuple(_rows(m, None)))]
    group = "Modal effective mass, %"
    heads = (Column("Mode", "right"), Column("Hz", "right"), *(Column(d, "right", group) for d in _DIRECTIONS))
    if _is_free(m, masses):
        return [Table(m.configuration if named else "", heads[:2], tuple(_rows(m, None)), _FREE)]
    rows = [*_rows(m, masses), _sum(masses), _total(masses, units)]
    return [Table(m.configuration if named else "", heads, tuple(rows))]


def _is_free(m: ModelModes, masses: EffectiveMasses) -> bool:
    """True where the rigid-body motions carry all: a table of dashes would say no more."""
    elastic = range(m.rigid_body_modes, len(m.freq_hz))
    parts = (part or 0.0 for i in elastic for part in _parts(masses, range(i, i + 1)))
    return m.rigid_body_modes == 6 and len(elastic) > 0 and max(parts) < _SHOWN


def _rows(m: ModelModes, masses: EffectiveMasses | None) -> list[tuple[Cell, ...]]:
    """Rigid-body modes share a row: each by itself is a chance mixture of the motions that are free."""
    rigid, count = m.rigid_body_modes, len(m.freq_hz)
    rows = []
    if rigid:
        name = "1" if rigid == 1 else f"1 to {rigid}"
        rows.append(row(name, Cell("rigid body", tone="muted"), *_cells(masses, range(rigid))))
    for i in range(rigid, count):
        rows.append(row(str(i + 1), freq(m.freq_hz[i]), *_cells(masses, range(i, i + 1))))
    return rows


def _cells(masses: EffectiveMasses | None, modes: range) -> list[Cell]:
    if masses is None:
        return []
    return [_cell(part) for part in _parts(masses, modes)]


def _parts(masses: EffectiveMasses, modes: range) -> list[float | None]:
    """Sum over modes in each direction; None where the structure has no mass."""
    chosen = np.array([[np.nan if f is None else f for f in masses.fractions[i]] for i in modes]).reshape(-1, 6)
    return [None if total == 0.0 else float(part) for total, part in zip(masses.total, chosen.sum(axis=0))]


def _cell(part: float | None) -> Cell:
    if part is None or part < _SHOWN:
        return Cell(NONE, tone="muted")
    return Cell(percent(100.0 * part), Bar(0.0, min(1.0, part)))


def _sum(masses: EffectiveMasses) -> tuple[Cell, ...]:
    parts = _parts(masses, range(len(masses.fractions)))
    return row("all", Cell("sum", tone="muted"), *(Cell(percent(None if p is None else 100.0 * p)) for p in parts))


def _total(masses: EffectiveMasses, units: tuple[str, str]) -> tuple[Cell, ...]:
    mass, inertia = units
    shown = zip(masses.total, (mass,) * 3 + (inertia,) * 3)
    return row("", Cell("100 % is", tone="muted"), *(with_unit(value(t), unit) if t else NONE for t, unit in shown))


def _sturm(m: ModelModes) -> str:
    return f"{m.configuration}: {m.sturm_sentence or NOT_TESTED}."
