"""Walk through a Universal File: which data sets it has, where, and whether they are whole.

Readers that pass over damage in silence return fewer values, so the frame of the file is checked here first:
delimiters, data set numbers, declared lengths of binary blocks, and text outside data sets. A file that ends between
two data sets cannot be told from a shorter whole file.

The standard delimiter is -1 in columns 5 and 6. Programs also write it elsewhere in the line, write remarks between
data sets and leave out the last delimiter. Such files are read, with a notice, where nothing can be lost by it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.formats import RECORD_FORMATS

_BLANK = b" \t\r\n\x00\x1a"
_NUMBER_LINE = re.compile(r" {0,5}(\d{1,6})([bB]?)(?:\s.*)?")
_SHIFTED_NUMBER = re.compile(r"\s*(\d{1,6})(?:([bB])\s.*)?\s*")
_NUMBER_ALONE = re.compile(rb"\s*\d{1,6}([bB]\s.*)?\s*")
_BINARY_FIELDS = ((7, 13), (13, 19), (19, 31), (31, 43))
_USUAL = {b"15", b"18", b"55", b"58", b"82", b"151", b"164", b"1858", b"2411", b"2412", b"2414", b"2420", b"781"}
"""Data sets with which files of tests begin."""
_TEXT_AHEAD = 65_536
"""Bytes at the start of a file in which its first delimiter is looked for, if its extension says nothing."""


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
    notices : what is unusual about its frame, and about the lines between it and the data set before
    """

    file: str
    number: int
    line: int
    head: str
    lines: tuple[str, ...]
    payload: bytes = b""
    binary: bool = False
    notices: tuple[Notice, ...] = ()

    @property
    def binary_form(self) -> tuple[str, str, str, str]:
        """Order of the bytes, format of numbers, number of header lines and of bytes, as the head of a binary data set
        states them: in columns, or else separated by blanks."""
        texts = [self.head[a:b].strip() for a, b in _BINARY_FIELDS]
        if not all(text.isdecimal() for text in texts[2:]):
            texts = [*self.head.split()[1:5], "", "", "", ""]
        order, form, lines, size = texts[:4]
        return order, form, lines, size

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

    def ahead(self) -> bytes:
        """The next line that is not blank, which stays to be taken; b"" at the end of the file."""
        position = self.position
        while position < len(self.data):
            end = self.data.find(b"\n", position)
            end = len(self.data) if end < 0 else end
            if (line := self.data[position:end]).strip(_BLANK):
                return line
            position = end + 1
        return b""

    def opens(self, line: bytes) -> bool:
        """Whether a line outside of data sets begins one: the number of a data set follows a shifted delimiter."""
        return _is_delimiter(line) or (_is_shifted(line) and _number(_text(self.ahead())) is not None)

    def closes(self, line: bytes) -> bool:
        """Whether a line of a data set ends it: a shifted delimiter is followed by another one, or by nothing."""
        if _is_delimiter(line):
            return True
        if not _is_shifted(line):
            return False
        ahead = self.ahead()
        if not ahead or _is_delimiter(ahead) or _is_shifted(ahead) or self._remark_ahead():
            return True
        # the delimiter of the next data set, whose number is then found outside: this one has lost its own
        return line.index(b"-1") < len("    ") and _NUMBER_ALONE.fullmatch(ahead.rstrip(_BLANK)) is not None

    def _remark_ahead(self) -> bool:
        """Whether remarks follow, and then the beginning of a data set."""
        rest = self.data[self.position : self.position + 4000].split(b"\n")
        lines = [line for line in rest if line.strip(_BLANK)]
        at = next((i for i, line in enumerate(lines) if _is_delimiter(line) or _is_shifted(line)), len(lines))
        follows = lines[at + 1] if at + 1 < len(lines) else b""
        return all(map(_is_remark, lines[:at])) and _NUMBER_ALONE.fullmatch(follows) is not None

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
    if not any(_is_delimiter(line) or _is_shifted(line) for line in reader.data.splitlines()):
        raise FemtuneError("uff.not-uff/deck" if _DECK.search(reader.data) else "uff.not-uff", where=Where(str(path)))
    data_sets: list[DataSet] = []
    remarks: list[Notice] = []
    while reader.more():
        line = reader.take()
        if reader.opens(line):
            data_set = _data_set(reader, data_sets)
            shifted = (Notice("uff.delimiter", where=data_set.where(), level="info"),) if _is_shifted(line) else ()
            data_sets.append(replace(data_set, notices=(*remarks, *shifted, *data_set.notices)))
            remarks = []
        elif line.strip(_BLANK):
            remarks.append(_remark(reader, line))
    if data_sets and remarks:
        data_sets[-1] = replace(data_sets[-1], notices=(*data_sets[-1].notices, *remarks))
    if not data_sets:
        raise FemtuneError("uff.not-uff", where=Where(str(path)))
    return tuple(data_sets)


