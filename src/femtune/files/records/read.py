"""A record file made into a TimeSeries: which reader, and what each column measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof
from femtune.errors import FemtuneError, Notice, Where, did_you_mean
from femtune.files.formats import RECORD_FORMATS, RecordFormat
from femtune.files.records.arrays import table_of
from femtune.files.records.clocks import of_one_clock
from femtune.files.records.headings import stated_channel
from femtune.files.records.table import RecordTable, problem, with_unnamed_times
from femtune.files.uff.scan import is_universal
from femtune.modal import Channel, TimeSeries
from femtune.unit_labels import unit_label
from femtune.units import SI, UnitSystem, force_unit

_RATE_TOLERANCE = 1e-3
"""Relative difference up to which two sampling rates are the same: files round 1/step to four digits and more."""
_LONGEST_SIGNATURE = 32
"""First bytes of a file that may tell its format."""
_EXACT_RATE = 1e-5
"""Relative error of a rate up to which nothing needs to be said: standard deviations of frequencies are larger."""


@dataclass(frozen=True)
class ChannelColumn:
    """What the user states about one column.

    Parameters
    ----------
    column : its number from 1, the column of times not counted, or its name in the file
    dof : where it was measured
    quantity, role, unit : as of `femtune.modal.Channel`
    factor : of its numbers, to be in `unit`
    """

    column: int | str
    dof: Dof
    quantity: str = "unknown"
    role: str = "response"
    unit: str = ""
    factor: float = 1.0


def read_record(
    path: Path | str,
    columns: Sequence[ChannelColumn] = (),
    sampling_hz: float | None = None,
    variable: str | None = None,
    format: str | None = None,
    units: UnitSystem = SI,
) -> TimeSeries:
    """Time records of a file: CSV and other text, UFF 58, .npy, .npz, .mat, HDF5, WAV, LVM, TDMS, MDF.

    Parameters
    ----------
    columns : what the columns measure, in the order wanted; without them the file states it itself, or the headings of
        its columns do (``force``, ``12Z+``, ``Acc [g]``), and other columns become responses 1S+, 2S+, …
    sampling_hz : needed if the file states none; otherwise both must agree
    variable : the array in a file that holds several, or the group of channels
    format : key of one of `RECORD_FORMATS`; by extension where None
    units : system into which channels are converted whose unit the file states in words that are understood

    Raises
    ------
    FemtuneError : ``record.*``: what cannot be read, with its place; ``record.rate`` for rates that contradict each
        other
    """
    return read_record_told(path, columns, sampling_hz, variable, format, units)[0]


def read_record_told(
    path: Path | str,
    columns: Sequence[ChannelColumn] = (),
    sampling_hz: float | None = None,
    variable: str | None = None,
    format: str | None = None,
    units: UnitSystem = SI,
) -> tuple[TimeSeries, tuple[Notice, ...]]:
    """As `read_record`, with what its reader tells: channels left out, times that the file does not state."""
    read = read_record_and_clock(path, columns, sampling_hz, variable, format, units)
    return read.record, read.notices


@dataclass(frozen=True)
class ReadRecord:
    """A record, what its reader tells of the file, and where the sampling rate comes from, in words."""

    record: TimeSeries
    notices: tuple[Notice, ...]
    rate_from: str


def read_record_and_clock(
    path: Path | str,
    columns: Sequence[ChannelColumn] = (),
    sampling_hz: float | None = None,
    variable: str | None = None,
    format: str | None = None,
    units: UnitSystem = SI,
) -> ReadRecord:
    """As `read_record`, with what its reader tells and the source of the sampling rate."""
    path = Path(path)
    table = _read(path, format_named(path, format), variable, [c.column for c in columns])
    if not any(isinstance(c.column, int) for c in columns):
        # columns that are given by number are counted as they stand in the file
        table = with_unnamed_times(table)
    chosen = [position_of(table, c.column) for c in columns] or list(range(len(table.values)))
    if twice := next((c for c, i in zip(columns, chosen) if chosen.count(i) > 1), None):
        raise problem(path, "record.column/twice", column=twice.column)
    channels = [_channel(c, table.names[i]) for c, i in zip(columns, chosen)]
    factors = np.array([c.factor for c in columns])
    if not columns:
        channels, factors = _converted(_stated_channels(table), units)
    rate = _rate(table, sampling_hz)
    try:
        made = TimeSeries(factors[:, None] * table.values[chosen], tuple(channels), rate, 0.0, table.times_s, str(path))
    except FemtuneError as error:
        sample = error.facts.get("sample")
        if sample and table.lines:
            error.where = Where(str(path), table.lines[sample - 1])
        raise
    if made.sampling_hz is not None and made.sampling_hz > LARGEST_RATE_HZ:
        raise problem(path, "record.rate/too-large", sampling_hz=made.sampling_hz)
    rounded = sampling_hz is None and table.sampling_hz is not None and table.rate_error > _EXACT_RATE
    of_rate = (Notice("record.rate/rounded", rate=rate, error=100.0 * table.rate_error),) if rounded else ()
    times = table.times_s is not None
    rate_from = _BY_USER if sampling_hz is not None else _BY_TIMES if times else _BY_FILE
    return ReadRecord(made, (*table.notices, *of_rate), rate_from)


_BY_USER = "stated in the settings"
_BY_TIMES = "from the column of times"
_BY_FILE = "stated in the file"


def _read(path: Path, format: RecordFormat, variable: str | None, columns: Sequence[int | str]) -> RecordTable:
    if not path.is_file():
        raise problem(path, "record.missing")
    if format.has == "groups":
        return of_one_clock(path, format.read_groups(path), variable, columns)
    if format.has != "arrays":
        return format.read_table(path)
    with format.open_arrays(path) as arrays:
        return table_of(path, arrays, variable)


def format_named(path: Path, key: str | None) -> RecordFormat:
    """The format that was named, or the one that the content or the extension tells (error ``record.format``)."""
    if key is None and is_universal(path):
        key = "uff"
    if key is None and path.is_file():
        with path.open("rb") as stream:
            first = stream.read(_LONGEST_SIGNATURE)
        key = next((one.key for one in RECORD_FORMATS if one.signatures and first.startswith(one.signatures)), None)
    format = RECORD_FORMATS.of_suffix(path) if key is None else RECORD_FORMATS[key]
    if format is None:
        known = ", ".join(RECORD_FORMATS.suffixes)
        raise problem(path, "record.format", values={"known": known}, suffix=path.suffix)
    return format


def position_of(table: RecordTable, column: int | str) -> int:
    """Position of a column given by its number from 1 or its name (errors ``record.column``)."""
    if isinstance(column, int):
        if 1 <= column <= len(table.values):
            return column - 1
        values: dict[str, object] = {"columns": len(table.values)}
        raise problem(table.source, "record.column", values=values, column=column)
    if table.names.count(column) != 1:
        times = table.names.count(column)
        code = "record.column/ambiguous-name" if times else "record.column/unknown-name"
        names = [n for n in table.names if n]
        hint = did_you_mean(column, names) or None
        values = {"names": ", ".join(names)[:300]}
        raise problem(table.source, code, values=values, hint=hint, column=column, times=times)
    return table.names.index(column)


def _channel(column: ChannelColumn, name: str) -> Channel:
    return Channel(column.dof, column.quantity, column.unit, column.role, name)


def _stated_channels(table: RecordTable) -> list[Channel]:
    """Channels that the file or its headings state, or numbered ones.

    Beside a force, columns of which nothing is said are accelerations, as in a table of channels without a quantity;
    those of another unit are not.
    """
    known = table.channels or tuple(map(stated_channel, table.names))
    forces = [one.quantity == "force" for one in known]
    if all(forces):
        # nothing responds: the file is one of forces alone, or the word means something else
        forces = [False] * len(known)
    dofs = [one.dof or Dof(i + 1, "S") for i, one in enumerate(known)]
    places = [*zip(dofs, forces)]
    responses = [one.dof for one, force in zip(known, forces) if not force]
    if len(set(places)) < len(places) or (None in responses and any(responses)):
        dofs = [Dof(i + 1, "S") for i in range(len(known))]
    usual = "acceleration" if any(forces) and any(table.channel_names) else "unknown"
    quantities = [usual if one.quantity == "unknown" and not one.unit else one.quantity for one in known]
    roles = ["input" if force else "response" for force in forces]
    units = [one.unit for one in known]
    return [Channel(*each) for each in zip(dofs, quantities, units, roles, table.channel_names)]


def _converted(channels: Sequence[Channel], units: UnitSystem) -> tuple[list[Channel], NDArray[np.float64]]:
    """Channels in the units of a system, and the factors of their values; channels of unknown units as they are."""
    factors = np.ones(len(channels))
    out = list(channels)
    for i, channel in enumerate(channels):
        label = unit_label(channel.unit)
        if label is None or not (label.is_force or label.motion == channel.quantity):
            continue
        factor = label.factor / (units.force if label.is_force else units.length)
        if abs(factor - 1.0) > _RATE_TOLERANCE:
            factors[i] = factor
            unit = force_unit(units) if label.is_force else units.name.partition("-")[0] + _PER_TIME[channel.quantity]
            out[i] = replace(channel, unit=unit)
    return out, factors


_PER_TIME = {"displacement": "", "velocity": "/s", "acceleration": "/s2"}
LARGEST_RATE_HZ = 1e9
"""Largest sampling rate: no test of a structure has more, and computed lengths overflow far above it."""


def _rate(table: RecordTable, said: float | None) -> float | None:
    tolerance = max(_RATE_TOLERANCE, table.rate_error)
    if said is not None and table.sampling_hz is not None and abs(said / table.sampling_hz - 1.0) > tolerance:
        raise FemtuneError(
            "record.rate",
            values={"stated": f"{said:g} Hz", "file": f"{table.sampling_hz:g} Hz", "source": table.source},
        )
    if said is None and table.sampling_hz is None and table.times_s is None:
        raise problem(table.source, "record.no-rate")
    return said if table.sampling_hz is None or (said and table.rate_error > _EXACT_RATE) else table.sampling_hz
