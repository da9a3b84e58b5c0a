"""Curves of a vibration test: a heading, then a line for each frequency or time with a value for each point."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where, each
from femtune.files.table_text import NotATable, TableText, read_table_text

_UNEVEN = 0.1
"""Deviation of a time from even spacing, relative to the step, that rounding of the written digits does not explain."""


def read_vibration_table(path: Path, outputs: int, *, history: bool = False) -> tuple[Reals, Reals]:
    """Frequencies (n,) in Hz, and values (outputs, n): amplitudes of a sweep, or power spectral densities.

    Parameters
    ----------
    history : times (n,) in s instead of frequencies, and values of any sign

    Raises
    ------
    FemtuneError : ``vibration.file``, with the line
    FemtuneErrors : of several lines
    """
    try:
        text = read_table_text(path)
    except NotATable as error:
        raise _error(path, error.line, "vibration.file/unreadable", reason=str(error)) from error
    if text.rows and all(_is_number(text, cell) for cell in text.rows[0]):
        # a file without a heading would lose its first line
        raise _error(path, text.lines[0], "vibration.file/heading")
    rows = zip(text.lines[1:], text.rows[1:])
    numbers = each(lambda row: _numbers(path, *row, text, outputs), rows)
    values = np.array(numbers).reshape(-1, outputs + 1)
    if len(values) < 2 or np.any(np.diff(values[:, 0]) <= 0.0) or (not history and np.any(values <= 0.0)):
        raise _error(path, None, "vibration.file/times" if history else "vibration.file")
    return values[:, 0], values[:, 1:].T


def read_signal(path: Path) -> tuple[Reals, Reals]:
    """Times (n,) in s of an excitation, and its values (n,).

    Raises
    ------
    FemtuneError : ``vibration.file``; ``vibration.signal`` where the times are not evenly spaced
    """
    times, values = read_vibration_table(path, 1, history=True)
    steps = np.diff(times)
    # times may be rounded to the digits that are written
    if np.abs(times - np.linspace(times[0], times[-1], len(times))).max() > _UNEVEN * steps.mean():
        raise _error(path, None, "vibration.signal", least=float(steps.min()), most=float(steps.max()))
    return times, values[0]


def _is_number(text: TableText, cell: str) -> bool:
    return bool(np.isfinite(text.number(cell))) or cell.lower() in ("nan", "inf", "-inf")


def _numbers(path: Path, line: int, row: Sequence[str], text: TableText, outputs: int) -> list[float]:
    if len(row) != outputs + 1:
        raise _error(path, line, "vibration.file/columns", given=len(row), outputs=outputs)
    numbers = [text.number(cell) for cell in row]
    if not np.all(np.isfinite(numbers)):
        raise _error(path, line, "vibration.file/number")
    return numbers


def _error(path: Path, line: int | None, code: str, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), **facts)
