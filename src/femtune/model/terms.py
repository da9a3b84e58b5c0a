"""Terms: elements that share coefficient functions of the parameters; together they are the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import get_args

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Flags, Integers, Reals
from femtune.errors import FemtuneError
from femtune.fem import Contribution, ElementBatch, Structure
from femtune.fem.contribution import LowRank
from femtune.fem.distribution import varied_entries
from femtune.fem.elements import pieces
from femtune.fem.fields import MatrixKind
from femtune.fem.values import TableJet
from femtune.model.coefficients import NOTHING, CoefficientBook, CoefficientGroup, Coefficients
from femtune.model.linear import memory
from femtune.model.linear.memory import require_memory
from femtune.parameters.jet import Jet

# ----------------------------------------------------------------------------------------------------
# Term: element matrices, or one sparse matrix, times functions of the parameters.


UNPACKED_AT_ONCE = 4096
"""Elements whose full matrices are computed together; those of solids with 20 nodes take 118 MB."""


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
class LowRankValues:
    """Entries of symmetric matrices RᵀCR, computed where they are read.

    Parameters
    ----------
    rows : (e, r, d) R of all elements of a batch that have some, which terms share
    index : (m,) elements of the term among these
    middle : (m, s) entries of C at `middle_pairs` (s, 2)
    pairs : (q, 2) the entries that are read, as of the term's layout
    """

    rows: Reals
    index: Integers
    middle: Reals
    middle_pairs: Integers
    pairs: Integers

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, part: slice | Integers) -> Reals:
        """(k, q) entries of some of the matrices."""
        R = self.rows[self.index[part]]
        full = np.swapaxes(R, 1, 2) @ (unpacked(self.middle[part], self.middle_pairs, R.shape[1]) @ R)
        d = full.shape[1]
        if len(self.pairs) == d * (d + 1) // 2:
            return upper_entries(full)
        return np.take(full.reshape(len(full), -1), self.pairs @ (d, 1), axis=1)

    def keep(self, mask: Flags) -> LowRankValues:
        """The elements where the mask is true."""
        return replace(self, index=self.index[mask], middle=self.middle[mask])


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
    values : (m, q) entries of the symmetric element matrices at the layout's pairs, kept or computed
    columns : (m,) which coefficient an element uses
    """

    layout: TermLayout
    values: Reals | LowRankValues
    columns: Integers

    @property
    def elements(self) -> Integers:
        """(m,) element numbers."""
        return self.layout.elements

    @property
    def dofs(self) -> Integers:
        """(m, d) g-set DOFs, −1 for ground."""
        return self.layout.dofs

    def arrays(self) -> Iterator[NDArray]:
        """All that it is made of."""
        yield from (self.layout.elements, self.layout.dofs, self.columns)
        values = self.values
        yield from (values.rows, values.index, values.middle) if isinstance(values, LowRankValues) else (values,)

    def keep(self, mask: Flags, layout: TermLayout) -> Term:
        """The elements where the mask is true; `layout` is the layout of these."""
        stored = self.values
        values = stored.keep(mask) if isinstance(stored, LowRankValues) else stored[mask]
        return replace(self, layout=layout, values=values, columns=self.columns[mask])

    def matrices(self, part: slice = slice(None)) -> Reals:
        """(m, d, d) full matrices of some of the elements."""
        return unpacked(self.values[part], self.layout.pairs, self.dofs.shape[1])

    def parts(self) -> Iterator[slice]:
        """Slices of the elements whose full matrices take little memory."""
        return (slice(i, i + UNPACKED_AT_ONCE) for i in range(0, len(self.elements), UNPACKED_AT_ONCE))


def unpacked(values: Reals, pairs: Integers, d: int) -> Reals:
    """(m, d, d) symmetric matrices from their entries (m, q) at pairs (q, 2); zero elsewhere."""
    out = np.zeros((len(values), d, d))
    out[:, pairs[:, 0], pairs[:, 1]] = values
    out[:, pairs[:, 1], pairs[:, 0]] = values
    return out


