"""Time records of Universal Files: data sets 58 of function type 1, ASCII and binary."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from femtune.files.records.headings import stated_channel
from femtune.files.records.table import RecordTable, StatedChannel, problem
from femtune.files.uff.measured_functions import MeasuredFunction, dof_of, read_functions
from femtune.files.uff.scan import scan_uff
from femtune.unit_labels import says_nothing, time_factor

_TIME_RESPONSE = 1
"""Function type of data set 58."""
_TIME = 17
"""Specific data type of the abscissa of data set 58."""
_QUANTITIES = {8: "displacement", 11: "velocity", 12: "acceleration", 13: "force", 15: "pressure", 2: "strain"}


def read_uff_time(path: Path) -> RecordTable:
    """All time records of a file, which must share one clock.

    Raises
    ------
    FemtuneError : ``record.file`` where there are none, or where lengths or steps differ; ``uff.*``
    """
    functions, _ = read_functions(scan_uff(path))
    times = [_in_seconds(f) for f in functions if _is_time(f)]
    if not times:
        kinds = sorted({f.header.function_type for f in functions})
        raise problem(path, "record.file/no-time-records", values={"function_types": kinds})
    _check_clock(path, times)
    first = times[0]
    channels = tuple(_channel(f) for f in times)
    names = tuple(str(c.dof or "") or _label(f) for c, f in zip(channels, times))
    even = first.header.even and first.header.step > 0.0 and len(first.x) > 1
    rate = (len(first.x) - 1) / (first.x[-1] - first.x[0]) if even and first.x[-1] > first.x[0] else None
    values = np.array([f.values for f in times])
    return RecordTable(values, names, rate, None if rate else first.x, str(path), channels)


def _is_time(function: MeasuredFunction) -> bool:
    header = function.header
    return (
        header.function_type == _TIME_RESPONSE
        and header.kinds[0] in (0, _TIME)
        and not np.iscomplexobj(function.values)
    )


def _in_seconds(function: MeasuredFunction) -> MeasuredFunction:
    """With times in s, if the unit label of the axis is another unit of time."""
    factor = time_factor(function.header.unit_labels[0])
    return function if factor in (None, 1.0) else replace(function, x=factor * function.x)


def _check_clock(path: Path, times: Sequence[MeasuredFunction]) -> None:
    first = times[0]
    for other in times[1:]:
        if len(other.x) != len(first.x) or not np.allclose(other.x, first.x, rtol=1e-6, atol=0.0):
            one, two = f"{len(first.x)} samples", f"{len(other.x)} samples at {other.where}"
            raise problem(path, "record.file/different-sampling", values={"first": one, "other": two})


def _channel(function: MeasuredFunction) -> StatedChannel:
    """DOF and quantity by the numbers of the header; by the label and the unit of the axis where these say nothing."""
    header = function.header
    unit = header.unit_labels[1]
    by_label = stated_channel(_label(function), "" if says_nothing(unit) else unit)
    quantity = _QUANTITIES.get(header.kinds[1], by_label.quantity)
    dof = dof_of(*header.response) if any(header.response) else by_label.dof
    return StatedChannel(dof, quantity, unit)


def _label(function: MeasuredFunction) -> str:
    text = function.header.axis_labels[1].strip()
    return "" if says_nothing(text) else text


# ----------------------------------------------------------------------------------------------------
# Records as sound: WAV files of any number of channels; whole numbers become fractions of full scale.


def read_wav(path: Path) -> RecordTable:
    """Channels and sampling rate of a WAV file.

    Raises
    ------
    FemtuneError : ``record.file`` for a file that is cut short or no WAV file
    """
    from scipy.io import wavfile  # noqa: PLC0415  as in the reader of MATLAB files

    try:
        with warnings.catch_warnings():
            # scipy warns of a file that ends too early, and of chunks that are not needed
            warnings.filterwarnings("error", message=".*prematurely.*")
            warnings.filterwarnings("ignore")
            warnings.filterwarnings("error", message=".*prematurely.*")
            rate, data = wavfile.read(path)
    # of a damaged file scipy raises whatever its own code stumbles over, UnboundLocalError for one without data
    except Exception as bad:
        raise problem(path, "record.file/wav", problem=_words(bad)) from bad
    values = np.atleast_2d(data.T).astype(float)
    if data.dtype.kind in "iu":
        middle = 128.0 if data.dtype == np.uint8 else 0.0
        values = (values - middle) / (128.0 if middle else -float(np.iinfo(data.dtype).min))
    return RecordTable(values, ("",) * len(values), float(rate), None, str(path))


def _words(bad: Exception) -> str:
    """What scipy says of the file; an error within its own code says nothing of it."""
    of_file = isinstance(bad, ValueError | EOFError | OSError | Warning)
    return str(bad)[:120] if of_file else "parts of it are missing or damaged"
