"""Tables of test points: a heading, then a line for each point with its coordinates and, if needed, its directions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from femtune.errors import FemtuneError, Where, did_you_mean, each
from femtune.files.table_text import NotATable, TableText, read_table_text
from femtune.testdata import WireFrame

_PLACE = ("node", "x", "y", "z")
_DIRECTIONS = tuple(f"{direction}_{axis}" for direction in "XYZ" for axis in "xyz")
_MOST_LINES = 1_000_000
"""Lines of a table: the points of a scan of a large surface."""
_LEAST_LENGTH = 1e-6
"""Length of a direction below which it is no direction but a mistake."""
_LARGEST = 1e30
"""Coordinates above this are no lengths in any units, and their squares overflow in single precision."""


def read_points(path: Path) -> WireFrame:
    """The points of a table with the columns node, x, y, z.

    A local direction X, Y or Z of a point may be any vector, given by three further columns such as X_x, X_y, X_z; the
    directions of a point need not be perpendicular.

    Raises
    ------
    FemtuneError : ``test.points``, with the line
    FemtuneErrors : of several lines
    """
    try:
        text = read_table_text(path)
    except NotATable as error:
        raise _error(path, error.line, "test.points", reason=str(error)) from error
    lines, rows = text.lines, text.rows
    if not 2 <= len(rows) <= _MOST_LINES:
        raise _error(path, None, "test.points", reason=f"the table has {len(rows)} lines")
    heads = list(rows[0])
    _check_heads(path, lines[0], heads)
    first: dict[float, int] = {}

    def numbers(row: tuple[int, tuple[str, ...]]) -> list[float]:
        cells = _numbers(path, row[0], heads, row[1], text)
        node = cells[heads.index("node")]
        if node in first:
            raise _error(path, row[0], "test.points/node-twice", node=int(node), first=first[node])
        first[node] = row[0]
        return cells

    table = np.array(each(numbers, zip(lines[1:], rows[1:])))
    column = {head: table[:, i] for i, head in enumerate(heads)}
    axes = np.tile(np.eye(3), (len(table), 1, 1))
    for k, direction in enumerate("XYZ"):
        if f"{direction}_x" in column:
            vectors = np.stack([column[f"{direction}_{axis}"] for axis in "xyz"], axis=1)
            length = np.linalg.norm(vectors, axis=1)
            if (short := np.flatnonzero(length < _LEAST_LENGTH)).size:
                raise _error(path, lines[1 + short[0]], "test.points/direction", direction=direction)
            axes[:, k] = vectors / length[:, None]
    return WireFrame(
        column["node"].astype(np.int64), np.stack([column[axis] for axis in "xyz"], axis=1), axes
    )  # fmt: skip


def _check_heads(path: Path, line: int, heads: list[str]) -> None:
    known = (*_PLACE, *_DIRECTIONS)
    for head in heads:
        if head not in known or heads.count(head) > 1:
            raise _error(path, line, "test.points/heading", head=head[:40], hint=did_you_mean(head, known))
    whole = [{f"{d}_{axis}" for axis in "xyz"} for d in "XYZ"]
    if not set(_PLACE) <= set(heads) or any(0 < len(three & set(heads)) < len(three) for three in whole):
        raise _error(path, line, "test.points/columns")


def _numbers(path: Path, line: int, heads: list[str], cells: Sequence[str], text: TableText) -> list[float]:
    if len(cells) != len(heads):
        raise _error(path, line, "test.points/fields", fields=len(cells), headings=len(heads))
    return [_number(path, line, head, cell, text) for head, cell in zip(heads, cells)]


def _number(path: Path, line: int, head: str, cell: str, text: TableText) -> float:
    value = text.number(cell)
    no_node = head == "node" and not (cell.isascii() and cell.isdigit() and 0 < int(cell[:18]) < 2**31)
    if no_node or not abs(value) < _LARGEST:
        raise _error(path, line, "test.points/number", text=cell[:40], head=head)
    return value


def _error(path: Path, line: int | None, code: str, hint: str | None = None, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), hint=hint, **facts)