def upper_entries(matrices: Reals) -> Reals:
    """(m, u) upper triangles of (m, d, d), row by row: quicker than to pick the entries one by one."""
    d, first = matrices.shape[1], 0
    out = np.empty((len(matrices), d * (d + 1) // 2))
    for i in range(d):
        out[:, first : first + d - i] = matrices[:, i, i:]
        first += d - i
    return out


Values = Reals | LowRankValues


def combined(parts: Sequence[tuple[Values, Reals]]) -> Iterator[tuple[Values, Reals]]:
    """Values of terms of one layout with a factor (m,) of each element; those of low rank added to one."""
    low: dict[int, list[tuple[LowRankValues, Reals]]] = {}
    for values, factors in parts:
        if isinstance(values, LowRankValues):
            low.setdefault(id(values.rows), []).append((values, factors))
        else:
            yield values, factors
    for group in low.values():
        first = group[0][0]
        r = first.rows.shape[1]
        middle = sum(factors[:, None, None] * unpacked(v.middle, v.middle_pairs, r) for v, factors in group)
        pairs = np.stack(np.triu_indices(r), axis=1)
        yield replace(first, middle=upper_entries(np.asarray(middle)), middle_pairs=pairs), np.ones(len(first))


def nowhere_zero(terms: Sequence[Term]) -> list[Values]:
    """Values of which one is not zero wherever a term of a layout is not; for low rank |R|ᵀ Σ|C| |R|."""
    term_values = (term.values for term in terms)
    sizes = [replace(v, middle=np.abs(v.middle)) if isinstance(v, LowRankValues) else v for v in term_values]
    sums = (term_values for term_values, _ in combined([(v, np.ones(len(v))) for v in sizes]))
    return [replace(v, rows=np.abs(v.rows)) if isinstance(v, LowRankValues) else v for v in sums]


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
"""Number of the coefficient function of what no parameter changes."""

EMPTY = -4
"""Number of the coefficient function of an element that a slot does not have yet."""


@dataclass(eq=False)
class _Open:
    """Sums of the piece that is being added: (p,) function of each element or EMPTY, and (p, u) upper triangles."""

    numbers: Integers
    sums: Reals


@dataclass(frozen=True, eq=False)
class _Block:
    """Packed sums of some elements: rows of the batch, functions, (u,) flags of entries, and (m, q) entries."""

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
        """(count, q) values; unused memory is released."""
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
        entries = upper_entries(matrices)
        for s in np.unique(slots):
            mine = slots == s
            if mine.all():
                _accumulate(self.opened[s], at, numbers, factors, entries)
            else:
                _accumulate(self.opened[s], at[mine], numbers[mine], factors[mine], entries[mine])

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
        self.opened.append(_Open(np.full(self.size, EMPTY), np.zeros((self.size, len(self._upper)))))

    def pack(self) -> None:
        """Store the sums of the piece."""
        for s, opened in enumerate(self.opened):
            block = self._packed(opened)
            if block is not None:
                if s not in self.stored:
                    self.stored[s] = _Stored(len(self.batch), block.used, np.empty((len(self.batch), block.used.sum())))
                self.stored[s].add(block)
        self.opened = []

    def _packed(self, opened: _Open) -> _Block | None:
        flat = opened.sums
        some = flat != 0.0
        rows = np.flatnonzero((opened.numbers != EMPTY) & some.any(axis=1))
        if not rows.size:
            return None
        used = np.asarray(some.any(axis=0))
        values = flat if used.all() and len(rows) == len(flat) else flat[np.ix_(rows, used)]
        return _Block(self.start + rows, opened.numbers[rows], used, values)

    def finish(self) -> Iterator[_SlotSums]:
        """The sums of every slot that has elements."""
        for slot in sorted(self.stored):
            stored = self.stored.pop(slot)
            pairs = np.stack(np.divmod(self._upper[stored.used], self.d), axis=1)
            yield _SlotSums(np.concatenate(stored.rows), pairs, stored.taken(), np.concatenate(stored.numbers))


@dataclass(frozen=True, eq=False)
class _SlotSums:
    """Rows of a batch (m,), pairs (q, 2) of entries, their sums (m, q), and the function (m,) of each."""

    rows: Integers
    pairs: Integers
    values: Reals
    numbers: Integers


def _accumulate(opened: _Open, at: Integers, numbers: Integers, factors: Reals, entries: Reals) -> None:
    """Add to the sums; `entries` are overwritten."""
    fresh = bool((opened.numbers[at] == EMPTY).all())
    opened.numbers[at] = numbers
    entries *= factors[:, None]
    if len(at) < len(opened.sums) or not np.array_equal(at, np.arange(len(at))):
        opened.sums[at] += entries
    elif fresh:
        opened.sums = entries
    else:
        opened.sums += entries


@dataclass(frozen=True)
class CompiledTerms:
    """The terms of a structure; `used` by kind of matrix: (n,) True for entries of the value table that it needs."""

    terms: tuple[TermFunction, ...]
    used: Mapping[MatrixKind, Flags]


class KeptTerms:
    """The terms of a model; their memory can be released, and they are compiled again when they are needed."""

    def __init__(self, terms: Sequence[TermFunction], again: Callable[[], Sequence[TermFunction]]) -> None:
        self._terms: tuple[TermFunction, ...] | None = tuple(terms)
        self._mass = tuple(term for term in terms if term.matrix == "mass")
        self._again = again

    @property
    def every(self) -> tuple[TermFunction, ...]:
        """All of them."""
        if self._terms is None:
            self._terms = tuple(self._again())
        return self._terms

    @property
    def mass(self) -> tuple[TermFunction, ...]:
        """Those of the mass, which are kept: they are small, and weighing a model takes no others."""
        return self._mass

    def release(self) -> None:
        """Release the memory of all terms except those of the mass."""
        self._terms = None


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
    moving = np.zeros(len(structure.values.values), bool)
    moving[list(touched)] = True
    needed = forecast(structure, moving, samples)
    require_memory(needed, "model.memory/elements", elements=sum(map(len, structure.batches)))
    book, used = CoefficientBook(samples), _used_by_none(structure)
    varied = _varied(structure)
    terms: list[Term] = []
    for batch in structure.batches:
        terms += _BatchTerms(structure, batch, moving, used, book, varied).compile()
    return CompiledTerms(tuple(terms), used)


def _varied(structure: Structure) -> Flags:
    """(n,) entries of the value table that vary over a region."""
    varied = np.zeros(len(structure.values.values), bool)
    varied[list(varied_entries(structure.values))] = True
    return varied


def _used_by_none(structure: Structure) -> dict[MatrixKind, Flags]:
    return {kind: np.zeros(len(structure.values.values), bool) for kind in get_args(MatrixKind)}


SAMPLED_ELEMENTS = 48
"""Elements of one kind whose terms are compiled to forecast the memory of all of them."""


def forecast(structure: Structure, moving: Flags, samples: Reals) -> int:
    """Bytes that the terms take: those of a few elements of every kind, times the number of elements.

    Elements are of one kind where they are in one batch and parameters move the same of their values; `moving` (n,)
    and `samples` as of `compile_terms`.
    """
    if sum(8 * len(b) * b.dofs.shape[1] ** 2 for b in structure.batches) < memory.NEGLIGIBLE_BYTES:
        return 0
    needed = 0.0
    for batch in structure.batches:
        moved = np.array([moving[at] for at in batch.roles.values()]).reshape(-1, len(batch))
        _, kinds = _distinct([*moved.astype(float)]) if len(moved) else (None, np.zeros(len(batch), int))
        for kind in range(kinds.max(initial=-1) + 1):
            rows = np.flatnonzero(kinds == kind)
            few = batch.some(rows[np.unique(np.linspace(0, len(rows) - 1, SAMPLED_ELEMENTS).astype(int))])
            # the DOFs of a whole batch are the structure's own
            whole = few.dofs if len(rows) == len(batch) else None
            needed += len(rows) / len(few) * _bytes_of_terms(structure, few, moving, samples, whole)
    return int(needed)


def _bytes_of_terms(
    structure: Structure, batch: ElementBatch, moving: Flags, samples: Reals, without: Integers | None
) -> int:
    alone = replace(structure, batches=(batch,))
    try:
        tables = _used_by_none(structure), CoefficientBook(samples), _varied(structure)
        terms = _BatchTerms(alone, batch, moving, *tables).compile()
    except FemtuneError:
        # errors of an element are reported when all elements are compiled
        return 0
    arrays = {id(a): a for term in terms for a in term.arrays()}
    return sum(a.nbytes for a in arrays.values() if a is not without)


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
    middles: dict[MatrixKind, TermSums] = field(default_factory=dict)
    low_rank: Reals = field(default_factory=lambda: np.zeros(0))
    layouts: list[TermLayout] = field(default_factory=list)

    def compile(self) -> list[Term]:
        """All terms, those that have elements."""
        for parts in pieces(self.batch, self.structure):
            if parts:
                self._add_piece(parts)
        terms = [self._term(kind, f) for kind in list(self.sums) for f in self.sums.pop(kind).finish()]
        low_rank = [(kind, f) for kind in list(self.middles) for f in self.middles.pop(kind).finish()]
        return terms + list(self._low_rank_terms(low_rank))

    def _add_piece(self, parts: list[Contribution]) -> None:
        start = min((int(p.at.min()) for p in parts if len(p.at)), default=0)
        stop = max((int(p.at.max()) + 1 for p in parts if len(p.at)), default=0)
        for part in parts:
            self._add(part, start, stop)
        for sums in (*self.sums.values(), *self.middles.values()):
            sums.pack()

    def _add(self, part: Contribution, start: int, stop: int) -> None:
        for numbers, factors in self._coefficients(part):
            self._add_with(part, numbers, factors, (start, stop))

    def _add_with(self, part: Contribution, numbers: Integers, factors: Reals, span: tuple[int, int]) -> None:
        full = numbers != NOTHING
        if isinstance(part.stored, LowRank):
            # constant parts join the other constants of their element
            moves = full & (numbers != CONSTANT)
            if moves.any():
                self._keep_rows(part.at, part.stored.rows)
            self._put(self.middles, part, part.stored.middle, moves, (numbers, factors), span)
            full = full & ~moves
        if full.any():
            self._put(self.sums, part, part.matrices, full, (numbers, factors), span)

    def _put(
        self, kinds: dict[MatrixKind, TermSums], part: Contribution, matrices: Reals, which: Flags,
        coefficients: tuple[Integers, Reals], span: tuple[int, int],
    ) -> None:  # fmt: skip
        """Add the matrices of some elements to the sums of their kind."""
        some = np.flatnonzero(which)
        if not some.size:
            return
        sums = kinds.setdefault(part.matrix, TermSums(self.batch))
        sums.span(*span, matrices.shape[1])
        chosen = matrices if which.all() else matrices[some]
        sums.add(part.at[some] - span[0], coefficients[0][some], coefficients[1][some], chosen)

    def _keep_rows(self, at: Integers, rows: Reals) -> None:
        if not self.low_rank.size:
            self.low_rank = np.empty((len(self.batch), *rows.shape[1:]))
        self.low_rank[at] = rows

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
            numbers_of_function, sizes = np.full(len(first), NOTHING), np.zeros(len(first))
            numbers_of_function[varied], sizes[varied] = np.where(weights == 0.0, NOTHING, number), weights
            yield numbers_of_function[kinds], sizes[kinds]

    def _lossless(self, part: Contribution, chosen: Integers) -> Flags:
        """True where a loss factor is zero and no parameter moves it, so that its stiffness may change."""
        if part.matrix != "hysteretic":
            return np.zeros(len(chosen), bool)
        loss = self.batch.roles[part.loss][part.at[chosen]]
        return np.asarray((self.structure.values.values[loss] == 0.0) & ~self.moving[loss])

    def _term(self, kind: MatrixKind, sums: _SlotSums) -> Term:
        return self._named(kind, sums.numbers, self._layout(sums.rows, sums.pairs), sums.values)

    def _low_rank_terms(self, every: list[tuple[MatrixKind, _SlotSums]]) -> Iterator[Term]:
        has = np.unique(np.concatenate([np.zeros(0, np.int64), *(sums.rows for _, sums in every)]))
        shared = self.low_rank if len(has) == len(self.batch) else self.low_rank[has]
        for kind, sums in every:
            index = np.searchsorted(has, sums.rows)
            moved = (shared[index] != 0.0).any(axis=1).astype(np.float32)
            layout = self._layout(sums.rows, np.argwhere(np.triu(moved.T @ moved) > 0.0), wider=True)
            values = LowRankValues(shared, index, sums.values, sums.pairs, layout.pairs)
            yield self._named(kind, sums.numbers, layout, values)

    def _layout(self, rows: Integers, pairs: Integers, wider: bool = False) -> TermLayout:
        """One that is known, if need be with more pairs, or a new one."""
        ids, dofs = self.batch.ids[rows], self.batch.dofs
        for known in self.layouts:
            fits = np.array_equal(known.pairs, pairs) or (wider and _covers(known.pairs, pairs))
            if fits and np.array_equal(known.elements, ids):
                return known
        self.layouts.append(TermLayout(ids, dofs if len(rows) == len(dofs) else dofs[rows], pairs))
        return self.layouts[-1]

    def _named(self, kind: MatrixKind, numbers: Integers, layout: TermLayout, values: Reals | LowRankValues) -> Term:
        distinct, columns = np.unique(numbers, return_inverse=True)
        constant = distinct[0] == CONSTANT
        label = f"{self.batch.kind} {'constant' if constant else kind}"
        coefficient = None if constant else Coefficients(self.book, distinct)
        return Term(kind, label, len(distinct), coefficient, layout, values, columns)


def _covers(pairs: Integers, others: Integers) -> bool:
    """True where all other pairs are among some."""
    return set(map(tuple, others.tolist())) <= set(map(tuple, pairs.tolist()))


def _distinct(columns: list[NDArray]) -> tuple[Integers, Integers]:
    """First of the rows that are alike in all columns, for each kind of row; and the kind of each row."""
    parts = [part for column in {id(c): c for c in columns}.values() for part in np.atleast_2d(column.T)]
    parts = [part for part in parts if (part != part[:1]).any()]
    if not parts:
        return np.zeros(min(len(columns[0]), 1), np.int64), np.zeros(len(columns[0]), np.int64)
    key = np.zeros(len(columns[0]), np.uint64)
    for part, odd in zip(parts, odd_numbers(len(parts))):
        key = (key + np.asarray(part, dtype=part.dtype if part.itemsize == 8 else float).view(np.uint64)) * odd
        key ^= key >> np.uint64(32)
    _, first, kinds = np.unique(key, return_index=True, return_inverse=True)
    if any((part != part[first][kinds]).any() for part in parts):
        # two rows that differ have one key
        _, first, kinds = np.unique(np.stack(parts, axis=1), axis=0, return_index=True, return_inverse=True)
    return first, kinds.ravel()


@lru_cache
def odd_numbers(count: int) -> NDArray[np.uint64]:
    """(count,) random multipliers of a hash."""
    return np.random.default_rng(8).integers(1 << 62, size=count, dtype=np.uint64) * np.uint64(2) + np.uint64(1)
