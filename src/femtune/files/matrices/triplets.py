"""Text files of one entry a line: `row column value`, or `node dof node dof value`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.files.matrices.text_blocks import check_whole_last_line, line_blocks, numbers, whole

Integers = NDArray[np.int64]


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
    return FemtuneError("matrices.empty", "the file holds no entry of a matrix", where=Where(str(path)),
                        hint="check that the solver wrote it to the end")  # fmt: skip


def _place(file: str, starts: list[tuple[int, int]]) -> Callable[[int], Where]:
    """Line of an entry, exact where no comments stand between the entries of a block."""

    def line(i: int) -> Where:
        begin, first = max(s for s in starts if s[0] <= i)
        return Where(file, first + i - begin)

    return line
