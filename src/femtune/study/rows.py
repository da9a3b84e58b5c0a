"""Tables of results: lists of flat records, which ``pandas.DataFrame`` takes as they are."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_SHOWN = 20
"""Rows of the table that is printed; the list has all of them."""
_TABLE_WIDTH = 110
"""Characters of a line of the printed table; columns beyond are counted. Wider ones would wrap in a notebook."""
_CELL_WIDTH = 40
"""Characters of a cell; longer texts are cut, so that one does not push out the other columns."""


class Row(dict[str, Any]):
    """A record of a table: a dict whose keys may also be read as attributes.

    Examples
    --------
    >>> row = Row(name="E", value=2.1e11)
    >>> row["value"] == row.value
    True
    """

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"this record has no '{name}'; it has {', '.join(self)}") from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]


class Rows(list[Row]):
    """A table: one `Row` per line, all with the same keys, numbers and texts only; ``None`` if there is no value.

    It is an ordinary list, so that ``pandas.DataFrame(rows)`` and ``polars.DataFrame(rows)`` take it as it is. It shows
    itself as a table, at the prompt as text and in a notebook as HTML.

    Examples
    --------
    >>> rows = Rows.of([{"mode": 1, "freq_hz": 12.5}, {"mode": 2, "freq_hz": 31.0}])
    >>> rows
    mode  freq_hz
       1     12.5
       2       31
    >>> rows[1].freq_hz
    31.0
    >>> rows.column("freq_hz")
    array([12.5, 31. ])
    """

    @classmethod
    def of(cls, records: Iterable[Mapping[str, Any]]) -> Rows:
        """A table of mappings."""
        return cls(map(Row, records))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self[0]) if self else ()

    def column(self, name: str) -> NDArray[Any]:
        """(rows,) values of a column; numbers with NaN where there is no value, else Python objects.

        Raises
        ------
        KeyError : where the table has no such column
        """
        values = [row[name] for row in self]
        if all(v is None or (isinstance(v, int | float) and not isinstance(v, bool)) for v in values):
            return np.array([math.nan if v is None else v for v in values], dtype=float)
        return np.array(values, dtype=object)

    def __repr__(self) -> str:
        if not self:
            return "(no rows)"
        columns = [_column(name, [row[name] for row in self[:MOST_SHOWN]]) for name in self.columns]
        width = 0
        shown: list[list[str]] = []
        for column in columns:
            width += len(column[0]) + 2
            if shown and width > _TABLE_WIDTH + 2:
                break
            shown.append(column)
        lines = ["  ".join(cells).rstrip() for cells in zip(*shown)]
        return "\n".join([*lines, *self._hidden(len(columns) - len(shown))])

    def _hidden(self, columns: int) -> list[str]:
        rows = len(self) - MOST_SHOWN
        counts = {"row": rows, "column": columns}
        parts = [f"{n} more {word}{'s' if n > 1 else ''}" for word, n in counts.items() if n > 0]
        return [f"… {', '.join(parts)}"] if parts else []

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in self.columns)
        lines = "".join(
            "<tr>" + "".join(f"<td>{html.escape(text_of(v))}</td>" for v in row.values()) + "</tr>"
            for row in self[:MOST_SHOWN]
        )
        rest = "".join(f"<p>{html.escape(line)}</p>" for line in self._hidden(0))
        return f"<table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>{rest}"


def text_of(value: object) -> str:
    """A value of a table as it is shown: six digits, or a dash if there is none."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    text = " ".join(str(value).split())
    return text if len(text) <= _CELL_WIDTH else text[: _CELL_WIDTH - 1] + "…"


def _column(name: str, values: list[Any]) -> list[str]:
    """Head and cells, padded to one width: numbers to the right, texts to the left."""
    cells = [name, *map(text_of, values)]
    width = max(map(len, cells))
    right = all(v is None or isinstance(v, int | float) for v in values)
    return [cell.rjust(width) if right else cell.ljust(width) for cell in cells]


def rows_of(records: Iterable[object], *columns: str) -> Rows:
    """A table of some attributes of records; a column that is a pair of numbers becomes two, ``_lower`` and ``_upper``.

    A list of names becomes one text.
    """
    return Rows(Row(_cells(record, columns)) for record in records)


def _cells(record: object, columns: tuple[str, ...]) -> Iterable[tuple[str, Any]]:
    for name in columns:
        value = getattr(record, name)
        if name.startswith("interval") and not isinstance(value, str):
            lower, upper = value if value is not None else (None, None)
            yield f"{name}_lower", lower
            yield f"{name}_upper", upper
        else:
            yield name, ", ".join(map(str, value)) if isinstance(value, tuple) else value
