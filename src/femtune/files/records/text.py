"""Records in text: columns with or without names, separated by commas, semicolons, tabs or blanks."""

from __future__ import annotations

import codecs
import datetime
import io
import itertools
import re
from pathlib import Path

import numpy as np

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.files.records.headings import stated_channel, stated_rate
from femtune.files.records.table import RecordTable, check_columns, is_time, problem, split_times
from femtune.unit_labels import says_nothing, unit_label

_MISSING = {"": "nan", "na": "nan", "n/a": "nan", "nan": "nan"}
_MOST_HEADER_LINES = 200
"""Lines before the numbers; loggers write some dozens."""


def read_text(path: Path) -> RecordTable:
    """A text file: header lines, of which the last may name the columns, then one line a sample.

    Lines of words behind the numbers, and columns of words, are left out with a notice. Without times the header may
    state the sampling rate, or the time step.

    Raises
    ------
    FemtuneError : ``record.file`` for text in place of a number, with its line, and for lines of different length
    """
    lines, stamped = _with_seconds(read_lines(path))
    lines, footer = _without_footer(lines)
    lines, words = _without_words(lines)
    first = _first_row(lines, path)
    separator = _separator(lines[first])
    comma = separator != "," and any("," in line for line in lines[first:])
    width = len(_fields(lines[first], separator))
    check_columns(width, path, first + 1)
    values = _quick(lines[first:], separator, comma)
    if values is None or values.shape[1] != width:
        values = _strict(lines, first, separator, comma, width, path)
    names, below = _names(lines, first, separator, width)
    notices = (*((Notice("record.left-out/words", channels=words),) if words else ()), *footer)
    columns = np.ascontiguousarray(values.T)
    if stamped and len(columns) > 1:
        times, columns, names, below = columns[0], columns[1:], names[1:], below[1:]
    else:
        keep = [i for i, name in enumerate(names) if not is_time(name)]
        columns, names, times = split_times(columns, names, below)
        below = tuple(below[i] for i in keep) if below else ()
    channels = tuple(map(stated_channel, names, map(_known, below))) if any(map(_known, below)) else ()
    rate = stated_rate([*lines[:first], *(str(one.facts["text"]) for one in footer)])
    stated, of_rate = (rate, ()) if times is None else (None, _against_times(rate, times))
    numbers = tuple(
        i for i, line in enumerate(lines[first:], first + 1) if line.strip() and line.lstrip()[0] not in "#%"
    )
    return RecordTable(
        columns, names, stated, times, str(path), channels, (*notices, *of_rate),
        lines=numbers if len(numbers) == columns.shape[1] else (),
    )  # fmt: skip


_RATE_DIFFERS = 0.01
"""Relative difference of a rate in the header from that of the times, from which it is told."""


def _against_times(rate: float | None, times: Reals) -> tuple[Notice, ...]:
    """``record.rate/header-differs`` where the header states another rate than the times have.

    Gaps change the mean step only, and rounded times the usual step only: the rate must differ from both.
    """
    steps = np.diff(times)
    if rate is None or not len(steps) or not np.isfinite(times).all() or not (steps > 0.0).all():
        return ()
    usual, mean = 1.0 / float(np.median(steps)), len(steps) / float(times[-1] - times[0])
    if min(abs(rate / one - 1.0) for one in (usual, mean)) <= _RATE_DIFFERS:
        return ()
    return (Notice("record.rate/header-differs", stated=rate, of_times=usual),)


def _is_unit(text: str) -> bool:
    plain = text.strip("[](){} ")
    return says_nothing(plain) or unit_label(plain) is not None


def _known(unit: str) -> str:
    """A unit of motion or force in a line of units; others say nothing of the structure."""
    label = unit_label(unit.strip("[](){} "))
    return unit.strip("[](){} ") if label is not None and (label.motion or label.is_force) else ""


