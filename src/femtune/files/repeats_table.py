"""Tables of repeated measurements: a heading, then a line for each repeat, separated by commas, semicolons or tabs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where, each
from femtune.files.table_text import NotATable, TableText, read_table_text

_GAPS = {"", "-", "nan", "na", "n/a"}


@dataclass(frozen=True)
class RepeatsTable:
    """Headings (m,), values (n, m) and lines (n,) of the file; a value is NaN where a field is empty or says nan."""

    heads: tuple[str, ...]
    values: NDArray[np.float64]
    lines: tuple[int, ...]


def read_repeats_table(path: Path) -> RepeatsTable:
    """Read a table of repeats.

    Raises
    ------
    FemtuneError : ``quantify.file`` for what is no table of numbers, with the line
    FemtuneErrors : of several lines
    """
    try:
        text = read_table_text(path)
    except NotATable as error:
        raise _error(path, error.line, "quantify.file/no-table", reason=str(error)) from error
    if len(text.rows) < 2:
        raise _error(path, None, "quantify.file/no-values")
    heads = text.rows[0]

    def numbers(row: tuple[int, tuple[str, ...]]) -> list[float]:
        return _numbers(path, row[0], row[1], heads, text)

    values = np.array(each(numbers, zip(text.lines[1:], text.rows[1:])))
    return RepeatsTable(heads, values, tuple(text.lines[1:]))


def _numbers(path: Path, line: int, cells: Sequence[str], heads: tuple[str, ...], text: TableText) -> list[float]:
    if len(cells) != len(heads):
        raise _error(path, line, "quantify.file/number-of-fields", fields=len(cells), headings=len(heads))
    return [_number(path, line, cell, head, text) for cell, head in zip(cells, heads)]


def _number(path: Path, line: int, cell: str, head: str, text: TableText) -> float:
    if cell.lower() in _GAPS:
        return math.nan
    value = text.number(cell)
    if math.isfinite(value):
        return value
    raise _error(path, line, "quantify.file/not-finite", text=cell[:40], heading=head)


def _error(path: Path, line: int | None, code: str, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), **facts)
