"""Tables of repeated measurements: a heading, then a line for each repeat, separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where

_GAPS = {"", "-", "nan", "na", "n/a"}
_SEPARATORS = ",;\t"


@dataclass(frozen=True)
class RepeatsTable:
    """Headings (m,) and values (n, m); NaN where a field is empty or says nan."""

    heads: tuple[str, ...]
    values: NDArray[np.float64]


def read_repeats_table(path: Path) -> RepeatsTable:
    """Read a table of repeats.

    Raises
    ------
    FemtuneError : ``quantify.file`` for what is no table of numbers, with the line
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise _error(path, None, "quantify.file/not-text") from error
    lines = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if len(lines) < 2:
        raise _error(path, None, "quantify.file/no-values")
    separator = separator_of(lines[0][1])
    try:
        rows = list(csv.reader((line for _, line in lines), delimiter=separator))
    except csv.Error as error:
        raise _error(path, None, "quantify.file/no-table", reason=str(error)) from error
    heads = tuple(cell.strip() for cell in rows[0])
    values = [_numbers(path, lines[i][0], rows[i], heads, separator) for i in range(1, len(rows))]
    return RepeatsTable(heads, np.array(values))


def separator_of(heading: str) -> str:
    """The character that separates the fields of a table: the most frequent one in its heading."""
    return max(_SEPARATORS, key=heading.count)


def _numbers(path: Path, line: int, cells: list[str], heads: tuple[str, ...], separator: str) -> list[float]:
    if len(cells) != len(heads):
        raise _error(path, line, "quantify.file/number-of-fields", fields=len(cells), headings=len(heads))
    return [_number(path, line, cell.strip(), head, separator) for cell, head in zip(cells, heads)]


def _number(path: Path, line: int, cell: str, head: str, separator: str) -> float:
    if cell.lower() in _GAPS:
        return float("nan")
    try:
        value = float(cell.replace(",", ".") if separator != "," else cell)
    except ValueError:
        value = float("inf")
    if math.isfinite(value):
        return value
    raise _error(path, line, "quantify.file/not-finite", text=cell[:40], heading=head)


def _error(path: Path, line: int | None, code: str, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), **facts)