def read_lines(path: Path) -> list[str]:
    """The lines of a text in UTF-8, UTF-16 or Latin-1 (error ``record.file`` for a binary file)."""
    content = path.read_bytes()
    try:
        is_wide = content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        text = content.decode("utf-16" if is_wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    if "\x00" in text:
        raise problem(path, "record.file/binary")
    return text.splitlines()


_MOST_FOOTER_LINES = 20
"""Lines of words behind the numbers; a file with more is another one."""


def _without_footer(lines: list[str]) -> tuple[list[str], tuple[Notice, ...]]:
    """The lines without those at the end that begin with a word, and what they say."""
    end = len(lines)
    while end > 0 and (not lines[end - 1].strip() or re.match(r"\s*\"?[^\W\d_]{2}", lines[end - 1])):
        end -= 1
    words = [line.strip() for line in lines[end:] if line.strip() and line.strip().lower() not in _MISSING]
    if not end or not words or len(words) > _MOST_FOOTER_LINES or _is_row_of_missing(words[0]):
        return lines, ()
    return lines[:end], (Notice("record.left-out/footer", text=" | ".join(words)[:200]),)


def _is_row_of_missing(line: str) -> bool:
    """Whether a line that begins with a word is a sample that the logger did not get."""
    return re.match(r"\s*\"?(nan|na|n/a|inf)\b", line, re.IGNORECASE) is not None


_LIKE_ROWS = 5
"""Lines with words in the same columns that make a table with columns of words."""


def _without_words(lines: list[str]) -> tuple[list[str], str]:
    """The lines without columns of words, and their names; of a table that has no row of numbers alone."""
    head = lines[:_MOST_HEADER_LINES]
    if any(_is_row(line) for line in head):
        return lines, ""
    kinds = [_kinds(line) for line in head]
    like = (i for i, kind in enumerate(kinds) if sum(kind) > 1 and kinds[i : i + _LIKE_ROWS] == [kind] * _LIKE_ROWS)
    first = next(like, None)
    if first is None:
        return lines, ""
    separator, kind = _separator(lines[first]) or " ", kinds[first]
    out = []
    for line in lines:
        fields = _fields(line, separator)
        same = len(fields) == len(kind)
        out.append(separator.join(f for f, number in zip(fields, kind) if number) if same else line)
    names = _names(lines, first, separator, len(kind))[0]
    return out, ", ".join(name or f"column {i}" for i, (name, number) in enumerate(zip(names, kind), 1) if not number)


def _is_row(line: str) -> bool:
    """Whether a line is one of numbers, at least one of them given."""
    if not line.strip() or line.lstrip()[0] in "#%":
        return False
    separator = _separator(line)
    fields = _fields(line, separator)
    return _numbers(fields, separator != ",") and any(f.strip() for f in fields)


def _kinds(line: str) -> list[bool]:
    """Of each field, whether it is a number."""
    separator = _separator(line)
    return [bool(f.strip()) and _number(f, separator != ",") is not None for f in _fields(line, separator)]


_STAMP = re.compile(
    r'\s*"?(?:(?P<date>\d{4}[-/]\d\d?[-/]\d\d?|\d\d?[./]\d\d?[./]\d{4})(?:[T ]|"?[;,\t]"?)\s*)?'
    r'(?P<hours>\d\d?):(?P<minutes>\d\d):(?P<seconds>\d\d(?:[.,]\d+(?=["\s;,\t]|Z|[+-]\d\d:)|:\d{3}(?!\d))?)'
    r'(?:\s?(?P<half>[AP]M))?(?:Z|[+-]\d\d:?\d\d)?"?'
)
"""A date and time of day, or a time of day, at the start of a line; date and time may be two columns."""
_DAY_S = 86_400.0
"""Seconds of a day."""
_LEAST_STAMPED = 2
"""Lines at the start of the numbers that must begin with a date or time."""


def _with_seconds(lines: list[str]) -> tuple[list[str], bool]:
    """The lines with seconds since the first one in place of dates and times of day, and whether they had any."""
    first = next((i for i, line in enumerate(lines[:_MOST_HEADER_LINES]) if _is_stamped(line)), len(lines))
    if first + _LEAST_STAMPED > len(lines) or not all(map(_is_stamped, lines[first : first + _LEAST_STAMPED])):
        return lines, False
    stamps = {i: match for i, line in enumerate(lines[first:], first) if (match := _STAMP.match(line)) is not None}
    moments, days, before = {}, 0, 0.0
    for i, match in stamps.items():
        seconds = float(match["seconds"].replace(",", ".").replace(":", "."))
        hours = int(match["hours"])
        hours = hours if match["half"] is None else hours % 12 + 12 * (match["half"] == "PM")
        clock = 3600.0 * hours + 60.0 * int(match["minutes"]) + seconds
        day = _day(match["date"])
        # midnight, where no date says so
        days += day is None and clock < before - 0.5 * _DAY_S
        before = clock
        moments[i] = (days if day is None else day, clock)
    start_day, start = moments[first]
    out = list(lines)
    for i, (day, clock) in moments.items():
        out[i] = f"{_DAY_S * (day - start_day) + clock - start:.9f}{lines[i][stamps[i].end() :]}"
    between = lines[first][stamps[first].end("date") : stamps[first].start("hours")] if stamps[first]["date"] else ""
    if mark := between.strip('" T'):
        # date and time are two columns with two headings
        wanted = out[first].count(mark)
        out[:first] = [line.partition(mark)[2] if line.count(mark) == wanted + 1 else line for line in out[:first]]
    return out, True


def _is_stamped(line: str) -> bool:
    """Whether a line begins with a time of day, and numbers follow."""
    match = _STAMP.match(line)
    return match is not None and re.match(r"\s*[;,\t ]\s*\S*\d", line[match.end() :]) is not None


def _day(date: str | None) -> int | None:
    """Number of the day of a date that begins with the year; others do not tell day and month apart."""
    year, *rest = re.split(r"[-/.]", date) if date else [""]
    try:
        return datetime.date(int(year), *map(int, rest)).toordinal() if len(year) == len("2024") else None
    except ValueError:
        return None


def _separator(line: str) -> str | None:
    """Of a row of numbers: a semicolon or tab where one is there; a comma, unless blanks separate decimal commas."""
    for mark in (";", "\t"):
        if mark in line:
            return mark
    by_blanks = line.split()
    return "," if "," in line and not (len(by_blanks) > 1 and _numbers(by_blanks, True)) else None


def _fields(line: str, separator: str | None) -> list[str]:
    fields = line.split(separator)
    return fields[:-1] if separator and len(fields) > 1 and not fields[-1].strip() else fields


def _number(text: str, comma: bool) -> float | None:
    plain = text.strip().strip('"')
    plain = plain.replace(",", ".") if comma else plain
    try:
        return float(_MISSING.get(plain.lower(), plain)) if "_" not in plain else None
    except ValueError:
        return None


def _numbers(fields: list[str], comma: bool) -> bool:
    return len(fields) > 0 and all(_number(f, comma) is not None for f in fields)


def _first_row(lines: list[str], path: Path) -> int:
    """The first line that is all numbers, at least one of them given."""
    first = next((i for i, line in enumerate(lines[:_MOST_HEADER_LINES]) if _is_row(line)), None)
    if first is not None:
        return first
    raise problem(path, "record.file/no-numbers")


def _quick(rows: list[str], separator: str | None, comma: bool) -> np.ndarray | None:
    text = "\n".join(rows)
    try:
        return np.loadtxt(io.StringIO(text.replace(",", ".") if comma else text), delimiter=separator, ndmin=2)
    except ValueError:
        return None


def _strict(lines: list[str], first: int, separator: str | None, comma: bool, width: int, path: Path) -> np.ndarray:
    """Row by row, so that what is wrong has its line."""
    out = []
    for number, line in enumerate(lines[first:], first + 1):
        if not line.strip() or line.lstrip()[0] in "#%":
            continue
        fields = _fields(line, separator)
        if len(fields) != width:
            last = not any(later.strip() for later in lines[number:])
            code = "record.file/columns-of-line"
            if last:
                code = "record.file/incomplete-last-line" if len(fields) < width else "record.file/columns-of-last-line"
            raise problem(path, code, number, values={"wanted": width, "found": len(fields)})
        row = [_number(f, comma) for f in fields]
        if None in row:
            bad = fields[row.index(None)].strip()[:30]
            hint = "leave a missing sample empty, or write nan"
            raise problem(
                path, "record.file/not-a-number", number, values={"column": row.index(None) + 1}, hint=hint, text=bad
            )
        out.append(row)
    return np.array(out, dtype=float)


def _names(lines: list[str], first: int, separator: str | None, width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names from the lines before the numbers that have as many of them as there are columns, and the line below them.

    It is the line that names a column of times, as a line of units may follow; otherwise the last one. () without a
    line below.
    """
    before = [line for line in lines[:first] if line.strip()]
    rows = [tuple(f.strip().strip('"') for f in _fields(line.lstrip("#% "), separator)) for line in reversed(before)]
    rows = list(itertools.takewhile(lambda row: len(row) == width, rows))
    if not rows:
        return ("",) * width, ()
    at = next((i for i, row in enumerate(rows) if any(map(is_time, row))), 0)
    if at + 1 < len(rows) and all(map(_is_unit, rows[at])) and any(map(is_time, rows[at + 1])):
        at += 1
    return rows[at], rows[at - 1] if at else ()
