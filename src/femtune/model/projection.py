"""Projection of terms on the free DOFs of a configuration: one pattern, and each coefficient's entries on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.coefficients import Coefficients
from femtune.model.free_elements import FreeElements, free_elements
from femtune.model.pattern import Pattern, upper_pattern
from femtune.model.spread import Piece, spread_of
from femtune.model.term import Layout, MatrixTerm, Term, TermFunction

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
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

    So are the terms of a kind whose coefficients are of one book.
    """
    own = _Projection.of(terms, T)
    pattern = upper_pattern(T.shape[1], own.entries(), own.count)
    own.locate(pattern)
    groups: dict[object, list[TermFunction]] = {}
    for term in terms:
        groups.setdefault(_together(term), []).append(term)
    return pattern, tuple(own.joined(group, len(pattern.indices)) for group in groups.values())


def _together(term: TermFunction) -> object:
    """Terms of the same key become one."""
    coefficient = term.coefficient
    if coefficient is None:
        return term.matrix, None
    return (term.matrix, coefficient.book) if isinstance(coefficient, Coefficients) else term


@dataclass(frozen=True, eq=False)
class _Projection:
    """Terms by their layout, the elements of the layouts on the free DOFs, and the places of their entries."""

    terms: dict[Layout, list[Term]]
    elements: dict[Layout, list[FreeElements]]
    matrices: dict[MatrixTerm, sp.csr_array]
    places: dict[FreeElements | MatrixTerm, Places] = field(default_factory=dict)

    @classmethod
    def of(cls, terms: Sequence[TermFunction], T: sp.csr_array) -> _Projection:
        """Sort terms by what they are made of."""
        by_layout: dict[Layout, list[Term]] = {}
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
                for chunk in elements.chunks():
                    rows, cols = elements.places(chunk)
                    some = self._some(layout, elements, chunk, rows)
                    yield (rows.ravel(), cols.ravel()) if some.all() else (rows[some], cols[some])
        for matrix in self.matrices.values():
            coo = matrix.tocoo()
            yield coo.row.astype(np.int32), coo.col.astype(np.int32)

    def _some(self, layout: Layout, elements: FreeElements, chunk: slice, rows: Places) -> NDArray[np.bool_]:
        some = np.zeros(rows.shape, bool)
        for term in self.terms[layout]:
            some |= elements.entries(term.values, chunk) != 0.0
        return np.asarray(some & (rows >= 0))

    def locate(self, pattern: Pattern) -> None:
        """Find the places of all entries in the pattern; −1 for those that go nowhere."""
        for layout, parts in self.elements.items():
            for elements in parts:
                found = np.empty((len(elements.rows), len(elements.pairs)), np.int32)
                for chunk in elements.chunks():
                    rows, cols = elements.places(chunk)
                    found[chunk] = pattern.find(rows, cols, self._some(layout, elements, chunk, rows))
                self.places[elements] = found
        for term, matrix in self.matrices.items():
            coo = matrix.tocoo()
            self.places[term] = pattern.find(coo.row, coo.col, np.ones(coo.nnz, bool))

    def joined(self, terms: Sequence[TermFunction], nnz: int) -> ProjectedTerm:
        """Terms that share a coefficient, or the functions of a book, as one."""
        function, columns = _function(terms)
        pieces = [piece for term, own in zip(terms, columns) for piece in self._pieces(term, own)]
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