def is_universal(path: str | Path) -> bool:
    """Whether the content of a file, whatever its extension, begins as a Universal File does."""
    try:
        with Path(path).open("rb") as stream:
            start = stream.read(_TEXT_AHEAD)
    except OSError:
        return False
    lines = [line for line in start.replace(b"\r", b"\n").split(b"\n") if line.strip(_BLANK)]
    first = next((i for i, line in enumerate(lines) if _is_delimiter(line) or _is_shifted(line)), len(lines))
    follows = lines[first + 1].split() if first + 1 < len(lines) else []
    return bool(follows) and follows[0].rstrip(b"bB") in _USUAL and all(map(_is_remark, lines[:first]))


def names_universal(path: str | Path) -> bool:
    """Whether a path names a Universal File: by its extension or, with any other one, by its content."""
    return Path(path).suffix.lower() in RECORD_FORMATS["uff"].suffixes or is_universal(path)


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


def _is_shifted(line: bytes) -> bool:
    """-1 alone in a line, but not in columns 5 and 6."""
    return line.strip(_BLANK) == b"-1" and not _is_delimiter(line)


def _is_remark(line: bytes) -> bool:
    """Text that cannot be lines of a data set whose delimiter is lost: these are numbers, or begin with one."""
    words = _text(line).split()
    # a shorter one may be the start of a delimiter
    return len("".join(words)) > len("-1") and not (_is_number(words[0].rstrip("bB")) and _is_number(words[-1]))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _remark(reader: _UffReader, line: bytes) -> Notice:
    text = repr(_text(line).strip()[:60])
    if not _is_remark(line):
        raise FemtuneError("uff.outside", where=reader.where(), values={"text": text})
    return Notice("uff.remark", where=reader.where(), level="info", text=text)


def _text(line: bytes) -> str:
    # editors make tabs of blanks, eight columns apart
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError:
        text = line.decode("latin-1")
    return text.rstrip(" \t\r\n\x00\x1a").expandtabs(8)


def _data_set(reader: _UffReader, before: Sequence[DataSet]) -> DataSet:
    opened = reader.line
    blank = _NUMBER_ALONE.fullmatch(reader.ahead().rstrip(_BLANK)) is not None
    head = _text(reader.take()) if reader.more() else ""
    while blank and not head and reader.more():
        head = _text(reader.take())
    match = _number(head)
    if match is None:
        raise _no_number(reader, opened, head)
    start = DataSet(reader.file, int(match[1]), opened, head, (), b"", bool(match[2]))
    return _binary(reader, start) if start.binary else _ascii(reader, start, before)


def _number(head: str) -> re.Match[str] | None:
    """The number of a data set and the mark of a binary one; behind column 6 only of data sets that tests have."""
    if match := _NUMBER_LINE.fullmatch(head):
        return match
    shifted = _SHIFTED_NUMBER.fullmatch(head)
    return shifted if shifted is not None and shifted[1].encode() in _USUAL else None


def _no_number(reader: _UffReader, opened: int, head: str) -> FemtuneError:
    where = Where(reader.file, opened)
    if not reader.more():
        return FemtuneError("uff.truncated", where=where)
    return FemtuneError("uff.syntax", where=where, values={"found": repr(head[:60])})


def _ascii(reader: _UffReader, start: DataSet, before: Sequence[DataSet]) -> DataSet:
    lines: list[str] = []
    while reader.more():
        line = reader.take()
        if reader.closes(line):
            return _with(start, lines)
        lines.append(_text(line))
    while lines and not lines[-1]:
        lines.pop()
    part = _with(start, lines)
    if _ends_whole(part, before):
        return replace(part, notices=(_not_closed(part),))
    raise _cut(part, "its closing delimiter", {"expected": "'    -1'", "found": "end of file"})


def _not_closed(part: DataSet) -> Notice:
    return Notice("uff.not-closed", where=part.where(max(len(part.lines) - 1, 0)), number=part.number)


