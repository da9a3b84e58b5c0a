"""Records of ASAM MDF files (.mf4, .mdf), by the library asammdf if it is installed."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from femtune._optional import require
from femtune.files.records.headings import stated_channel
from femtune.files.records.table import NUMBER_KINDS, RecordTable, check_columns, problem

_SAME_TIMES = 1e-6
"""Difference of the time stamps of two channels, relative to the whole duration, up to which they share one clock."""


def read_mdf(path: Path) -> RecordTable:
    """The channels of an MDF file that have numbers, with their names, units and time stamps.

    Raises
    ------
    FemtuneError : ``record.file`` without the library, for a damaged file, and for channels of several clocks
    """
    if importlib.util.find_spec("asammdf") is None:
        raise problem(path, "record.file/no-mdf")
    asammdf = require("asammdf")
    try:
        with _quiet(), asammdf.MDF(path) as file:
            signals = [signal for signal in _signals(file) if _is_record(signal)]
    except (MemoryError, KeyboardInterrupt):
        raise
    # the library raises whatever its own code stumbles over in a damaged file
    except Exception as bad:
        raise problem(path, "record.file/mdf", problem=(str(bad) or type(bad).__name__).splitlines()[0][:120]) from bad
    if not signals:
        raise problem(path, "record.file/mdf", problem="it has no channels with several numbers")
    times = np.asarray(signals[0].timestamps, dtype=float)
    duration = float(np.ptp(times)) or 1.0
    for other in signals[1:]:
        own = np.asarray(other.timestamps, dtype=float)
        if own.shape != times.shape or np.abs(own - times).max() > _SAME_TIMES * duration:
            both = {str(one.name): f"{len(one.timestamps)} samples" for one in (signals[0], other)}
            raise problem(path, "record.file/mdf-clocks", values=both)
    check_columns(len(signals), path)
    names = tuple(str(one.name) for one in signals)
    stated = tuple(stated_channel(str(one.name), str(one.unit or "")) for one in signals)
    values = np.array([np.asarray(one.samples, dtype=float) for one in signals])
    return RecordTable(values, names, None, times, str(path), stated)


def _signals(file: Any) -> Iterator[Any]:
    """Every channel that is no time axis."""
    for number, group in enumerate(file.groups):
        for at in range(len(group.channels)):
            if at != file.masters_db.get(number):
                yield file.get(group=number, index=at)


def _is_record(signal: Any) -> bool:
    samples = np.asarray(signal.samples)
    return samples.ndim == 1 and samples.size > 1 and samples.dtype.kind in NUMBER_KINDS


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what the library writes to its log: it reports damage by errors."""
    log = logging.getLogger("asammdf")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(level)
