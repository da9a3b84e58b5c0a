"""Entries of a matrix as a file lists them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Where

Integers = NDArray[np.int64]

_TABLE = 100_000_000


@dataclass(frozen=True, eq=False)
class Entries:
    """Entries of a matrix as a file lists them.

    Parameters
    ----------
    row, col : (m,) from 0
    value : (m,) real or complex
    size : (rows, columns)
    rows : (n, 2) node and component of each row, or None
    line : line or byte of an entry from its position; None where the file has no such thing
    """

    row: Integers
    col: Integers
    value: NDArray
    size: tuple[int, int]
    rows: Integers | None = None
    line: Callable[[int], Where] | None = None


def numbered(first: Integers, second: Integers) -> tuple[Integers, tuple[Integers, Integers]]:
    """Distinct numbers of both, ascending, and the place of each among them."""
    most = int(max(first.max(initial=0), second.max(initial=0))) + 1
    if most > _TABLE or min(first.min(initial=0), second.min(initial=0)) < 0:
        names, at = np.unique(np.concatenate([first, second]), return_inverse=True)
        return names, (at[: len(first)], at[len(first) :])
    # a table is faster than sorting and takes less memory
    seen = np.zeros(most, bool)
    seen[first] = seen[second] = True
    place = np.cumsum(seen) - 1
    return np.flatnonzero(seen), (place[first], place[second])


def row_label(rows: Integers | None, i: int) -> str:
    """A row in words: node and component where they are known, or its number from 1."""
    if rows is None or i >= len(rows):
        return f"row {i + 1}"
    return f"{rows[i, 0]}:{rows[i, 1]}"
