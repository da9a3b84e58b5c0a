"""Tables of repeated measurements: a heading, then a line for each repeat, separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

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
        raise _error(path, None, "the file cannot be read as UTF-8 text", "export it as CSV") from error
    lines = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if len(lines) < 2:
        raise _error(path, None, "the table has no line of values", "a heading, then a line for each repeat")
    separator = max(_SEPARATORS, key=lines[0][1].count)
    rows = list(csv.reader((line for _, line in lines), delimiter=separator))
    heads = tuple(cell.strip() for cell in rows[0])
    values = [_numbers(path, lines[i][0], rows[i], heads, separator) for i in range(1, len(rows))]
    return RepeatsTable(heads, np.array(values))


def _numbers(path: Path, line: int, cells: list[str], heads: tuple[str, ...], separator: str) -> list[float]:
    if len(cells) != len(heads):
        what = f"{len(cells)} values under {len(heads)} headings"
        raise _error(path, line, what, "give every line as many fields as the heading; leave gaps empty")
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
    raise _error(path, line, f"'{cell[:40]}' under '{head}' is no finite number", "leave the field empty for a gap")


def _error(path: Path, line: int | None, what: str, hint: str) -> FemtuneError:
    return FemtuneError("quantify.file", what, where=Where(str(path), line), hint=hint)
