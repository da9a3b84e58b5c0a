"""Pattern of the upper triangle that all matrices of a configuration share."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Places = NDArray[np.int32]

# entries that are sorted at once
SORTED = 8_000_000


@dataclass(frozen=True, eq=False)
class Pattern:
    """csr pattern of an upper triangle with its whole diagonal, columns ascending."""

    indptr: Places
    indices: Places

    @cached_property
    def _numbered(self) -> sp.csr_array:
        n = len(self.indptr) - 1
        return sp.csr_array((np.arange(len(self.indices), dtype=np.int32), self.indices, self.indptr), shape=(n, n))

    def find(self, rows: NDArray, cols: NDArray, wanted: NDArray[np.bool_]) -> Places:
        """Places of entries, in the shape of `wanted`; −1 where that is False. Wanted ones must be in the pattern."""
        if wanted.all():
            return self._places(rows.ravel(), cols.ravel()).reshape(wanted.shape)
        out = np.full(wanted.shape, -1, np.int32)
        out[wanted] = self._places(rows[wanted], cols[wanted])
        return out

    def _places(self, rows: NDArray, cols: NDArray) -> Places:
        return np.asarray(self._numbered[rows, cols], dtype=np.int32) if len(rows) else np.zeros(0, np.int32)


def upper_pattern(n: int, entries: Iterable[tuple[Places, Places]], count: int) -> Pattern:
    """Union of entries (rows, columns) in the upper triangle and the diagonal; `count` is about their number."""
    diagonal = np.arange(n, dtype=np.int32)
    total = _flags(n, [(diagonal, diagonal)])
    waiting: list[tuple[Places, Places]] = []
    for chunk in entries:
        waiting.append(chunk)
        if sum(len(rows) for rows, _ in waiting) >= SORTED:
            total, waiting = sp.csr_array(total + _flags(n, waiting)), []
    total = sp.csr_array(total + _flags(n, waiting)) if waiting else total
    total.sort_indices()
    return Pattern(total.indptr.astype(np.int32), total.indices.astype(np.int32))


def _flags(n: int, chunks: list[tuple[Places, Places]]) -> sp.csr_array:
    rows, cols = (np.concatenate(parts) for parts in zip(*chunks))
    return sp.csr_array(sp.coo_array((np.ones(len(rows), bool), (rows, cols)), shape=(n, n)))
