"""Element matrices on the free DOFs of a configuration: most DOFs are renumbered, constrained ones are replaced."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.term import Layout, unpacked

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
Places = NDArray[np.int32]

# matrix entries that are handled at once
AT_ONCE = 4_000_000


@dataclass(frozen=True, eq=False)
class FreeElements:
    """Some elements of a layout on the free DOFs.

    Parameters
    ----------
    rows : (m,) the elements, as rows of the layout
    dofs : (m, f) free DOFs of each, −1 for none
    pairs : (q, 2) rows and columns of the entries that are kept; an entry goes to the upper triangle
    follow : (m, d, f) transformation of the element's own DOFs; None where they are free ones themselves
    source : (s, 2) pairs of the layout, which the values come in
    """

    rows: Integers
    dofs: Places
    pairs: Integers
    follow: Reals | None
    source: Integers

    def chunks(self) -> Iterator[slice]:
        """Slices of the elements, of about AT_ONCE entries each."""
        step = max(AT_ONCE // max(len(self.pairs), len(self.source), 1), 1)
        return (slice(i, i + step) for i in range(0, len(self.rows), step))

    def places(self, part: slice) -> tuple[Places, Places]:
        """Rows and columns (m, q), row ≤ column, of the entries; −1 in the row of those that go nowhere."""
        a, b = self.dofs[part][:, self.pairs[:, 0]], self.dofs[part][:, self.pairs[:, 1]]
        return np.minimum(a, b), np.maximum(a, b)

    def entries(self, values: Reals, at: slice | Integers) -> Reals:
        """(m, q) entries of some of the elements, from the layout's values."""
        own = values[at] if len(self.rows) == len(values) else values[self.rows[at]]
        if self.follow is None:
            return own
        T = self.follow[at]
        full = np.swapaxes(T, 1, 2) @ unpacked(own, self.source, T.shape[1]) @ T
        return full[:, self.pairs[:, 0], self.pairs[:, 1]]


def free_elements(layout: Layout, T: sp.csr_array) -> list[FreeElements]:
    """The elements of a layout on the free DOFs of u_g = T u_free; elements without free DOFs are left out."""
    if not len(layout.elements):
        return []
    simple = _simple(T)
    own = np.where(layout.dofs >= 0, simple[layout.dofs], -1)
    renumbered = np.asarray((own != _FOLLOWS).all(axis=1)) & ~_repeated(own)
    found = [FreeElements(np.flatnonzero(renumbered), own[renumbered], layout.pairs, None, layout.pairs)]
    return [part for part in [*found, *_replaced(layout, T, np.flatnonzero(~renumbered))] if len(part.rows)]


_FOLLOWS = -2


def _simple(T: sp.csr_array) -> Places:
    """(n_g,) free DOF that a g-set DOF is; −1 where it is held, _FOLLOWS where it is not one free DOF itself."""
    count = np.diff(T.indptr)
    out = np.where(count == 0, -1, _FOLLOWS).astype(np.int32)
    one = np.flatnonzero(count == 1)
    own = T.indptr[one]
    same = T.data[own] == 1.0
    out[one[same]] = T.indices[own[same]]
    return out


def _repeated(dofs: Places) -> NDArray[np.bool_]:
    """(m,) True where a DOF occurs twice in an element."""
    ordered = np.sort(dofs, axis=1)
    return np.asarray(((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] >= 0)).any(axis=1))


def _replaced(layout: Layout, T: sp.csr_array, rows: Integers) -> Iterator[FreeElements]:
    """Elements with constrained DOFs, those that come to the same number of free DOFs together."""
    if not rows.size:
        return
    d = layout.dofs.shape[1]
    grounded = sp.csr_array(sp.vstack([T, sp.csr_array((1, T.shape[1]))], format="csr"))
    follow = grounded[layout.dofs[rows].ravel()].tocoo()
    # number the free DOFs of each element in ascending order
    element = follow.row // d
    keys, local = np.unique(element.astype(np.int64) * T.shape[1] + follow.col, return_inverse=True)
    owner, dof = np.divmod(keys, max(T.shape[1], 1))
    count = np.bincount(owner, minlength=len(rows))
    start = np.cumsum(count) - count
    for f in np.unique(count[count > 0]):
        mine = np.flatnonzero(count == f)
        place = np.full(len(rows), -1)
        place[mine] = np.arange(len(mine))
        some = place[element] >= 0
        matrices = np.zeros((len(mine), d, f))
        column = local[some] - start[element[some]]
        matrices[place[element[some]], follow.row[some] % d, column] = follow.data[some]
        dofs = dof[start[mine][:, None] + np.arange(f)].astype(np.int32)
        pairs = np.stack(np.triu_indices(f), axis=1)
        yield FreeElements(rows[mine], dofs, pairs, matrices, layout.pairs)
