"""Walk through a Universal File: which data sets it has, where, and whether they are whole.

The library that reads the values (pyuff) passes over damage in silence, so the frame of the file is checked
here first: delimiters, data set numbers, declared lengths of binary blocks, and text outside data sets. A file
that ends between two data sets cannot be told from a shorter whole file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from femtune.errors import FemtuneError, Where

_BLANK = b" \t\r\n\x00\x1a"
_NUMBER_LINE = re.compile(r" {0,5}(\d{1,6})([bB]?)(?:\s.*)?")
_BINARY_FIELDS = ((7, 13), (13, 19), (19, 31), (31, 43))


@dataclass(frozen=True)
class DataSet:
    """One data set as it stands in the file.

    Parameters
    ----------
    file : its file
    number : 55, 58, 2411 …
    line : line number of its opening delimiter
    head : the line that holds the number
    lines : the text lines that follow, without line ends and trailing blanks
    payload : the bytes of a binary data set, else empty
    binary : True for 58b and its kin
    """

    file: str
    number: int
    line: int
    head: str
    lines: tuple[str, ...]
    payload: bytes = b""
    binary: bool = False

    def where(self, i: int | None = None) -> Where:
        """The place of text line `i`, or of the data set."""
        line = self.line if i is None else self.line + 2 + i
        return Where(self.file, line, f"data set {self.number}{'b' if self.binary else ''}")

    def error(
        self,
        code: str,
        i: int | None = None,
        *,
        values: dict[str, Any] | None = None,
        hint: str | None = None,
        **facts: Any,
    ) -> FemtuneError:
        """An error at text line `i` of this data set."""
        return FemtuneError(code, where=self.where(i), values=values, hint=hint, **facts)


class _UffReader:
    """A position in the bytes of a file, and its line number."""

    def __init__(self, data: bytes, file: str) -> None:
        self.data, self.file, self.position, self.line = data, file, 0, 0

    def more(self) -> bool:
        return self.position < len(self.data)

    def take(self) -> bytes:
        end = self.data.find(b"\n", self.position)
        end = len(self.data) if end < 0 else end
        text = self.data[self.position : end]
        self.position, self.line = end + 1, self.line + 1
        return text

    def where(self, record: str = "") -> Where:
        return Where(self.file, self.line, record)


def scan_uff(path: str | Path) -> tuple[DataSet, ...]:
    """The data sets of a Universal File in their order.

    Raises
    ------
    FemtuneError : ``uff.no-file``, ``uff.not-uff``, ``uff.outside``, ``uff.syntax``, ``uff.truncated``,
        ``uff.binary-length``
    """
    reader = _UffReader(_bytes(Path(path)), str(path))
    if not any(map(_is_delimiter, reader.data.splitlines())):
        raise FemtuneError("uff.not-uff/deck" if _DECK.search(reader.data) else "uff.not-uff", where=Where(str(path)))
    data_sets = []
    while reader.more():
        line = reader.take()
        if _is_delimiter(line):
            data_sets.append(_data_set(reader))
        elif line.strip(_BLANK):
            raise _outside(reader, line)
    return tuple(data_sets)


def _bytes(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise FemtuneError("uff.no-file", where=Where(str(path)), strerror=problem.strerror) from problem
    return data if b"\n" in data else data.replace(b"\r", b"\n")


_DECK = re.compile(rb"^(BEGIN\s+BULK|GRID[\s,*]|CEND\b)", re.MULTILINE | re.IGNORECASE)
"""Lines of a Nastran deck."""


def _is_delimiter(line: bytes) -> bool:
    return line[:6] == b"    -1" and not line[6:].strip(_BLANK)


def _outside(reader: _UffReader, line: bytes) -> FemtuneError:
    return FemtuneError("uff.outside", where=reader.where(), values={"text": repr(_text(line)[:60])})


def _text(line: bytes) -> str:
    return line.decode("utf-8", errors="replace").rstrip(" \r\n\x00\x1a")


def _data_set(reader: _UffReader) -> DataSet:
    opened = reader.line
    head = _text(reader.take()) if reader.more() else ""
    match = _NUMBER_LINE.fullmatch(head)
    if match is None:
        raise _no_number(reader, opened, head)
    start = DataSet(reader.file, int(match[1]), opened, head, (), b"", bool(match[2]))
    return _binary(reader, start) if start.binary else _ascii(reader, start)


def _no_number(reader: _UffReader, opened: int, head: str) -> FemtuneError:
    where = Where(reader.file, opened)
    if not reader.more():
        return FemtuneError("uff.truncated", where=where)
    return FemtuneError("uff.syntax", where=where, values={"found": repr(head[:60])})


def _ascii(reader: _UffReader, start: DataSet) -> DataSet:
    lines: list[str] = []
    while reader.more():
        line = reader.take()
        if _is_delimiter(line):
            return _with(start, lines)
        lines.append(_text(line))
    raise _cut(_with(start, lines), "its closing delimiter", {"expected": "'    -1'", "found": "end of file"})


def _with(start: DataSet, lines: list[str], payload: bytes = b"") -> DataSet:
    return DataSet(start.file, start.number, start.line, start.head, tuple(lines), payload, start.binary)


def _cut(part: DataSet, missing: str, values: dict[str, Any]) -> FemtuneError:
    last = max(len(part.lines) - 1, 0)
    return part.error(
        "uff.truncated/inside-data-set",
        last,
        values={**values, **_declared(part)},
        data_set=part.number,
        line=part.line,
        missing=missing,
    )


def _declared(part: DataSet) -> dict[str, Any]:
    """How many points a cut data set 58 declares, where its header is still whole."""
    text = part.lines[6][10:20].strip() if part.number == 58 and len(part.lines) > 6 else ""
    return {"points declared": int(text)} if text.isdecimal() else {}


def _binary(reader: _UffReader, start: DataSet) -> DataSet:
    header_lines, declared = _binary_lengths(start)
    lines = [_text(reader.take()) for _ in range(header_lines) if reader.more()]
    length = _true_length(reader, _with(start, lines), declared)
    payload = reader.data[reader.position : reader.position + length]
    whole = _with(start, lines, payload)
    if len(lines) < header_lines or len(payload) < length:
        raise _cut(whole, "a part of its bytes", {"bytes expected": length, "bytes found": len(payload)})
    reader.position += length
    _close_binary(reader, whole)
    return whole


def _true_length(reader: _UffReader, start: DataSet, declared: int) -> int:
    """The declared length, or that of the declared points where only this one ends at a delimiter.

    pyuff itself declares half the length of complex functions.
    """
    by_points = _length_of_points(start)
    if not _closes(reader, declared) and by_points is not None and _closes(reader, by_points):
        return by_points
    return declared


def _closes(reader: _UffReader, length: int) -> bool:
    rest = reader.data[reader.position + length : reader.position + length + 200].lstrip(b"\r\n")
    return _is_delimiter(rest.partition(b"\n")[0])


def _length_of_points(start: DataSet) -> int | None:
    texts = [start.lines[6][k : k + 10].strip() for k in (0, 10, 20)] if len(start.lines) > 6 else []
    if start.number != 58 or not texts or not all(text.isdecimal() for text in texts):
        return None
    value_type, points, spacing = map(int, texts)
    numbers = (2 if value_type > 4 else 1) + (0 if spacing else 1)
    return points * numbers * (4 if value_type in (2, 5) else 8)


def _close_binary(reader: _UffReader, whole: DataSet) -> None:
    length = len(whole.payload)
    reader.line += whole.payload.count(b"\n")
    rest = reader.data[reader.position : reader.position + 8]
    gap = len(rest) - len(rest.lstrip(b"\r\n"))
    reader.position += gap
    if not reader.more():
        raise _cut(whole, "its closing delimiter", {"expected": "'    -1'", "found": "end of file"})
    if not _is_delimiter(line := reader.take()):
        if b"\n" not in reader.data[reader.position - 1 :] and b"    -1".startswith(line[:6]):
            raise _cut(whole, "its closing delimiter", {"expected": "'    -1'", "found": repr(line[:6])})
        raise whole.error("uff.binary-length/no-delimiter", values={"bytes declared": length})


def _binary_lengths(start: DataSet) -> tuple[int, int]:
    texts = [start.head[a:b].strip() for a, b in _BINARY_FIELDS]
    if not all(text.isdecimal() for text in texts) or int(texts[2]) > 100:
        raise start.error("uff.syntax/binary-header", values={"found": repr(start.head[:60])})
    return int(texts[2]), int(texts[3])
