"""RecordTable: the columns of a record file as they are, before it is known what they measure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import Dof
from femtune.errors import FemtuneError, Notice, Where
from femtune.unit_labels import time_factor


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
    lines : of a text, the line of each sample, from 1
    """

    values: Reals
    names: tuple[str, ...]
    sampling_hz: float | None = None
    times_s: Reals | None = None
    source: str = ""
    channels: tuple[StatedChannel, ...] = ()
    notices: tuple[Notice, ...] = ()
    rate_error: float = 0.0
    lines: tuple[int, ...] = ()

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


LONGEST_HEADING = 300
"""Letters of a heading that are read."""
_TIME_WORD = re.compile(
    r"(?:(?:elapsed|relative|rel|absolute|abs|sample|sampling|recording|measurement)[ _.-]*)?"
    r"(?:t|time|time[ _-]?stamps?|zeit|temps|tiempo|tempo|epoch|elapsed)"
    r"(?:[ _-]*(?:axis|elapsed|stamp|rel|abs|relative|absolute|vector))?(?:\s*\d+\s*-.*)?"
    r"(?:[ _-]+(?P<unit>[a-zµμ]+))?",
)
"""Headings of a column of times, in small letters and without brackets; catman writes ``Zeit 1 - …``."""
_UNIT_WORD = re.compile(r"(?P<unit>[a-zµμ]+)(?:[ _-]*(?:elapsed|passed))?")
"""Headings that are a unit of time."""
_BRACKETS = re.compile(r"[\[({]([^\[\](){}]*)[\])}]")
_EPOCH_UNITS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
"""Times since 1970 by their size: from which on, and the unit in s. A test does not last for three thousand years."""


def time_unit(name: str, below: str = "") -> float | None:
    """Seconds in the unit of a column of times, by its heading and the text below it; None for another column.

    Examples
    --------
    >>> from femtune.files.records.table import time_unit
    >>> time_unit("Time [ms]"), time_unit("t_s"), time_unit("Zeit"), time_unit("Accel X")
    (0.001, 1.0, 1.0, None)
    """
    name, below = name[:LONGEST_HEADING], below[:LONGEST_HEADING]
    plain = " ".join(_BRACKETS.sub(" ", name).split()).strip('" ').lower()
    stated = [factor for text in (below.strip("[](){} "), *_BRACKETS.findall(name)) if (factor := time_factor(text))]
    if alone := _UNIT_WORD.fullmatch(plain):
        # a unit as the whole heading; single letters say too little
        alone_factor = time_factor(alone["unit"]) if len(alone["unit"]) > 1 else None
        if alone_factor is not None and alone["unit"] not in ("min", "us"):
            return alone_factor
    word = _TIME_WORD.fullmatch(plain)
    if word is None or (plain == "t" and _BRACKETS.search(name) and not stated):
        # the last is a temperature
        return None
    if word["unit"] and not stated:
        return time_factor(word["unit"])
    return stated[0] if stated else 1.0


def is_time(name: str) -> bool:
    """Whether a column of this name has the times of the samples."""
    return time_unit(name) is not None


def in_seconds(times: Reals, unit: float) -> Reals:
    """Times in seconds; those since 1970 from the first one, in the unit that their size tells where none is stated."""
    largest = np.abs(times).max(initial=0.0)
    if unit == 1.0 and (since := next((size for least, size in _EPOCH_UNITS if largest >= least), None)):
        return (times - times[0]) * since
    return times if unit == 1.0 else times * unit


def split_times(
    values: Reals, names: tuple[str, ...], below: tuple[str, ...] = ()
) -> tuple[Reals, tuple[str, ...], Reals | None]:
    """Columns and names without those that are called time, and the times of the first of them in seconds.

    Parameters
    ----------
    below : texts below the names, such as units
    """
    units = [time_unit(name, unit) for name, unit in zip(names, below or ("",) * len(names))]
    at = [i for i, unit in enumerate(units) if unit is not None]
    if not at:
        return values, names, None
    rest = [i for i in range(len(names)) if i not in at]
    return values[rest], tuple(names[i] for i in rest), in_seconds(values[at[0]], units[at[0]] or 1.0)


_UNNAMED = (
    *("", "x", "x_value", "x value", "x-axis", "abscissa", "#", "n", "no", "no.", "nr", "nr.", "index", "idx", "point"),
    *("sample", "samples", "sample number", "sample_number", "sample no.", "count", "counter", "var1", "column1"),
)
"""Headings of a first column that has times, or counts the samples."""
_EVEN = 0.05
"""Deviation from even spacing, relative to the step, that rounding of written times explains, and no signal keeps."""
_LEAST_ROWS = 16
"""Samples below which a straight line could be a signal."""


def with_unnamed_times(table: RecordTable) -> RecordTable:
    """The table with the times of a first column that rises evenly and is not named, and without a count of samples."""
    values = table.values
    if len(values) < 2 or values.shape[1] < _LEAST_ROWS:
        return table
    name = table.names[0][:LONGEST_HEADING]
    plain = _BRACKETS.sub("", name).strip().lower()
    unit = next((factor for text in _BRACKETS.findall(name) if (factor := time_factor(text))), None)
    if plain not in _UNNAMED:
        return table
    first = values[0]
    step = (first[-1] - first[0]) / (len(first) - 1)
    even = np.isfinite(first).all() and step > 0.0
    if not even or np.abs(first - np.linspace(first[0], first[-1], len(first))).max() > _EVEN * step:
        return table
    counts = step == 1.0 and first[0] in (0.0, 1.0) and unit is None
    if not counts and table.times_s is not None:
        return table
    rest = replace(table, values=values[1:], names=table.names[1:], channels=table.channels[1:])
    return rest if counts else replace(rest, times_s=in_seconds(first, unit or 1.0))
