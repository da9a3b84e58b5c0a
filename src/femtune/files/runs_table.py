"""A table of finished runs: a line per run with the values of parameters, frequencies, and shapes if there are any.

The columns of frequencies are called ``f1_hz``, ``f2_hz`` …; those of shapes ``shape1_12Z`` …: mode, node, direction,
and, if the program that wrote it names a sign, ``shape1_12Z+`` or ``shape1_12Z-``.
Every other column of numbers may be a parameter. A run without frequencies has failed and is left out. Tables are text,
or Parquet files by the ending of their name.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from femtune._optional import require
from femtune.arrays import Flags, Reals
from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, Where, raise_together
from femtune.files.table_text import LARGEST_BYTES, NotATable, TableText, read_table_text
from femtune.files.whole_file import write_whole

_FREQUENCY = re.compile(r"f(\d+)_hz")
_SHAPE = re.compile(r"shape(\d+)_(\d+(?:S|R?[XYZ]))([+-]?)")
_GAPS = {"", "-", "nan", "na", "n/a"}
_PARQUET = (".parquet", ".pq")
STATE = "state"

LARGEST_HZ = 1e12
"""Frequencies beyond it are mistakes: their squares would leave no digits for other modes."""


@dataclass(frozen=True, eq=False)
class RunsTable:
    """Runs of a model.

    Parameters
    ----------
    columns : (n,) values by name: parameters, and whatever else the table has
    freq_hz : (n, m) natural frequencies; NaN for a run that failed
    shapes : (n, s, m) at `dofs`, of unit modal mass; None where the table has none
    dofs : of the shapes
    states : (n,) "done" or why a run failed

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.files.runs_table import RunsTable
    >>> table = RunsTable({"E": np.array([1.0, 2.0])}, np.array([[1.0, 5.0], [np.nan, np.nan]]))
    >>> table.usable
    array([ True, False])
    """

    columns: Mapping[str, Reals]
    freq_hz: Reals
    shapes: Reals | None = None
    dofs: DofSet = field(default_factory=lambda: DofSet(()))
    states: tuple[str, ...] = ()

    @property
    def usable(self) -> Flags:
        """(n,) True for runs with frequencies, and shapes where the table has some."""
        complete = np.isfinite(self.freq_hz).all(axis=1)
        return np.asarray(complete if self.shapes is None else complete & np.isfinite(self.shapes).all(axis=(1, 2)))

    def points(self, names: Sequence[str]) -> Reals:
        """(n, k) values of parameters."""
        return np.stack([self.columns[name] for name in names], axis=1)


def write_runs_table(path: Path, table: RunsTable) -> None:
    """Write a table as CSV that `read_runs_table` reads.

    Raises
    ------
    FemtuneError : ``run.unwritable``
    """
    m = table.freq_hz.shape[1]
    labels = [str(dof)[:-1] for dof in table.dofs] if table.shapes is not None else []
    heads = [*table.columns, *(f"f{j + 1}_hz" for j in range(m))]
    heads += [f"shape{j + 1}_{label}" for j in range(m) for label in labels]
    blocks = [*table.columns.values(), *table.freq_hz.T]
    if table.shapes is not None:
        # the sign of a DOF is that of its column
        blocks += [column for j in range(m) for column in (table.shapes[:, :, j] * table.dofs.signs).T]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*heads, *([STATE] if table.states else [])])
    for i in range(len(table.freq_hz)):
        cells = [repr(float(block[i])) if math.isfinite(block[i]) else "" for block in blocks]
        writer.writerow([*cells, *([table.states[i]] if table.states else [])])
    try:
        write_whole(path, text.getvalue().encode())
    except OSError as error:
        raise FemtuneError("run.unwritable", where=Where(str(path)), reason=error.strerror or error) from error


def read_runs_table(path: Path) -> RunsTable:
    """Read a table of runs, a text or a Parquet file; columns of text are left out.

    Raises
    ------
    FemtuneError : ``runs.table`` in its variants, ``install.missing`` without the library for Parquet
    FemtuneErrors : ``runs.table`` of several lines
    """
    if path.suffix.lower() in _PARQUET:
        return _read_parquet(path)
    try:
        text = read_table_text(path)
    except NotATable as error:
        raise _error(path, error.line, "runs.table/unreadable", reason=str(error)) from error
    if len(text.rows) < 2:
        raise _error(path, None, "runs.table/no-values")
    heads, rows, numbers = text.rows[0], text.rows[1:], list(text.lines[1:])
    twice = sorted({head for head in heads if heads.count(head) > 1})
    if twice:
        raise _error(path, text.lines[0], "runs.table/heading-twice", heading=twice[0])
    wrong = [
        _error(path, line, "runs.table/number-of-fields", fields=len(row), headings=len(heads))
        for line, row in zip(numbers, rows)
        if len(row) != len(heads)
    ]
    # the other lines are looked at, too, so that all that are wrong are told together
    numbers = [line for line, row in zip(numbers, rows) if len(row) == len(heads)]
    rows = tuple(row for row in rows if len(row) == len(heads))
    cells = {head: [row[j] for row in rows] for j, head in enumerate(heads)}
    states = tuple(cells.pop(STATE, []))
    columns = {head: np.array([_number(text, cell) for cell in column]) for head, column in cells.items()}
    columns = {head: column for head, column in columns.items() if not _is_text(head, column)}
    wrong += [
        _error(path, numbers[i], "runs.table/not-a-number", text=cells[head][i][:40], heading=head)
        for head, column in columns.items()
        for i in np.flatnonzero(np.isinf(column))
    ]
    _raise_in_order(wrong + _wrong_frequencies(path, columns, numbers))
    return _table(path, columns, states, text.lines[0])


def _read_parquet(path: Path) -> RunsTable:
    """A table in a Parquet file; the number in a message is that of the row."""
    arrow, parquet = require("pyarrow", extra="parquet"), require("pyarrow.parquet", extra="parquet")
    try:
        _check_size(path, path.stat().st_size)
        schema = parquet.read_schema(path)
        kinds = [f.type for f in schema if f.name == STATE]
        texts = [STATE] if kinds and (arrow.types.is_string(kinds[0]) or arrow.types.is_large_string(kinds[0])) else []
        # texts that many rows have in common are kept once
        with parquet.ParquetFile(path, read_dictionary=texts) as file:
            columns, states = _parquet_columns(path, arrow, file, texts)
    except (OSError, ValueError, KeyError, MemoryError, arrow.ArrowException) as error:
        reason = str(error).partition("\n")[0][:200] or type(error).__name__
        raise _error(path, None, "runs.table/unreadable", reason=reason) from error
    numbers = list(range(1, len(next(iter(columns.values()), [])) + 1))
    wrong = [
        _error(path, numbers[i], "runs.table/not-a-number", text=str(column[i]), heading=head)
        for head, column in columns.items()
        for i in np.flatnonzero(np.isinf(column))
    ]
    _raise_in_order(wrong + _wrong_frequencies(path, columns, numbers))
    return _table(path, columns, states, None)


def _parquet_columns(path: Path, arrow: Any, file: Any, texts: list[str]) -> tuple[dict[str, Reals], tuple[str, ...]]:
    """Columns of numbers, with NaN for gaps, and the states."""
    schema, n_runs = file.schema_arrow, file.metadata.num_rows
    names = list(schema.names)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise _error(path, None, "runs.table/heading-twice", heading=twice[0])
    if n_runs == 0:
        raise _error(path, None, "runs.table/no-values")
    kinds = arrow.types
    numeric = (kinds.is_integer, kinds.is_floating, kinds.is_decimal)
    wanted = [f.name for f in schema if any(is_kind(f.type) for is_kind in numeric)]
    for name in names:
        if name not in wanted and (_FREQUENCY.fullmatch(name) or _SHAPE.fullmatch(name)):
            raise _error(path, None, "runs.table/column-of-text", heading=name, kind=schema.field(name).type)
    # a small file can hold a great many equal rows
    _check_size(path, 8 * n_runs * (len(wanted) + 1))
    table = file.read(columns=[*wanted, *texts])
    columns = {n: np.array(table.column(n).cast(arrow.float64(), safe=False).to_numpy(), float) for n in wanted}
    columns.pop(STATE, None)
    if not texts:
        return columns, ()
    coded = table.column(STATE).dictionary_encode().unify_dictionaries().combine_chunks()
    states = coded.dictionary.to_pylist()
    return columns, tuple("" if i is None else states[i] for i in coded.indices.to_pylist())


def _check_size(path: Path, n_bytes: int) -> None:
    if n_bytes > LARGEST_BYTES:
        raise _error(path, None, "runs.table/unreadable", reason=f"it is larger than {LARGEST_BYTES // 1_000_000} MB")


def _is_text(head: str, column: Reals) -> bool:
    """A name or remark for each run is no number that was mistyped."""
    return bool(np.isinf(column).all()) and not (_FREQUENCY.fullmatch(head) or _SHAPE.fullmatch(head))


def _number(text: TableText, cell: str) -> float:
    """NaN for a gap, infinity for what is no number."""
    return math.nan if cell.lower() in _GAPS else text.number(cell)


def _raise_in_order(errors: Sequence[FemtuneError]) -> None:
    """All errors of a table together, line after line."""
    raise_together(sorted(errors, key=lambda error: (error.where and error.where.line) or 0))


def _wrong_frequencies(path: Path, columns: Mapping[str, Reals], numbers: Sequence[int]) -> list[FemtuneError]:
    """An error for each value of a column of frequencies that is none; `numbers` are the lines of the runs."""
    return [
        _error(path, numbers[i], "runs.table/frequency", mode=int(match[1]), value=float(value))
        for head, column in columns.items()
        if (match := _FREQUENCY.fullmatch(head))
        for i, value in enumerate(column)
        if math.isfinite(value) and not 0.0 <= value <= LARGEST_HZ
    ]


def _table(path: Path, values: dict[str, Reals], states: tuple[str, ...], heading: int | None) -> RunsTable:
    """The table of columns; `heading` is the line of the headings."""
    modes = {int(match[1]): head for head in values if (match := _FREQUENCY.fullmatch(head))}
    if not modes or sorted(modes) != list(range(1, len(modes) + 1)):
        raise _error(path, heading, "runs.table/no-frequencies", headings=", ".join(values)[:200])
    freq_hz = np.stack([values.pop(modes[j]) for j in sorted(modes)], axis=1)
    by_mode: dict[tuple[int, Dof], Reals] = {}
    for head in list(values):
        if match := _SHAPE.fullmatch(head):
            at, sign = (int(match[1]), parse_dof(f"{match[2]}+")), -1.0 if match[3] == "-" else 1.0
            if at in by_mode:
                raise _error(path, heading, "runs.table/heading-twice", heading=f"shape{at[0]}_{match[2]}")
            by_mode[at] = sign * values.pop(head)
    if not by_mode:
        return RunsTable(values, freq_hz, states=states)
    dofs = sorted({dof for _, dof in by_mode})
    lacking = [(j, dof) for j in sorted(modes) for dof in dofs if (j, dof) not in by_mode]
    if lacking or len(by_mode) != len(modes) * len(dofs):
        j, dof = lacking[0] if lacking else max(by_mode)
        raise _error(path, heading, "runs.table/shapes", mode=j, dof=str(dof)[:-1])
    shapes = np.stack([np.stack([by_mode[j, dof] for dof in dofs], axis=1) for j in sorted(modes)], axis=2)
    return RunsTable(values, freq_hz, shapes, DofSet(dofs), states)


def _error(path: Path, line: int | None, code: str, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), **facts)
