"""Records of LabVIEW in binary TDMS files, by the library npTDMS where it is installed."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from femtune._optional import require
from femtune.arrays import Reals
from femtune.files.records.arrays import check_size
from femtune.files.records.clocks import ClockGroup
from femtune.files.records.headings import stated_channel
from femtune.files.records.table import (
    NUMBER_KINDS,
    RecordTable,
    check_columns,
    in_seconds,
    is_time,
    problem,
    time_unit,
)

_TIME_KIND = "M"
"""Kind of `numpy.dtype` of time stamps."""
_LARGEST_BYTES = 16
"""Bytes of a value of any type of number or time of the format, as it is stored or read."""


def read_tdms(path: Path) -> list[ClockGroup]:
    """The channels of numbers of a TDMS file, by groups; a group with several time steps or lengths becomes several.

    Raises
    ------
    FemtuneError : ``install.missing`` without the library, ``record.file`` for a damaged file, ``record.too-large``
    """
    nptdms = require("nptdms", extra="tdms")
    try:
        # a stream of our own: an index beside the file is not used, which may be that of another one
        size = path.stat().st_size
        with path.open("rb") as raw, _complaints() as complaints, nptdms.TdmsFile.open(_Bounded(raw, size)) as file:
            groups = [(str(group.name), list(group.channels())) for group in file.groups()]
            check_columns(sum(len(channels) for _, channels in groups), path)
            check_size(path, _LARGEST_BYTES * sum(len(one) for _, channels in groups for one in channels))
            made = [one for name, channels in groups for one in _groups_of(path, name, channels)]
    except MemoryError as bad:
        raise problem(path, "record.file/tdms", problem="it states more values than it has") from bad
    # the library raises whatever its own code stumbles over in a damaged file
    except Exception as bad:
        if getattr(bad, "code", "").startswith("record."):
            raise
        raise problem(path, "record.file/tdms", problem=(str(bad) or type(bad).__name__)[:120]) from bad
    # of a file that is cut the library reads what is left
    if complaints:
        raise problem(path, "record.file/tdms", problem=complaints[0][:120])
    return made


class _Bounded:
    """A stream whose readers get no more memory than it has bytes: the library asks for what the file states."""

    def __init__(self, stream: IO[bytes], size: int) -> None:
        self._stream, self._size = stream, size
        self.seek, self.tell = stream.seek, stream.tell

    def read(self, count: int = -1) -> bytes:
        left = max(self._size - self.tell(), 0)
        return self._stream.read(left if count < 0 else min(count, left))

    def readinto(self, buffer: Any) -> int:
        return int(self._stream.readinto(buffer))  # type: ignore[attr-defined]

    def close(self) -> None:
        self._stream.close()


@contextmanager
def _complaints() -> Iterator[list[str]]:
    """What the library reports to its logs, which is not shown."""
    said: list[str] = []
    names = [name for name in logging.root.manager.loggerDict if name.startswith("nptdms.")]
    top, logs = logging.getLogger("nptdms"), [logging.getLogger(name) for name in names]
    before = [(log, log.handlers[:], log.propagate) for log in (top, *logs)]
    listener = logging.Handler(logging.WARNING)
    listener.emit = lambda record: said.append(record.getMessage())  # type: ignore[method-assign]
    for log in logs:
        log.handlers, log.propagate = [], True
    top.handlers, top.propagate = [listener], False
    try:
        yield said
    finally:
        for log, handlers, passes in before:
            log.handlers, log.propagate = handlers, passes


@dataclass(frozen=True, eq=False)
class _Channel:
    """A channel of numbers; `step_s` is 0 where the file does not state one."""

    name: str
    unit: str
    step_s: float
    values: Reals


def _groups_of(path: Path, name: str, channels: Sequence[Any]) -> Iterator[ClockGroup]:
    numeric, times = [], dict[int, Reals]()
    for one in channels:
        values = np.asarray(one[:])
        if values.ndim != 1 or values.size < 2:
            continue
        if values.dtype.kind == _TIME_KIND:
            seconds = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9
            times.setdefault(len(values), np.asarray(seconds, dtype=float))
        elif values.dtype.kind in NUMBER_KINDS:
            step = float(one.properties.get("wf_increment", 0.0) or 0.0)
            numeric.append(_Channel(str(one.name), _unit(one.properties), step, np.asarray(values, dtype=float)))
    for one in [c for c in numeric if is_time(c.name) and not c.step_s > 0.0]:
        times[len(one.values)] = in_seconds(one.values, time_unit(one.name, one.unit) or 1.0)
        numeric.remove(one)
    clocks: dict[tuple[int, float], list[_Channel]] = {}
    for one in numeric:
        clocks.setdefault((len(one.values), one.step_s), []).append(one)
    for (samples, step), some in clocks.items():
        rate = 1.0 / step if step > 0.0 else None
        clock = f"{rate:.6g} Hz" if rate else f"{samples} samples"
        stated = tuple(stated_channel(one.name, one.unit) for one in some)
        yield ClockGroup(
            f"{name}, {clock}" if len(clocks) > 1 else name,
            RecordTable(
                np.array([one.values for one in some]), tuple(one.name for one in some), rate,
                None if rate else times.get(samples), str(path), stated,
            ),
        )  # fmt: skip


def _unit(properties: Mapping[str, Any]) -> str:
    """The unit of a channel; volts are what LabVIEW writes where nobody has stated a unit."""
    text = str(properties.get("unit_string", "") or properties.get("NI_UnitDescription", ""))
    return "" if text.lower() in ("volts", "v") else text
