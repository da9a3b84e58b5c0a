"""The stiffness of each grid point's own translations and rotations, without the rest of the matrix."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.fem.elimination import Elimination
from femtune.fem.values import TableJet
from femtune.model.free_elements import FreeElements, free_elements
from femtune.model.projection import upper_of
from femtune.model.term import Layout, MatrixTerm, Term, TermFunction

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
Entries = tuple[NDArray, NDArray, Reals]


def node_blocks(terms: Sequence[TermFunction], elimination: Elimination, n_grid: int, table: TableJet) -> sp.csr_array:
    """(n, n) entries of TᵀKT between translations, and between rotations, of one grid point; scalar points' diagonals.

    `n_grid` DOFs are those of grid points.
    """
    free, n = elimination.free, len(elimination.free)
    # the three DOFs of a block share a number, a scalar point's has its own; the last stands for no DOF
    group = np.append(np.where(free < n_grid, free // 3, n_grid + free), -1)
    layouts: dict[Layout, list[FreeElements]] = {}
    found: list[Entries] = [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))]
    for term in terms:
        c = term.coefficient(table).value if term.coefficient else np.ones(1)
        if isinstance(term, Term):
            if term.layout not in layouts:
                layouts[term.layout] = free_elements(term.layout, elimination.T)
            found += [e for elements in layouts[term.layout] for e in _of_elements(elements, term, c, group)]
        elif isinstance(term, MatrixTerm):
            found.append(_of_matrix(upper_of(term.upper, elimination.T), float(c[0]), group))
    rows, cols, values = (np.concatenate(parts) for parts in zip(*found))
    upper = sp.csr_array((values, (rows, cols)), shape=(n, n))
    return sp.csr_array(upper + sp.triu(upper, 1).T)


def _of_elements(elements: FreeElements, term: Term, c: Reals, group: Integers) -> Iterator[Entries]:
    for chunk in elements.chunks():
        groups = group[elements.dofs[chunk]]
        a, b = groups[:, elements.pairs[:, 0]], groups[:, elements.pairs[:, 1]]
        own = (a == b) & (a >= 0)
        used = np.flatnonzero(own.any(axis=0))
        own = own[:, used]
        rows, cols = (x[:, used][own] for x in elements.places(chunk))
        scale = c[term.columns[elements.rows[chunk]]]
        yield rows, cols, (elements.entries(term.values, chunk)[:, used] * scale[:, None])[own]


def _of_matrix(upper: sp.csr_array, c: float, group: Integers) -> Entries:
    coo = upper.tocoo()
    own = group[coo.row] == group[coo.col]
    return coo.row[own], coo.col[own], c * coo.data[own]
