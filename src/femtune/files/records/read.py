"""A record file made into a TimeSeries: which reader, and what each column measures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femtune.dofs import Dof
from femtune.errors import FemtuneError, did_you_mean
from femtune.files.records.arrays import read_hdf5, read_mat, read_npy
from femtune.files.records.table import RecordTable, problem
from femtune.files.records.text import read_text
from femtune.files.records.waves import UffChannel, read_uff_time, read_wav
from femtune.modal import Channel, TimeSeries

_ARRAYS: Mapping[str, Callable[[Path, str | None], RecordTable]] = {
    "numpy": read_npy,
    "matlab": read_mat,
    "hdf5": read_hdf5,
}
FORMATS = ("text", *_ARRAYS, "wav", "uff")
_BY_EXTENSION = {
    ".csv": "text", ".txt": "text", ".dat": "text", ".asc": "text", ".tsv": "text", ".npy": "numpy", ".npz": "numpy",
    ".mat": "matlab", ".h5": "hdf5", ".hdf5": "hdf5", ".wav": "wav", ".uff": "uff", ".unv": "uff",
}  # fmt: skip

_SAME_RATE = 1e-3


@dataclass(frozen=True)
class ChannelColumn:
    """What the user says of one column.

    Parameters
    ----------
    column : its number from 1, the column of times not counted, or its name in the file
    dof : where it was measured
    quantity, role, unit : as of `femtune.modal.Channel`
    factor : what its numbers are multiplied with to be in `unit`
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
) -> TimeSeries:
    """Time records of a file: CSV and other text, UFF 58, .npy, .npz, .mat, HDF5, WAV.

    Parameters
    ----------
    columns : what the columns measure, in the order wanted; without them a Universal File says it itself, and columns
        of other files become responses 1S+, 2S+, …
    sampling_hz : needed where the file says none; where it does they must agree
    variable : the array in a file that holds several
    format : one of `FORMATS`; by extension where None

    Raises
    ------
    FemtuneError : ``record.*``: what cannot be read, with its place; ``record.rate`` for rates that contradict each
        other
    """
    path = Path(path)
    table, known = _read(path, format or format_of(path), variable)
    chosen = [position_of(table, c.column) for c in columns] or list(range(len(table.values)))
    if twice := next((c for c, i in zip(columns, chosen) if chosen.count(i) > 1), None):
        raise problem(path, "record.column/twice", column=twice.column)
    channels = [_channel(c, table.names[i]) for c, i in zip(columns, chosen)] or _own(table, known)
    factors = np.array([c.factor for c in columns] or np.ones(len(chosen)))
    rate = _rate(table, sampling_hz)
    return TimeSeries(factors[:, None] * table.values[chosen], tuple(channels), rate, 0.0, table.times_s, str(path))


def _read(path: Path, format: str, variable: str | None) -> tuple[RecordTable, tuple[UffChannel, ...]]:
    if not path.is_file():
        raise problem(path, "record.missing")
    if format in _ARRAYS:
        return _ARRAYS[format](path, variable), ()
    if format == "uff":
        return read_uff_time(path)
    return (read_wav(path) if format == "wav" else read_text(path)), ()


def format_of(path: Path) -> str:
    """The format that belongs to an extension (error ``record.format``)."""
    found = _BY_EXTENSION.get(path.suffix.lower())
    if found is None:
        known = ", ".join(_BY_EXTENSION)
        raise problem(path, "record.format", values={"known": known}, suffix=path.suffix)
    return found


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


def _own(table: RecordTable, known: Sequence[UffChannel]) -> list[Channel]:
    """Channels that the file names itself, or numbered ones."""
    dofs = [c.dof for c in known]
    if known and None not in dofs and len(set(dofs)) == len(dofs):
        return [
            Channel(c.dof, c.quantity, c.unit, "input" if c.quantity == "force" else "response") for c in known if c.dof
        ]
    return [Channel(Dof(i + 1, "S"), name=name) for i, name in enumerate(table.names)]


def _rate(table: RecordTable, said: float | None) -> float | None:
    if said is not None and table.sampling_hz is not None and abs(said / table.sampling_hz - 1.0) > _SAME_RATE:
        raise FemtuneError(
            "record.rate",
            values={"stated": f"{said:g} Hz", "file": f"{table.sampling_hz:g} Hz", "source": table.source},
        )
    if said is None and table.sampling_hz is None and table.times_s is None:
        raise problem(table.source, "record.no-rate")
    return said if table.sampling_hz is None else table.sampling_hz
