"""Tables of small masses of the test equipment: a heading, then a line for each sensor or stinger."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from femtune.errors import FemtuneError, Where, did_you_mean, each
from femtune.files.table_text import NotATable, TableText, read_table_text

_MASSES = {"mass": 0.0, "mass_g": 1e-3, "mass_kg": 1.0}
"""Headings of the mass with the size of the unit in kg; 0: the unit of the study."""
_OFFSETS = ("x", "y", "z")
_KNOWN = ("node", *_MASSES, *_OFFSETS, "label")
_MOST_LINES = 100_000
"""Lines of a table; no test has so many sensors."""


@dataclass(frozen=True)
class TableMass:
    """A mass on a grid point, in the units of the study, and the line of the table."""

    node: int
    mass: float
    offset: tuple[float, float, float]
    label: str
    line: int


def read_masses_table(path: Path, mass_unit_kg: float) -> tuple[TableMass, ...]:
    """Read a table with the columns node, mass (or mass_g, mass_kg), and if wanted x, y, z (offset) and label.

    Parameters
    ----------
    mass_unit_kg : size of the study's unit of mass

    Raises
    ------
    FemtuneError : ``configuration.masses-file``, with the line
    FemtuneErrors : of several lines
    """
    try:
        text = read_table_text(path)
    except NotATable as error:
        raise _error(path, error.line, "configuration.masses-file", reason=str(error)) from error
    if not 2 <= len(text.rows) <= _MOST_LINES:
        raise _error(path, None, "configuration.masses-file/lines", lines=len(text.rows), most=_MOST_LINES)
    heads = list(text.rows[0])
    unit = _check_heads(path, text.lines[0], heads) / mass_unit_kg or 1.0
    rows = zip(text.lines[1:], text.rows[1:])
    return tuple(each(lambda row: _mass(path, row[0], heads, row[1], unit, text), rows))


def _check_heads(path: Path, line: int, heads: list[str]) -> float:
    """The size of the unit of the masses in kg; 0 for that of the study."""
    for head in heads:
        if head not in _KNOWN or heads.count(head) > 1:
            hint = did_you_mean(head, _KNOWN)
            raise _error(path, line, "configuration.masses-file/heading", head=head[:40], hint=hint)
    given = [head for head in heads if head in _MASSES]
    if "node" not in heads or len(given) != 1:
        raise _error(path, line, "configuration.masses-file/columns")
    return _MASSES[given[0]]


def _mass(path: Path, line: int, heads: Sequence[str], cells: Sequence[str], unit: float, text: TableText) -> TableMass:
    if len(cells) != len(heads):
        raise _error(path, line, "configuration.masses-file/fields", fields=len(cells), headings=len(heads))
    row = dict(zip(heads, cells))
    node = row["node"]
    if not (node.isascii() and node.isdigit() and 0 < len(node) <= 18 and int(node)):
        raise _error(path, line, "configuration.masses-file/number", text=node[:40], head="node")
    mass = _number(path, line, text, row, next(head for head in heads if head in _MASSES))
    if mass < 0.0:
        raise _error(path, line, "configuration.masses-file/negative", mass=mass)
    x, y, z = (_number(path, line, text, row, name) for name in _OFFSETS)
    return TableMass(int(node), mass * unit, (x, y, z), row.get("label", ""), line)


def _number(path: Path, line: int, text: TableText, row: Mapping[str, str], head: str) -> float:
    cell = row.get(head, "0")
    value = text.number(cell)
    if not math.isfinite(value):
        raise _error(path, line, "configuration.masses-file/number", text=cell[:40], head=head)
    return value


def _error(path: Path, line: int | None, code: str, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), **facts)
