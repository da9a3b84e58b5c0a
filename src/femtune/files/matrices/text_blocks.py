"""Columns of numbers in a text file, read block by block; a line that does not fit is named."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where

BLOCK = 1 << 24
"""Bytes that are read together: 16 MB."""
_CHECKED_START = 4096
"""Bytes at the beginning that must be text."""
_CHECKED_END = 4096
"""Bytes at the end in which the last line is looked for."""
_PRINTED = bytes([*b"\t\n\f\r\x1a", *range(32, 127), *range(128, 256)])
_NUMBERS = bytes.maketrans(b",;DdQ\r\t", b"  EEE  ")


@dataclass(frozen=True)
class LineBlock:
    """Whole lines of a file; `first` is the number of the first of them."""

    file: str
    first: int
    content: bytes


def line_blocks(path: Path, skip: int = 0) -> Iterator[LineBlock]:
    """Blocks of whole lines after the first `skip` lines (errors ``matrices.unreadable``, ``matrices.binary``)."""
    number = 1
    try:
        with path.open("rb") as file:
            check_text(path, file.read(_CHECKED_START))
            file.seek(0)
            for _ in range(skip):
                file.readline()
                number += 1
            while content := file.read(BLOCK):
                content += file.readline()
                yield LineBlock(str(path), number, content)
                number += content.count(b"\n")
    except OSError as error:
        raise FemtuneError("matrices.unreadable", where=Where(str(path)), strerror=error.strerror) from error


def check_text(path: Path, start: bytes) -> None:
    """Refuse the beginning of a file that is no text (error ``matrices.binary``)."""
    control = start.translate(None, _PRINTED)
    if control:
        raise FemtuneError(
            "matrices.binary",
            where=Where(str(path), None, f"byte {start.index(control[:1])}"),
            values={"first bytes": start[:16].hex(" ")},
        )


def numbers(lines: LineBlock, columns: int, what: str, comment: bytes = b"") -> NDArray[np.float64]:
    """(m, columns) numbers of the lines; comments and blank lines are left aside.

    Raises
    ------
    FemtuneError : ``matrices.text``, naming the line
    """
    kept = _without(lines, comment)
    expected = kept.content.count(b"\n") + (not kept.content.endswith(b"\n") and bool(kept.content))
    values = _parsed(kept.content.translate(_NUMBERS))
    if values is None or values.size != expected * columns:
        raise _bad_line(lines, columns, what, comment)
    return values.reshape(-1, columns)


def _without(lines: LineBlock, comment: bytes) -> LineBlock:
    content = lines.content
    plain = comment == b"" or comment not in content
    if plain and b"\n\n" not in content and b"\n\r" not in content and not content.startswith((b"\n", b"\r")):
        return lines
    some = (line for line in content.splitlines(keepends=True) if line.strip())
    kept = b"".join(line for line in some if not comment or not line.lstrip().startswith(comment))
    return replace(lines, content=kept)


def _parsed(content: bytes) -> NDArray[np.float64] | None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(content.decode("latin-1"), sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def _bad_line(lines: LineBlock, columns: int, what: str, comment: bytes) -> FemtuneError:
    """The first line that does not hold so many numbers; the block does, so there is one."""
    for i, line in enumerate(lines.content.splitlines()):
        if not line.strip() or (comment and line.lstrip().startswith(comment)):
            continue
        values = _parsed(line.translate(_NUMBERS))
        if values is None or values.size != columns:
            return _at_line(lines, i, line, columns, what)
    return _at_line(lines, 0, lines.content[:80], columns, what)


def _at_line(lines: LineBlock, i: int, line: bytes, columns: int, what: str) -> FemtuneError:
    last = lines.content.count(b"\n") <= i
    return FemtuneError(
        "matrices.truncated/line" if last else "matrices.text/columns",
        where=Where(lines.file, lines.first + i),
        values={"line": f"'{line[:80].decode('latin-1')}'"},
        n_columns=columns,
        names=what,
    )


def check_whole_last_line(path: Path) -> None:
    """Refuse a file whose last line does not end: solvers end every line (error ``matrices.truncated``)."""
    with path.open("rb") as file:
        file.seek(0, 2)
        end = file.tell()
        file.seek(max(end - _CHECKED_END, 0))
        tail = file.read()
    if tail and not tail.endswith(b"\n"):
        line = tail.rpartition(b"\n")[2]
        raise FemtuneError(
            "matrices.truncated/last-line",
            where=Where(str(path), None, f"byte {end}"),
            values={"last line": f"'{line[:80].decode('latin-1')}'"},
        )


def whole(values: NDArray[np.float64], line: Callable[[int], Where], what: str) -> NDArray[np.signedinteger]:
    """Numbers that must be whole, in 32 bits where they fit (error ``matrices.text``)."""
    bad = np.flatnonzero((values != np.rint(values)) | (np.abs(values) > 2**53))
    if bad.size:
        raise FemtuneError(
            "matrices.text/whole-number", where=line(int(bad[0])), values={what: values[bad[0]]}, column_name=what
        )
    small = np.abs(values).max(initial=0.0) < 2**31
    return values.astype(np.int32 if small else np.int64)


# ----------------------------------------------------------------------------------------------------
# Text files of one entry a line: `row column value`, or `node dof node dof value`.


@dataclass(frozen=True, eq=False)
class Listed:
    """Whole numbers (m, k), of 32 bits where they fit, and values (m,) of a file; `line` tells the line of an entry."""

    keys: NDArray[np.signedinteger]
    value: NDArray
    line: Callable[[int], Where]


def read_listed(path: Path, keys: int, what: str, skip: int = 0, comment: bytes = b"*", values: int = 1) -> Listed:
    """Lines of `keys` whole numbers and a value, of two numbers where it is complex.

    Raises
    ------
    FemtuneError : ``matrices.text``, ``matrices.truncated``, ``matrices.empty``, ``matrices.unreadable``
    """
    found_keys, found_values, starts, count = [], [], [], 0
    for lines in line_blocks(path, skip):
        block = numbers(lines, keys + values, what, comment)
        starts.append((count, lines.first))
        count += len(block)
        found_keys.append(_keys(block, keys, _place(str(path), [(0, lines.first)])))
        found_values.append(np.ascontiguousarray(block[:, keys]) if values == 1 else block[:, keys] + 1j * block[:, -1])
    if not count:
        raise empty(path)
    check_whole_last_line(path)
    return Listed(np.concatenate(found_keys), np.concatenate(found_values), _place(str(path), starts))


def _keys(block: NDArray[np.float64], keys: int, where: Callable[[int], Where]) -> NDArray[np.signedinteger]:
    columns = [whole(block[:, i], where, f"number {i + 1}") for i in range(keys)]
    return np.stack(columns, axis=1) if columns else np.zeros((len(block), 0), np.int32)


def empty(path: Path) -> FemtuneError:
    """The file holds no entry."""
    return FemtuneError("matrices.empty", where=Where(str(path)))


def _place(file: str, starts: list[tuple[int, int]]) -> Callable[[int], Where]:
    """Line of an entry, exact where no comments stand between the entries of a block."""

    def line(i: int) -> Where:
        begin, first = max(s for s in starts if s[0] <= i)
        return Where(file, first + i - begin)

    return line