def _ends_whole(part: DataSet, before: Sequence[DataSet]) -> bool:
    """Whether a data set at the end of the file, without its delimiter, is known to have all of its lines.

    A function declares its points; a mode has the lines that another mode of the file has. Other data sets declare
    nothing, so that lost lines could not be told.
    """
    if part.number == 58:
        return _has_all_points(part)
    if part.number not in (55, 2414):
        return False
    return any(
        one.number == part.number and list(map(len, one.lines[8:])) == list(map(len, part.lines[8:])) for one in before
    )


def _has_all_points(part: DataSet) -> bool:
    """Whether a function in text has the numbers of its points, the last one to its last column."""
    form = _form(part)
    if form is None:
        return False
    value_type, points, spacing = form
    numbers = points * ((2 if value_type > 4 else 1) + (0 if spacing else 1))
    single = value_type in (2, 5)
    line, width = (6, 13) if single else (4, 20)
    if not single and not spacing:
        return False
    full, rest = divmod(numbers, line)
    body = part.lines[11:]
    wanted = [line * width] * full + ([rest * width] if rest else [])
    return list(map(len, body)) == wanted


def _with(start: DataSet, lines: list[str], payload: bytes = b"") -> DataSet:
    return replace(start, lines=tuple(lines), payload=payload)


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


def _form(part: DataSet) -> tuple[int, int, int] | None:
    """Ordinate data type, points and spacing that a data set 58 declares; None where they are no numbers."""
    texts = [part.lines[6][k : k + 10].strip() for k in (0, 10, 20)] if len(part.lines) > 6 else []
    if part.number != 58 or not texts or not all(text.isdecimal() for text in texts):
        return None
    value_type, points, spacing = map(int, texts)
    return value_type, points, spacing


def _binary(reader: _UffReader, start: DataSet) -> DataSet:
    header_lines, declared = _binary_lengths(start)
    lines = [_text(reader.take()) for _ in range(header_lines) if reader.more()]
    length = _true_length(reader, _with(start, lines), declared)
    payload = reader.data[reader.position : reader.position + length]
    whole = _with(start, lines, payload)
    if len(lines) < header_lines or len(payload) < length:
        raise _cut(whole, "a part of its bytes", {"bytes expected": length, "bytes found": len(payload)})
    reader.position += length
    return _close_binary(reader, whole)


def _true_length(reader: _UffReader, start: DataSet, declared: int) -> int:
    """The declared length, or that of the declared points where only this one ends at a delimiter.

    pyuff itself declares half the length of complex functions.
    """
    by_points = _length_of_points(start)
    if not _closes(reader, declared) and by_points is not None and _closes(reader, by_points):
        return by_points
    return declared


def _closes(reader: _UffReader, length: int) -> bool:
    rest = reader.data[reader.position + length : reader.position + length + 200].lstrip(b"\r\n").partition(b"\n")[0]
    return _is_delimiter(rest) or _is_shifted(rest)


def _length_of_points(start: DataSet) -> int | None:
    form = _form(start)
    if form is None:
        return None
    value_type, points, spacing = form
    numbers = (2 if value_type > 4 else 1) + (0 if spacing else 1)
    return points * numbers * (4 if value_type in (2, 5) else 8)


def _close_binary(reader: _UffReader, whole: DataSet) -> DataSet:
    length = len(whole.payload)
    reader.line += whole.payload.count(b"\n")
    rest = reader.data[reader.position : reader.position + 8]
    gap = len(rest) - len(rest.lstrip(b"\r\n"))
    reader.position += gap
    if not reader.data[reader.position : reader.position + 100].strip(_BLANK):
        if _length_of_points(whole) == length:
            reader.position = len(reader.data)
            return replace(whole, notices=(_not_closed(whole),))
        raise _cut(whole, "its closing delimiter", {"expected": "'    -1'", "found": "end of file"})
    if not (_is_delimiter(line := reader.take()) or _is_shifted(line)):
        if b"\n" not in reader.data[reader.position - 1 :] and b"    -1".startswith(line[:6]):
            raise _cut(whole, "its closing delimiter", {"expected": "'    -1'", "found": repr(line[:6])})
        raise whole.error("uff.binary-length/no-delimiter", values={"bytes declared": length})
    return whole


def _binary_lengths(start: DataSet) -> tuple[int, int]:
    lines, size = start.binary_form[2:]
    if not (lines.isdecimal() and size.isdecimal()) or int(lines) > 100:
        raise start.error("uff.syntax/binary-header", values={"found": repr(start.head[:60])})
    return int(lines), int(size)
