"""Blocks of vectors whose memory is used again: new memory of the system costs more time than the work on it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Literal

import numpy as np

from femtune.arrays import Reals


class _ArrayPool:
    """Memory without references from arrays is used again."""

    def __init__(self) -> None:
        self._kept = [np.empty(0)]
        # as many as the list and the count itself hold
        self._unused = sys.getrefcount(self._kept[0])

    def take(self, size: int) -> Reals:
        """An array of `size` numbers, whatever is in it."""
        for i in range(len(self._kept)):
            if size <= self._kept[i].size <= 2 * size and sys.getrefcount(self._kept[i]) == self._unused:
                return self._kept[i][:size]
        self._kept.append(np.empty(size))
        return self._kept[-1][:]


_POOL: ContextVar[_ArrayPool | None] = ContextVar("pool", default=None)
_LEAST_RECYCLED = 1 << 17
"""Numbers from which on memory is kept here; smaller arrays (1 MB) are recycled by the C library as well."""
_WIDEST_RECYCLED = 32
"""Columns up to which memory is kept here; wider blocks are results that stay."""


@contextmanager
def recycled() -> Iterator[None]:
    """Blocks that are requested inside use the memory again of those that are gone."""
    token = _POOL.set(_POOL.get() or _ArrayPool())
    try:
        yield
    finally:
        _POOL.reset(token)


def empty_block(rows: int, columns: int, order: Literal["C", "F"] = "F") -> Reals:
    """A (rows, columns) array, not set to anything."""
    pool = _POOL.get()
    if pool is None or columns > _WIDEST_RECYCLED or rows * columns < _LEAST_RECYCLED:
        return np.empty((rows, columns), order=order)
    return pool.take(rows * columns).reshape((rows, columns), order=order)
