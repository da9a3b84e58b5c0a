"""RecordTable: the columns of a record file as they are, before it is known what they measure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import Dof
from femtune.errors import FemtuneError, Notice, Where


@dataclass(frozen=True)
class StatedChannel:
    """What a file itself says of one of its columns; None for a DOF that it does not name."""

    dof: Dof | None
    quantity: str
    unit: str


NUMBER_KINDS = ("i", "u", "f")
"""Kinds of `numpy.dtype` of integers and real numbers."""
REAL_KINDS = (*NUMBER_KINDS, "b")
"""The same with truth values, which count as 0 and 1."""
COMPLEX_KINDS = ("c",)
"""Kinds of complex numbers."""

TIMES = ("t", "time", "zeit", "temps", "tiempo", "tempo")
"""Names of a column of times, without a unit in brackets and in small letters."""


@dataclass(frozen=True, eq=False)
class RecordTable:
    """Columns of one length.

    Parameters
    ----------
    values : (columns, samples); NaN where the file has none
    names : of the columns, "" where the file gives none
    sampling_hz : the rate that the file states, or None
    times_s : (samples,) of a column of times, which is then removed from the columns, or None
    source : the file
    channels : of the columns, if the file states them; otherwise ()
    notices : what was left out of the file, or is doubtful about its times
    rate_error : relative error of `sampling_hz`, where the file states it with few digits
    """

    values: Reals
    names: tuple[str, ...]
    sampling_hz: float | None = None
    times_s: Reals | None = None
    source: str = ""
    channels: tuple[StatedChannel, ...] = ()
    notices: tuple[Notice, ...] = ()
    rate_error: float = 0.0

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels in the file, "" for those whose names are their DOFs."""
        by_dof = [one.dof is not None and str(one.dof) == name for one, name in zip(self.channels, self.names)]
        return tuple("" if same else name for same, name in zip(by_dof or [False] * len(self.names), self.names))


def problem(
    path: object,
    code: str,
    line: int | None = None,
    *,
    values: Mapping[str, object] | None = None,
    hint: str | None = None,
    **facts: Any,
) -> FemtuneError:
    """An error in a record file."""
    return FemtuneError(code, where=Where(str(path), line), values=values, hint=hint, **facts)


def as_columns(array: NDArray, path: object) -> Reals:
    """(columns, samples) of a real array of one or two dimensions; the longer side is time.

    Raises
    ------
    FemtuneError : ``record.file`` for complex numbers, text, or another number of dimensions
    """
    if array.dtype.kind not in REAL_KINDS or array.ndim not in (1, 2) or not array.size:
        description = f"{array.ndim} dimensions {array.shape} of type {array.dtype}"
        raise problem(path, "record.file/array", values={"found": description})
    columns = np.atleast_2d(array.astype(float))
    check_columns(min(columns.shape), path)
    return columns if columns.shape[1] >= columns.shape[0] else np.ascontiguousarray(columns.T)


MOST_COLUMNS = 10_000
"""More channels than any test has: a wider table is transposed, or no table at all."""


def check_columns(count: int, path: object, line: int | None = None) -> None:
    """Refuse tables with more columns than a test can have (error ``record.too-wide``)."""
    if count > MOST_COLUMNS:
        raise problem(path, "record.too-wide", line, count=count, most=MOST_COLUMNS)


def is_time(name: str) -> bool:
    """Whether a column of this name has the times of the samples."""
    return name.strip().lower().split("(")[0].split("[")[0].strip() in TIMES


def split_times(values: Reals, names: tuple[str, ...]) -> tuple[Reals, tuple[str, ...], Reals | None]:
    """Columns and names without the first column that is called time, and that column."""
    for i, name in enumerate(names):
        if is_time(name):
            rest = [j for j in range(len(names)) if j != i]
            return values[rest], tuple(names[j] for j in rest), values[i]
    return values, names, None


_UNNAMED = ("", "x", "x_value", "x value", "x-axis", "#", "n", "no", "no.", "nr", "index", "sample", "samples")
"""Headings of a first column that has times, or counts the samples."""
_EVEN = 0.05
"""Deviation from even spacing, relative to the step, that rounding of written times explains, and no signal keeps."""
_LEAST_ROWS = 16
"""Samples below which a straight line could be a signal."""


def with_unnamed_times(table: RecordTable) -> RecordTable:
    """The table with the times of a first column that rises evenly and is not named, and without a count of samples."""
    values = table.values
    known = table.times_s is not None or table.channels or len(values) < 2
    if known or table.names[0].strip().lower() not in _UNNAMED or values.shape[1] < _LEAST_ROWS:
        return table
    first = values[0]
    step = (first[-1] - first[0]) / (len(first) - 1)
    even = np.isfinite(first).all() and step > 0.0
    if not even or np.abs(first - np.linspace(first[0], first[-1], len(first))).max() > _EVEN * step:
        return table
    counts = step == 1.0 and first[0] in (0.0, 1.0)
    if counts and table.sampling_hz is None:
        return replace(table, values=values[1:], names=table.names[1:])
    return replace(table, values=values[1:], names=table.names[1:], times_s=None if counts else first)
