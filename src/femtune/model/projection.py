"""Projection of terms on the free DOFs of a configuration: one pattern, and each coefficient's entries on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Flags, Integers, Reals
from femtune.model.coefficients import Coefficients
from femtune.model.spread import Piece, spread_of
from femtune.model.terms import LowRankValues, MatrixTerm, Term, TermFunction, TermLayout, nowhere_zero, unpacked

# ----------------------------------------------------------------------------------------------------
# Pattern of the upper triangle that all matrices of a configuration share.


SORTED_AT_ONCE = 2_000_000
"""Entries that are sorted together, at least; or as many as the pattern has so far."""


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
        if sum(len(rows) for rows, _ in waiting) >= max(SORTED_AT_ONCE, total.nnz):
            total, waiting = sp.csr_array(total + _flags(n, waiting)), []
    total = sp.csr_array(total + _flags(n, waiting)) if waiting else total
    total.sort_indices()
    return Pattern(total.indptr.astype(np.int32), total.indices.astype(np.int32))


def _flags(n: int, chunks: list[tuple[Places, Places]]) -> sp.csr_array:
    rows, cols = (np.concatenate(parts) for parts in zip(*chunks))
    return sp.csr_array(sp.coo_array((np.ones(len(rows), bool), (rows, cols)), shape=(n, n)))


# ----------------------------------------------------------------------------------------------------
# Element matrices on the free DOFs of a configuration: most DOFs are renumbered, constrained ones are replaced.


AT_ONCE = 1_000_000
"""Entries of element matrices that are handled together: 8 MB."""


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

    def entries(self, values: Reals | LowRankValues, at: slice | Integers) -> Reals:
        """(m, q) entries of some of the elements, from the layout's values."""
        stored = values[self._of_layout(len(values), at)]
        if self.follow is None:
            return stored
        T = self.follow[at]
        full = np.swapaxes(T, 1, 2) @ unpacked(stored, self.source, T.shape[1]) @ T
        return full[:, self.pairs[:, 0], self.pairs[:, 1]]

    def _of_layout(self, count: int, at: slice | Integers) -> slice | Integers:
        return at if len(self.rows) == count else self.rows[at]


def free_elements(layout: TermLayout, T: sp.csr_array) -> list[FreeElements]:
    """The elements of a layout on the free DOFs of u_g = T u_free; elements without free DOFs are left out."""
    if not len(layout.elements):
        return []
    simple = _simple(T)
    dofs = np.where(layout.dofs >= 0, simple[layout.dofs], -1)
    renumbered = np.asarray((dofs != _FOLLOWS).all(axis=1)) & ~_repeated(dofs)
    unconstrained = [FreeElements(np.flatnonzero(renumbered), dofs[renumbered], layout.pairs, None, layout.pairs)]
    return [part for part in [*unconstrained, *_replaced(layout, T, np.flatnonzero(~renumbered))] if len(part.rows)]


_FOLLOWS = -2
"""Number of a DOF that depends on others, or on one with a factor."""


def _simple(T: sp.csr_array) -> Places:
    """(n_g,) free DOF that a g-set DOF is; −1 where it is held, _FOLLOWS where it is not one free DOF itself."""
    count = np.diff(T.indptr)
    out = np.where(count == 0, -1, _FOLLOWS).astype(np.int32)
    one = np.flatnonzero(count == 1)
    place = T.indptr[one]
    same = T.data[place] == 1.0
    out[one[same]] = T.indices[place[same]]
    return out


def _repeated(dofs: Places) -> NDArray[np.bool_]:
    """(m,) True where a DOF occurs twice in an element."""
    ordered = np.sort(dofs, axis=1)
    return np.asarray(((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] >= 0)).any(axis=1))


def _replaced(layout: TermLayout, T: sp.csr_array, rows: Integers) -> Iterator[FreeElements]:
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


Places = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class ProjectedTerm:
    """Terms on the free DOFs: entries of the upper triangle on the common pattern = `spread` @ coefficients.

    `spread` is sparse (nnz, n_columns); column c is the upper triangle of TᵀK_cT.
    """

    term: TermFunction
    spread: sp.csc_array


def project(terms: Sequence[TermFunction], T: sp.csr_array) -> tuple[Pattern, tuple[ProjectedTerm, ...]]:
    """TᵀK_cT of every coefficient, on the union of their patterns; all constant terms of a kind of matrix are one.

    So are the terms of a kind whose coefficients are of one book, or the same function.
    """
    projection = _Projection.of(terms, T)
    pattern = upper_pattern(T.shape[1], projection.entries(), projection.count)
    projection.locate(pattern)
    groups: dict[object, list[TermFunction]] = {}
    for term in terms:
        groups.setdefault(_together(term), []).append(term)
    return pattern, tuple(projection.joined(group, len(pattern.indices)) for group in groups.values())


def _together(term: TermFunction) -> object:
    """Terms of the same key become one."""
    coefficient = term.coefficient
    if coefficient is None:
        return term.matrix, None
    return term.matrix, coefficient.book if isinstance(coefficient, Coefficients) else coefficient


