"""Records of LabVIEW: text files of measurements (.lvm), and binary ones (.tdms) by the library npTDMS.

The text format is described by National Instruments as "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femtune._optional import require
from femtune.arrays import Reals
from femtune.files.records.headings import stated_channel
from femtune.files.records.table import RecordTable, StatedChannel, check_columns, problem
from femtune.files.records.text import read_lines, read_text

_MARK = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ","}
_SAME_RATE = 1e-6
"""Relative difference up to which time steps of two channels are the same: the format has many digits."""


@dataclass(frozen=True)
class _Segment:
    """Header of a segment by the word in front of each line, number of the line of its headings, and its rows."""

    header: Mapping[str, Sequence[str]]
    line: int
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


def read_lvm(path: Path) -> RecordTable:
    """The record of a LabVIEW measurement file; one without header is read as a table of columns.

    Raises
    ------
    FemtuneError : ``record.file`` for a file that is cut in its header, whose segments are several records, or that has
        text in place of numbers, with its line
    """
    lines = read_lines(path)
    if not lines or not lines[0].startswith(_MARK):
        return read_text(path)
    ends = [i for i, line in enumerate(lines) if line.startswith(_END)]
    if not ends:
        raise problem(path, "record.file/lvm", 1, problem="its header does not end")
    general = _header(lines[: ends[0]], "\t" if "\t" in lines[0] + lines[1] else ",")
    separator = _SEPARATORS.get(_word(general, "Separator", "Tab").lower(), "\t")
    comma = _word(general, "Decimal_Separator", ".") == ","
    segments = _segments(lines, ends, separator)
    if len(segments) != 1:
        raise problem(path, "record.file/lvm", problem=f"it has {len(segments)} segments of data, but one is needed")
    return _record(path, segments[0], _word(general, "X_Columns", "One").lower(), comma)


def _header(lines: Sequence[str], separator: str) -> dict[str, list[str]]:
    rows = [line.split(separator) for line in lines]
    return {row[0].strip(): [cell.strip() for cell in row[1:]] for row in rows if row[0].strip()}


def _word(header: Mapping[str, Sequence[str]], key: str, usual: str) -> str:
    return next(iter(header.get(key, ())), "") or usual


def _segments(lines: Sequence[str], ends: Sequence[int], separator: str) -> list[_Segment]:
    """Each header behind the first one, with the rows up to the next header or the end."""
    out = []
    for k, end in enumerate(ends[1:], 1):
        header = _header(lines[ends[k - 1] + 1 : end], separator)
        stop = ends[k + 1] if k + 1 < len(ends) else len(lines)
        body = [line.split(separator) for line in lines[end + 1 : stop]]
        # the rows end where the header of the next segment begins
        length = next((i for i, row in enumerate(body) if i and row[0].strip() == "Channels"), len(body))
        rows = [row for row in body[1:length] if any(cell.strip() for cell in row)]
        out.append(_Segment(header, end + 2, [cell.strip() for cell in body[0]] if body else [], rows))
    return [one for one in out if one.rows]


def _record(path: Path, segment: _Segment, x_columns: str, comma: bool) -> RecordTable:
    count = _word(segment.header, "Channels", "0")
    channels = int(count) if count.isdecimal() else 0
    check_columns(channels, path)
    # without times the column of times is there too, but empty; some writers leave it out
    no_times = range(1, channels + 1) if not any(row[0].strip() for row in segment.rows) else range(channels)
    at = {"no": no_times, "one": range(1, channels + 1), "multi": range(1, 2 * channels, 2)}.get(x_columns)
    if at is None or not channels:
        raise problem(path, "record.file/lvm", segment.line, problem="its header states no channels or columns")
    stated_samples = [int(text) for text in segment.header.get("Samples", ()) if text.isdecimal()]
    if len(segment.rows) < max(stated_samples, default=0):
        few = f"it states {max(stated_samples)} samples and has {len(segment.rows)}"
        raise problem(path, "record.file/lvm", segment.line, problem=few)
    values = np.array([_numbers(path, segment, row, at, comma) for row in enumerate(segment.rows)]).T
    steps = [_number(text, comma) for text in _of_channels(segment, "Delta_X", x_columns, channels) if text]
    if not steps or any(s is None or not s > 0.0 or abs(s / (steps[0] or s) - 1.0) > _SAME_RATE for s in steps):
        raise problem(path, "record.file/lvm", problem="its channels have not one positive time step")
    named = at if segment.headings[:1] != ["X_Value"] or at.start else range(1, channels + 1)
    headings = [segment.headings[i] if i < len(segment.headings) else "" for i in named]
    units = _of_channels(segment, "Y_Unit_Label", x_columns, channels)
    stated = tuple(stated_channel(name, "" if unit == "Volts" else unit) for name, unit in zip(headings, units))
    return _table(path, values, headings, stated, 1.0 / float(steps[0] or 1.0))


def _of_channels(segment: _Segment, key: str, x_columns: str, channels: int) -> list[str]:
    """The words of a line of the header, one for each channel; of pairs of columns every second one has a word."""
    words = list(segment.header.get(key, ()))
    words = words[::2] if x_columns == "multi" and len(words) >= 2 * channels - 1 else words
    return [*words, *[""] * channels][:channels]


def _table(
    path: Path, values: Reals, headings: Sequence[str], stated: tuple[StatedChannel, ...], rate: float | None
) -> RecordTable:
    return RecordTable(np.ascontiguousarray(values), tuple(headings), rate, None, str(path), stated)


def _number(text: str, comma: bool) -> float | None:
    try:
        return float(text.replace(",", ".") if comma else text) if "_" not in text else None
    except ValueError:
        return None


def _numbers(path: Path, segment: _Segment, row: tuple[int, Sequence[str]], at: range, comma: bool) -> list[float]:
    """The numbers of a row; an empty cell of a shorter channel is NaN."""
    number, cells = row
    if len(cells) <= at[-1]:
        code = "record.file/incomplete-last-line" if number + 1 == len(segment.rows) else "record.file/columns-of-line"
        raise problem(path, code, segment.line + 1 + number, values={"wanted": at[-1] + 1, "found": len(cells)})
    out = []
    for i in at:
        text = cells[i].strip() if i < len(cells) else ""
        value = _number(text, comma) if text else np.nan
        if value is None:
            place = segment.line + 1 + number
            raise problem(path, "record.file/not-a-number", place, values={"column": i + 1}, text=text[:30])
        out.append(value)
    return out


# ----------------------------------------------------------------------------------------------------
# Binary files, by a library that is used if it is installed.


def read_tdms(path: Path) -> RecordTable:
    """The channels of a TDMS file that have numbers: of one length and one time step.

    Raises
    ------
    FemtuneError : ``record.file`` without the library, for a damaged file, and channels of several lengths or steps
    """
    if importlib.util.find_spec("nptdms") is None:
        raise problem(path, "record.file/no-tdms")
    nptdms = require("nptdms")
    try:
        with _complaints() as complaints, nptdms.TdmsFile.open(path) as file:
            channels = [(one, _samples(one)) for group in file.groups() for one in group.channels()]
    except (MemoryError, KeyboardInterrupt):
        raise
    # the library raises whatever its own code stumbles over in a damaged file
    except Exception as bad:
        raise problem(path, "record.file/tdms", problem=(str(bad) or type(bad).__name__)[:120]) from bad
    # of a file that is cut the library reads what is left
    if complaints:
        raise problem(path, "record.file/tdms", problem=complaints[0][:120])
    numeric = [(one, values) for one, values in channels if values is not None and values.size > 1]
    lengths = sorted({values.size for _, values in numeric})
    steps = {float(one.properties.get("wf_increment", 0.0) or 0.0) for one, _ in numeric}
    if len(lengths) != 1 or len(steps) != 1:
        shown = {"samples": str(lengths[:5]), "time steps": str(sorted(steps)[:5])}
        raise problem(path, "record.file/tdms-channels", values=shown)
    names = [str(one.name) for one, _ in numeric]
    stated = tuple(stated_channel(str(one.name), _unit(one.properties)) for one, _ in numeric)
    check_columns(len(names), path)
    step = steps.pop()
    rows = np.array([values for _, values in numeric], dtype=float)
    return _table(path, rows, names, stated, 1.0 / step if step > 0.0 else None)


@contextmanager
def _complaints() -> Iterator[list[str]]:
    """What the library reports to its log, which is not shown."""
    said: list[str] = []
    log = logging.getLogger("nptdms")
    listener, handlers, passes = logging.Handler(logging.WARNING), log.handlers[:], log.propagate
    listener.emit = lambda record: said.append(record.getMessage())  # type: ignore[method-assign]
    log.handlers, log.propagate = [listener], False
    try:
        yield said
    finally:
        log.handlers, log.propagate = handlers, passes


def _samples(channel: Any) -> Any:
    values = np.asarray(channel[:])
    return values if values.dtype.kind in "iuf" and values.ndim == 1 else None


def _unit(properties: Mapping[str, Any]) -> str:
    text = str(properties.get("unit_string", "") or properties.get("NI_UnitDescription", ""))
    return "" if text.lower() in ("volts", "v") else text
