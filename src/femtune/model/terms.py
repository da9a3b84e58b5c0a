"""Terms: elements that share coefficient functions of the parameters; together they are the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from femtune.fem import Contribution, ElementBatch, Structure
from femtune.fem.contribution import MatrixKind
from femtune.fem.elements import pieces
from femtune.model.coefficients import NOTHING, CoefficientBook, Coefficients, Source
from femtune.model.memory import require_memory
from femtune.model.term import Layout, Term, TermFunction
from femtune.model.term_sums import CONSTANT, TermSums

Flags = NDArray[np.bool_]
Reals = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class CompiledTerms:
    """The terms of a structure; `used` by kind of matrix: (n,) True for entries of the value table that it needs."""

    terms: tuple[TermFunction, ...]
    used: Mapping[MatrixKind, Flags]


def compile_terms(structure: Structure, touched: set[int], samples: Reals) -> CompiledTerms:
    """Exact terms of a structure; what no touched value reaches folds into one constant term a batch and matrix.

    Contributions whose coefficients are proportional functions of the parameters are one term.

    Parameters
    ----------
    touched : positions of the value table that parameters move, dependents included
    samples : (s, n) value tables at points of the parameters, the nominal one first, which tell what is proportional

    Raises
    ------
    FemtuneError : ``model.memory``, and what the elements refuse
    """
    require_memory(_forecast(structure, touched), f"the matrices of {sum(map(len, structure.batches)):,} elements")
    moving = np.zeros(len(structure.values.values), bool)
    moving[list(touched)] = True
    book, used = CoefficientBook(samples), {kind: np.zeros(len(moving), bool) for kind in get_args(MatrixKind)}
    terms: list[Term] = []
    for batch in structure.batches:
        terms += _BatchTerms(structure, batch, moving, used, book).compile()
    return CompiledTerms(tuple(terms), used)


def _forecast(structure: Structure, touched: set[int]) -> int:
    """Bytes of packed element matrices: a stiffness and a mass each, and one more where parameters move something."""
    most = sum(8 * len(b) * b.dofs.shape[1] * (b.dofs.shape[1] + 1) // 2 for b in structure.batches)
    return most * (2 if touched else 1)


@dataclass(eq=False)
class _BatchTerms:
    """The terms of one batch, summed piece by piece."""

    structure: Structure
    batch: ElementBatch
    moving: Flags
    used: Mapping[MatrixKind, Flags]
    book: CoefficientBook
    sums: dict[MatrixKind, TermSums] = field(default_factory=dict)

    def compile(self) -> list[Term]:
        """All terms, those that have elements."""
        for parts in pieces(self.batch, self.structure):
            if parts:
                self._add_piece(parts)
        layouts: list[Layout] = []
        return [self._term(kind, *found) for kind in list(self.sums) for found in self.sums.pop(kind).finish(layouts)]

    def _add_piece(self, parts: list[Contribution]) -> None:
        start = min((int(p.at.min()) for p in parts if len(p.at)), default=0)
        stop = max((int(p.at.max()) + 1 for p in parts if len(p.at)), default=0)
        for part in parts:
            self._add(part, start, stop)
        for sums in self.sums.values():
            sums.pack()

    def _add(self, part: Contribution, start: int, stop: int) -> None:
        numbers, factors = self._coefficients(part)
        some = np.flatnonzero(numbers != NOTHING)
        if not some.size:
            return
        if part.matrix not in self.sums:
            self.sums[part.matrix] = TermSums(self.batch)
        matrices = part.matrices if len(some) == len(part.at) else part.matrices[some]
        sums = self.sums[part.matrix]
        sums.span(start, stop, part.matrices.shape[1])
        sums.add(part.at[some] - start, numbers[some], factors[some], matrices)

    def _coefficients(self, part: Contribution) -> tuple[Integers, Reals]:
        """(m,) number of the coefficient function of each element, CONSTANT or NOTHING; and (m,) its factor."""
        at = np.stack([self.batch.roles[role][part.at] for role in part.roles], axis=1)
        first, kinds = _distinct([*at.T, *part.facts.values()])
        at, facts = at[first], {name: fact[first] for name, fact in part.facts.items()}
        self.used[part.matrix][at] = True
        source = Source(part.coefficient, {role: at[:, i] for i, role in enumerate(part.roles)}, facts)
        moves = np.asarray(self.moving[at].any(axis=1)) & ~self._lossless(part, first)
        numbers, factors = np.full(len(first), CONSTANT), np.zeros(len(first))
        still, free = np.flatnonzero(~moves), np.flatnonzero(moves)
        if still.size:
            factors[still] = source.rows(still).values(self.structure.values.values[None])[0]
            numbers[still[factors[still] == 0.0]] = NOTHING
        if free.size:
            numbers[free], factors[free] = self.book.number(source.rows(free))
        return numbers[kinds], factors[kinds]

    def _lossless(self, part: Contribution, chosen: Integers) -> Flags:
        """True where a loss factor is zero and no parameter moves it, so that its stiffness may move as it likes."""
        if part.matrix != "hysteretic":
            return np.zeros(len(chosen), bool)
        loss = self.batch.roles[part.loss][part.at[chosen]]
        return np.asarray((self.structure.values.values[loss] == 0.0) & ~self.moving[loss])

    def _term(self, kind: MatrixKind, layout: Layout, values: Reals, numbers: Integers) -> Term:
        own, columns = np.unique(numbers, return_inverse=True)
        constant = own[0] == CONSTANT
        label = f"{self.batch.kind} {'constant' if constant else kind}"
        coefficient = None if constant else Coefficients(self.book, own)
        return Term(kind, label, len(own), coefficient, layout, values, columns)


def _distinct(columns: list[NDArray]) -> tuple[Integers, Integers]:
    """First of the rows that are alike in all columns, for each kind of row; and the kind of each row."""
    kinds = np.zeros(len(columns[0]), np.int64)
    for column in {id(c): c for c in columns}.values():
        for part in np.atleast_2d(column.T):
            if len(part) and (part != part[0]).any():
                _, found = np.unique(part, return_inverse=True)
                _, kinds = np.unique(kinds * (found.max(initial=0) + 1) + found, return_inverse=True)
    _, first = np.unique(kinds, return_index=True)
    return first, kinds