@dataclass(frozen=True, eq=False)
class _Projection:
    """Terms by their layout, the elements of the layouts on the free DOFs, and the places of their entries."""

    terms: dict[TermLayout, list[Term]]
    elements: dict[TermLayout, list[FreeElements]]
    matrices: dict[MatrixTerm, sp.csr_array]
    places: dict[FreeElements | MatrixTerm, Places] = field(default_factory=dict)
    some: dict[FreeElements, list[Flags]] = field(default_factory=dict)

    @classmethod
    def of(cls, terms: Sequence[TermFunction], T: sp.csr_array) -> _Projection:
        """Sort terms by what they are made of."""
        by_layout: dict[TermLayout, list[Term]] = {}
        matrices = {}
        for term in terms:
            if isinstance(term, Term):
                by_layout.setdefault(term.layout, []).append(term)
            elif isinstance(term, MatrixTerm):
                matrices[term] = upper_of(term.upper, T)
        return cls(by_layout, {layout: free_elements(layout, T) for layout in by_layout}, matrices)

    @property
    def count(self) -> int:
        """Entries of all matrices before any two are added."""
        elements = (len(e.rows) * len(e.pairs) for parts in self.elements.values() for e in parts)
        return sum(elements) + sum(m.nnz for m in self.matrices.values())

    def entries(self) -> Iterator[tuple[Places, Places]]:
        """Rows and columns of all entries that are not zero in some term."""
        for layout, parts in self.elements.items():
            for elements in parts:
                kept = self.some[elements] = []
                terms = self.terms[layout]
                values = nowhere_zero(terms) if elements.follow is None else [t.values for t in terms]
                for chunk in elements.chunks():
                    rows, cols = elements.places(chunk)
                    some = np.any([elements.entries(v, chunk) != 0.0 for v in values], axis=0) & (rows >= 0)
                    kept.append(some)
                    yield (rows.ravel(), cols.ravel()) if some.all() else (rows[some], cols[some])
        for matrix in self.matrices.values():
            coo = matrix.tocoo()
            yield coo.row.astype(np.int32), coo.col.astype(np.int32)

    def locate(self, pattern: Pattern) -> None:
        """Find the places of all entries in the pattern; −1 for those that go nowhere."""
        for elements, kept in self.some.items():
            places = np.empty((len(elements.rows), len(elements.pairs)), np.int32)
            for chunk, some in zip(elements.chunks(), kept):
                places[chunk] = pattern.find(*elements.places(chunk), some)
            self.places[elements] = places
        self.some.clear()
        for term, matrix in self.matrices.items():
            coo = matrix.tocoo()
            self.places[term] = pattern.find(coo.row, coo.col, np.ones(coo.nnz, bool))

    def joined(self, terms: Sequence[TermFunction], nnz: int) -> ProjectedTerm:
        """Terms that share a coefficient, or the functions of a book, as one."""
        function, columns = _function(terms)
        pieces = [piece for term, projected in zip(terms, columns) for piece in self._pieces(term, projected)]
        return ProjectedTerm(function, spread_of(pieces, function.n_columns, nnz))

    def _pieces(self, term: TermFunction, columns: Integers) -> Iterator[Piece]:
        if isinstance(term, Term):
            for elements in self.elements[term.layout]:
                yield Piece(self.places[elements], columns[term.columns[elements.rows]], _values(elements, term))
        elif isinstance(term, MatrixTerm):
            data = self.matrices[term].data[None]
            yield Piece(self.places[term][None], columns, lambda at: data[at])


def _values(elements: FreeElements, term: Term) -> Callable[[Integers], Reals]:
    return lambda at: elements.entries(term.values, at)


def _function(terms: Sequence[TermFunction]) -> tuple[TermFunction, list[Integers]]:
    """What multiplies the joined terms, and where the columns of each are among its own."""
    first = terms[0]
    coefficients = [term.coefficient for term in terms if isinstance(term.coefficient, Coefficients)]
    if not coefficients:
        label = f"{first.matrix} constant" if first.coefficient is None else first.label
        return TermFunction(first.matrix, label, first.n_columns, first.coefficient), [
            np.arange(first.n_columns)
        ] * len(terms)
    numbers = np.unique(np.concatenate([c.numbers for c in coefficients]))
    both = Coefficients(coefficients[0].book, numbers)
    return TermFunction(first.matrix, first.matrix, len(numbers), both), [
        np.searchsorted(numbers, c.numbers) for c in coefficients
    ]


def upper_of(upper: sp.csr_array, T: sp.csr_array) -> sp.csr_array:
    """Upper triangle of TᵀAT."""
    strict = sp.triu(upper, 1, format="csr")
    half = sp.csr_array(T.T @ (upper @ T)), sp.csr_array(T.T @ (strict @ T))
    whole = sp.csr_array(sp.triu(half[0] + half[1].T, format="csr"))
    whole.eliminate_zeros()
    whole.sort_indices()
    return whole
