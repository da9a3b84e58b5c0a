"""Sums of the contributions of a batch to one kind of matrix, kept packed: the upper triangles' entries that are used.

An element has one sum for its constant part and one for each function of the parameters that it follows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.fem import ElementBatch
from femtune.model.term import Layout

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

CONSTANT = -3
"""Stands for the number of a coefficient function in what parameters don't move."""

EMPTY = -4


@dataclass(eq=False)
class _Open:
    """Full sums of the piece that is being added: (p,) function of each element, EMPTY without; (p, d, d) its sum."""

    numbers: Integers
    sums: Reals


@dataclass(frozen=True, eq=False)
class _Block:
    """Packed sums of some elements: rows of the batch, functions, (d·d,) flags of entries, and (m, q) entries."""

    rows: Integers
    numbers: Integers
    used: NDArray[np.bool_]
    values: Reals


@dataclass(eq=False)
class _Stored:
    """Packed sums of one slot for up to `capacity` elements; memory that is not written to is not taken."""

    capacity: int
    used: NDArray[np.bool_]
    values: Reals
    count: int = 0
    rows: list[Integers] = field(default_factory=list)
    numbers: list[Integers] = field(default_factory=list)

    def add(self, block: _Block) -> None:
        """Put a block after the others."""
        if (block.used & ~self.used).any():
            self._widen(self.used | block.used)
        at = slice(self.count, self.count + len(block.rows))
        if np.array_equal(block.used, self.used):
            self.values[at] = block.values
        else:
            self.values[at] = 0.0
            self.values[at, block.used[self.used]] = block.values
        self.count = at.stop
        self.rows.append(block.rows)
        self.numbers.append(block.numbers)

    def _widen(self, used: NDArray[np.bool_]) -> None:
        wider = np.empty((self.capacity, int(used.sum())))
        wider[: self.count] = 0.0
        wider[: self.count, self.used[used]] = self.values[: self.count]
        self.used, self.values = used, wider

    def taken(self) -> Reals:
        """(count, q) values; the room that is left over is given back."""
        self.values.resize((self.count, self.values.shape[1]), refcheck=False)
        return self.values


@dataclass(eq=False)
class TermSums:
    """Sums of one kind of matrix; each slot holds at most one function an element, the first only constants."""

    batch: ElementBatch
    opened: list[_Open] = field(default_factory=list)
    stored: dict[int, _Stored] = field(default_factory=dict)
    start: int = 0
    size: int = 0
    d: int = 0

    @cached_property
    def _upper(self) -> Integers:
        """Places of the upper triangle in a flat matrix."""
        return np.ravel_multi_index(np.triu_indices(self.d), (self.d, self.d))

    def span(self, start: int, stop: int, d: int) -> None:
        """The rows of the batch that the contributions added next belong to, and the size of their matrices."""
        self.start, self.size, self.d = start, stop - start, d

    def add(self, at: Integers, numbers: Integers, factors: Reals, matrices: Reals) -> None:
        """Add factor times matrix to the sum of each element's function; `at` counts from the start of the span."""
        slots = self._slots(at, numbers)
        for s in np.unique(slots):
            mine = slots == s
            if mine.all():
                _accumulate(self.opened[s], at, numbers, factors, matrices)
            else:
                _accumulate(self.opened[s], at[mine], numbers[mine], factors[mine], matrices[mine])

    def _slots(self, at: Integers, numbers: Integers) -> Integers:
        """(m,) the slot that has an element's function already, else its first empty one."""
        if not self.opened:
            self._open()
        slots = np.where(numbers == CONSTANT, 0, -1)
        for wanted in (numbers, EMPTY):
            for s, opened in enumerate(self.opened[1:], 1):
                slots[(slots < 0) & (opened.numbers[at] == wanted)] = s
        if (slots < 0).any():
            slots[slots < 0] = len(self.opened)
            self._open()
        return slots

    def _open(self) -> None:
        self.opened.append(_Open(np.full(self.size, EMPTY), np.zeros((self.size, self.d, self.d))))

    def pack(self) -> None:
        """Put the piece's sums away."""
        for s, opened in enumerate(self.opened):
            block = self._packed(opened)
            if block is not None:
                if s not in self.stored:
                    self.stored[s] = _Stored(len(self.batch), block.used, np.empty((len(self.batch), block.used.sum())))
                self.stored[s].add(block)
        self.opened = []

    def _packed(self, opened: _Open) -> _Block | None:
        flat = opened.sums.reshape(self.size, -1)[:, self._upper]
        rows = np.flatnonzero((opened.numbers != EMPTY) & flat.any(axis=1))
        if not rows.size:
            return None
        used = np.asarray(flat.any(axis=0))
        values = flat if used.all() and len(rows) == len(flat) else flat[np.ix_(rows, used)]
        return _Block(self.start + rows, opened.numbers[rows], used, values)

    def finish(self, layouts: list[Layout]) -> Iterator[tuple[Layout, Reals, Integers]]:
        """Layout, values and functions of every slot that has elements; `layouts` of the batch are shared and grow."""
        for slot in sorted(self.stored):
            stored = self.stored.pop(slot)
            rows = np.concatenate(stored.rows)
            pairs = np.stack(np.divmod(self._upper[stored.used], self.d), axis=1)
            yield self._layout(rows, pairs, layouts), stored.taken(), np.concatenate(stored.numbers)

    def _layout(self, rows: Integers, pairs: Integers, layouts: list[Layout]) -> Layout:
        ids, dofs = self.batch.ids[rows], self.batch.dofs
        for known in layouts:
            if np.array_equal(known.elements, ids) and np.array_equal(known.pairs, pairs):
                return known
        layouts.append(Layout(ids, dofs if len(rows) == len(dofs) else dofs[rows], pairs))
        return layouts[-1]


def _accumulate(opened: _Open, at: Integers, numbers: Integers, factors: Reals, matrices: Reals) -> None:
    fresh = bool((opened.numbers[at] == EMPTY).all())
    opened.numbers[at] = numbers
    scale = factors[:, None, None]
    if len(at) < len(opened.sums) or not np.array_equal(at, np.arange(len(at))):
        opened.sums[at] += scale * matrices
    elif fresh:
        np.multiply(matrices, scale, out=opened.sums)
    else:
        opened.sums += matrices * scale
