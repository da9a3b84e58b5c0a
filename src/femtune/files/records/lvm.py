"""Records of LabVIEW as text: measurement files (.lvm).

The format is described by National Instruments as "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.files.records.clocks import ClockGroup
from femtune.files.records.headings import stated_channel
from femtune.files.records.table import RecordTable, check_columns, problem, with_unnamed_times
from femtune.files.records.text import read_lines, read_text

_MARK = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ","}
_SAME_STEP = 1e-6
"""Relative difference up to which time steps of two channels are the same."""
_WRITTEN = 1e-6
"""Last digit of times in the column X_Value, in s."""
_EVEN = 0.05
"""Deviation of times from even steps, relative to the step, that their rounding explains beside `_WRITTEN`."""
_NO_STEP = "a channel has no positive time step (Delta_X)"
_CLOCK_STARTS = 1904
"""First year of the clock of LabVIEW: a time before it was not set."""


@dataclass(frozen=True)
class _Segment:
    """Header of a segment by the word in front of each line, number of the line of its headings, and its rows."""

    header: Mapping[str, Sequence[str]]
    line: int
    headings: Sequence[str]
    rows: Sequence[str]


@dataclass(frozen=True)
class _Layout:
    """How the rows of a file are written.

    Parameters
    ----------
    separator : of the cells
    comma : whether decimals follow a comma
    x_columns : "no", "one" or "multi"
    """

    separator: str
    comma: bool
    x_columns: str

    def cells(self, line: str) -> list[str]:
        return line.split(self.separator)

    def number(self, text: str) -> float | None:
        """A number; NaN for an empty cell, None for another text."""
        if not text.strip():
            return float("nan")
        try:
            return float(text.replace(",", ".") if self.comma else text) if "_" not in text else None
        except ValueError:
            return None

    def of_channels(self, segment: _Segment, key: str, channels: int) -> list[str]:
        """The words of a line of the header, one for each channel; of pairs of columns every second one has a word."""
        words = list(segment.header.get(key, ()))
        words = words[::2] if self.x_columns == "multi" and len(words) >= 2 * channels - 1 else words
        return [*words, *[""] * channels][:channels]


def read_lvm(path: Path) -> list[ClockGroup]:
    """The channels of a LabVIEW measurement file, by time steps; one without header is read as a table of columns.

    Segments follow each other with the times that they state. Channels without any number are not listed.

    Raises
    ------
    FemtuneError : ``record.file`` for a file that is cut in its header, whose segments have different channels, or that
        has text in place of numbers, with its line
    """
    lines = read_lines(path)
    ends = [i for i, line in enumerate(lines) if line.startswith(_END)]
    if not lines or not lines[0].startswith(_MARK) or len(ends) == 1:
        # with one header only there is a plain table behind it
        return [ClockGroup("", with_unnamed_times(read_text(path)))]
    if not ends:
        raise problem(path, "record.file/lvm", 1, problem="its header does not end")
    general = _header(lines[: ends[0]], "\t" if "\t" in lines[0] + lines[1] else ",")
    layout = _Layout(
        _SEPARATORS.get(_word(general, "Separator", "Tab").lower(), "\t"),
        _word(general, "Decimal_Separator", ".") == ",",
        _word(general, "X_Columns", "One").lower(),
    )
    segments = list(_segments(lines, ends, layout))
    if not segments:
        raise problem(path, "record.file/lvm", problem="it has no segment with samples")
    return _by_steps(path, [_Samples.of(path, one, layout) for one in segments])


def _header(lines: Sequence[str], separator: str) -> dict[str, list[str]]:
    rows = [line.split(separator) for line in lines]
    return {row[0].strip(): [cell.strip() for cell in row[1:]] for row in rows if row[0].strip()}


def _word(header: Mapping[str, Sequence[str]], key: str, usual: str) -> str:
    return next(iter(header.get(key, ())), "") or usual


def _segments(lines: Sequence[str], ends: Sequence[int], layout: _Layout) -> Iterator[_Segment]:
    """Each header behind the first one, with the rows up to the next header or the end."""
    begins = [_begin_of_header(lines, end, layout) for end in ends[1:]]
    for begin, end, stop in zip(begins, ends[1:], [*begins[1:], len(lines)]):
        headings = [cell.strip() for cell in layout.cells(lines[end + 1])] if end + 1 < stop else []
        rows = [line for line in lines[end + 2 : stop] if line.strip()]
        if rows:
            yield _Segment(_header(lines[begin:end], layout.separator), end + 2, headings, rows)


def _begin_of_header(lines: Sequence[str], end: int, layout: _Layout) -> int:
    """The first line of a header: before it there is an empty line, or one that begins with a number."""
    begin = end
    while begin > 0:
        first = layout.cells(lines[begin - 1])[0].strip()
        if not first or layout.number(first) is not None or lines[begin - 1].startswith(_END):
            break
        begin -= 1
    return begin


# ----------------------------------------------------------------------------------------------------
# One segment.


@dataclass(frozen=True, eq=False)
class _Samples:
    """The channels of a segment that have numbers.

    Parameters
    ----------
    names, units : of the channels
    steps : (channels,) as they are stated
    digits : relative error of each step by its last digit
    columns : values of each channel; those of a slower channel without the rows that it leaves empty
    times : of each channel, as they are written beside it, or None
    begins : time of the first sample of each channel, from the beginning of the segment
    begin_s : date and time at which the segment began, or None
    line : of its headings
    """

    names: list[str]
    units: list[str]
    steps: list[float]
    digits: list[float]
    columns: list[Reals]
    times: list[Reals | None]
    begins: list[float]
    begin_s: float | None
    line: int

    @staticmethod
    def of(path: Path, segment: _Segment, layout: _Layout) -> _Samples:
        channels, at = _places(path, segment, layout)
        stated = [int(text) for text in segment.header.get("Samples", ()) if text.isdecimal()]
        if len(segment.rows) < max(stated, default=0):
            few = f"it states {max(stated)} samples and has {len(segment.rows)}"
            raise problem(path, "record.file/lvm", segment.line, problem=few)
        wanted = [*at, *sorted({i for i in (_times_at(one, layout) for one in at) if i is not None})]
        table = dict(zip(wanted, _numbers(path, segment, layout, wanted, len(at))))
        with_x = segment.headings[:1] != ["X_Value"] or at.start > 0
        headings = [*(segment.headings if with_x else segment.headings[1:]), *[""] * (max(at) + 1)]
        words = layout.of_channels(segment, "Delta_X", channels)
        kept = [k for k, i in enumerate(at) if not np.isnan(table[i]).all()]
        steps = [float(layout.number(words[k]) or 0.0) for k in kept]
        if not kept or not all(step > 0.0 for step in steps):
            raise problem(
                path, "record.file/lvm", segment.line, problem="a channel has no positive time step (Delta_X)"
            )
        columns, times = [], list[Reals | None]()
        for k, step in zip(kept, steps):
            values, at_x = table[at[k]], _times_at(at[k], layout)
            # a slower channel leaves rows empty
            slower = step > min(steps) * (1.0 + _SAME_STEP)
            there = ~np.isnan(values) if slower else np.full(len(values), True)
            of_channel = at_x is not None and not (slower and layout.x_columns == "one")
            x = table[at_x][there] if of_channel and at_x is not None else None
            columns.append(values[there])
            times.append(None if x is None or np.isnan(x).any() else x)
        units = layout.of_channels(segment, "Y_Unit_Label", channels)
        begins = [layout.number(text) or 0.0 for text in layout.of_channels(segment, "X0", channels)]
        begins = [begins[k] if np.isfinite(begins[k]) else 0.0 for k in kept]
        return _Samples(
            [headings[at[k]] for k in kept],
            # volts are what LabVIEW writes where nobody has stated a unit
            ["" if units[k] in ("Volts", "V") else units[k] for k in kept],
            steps, [_last_digit(words[k]) for k in kept], columns, times, begins, _begin(segment), segment.line,
        )  # fmt: skip

    @property
    def clocks(self) -> list[list[int]]:
        """Positions of the channels of each time step and length."""
        kinds = [(f"{step:.6g}", len(column)) for step, column in zip(self.steps, self.columns)]
        return [[i for i, kind in enumerate(kinds) if kind == one] for one in dict.fromkeys(kinds)]


def _places(path: Path, segment: _Segment, layout: _Layout) -> tuple[int, range]:
    """Number of channels, and the columns in which they stand."""
    count = _word(segment.header, "Channels", "0")
    channels = int(count) if count.isdecimal() and len(count) < len(str(10**6)) else 0
    check_columns(channels, path)
    # without times the column of times is there too, but empty; some writers leave it out
    without = range(channels) if any(layout.cells(row)[0].strip() for row in segment.rows) else range(1, channels + 1)
    places = {"no": without, "one": range(1, channels + 1), "multi": range(1, 2 * channels, 2)}
    at = places.get(layout.x_columns)
    if at is None or not channels:
        raise problem(path, "record.file/lvm", segment.line, problem="its header states no channels or columns")
    return channels, at


def _times_at(column: int, layout: _Layout) -> int | None:
    """The column of the times of a column of values."""
    return {"no": None, "one": 0, "multi": column - 1}[layout.x_columns]


def _numbers(path: Path, segment: _Segment, layout: _Layout, at: Sequence[int], channels: int) -> Reals:
    """(columns, rows) numbers; an empty cell is NaN. The last of the channels must be there in each row."""
    rows = [line.replace(",", ".") for line in segment.rows] if layout.comma else segment.rows
    try:
        # of complete rows, without comments, in a tenth of the time
        return np.loadtxt(rows, delimiter=layout.separator, usecols=list(at), ndmin=2, comments=None).T
    except ValueError:
        return np.array([_row(path, segment, layout, number, at, channels) for number in range(len(segment.rows))]).T


def _row(path: Path, segment: _Segment, layout: _Layout, number: int, at: Sequence[int], channels: int) -> list[float]:
    cells, line, last = layout.cells(segment.rows[number]), segment.line + 1 + number, max(at[:channels])
    if len(cells) <= last:
        code = "record.file/incomplete-last-line" if number + 1 == len(segment.rows) else "record.file/columns-of-line"
        raise problem(path, code, line, values={"wanted": last + 1, "found": len(cells)})
    out = []
    for i in at:
        value = layout.number(cells[i])
        if value is None:
            text = cells[i].strip()[:30]
            raise problem(path, "record.file/not-a-number", line, values={"column": i + 1}, text=text)
        out.append(value)
    return out


def _last_digit(text: str) -> float:
    """Half of the last digit of a positive number, relative to it."""
    mantissa = re.split("[eE]", text.replace(",", "."))[0].strip()
    decimals = len(mantissa.partition(".")[2])
    try:
        return 0.5 * 10.0**-decimals / float(mantissa)
    except (ValueError, ZeroDivisionError):
        return 0.0


def _begin(segment: _Segment) -> float | None:
    """Date and time of the first channel of a segment in seconds; None where they were not set."""
    day = re.fullmatch(r"(\d{4})[/.-](\d\d?)[/.-](\d\d?)", _word(segment.header, "Date", ""))
    clock = re.fullmatch(r"(\d\d?):(\d\d?):(\d\d?(?:[.,]\d+)?)", _word(segment.header, "Time", ""))
    try:
        days = datetime.date(*map(int, day.groups())).toordinal() if day and int(day[1]) >= _CLOCK_STARTS else None
    except ValueError:
        return None
    if days is None or clock is None:
        return None
    return 86_400.0 * days + 3600.0 * int(clock[1]) + 60.0 * int(clock[2]) + float(clock[3].replace(",", "."))


# ----------------------------------------------------------------------------------------------------
# All segments.


def _by_steps(path: Path, segments: Sequence[_Samples]) -> list[ClockGroup]:
    """A group for each time step, with the samples of all segments."""
    first = segments[0]
    for other in segments[1:]:
        same = other.names == first.names and np.allclose(other.steps, first.steps, rtol=_SAME_STEP, atol=0.0)
        if not same or len(other.clocks) != len(first.clocks):
            raise problem(path, "record.file/lvm", other.line, problem="its segments have different channels")
    groups = []
    for k, at in enumerate(first.clocks):
        names = tuple(first.names[i] for i in at)
        stated = tuple(stated_channel(first.names[i], first.units[i]) for i in at)
        pieces = [np.array([one.columns[i] for i in one.clocks[k]]) for one in segments]
        values = np.concatenate(pieces, axis=1)
        step = first.steps[at[0]]
        times, notices = _times(segments, [one.clocks[k][0] for one in segments], step)
        rate, error = (1.0 / step, first.digits[at[0]]) if times is None else (None, 0.0)
        name = f"{1.0 / step:.6g} Hz" + (f", {values.shape[1]} samples" if len(first.clocks) > 1 else "")
        table = RecordTable(values, names, rate, times, str(path), stated, notices, error)
        groups.append(ClockGroup(name, table))
    return groups


def _times(
    segments: Sequence[_Samples], channels: Sequence[int], step: float
) -> tuple[Reals | None, tuple[Notice, ...]]:
    """The times of all samples of a clock; None for an even step without a time of its own.

    The column of times is preferred: the step is often written with few digits. A segment that does not state when it
    began stands one sample behind the end of the one before it, so that it does not continue it.
    """
    own = [_of_segment(one, i, step) for one, i in zip(segments, channels)]
    if len(segments) == 1:
        return (own[0] if segments[0].times[channels[0]] is not None else None), ()
    origin = segments[0].begin_s
    placed, untimed = [own[0]], 0
    for segment, times in zip(segments[1:], own[1:]):
        end = float(placed[-1][-1])
        since = 0.0 if origin is None or segment.begin_s is None else segment.begin_s - origin
        begin = since + float(times[0])
        if abs(begin - end - step) < 0.5 * step:
            begin = end + step
        elif begin <= end:
            begin, untimed = end + 2.0 * step, untimed + 1
        placed.append(times - times[0] + begin)
    notices = (Notice("record.segments-untimed", count=len(segments), untimed=untimed),) if untimed else ()
    return np.concatenate(placed), notices


def _of_segment(segment: _Samples, channel: int, step: float) -> Reals:
    """Times of the samples of a channel in its segment: as they are written, even where their rounding is all else."""
    written, count = segment.times[channel], len(segment.columns[channel])
    if written is None or count < 2:
        return np.asarray(segment.begins[channel] + step * np.arange(count), dtype=np.float64)
    even: Reals = np.linspace(written[0], written[-1], count, dtype=np.float64)
    own = float(written[-1] - written[0]) / (count - 1)
    is_even = bool(np.abs(written - even).max() <= max(_EVEN * own, _WRITTEN))
    return even if is_even else written
