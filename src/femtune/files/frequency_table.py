"""A list of measured frequencies without shapes: a text with a line for each mode."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from femtune.dofs import DofSet
from femtune.errors import FemtuneError, Where, each
from femtune.files.table_text import NotATable, TableText, read_table_text
from femtune.modal import ModeSet
from femtune.testdata import NO_GEOMETRY, ModalTest
from femtune.units import UnitSystem

_COLUMNS = {
    "freq_hz": ("freq_hz", "frequency_hz", "f_hz", "hz", "frequency", "freq"),
    "freq_sd_hz": ("freq_sd_hz", "sd_hz", "sigma_hz"),
    "freq_sd_percent": ("freq_sd_percent", "sd_percent", "sigma_percent"),
    "damping_ratio": ("damping_ratio", "damping", "zeta"),
    "mode": ("mode", "label", "name"),
}
"""Columns, each with the headings that name it, in small letters."""
_HEADINGS = {heading: column for column, headings in _COLUMNS.items() for heading in headings}
_GAPS = {"", "-", "nan", "na", "n/a"}
_LARGEST = 1_000_000
"""Bytes of a list of frequencies; ten thousand modes take half as many."""


def is_frequency_heading(heads: list[str]) -> bool:
    """Whether the headings of a table, in small letters, are those of a list of frequencies."""
    columns = [_column(head) for head in heads]
    return "freq_hz" in columns and None not in columns


def read_frequency_table(path: Path, units: UnitSystem, name: str = "") -> ModalTest:
    """The frequencies of a table, as modes at no DOF.

    Parameters
    ----------
    path : a text with a line for each mode under the headings ``mode,freq_hz,freq_sd_hz,damping_ratio``, of which only
        ``freq_hz`` is needed; ``freq_sd_percent`` may stand for ``freq_sd_hz``
    units : of the test
    name : of the test; else the name of the file

    Raises
    ------
    FemtuneError : ``test.frequencies`` in its variants, with the line
    """
    try:
        text = read_table_text(path, _LARGEST)
    except NotATable as error:
        raise _error(path, "test.frequencies", error.line, reason=str(error)) from error
    columns = [_column(head.lower()) for head in text.rows[0]]
    twice = next((column for column in columns if columns.count(column) > 1), None)
    if twice is not None:
        raise _error(path, "test.frequencies", text.lines[0], reason=f"two columns are {twice}")
    if len(text.rows) < 2:
        raise _error(path, "test.frequencies", None, reason="it has a heading and no values")
    rows = [dict(zip(columns, row)) for row in text.rows[1:]]
    for line, row in zip(text.lines[1:], text.rows[1:]):
        if len(row) != len(columns):
            raise _error(path, "test.frequencies/fields", line, fields=len(row), headings=len(columns))

    def values(column: str) -> np.ndarray:
        return np.array(each(lambda one: _value(path, text, *one, column), list(zip(text.lines[1:], rows))))

    freq_hz, sd_hz = values("freq_hz"), values("freq_sd_hz")
    damping = values("damping_ratio") if "damping_ratio" in columns else None
    if "freq_sd_percent" in columns:
        percent = values("freq_sd_percent")
        if "freq_sd_hz" in columns:
            raise _error(path, "test.frequencies", text.lines[0], reason="it has two columns of standard deviations")
        sd_hz = 0.01 * percent * freq_hz
    labels = [row.get("mode", "") or str(i) for i, row in enumerate(rows, start=1)]
    again = next((i for i, label in enumerate(labels) if label in labels[:i]), None)
    if again is not None:
        raise _error(path, "test.frequencies/twice", text.lines[1 + again], mode=labels[again][:40])
    return frequencies_alone(freq_hz, units, name or path.stem, str(path), tuple(labels), sd_hz, damping)


def frequencies_alone(
    freq_hz: np.ndarray,
    units: UnitSystem,
    name: str,
    source: str,
    labels: tuple[str, ...] = (),
    sd_hz: np.ndarray | None = None,
    damping_ratio: np.ndarray | None = None,
) -> ModalTest:
    """A test of frequencies only, (m,) each: its modes have no DOF, so that no MAC is defined."""
    known = sd_hz is not None and bool(np.isfinite(sd_hz).any())
    modes = ModeSet(
        freq_hz, np.zeros((0, len(freq_hz))), DofSet(()), labels,
        damping_ratio, freq_sd_hz=sd_hz if known else None, source=source,
    )  # fmt: skip
    return ModalTest(name=name, units=units, geometry=NO_GEOMETRY, modes=modes, source=source)


def _column(head: str) -> str | None:
    """The column that a heading names: ``Frequency [Hz]`` is frequency_hz."""
    return _HEADINGS.get(re.sub(r"[^a-z0-9]+", "_", head.strip().lower().replace("%", " percent ")).strip("_"))


def _value(path: Path, text: TableText, line: int, row: dict[str | None, str], column: str) -> float:
    """A positive number, NaN for a gap; a frequency has no gap, and damping may be anything finite."""
    cell = row.get(column, "")
    if cell.lower() in _GAPS and column != "freq_hz":
        return math.nan
    value = text.number(cell)
    if not math.isfinite(value) or (column != "damping_ratio" and value <= 0.0):
        raise _error(path, "test.frequencies/number", line, text=cell[:40], column=column)
    return value


def _error(path: Path, code: str, line: int | None, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), **facts)
