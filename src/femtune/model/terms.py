"""Terms: elements that share coefficient functions of the parameters; together they are the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import get_args

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Flags, Integers, Reals
from femtune.fem import Contribution, ElementBatch, Structure
from femtune.fem.distribution import varied_entries
from femtune.fem.elements import pieces
from femtune.fem.fields import MatrixKind
from femtune.fem.values import TableJet
from femtune.model.coefficients import NOTHING, CoefficientBook, CoefficientGroup, Coefficients
from femtune.model.linear.memory import require_memory
from femtune.parameters.jet import Jet

# ----------------------------------------------------------------------------------------------------
# Term: element matrices, or one sparse matrix, times functions of the parameters.


# elements whose full matrices are made at once
UNPACKED = 4096


@dataclass(frozen=True, eq=False)
class TermLayout:
    """Which elements a term has and where the entries of their matrices go; terms may share one.

    Parameters
    ----------
    elements : (m,) element numbers, 0 for masses that a configuration adds
    dofs : (m, d) g-set DOFs, −1 for ground
    pairs : (q, 2) rows and columns, row ≤ column, of the entries of the element matrices that are kept
    """

    elements: Integers
    dofs: Integers
    pairs: Integers

    def keep(self, mask: Flags) -> TermLayout:
        """The elements where the mask is true."""
        return TermLayout(self.elements[mask], self.dofs[mask], self.pairs)


@dataclass(frozen=True, eq=False)
class TermFunction:
    """What multiplies the matrices of a term.

    Parameters
    ----------
    matrix : "stiffness", "mass", "viscous" or "hysteretic"
    label : what it is, "shell-quad stiffness"
    n_columns : number of coefficients; one for a term that is a scalar times a matrix
    coefficient : jet of the value table -> jet of shape (n_columns,); None where it is the constant 1
    """

    matrix: MatrixKind
    label: str
    n_columns: int
    coefficient: Callable[[TableJet], Jet] | None


@dataclass(frozen=True, eq=False)
class Term(TermFunction):
    """Σ_e c[column_e](p) · matrix_e on the g-set.

    Parameters
    ----------
    layout : elements, DOFs and entries
    values : (m, q) entries of the symmetric element matrices at the layout's pairs
    columns : (m,) which coefficient an element uses
    """

    layout: TermLayout
    values: Reals
    columns: Integers

    @property
    def elements(self) -> Integers:
        """(m,) element numbers."""
        return self.layout.elements

    @property
    def dofs(self) -> Integers:
        """(m, d) g-set DOFs, −1 for ground."""
        return self.layout.dofs

    def keep(self, mask: Flags, layout: TermLayout) -> Term:
        """The elements where the mask is true; `layout` is the layout of these."""
        return replace(self, layout=layout, values=self.values[mask], columns=self.columns[mask])

    def matrices(self, part: slice = slice(None)) -> Reals:
        """(m, d, d) full matrices of some of the elements."""
        return unpacked(self.values[part], self.layout.pairs, self.dofs.shape[1])

    def parts(self) -> Iterator[slice]:
        """Slices of the elements whose full matrices take little memory."""
        return (slice(i, i + UNPACKED) for i in range(0, len(self.elements), UNPACKED))


def unpacked(values: Reals, pairs: Integers, d: int) -> Reals:
    """(m, d, d) symmetric matrices from their entries (m, q) at pairs (q, 2); zero elsewhere."""
    out = np.zeros((len(values), d, d))
    out[:, pairs[:, 0], pairs[:, 1]] = values
    out[:, pairs[:, 1], pairs[:, 0]] = values
    return out


def constant_term(matrix: MatrixKind, label: str, elements: Integers, dofs: Integers, matrices: Reals) -> Term:
    """A term without coefficient from full symmetric matrices (m, d, d)."""
    pairs = np.stack(np.triu_indices(dofs.shape[1]), axis=1)
    pairs = pairs[(matrices[:, pairs[:, 0], pairs[:, 1]] != 0.0).any(axis=0)]
    values = np.ascontiguousarray(matrices[:, pairs[:, 0], pairs[:, 1]])
    return Term(matrix, label, 1, None, TermLayout(elements, dofs, pairs), values, np.zeros(len(elements), np.int64))


@dataclass(frozen=True, eq=False)
class MatrixTerm(TermFunction):
    """c(p) · A with one sparse matrix that no elements made: `upper` (n_g, n_g), csr, with the diagonal."""

    upper: sp.csr_array


# ----------------------------------------------------------------------------------------------------
# Sums of the contributions of a batch to one kind of matrix, kept packed: the upper triangles' entries that are used.
#
# An element has one sum for its constant part and one for each function of the parameters that it follows.


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

    def finish(self, layouts: list[TermLayout]) -> Iterator[tuple[TermLayout, Reals, Integers]]:
        """Layout, values and functions of every slot that has elements; `layouts` of the batch are shared and grow."""
        for slot in sorted(self.stored):
            stored = self.stored.pop(slot)
            rows = np.concatenate(stored.rows)
            pairs = np.stack(np.divmod(self._upper[stored.used], self.d), axis=1)
            yield self._layout(rows, pairs, layouts), stored.taken(), np.concatenate(stored.numbers)

    def _layout(self, rows: Integers, pairs: Integers, layouts: list[TermLayout]) -> TermLayout:
        ids, dofs = self.batch.ids[rows], self.batch.dofs
        for known in layouts:
            if np.array_equal(known.elements, ids) and np.array_equal(known.pairs, pairs):
                return known
        layouts.append(TermLayout(ids, dofs if len(rows) == len(dofs) else dofs[rows], pairs))
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
    require_memory(_forecast(structure, touched), "model.memory/elements", elements=sum(map(len, structure.batches)))
    moving = np.zeros(len(structure.values.values), bool)
    moving[list(touched)] = True
    book, used = CoefficientBook(samples), {kind: np.zeros(len(moving), bool) for kind in get_args(MatrixKind)}
    varied = np.zeros(len(moving), bool)
    varied[list(varied_entries(structure.values))] = True
    terms: list[Term] = []
    for batch in structure.batches:
        terms += _BatchTerms(structure, batch, moving, used, book, varied).compile()
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
    varied: Flags
    sums: dict[MatrixKind, TermSums] = field(default_factory=dict)

    def compile(self) -> list[Term]:
        """All terms, those that have elements."""
        for parts in pieces(self.batch, self.structure):
            if parts:
                self._add_piece(parts)
        layouts: list[TermLayout] = []
        return [self._term(kind, *found) for kind in list(self.sums) for found in self.sums.pop(kind).finish(layouts)]

    def _add_piece(self, parts: list[Contribution]) -> None:
        start = min((int(p.at.min()) for p in parts if len(p.at)), default=0)
        stop = max((int(p.at.max()) + 1 for p in parts if len(p.at)), default=0)
        for part in parts:
            self._add(part, start, stop)
        for sums in self.sums.values():
            sums.pack()

    def _add(self, part: Contribution, start: int, stop: int) -> None:
        for numbers, factors in self._coefficients(part):
            self._add_with(part, numbers, factors, start, stop)

    def _add_with(self, part: Contribution, numbers: Integers, factors: Reals, start: int, stop: int) -> None:
        some = np.flatnonzero(numbers != NOTHING)
        if not some.size:
            return
        if part.matrix not in self.sums:
            self.sums[part.matrix] = TermSums(self.batch)
        matrices = part.matrices if len(some) == len(part.at) else part.matrices[some]
        sums = self.sums[part.matrix]
        sums.span(start, stop, part.matrices.shape[1])
        sums.add(part.at[some] - start, numbers[some], factors[some], matrices)

    def _coefficients(self, part: Contribution) -> Iterator[tuple[Integers, Reals]]:
        """(m,) number of the coefficient function of each element, CONSTANT or NOTHING; and (m,) its factor.

        Elements whose coefficients are combinations of several functions come once for each of these.
        """
        at = np.stack([self.batch.roles[role][part.at] for role in part.roles], axis=1)
        first, kinds = _distinct([*at.T, *part.facts.values()])
        at, facts = at[first], {name: fact[first] for name, fact in part.facts.items()}
        self.used[part.matrix][at] = True
        source = CoefficientGroup(part.coefficient, {role: at[:, i] for i, role in enumerate(part.roles)}, facts)
        moves = np.asarray(self.moving[at].any(axis=1)) & ~self._lossless(part, first)
        numbers, factors = np.full(len(first), CONSTANT), np.zeros(len(first))
        still, free = np.flatnonzero(~moves), np.flatnonzero(moves)
        if still.size:
            factors[still] = source.rows(still).values(self.structure.values.values[None])[0]
            numbers[still[factors[still] == 0.0]] = NOTHING
        varied = free[self.varied[at[free]].any(axis=1)] if self.varied.any() else free[:0]
        spanned = self.book.spanned(source.rows(varied)) if varied.size else None
        if spanned is not None:
            numbers[varied] = NOTHING
            free = np.setdiff1d(free, varied)
        if free.size:
            numbers[free], factors[free] = self.book.number(source.rows(free))
        yield numbers[kinds], factors[kinds]
        for number, weights in () if spanned is None else zip(spanned.numbers, spanned.factors):
            own, sizes = np.full(len(first), NOTHING), np.zeros(len(first))
            own[varied], sizes[varied] = np.where(weights == 0.0, NOTHING, number), weights
            yield own[kinds], sizes[kinds]

    def _lossless(self, part: Contribution, chosen: Integers) -> Flags:
        """True where a loss factor is zero and no parameter moves it, so that its stiffness may move as it likes."""
        if part.matrix != "hysteretic":
            return np.zeros(len(chosen), bool)
        loss = self.batch.roles[part.loss][part.at[chosen]]
        return np.asarray((self.structure.values.values[loss] == 0.0) & ~self.moving[loss])

    def _term(self, kind: MatrixKind, layout: TermLayout, values: Reals, numbers: Integers) -> Term:
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
