"""Groups of channels with a clock of their own, of which a record is one: files of loggers have several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from femtune.errors import did_you_mean
from femtune.files.records.table import RecordTable, check_columns, problem
from femtune.modal.time_series import STEP_TOLERANCE

_MOST_LISTED = 12
"""Groups, and channels of a group, that a message lists."""


@dataclass(frozen=True, eq=False)
class ClockGroup:
    """Channels that were sampled together, under the name that the file gives them; none where all were left out."""

    name: str
    table: RecordTable


def of_one_clock(
    path: Path, groups: Sequence[ClockGroup], variable: str | None, columns: Sequence[int | str] = ()
) -> RecordTable:
    """The groups that share one clock as one table.

    Parameters
    ----------
    variable : name of the group that is wanted, or None
    columns : of channels that are wanted; names decide between groups where `variable` does not

    Raises
    ------
    FemtuneError : ``record.clocks`` where groups with different clocks remain, ``record.variable`` for an unknown name,
        ``record.file/no-channels`` for a file without channels of numbers
    """
    aside = tuple(notice for one in groups if not one.table.names for notice in one.table.notices)
    groups = [one for one in groups if one.table.names]
    if not groups:
        raise problem(path, "record.file/no-channels")
    chosen = [one for one in groups if variable in (None, one.name)]
    if not chosen:
        names = [one.name for one in groups]
        values = {"groups": ", ".join(names[:_MOST_LISTED])}
        hint = did_you_mean(variable or "", names) or None
        raise problem(path, "record.variable/group", values=values, hint=hint, variable=variable)
    clocks = _by_clock([one.table for one in chosen])
    wanted = {name for name in columns if isinstance(name, str)}
    if len(clocks) > 1 and wanted:
        clocks = [some for some in clocks if wanted <= {name for one in some for name in one.names}]
    if len(clocks) != 1:
        listed = {f"'{one.name}'": _described(one.table) for one in chosen[:_MOST_LISTED]}
        raise problem(path, "record.clocks", values=listed, count=len(chosen))
    joined = _joined(path, clocks[0])
    return replace(joined, notices=(*joined.notices, *aside))


def _by_clock(tables: Sequence[RecordTable]) -> list[list[RecordTable]]:
    clocks: list[list[RecordTable]] = []
    for table in tables:
        same = next((some for some in clocks if _one_clock(some[0], table)), None)
        if same is None:
            clocks.append([table])
        else:
            same.append(table)
    return clocks


def _one_clock(first: RecordTable, other: RecordTable) -> bool:
    """Whether two tables have as many samples at the same times, up to a thousandth of a step."""
    if first.values.shape[1] != other.values.shape[1] or (first.times_s is None) != (other.times_s is None):
        return False
    if first.times_s is not None and other.times_s is not None:
        step = float(np.ptp(first.times_s)) / max(len(first.times_s) - 1, 1)
        return bool(np.abs(first.times_s - other.times_s).max(initial=0.0) <= STEP_TOLERANCE * step)
    rates = first.sampling_hz, other.sampling_hz
    if rates[0] is None or rates[1] is None:
        return rates[0] == rates[1]
    return abs(rates[0] / rates[1] - 1.0) * first.values.shape[1] <= STEP_TOLERANCE


def _described(table: RecordTable) -> str:
    """Channels and clock, for a message."""
    names, count = ", ".join(table.names[:5]), len(table.names)
    channels = f"{names} and {count - 5} more" if count > 5 else names
    rate, times = table.sampling_hz, table.times_s
    if rate is None and times is not None and len(times) > 1 and times[-1] > times[0]:
        rate = (len(times) - 1) / float(times[-1] - times[0])
    clock = "" if rate is None else f" at {rate:.6g} Hz"
    return f"{table.values.shape[1]} samples{clock}: {channels}"


def _joined(path: Path, tables: Sequence[RecordTable]) -> RecordTable:
    names = tuple(name for one in tables for name in one.names)
    check_columns(len(names), path)
    if len(tables) == 1:
        return tables[0]
    channels = tuple(channel for one in tables for channel in one.channels)
    notices = tuple(notice for one in tables for notice in one.notices)
    values = np.vstack([one.values for one in tables])
    return replace(tables[0], values=values, names=names, channels=channels, notices=notices)
