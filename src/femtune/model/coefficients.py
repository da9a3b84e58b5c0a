"""Coefficient functions of the parameters, those that are proportional to each other kept once.

Whether two are proportional is decided by numbers: analytic functions whose ratio is the same at several random points
are the same function except for a factor, which goes into the matrices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.fem.contribution import Coefficient
from femtune.fem.values import TableJet
from femtune.parameters import jet
from femtune.parameters.jet import Jet

PROPORTIONAL = 1e-13
"""Relative difference below which two ratios are equal; a coefficient carries a few roundings of 1e-16."""
VANISHING = 1e-3
"""Nominal value relative to the largest one at the samples below which it is no measure of a coefficient."""
CLEARLY_LARGER = 10.0
"""Factor by which a multiple must exceed the one that represents a function to take its place."""
SPANNED = 3e-13
"""Part of a coefficient that combinations of functions may miss at the samples before further functions are added."""
NEARLY_SPANNED = 1e-11
"""The same in the end: coefficients that are no polynomials, such as shear with residual bending flexibility, would
need more and more functions."""
NOTHING = -1
"""The number of a coefficient that is zero for all values of the parameters."""


@dataclass(frozen=True, eq=False)
class CoefficientGroup:
    """Coefficients of one function: positions of its roles in the value table (m,) each, and its facts (m,)."""

    function: Coefficient
    roles: Mapping[str, Integers]
    facts: Mapping[str, NDArray]

    def rows(self, at: Integers) -> CoefficientGroup:
        """Some of them."""
        return CoefficientGroup(
            self.function, {r: p[at] for r, p in self.roles.items()}, {f: v[at] for f, v in self.facts.items()}
        )

    def __len__(self) -> int:
        return len(next(iter(self.roles.values())))

    def values(self, table: Reals) -> Reals:
        """(s, m) values for s value tables (s, n)."""
        count = len(table)
        roles = {r: jet.constant(table[:, p].ravel(), 0) for r, p in self.roles.items()}
        facts = {f: np.concatenate([v] * count) for f, v in self.facts.items()}
        with np.errstate(all="ignore"):
            values = np.asarray(self.function(roles, facts).value)
        return np.broadcast_to(values, (count * len(self),)).reshape(count, len(self))

    @property
    def kind(self) -> tuple[object, ...]:
        """Equal for coefficients of one function of the same values."""
        return (self.function, *self.roles, *self.facts)

    def jet(self, table: TableJet) -> Jet:
        """Jet of shape (m,) at a point of the parameters."""
        return self.function({r: table[p] for r, p in self.roles.items()}, self.facts)


@dataclass(frozen=True, eq=False)
class Spanned:
    """Coefficients (m,) as combinations: `numbers` (k,) of functions, and their `factors` (k, m)."""

    numbers: Integers
    factors: Reals


def _independent(columns: Reals) -> Integers:
    """Columns (s, m) that span all of them, by pivoting, the largest first."""
    _, R, order = la.qr(columns, mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    # smaller pivots are rounding of the largest one and are left to the next round
    return np.asarray(order[: len(size)][size > max(SPANNED, _SMALLEST_PIVOT * size[:1].max(initial=0.0))])


_SMALLEST_PIVOT = 1e-6
"""Pivot relative to the largest one below which a column is left to the next round: its rest is mostly rounding."""


@dataclass(eq=False)
class CoefficientBook:
    """All coefficient functions of a model, numbered; `samples` (s, n) are value tables, the nominal one first."""

    samples: Reals
    sources: list[CoefficientGroup] = field(default_factory=list)
    places: list[tuple[int, int]] = field(default_factory=list)
    _sizes: Reals = field(default_factory=lambda: np.zeros(0))
    _ratios: Reals = field(init=False)
    _keys: Reals = field(default_factory=lambda: np.zeros(0))
    _order: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    _spans: dict[object, list[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count = len(self.samples)
        self._ratios = np.zeros((0, count))
        # a positive mean is zero for hardly any function; the key tells functions apart by one number
        self._mean, self._key = np.random.default_rng(20).uniform(0.5, 1.5, (2, count))

    def __len__(self) -> int:
        return len(self.places)

    def number(self, source: CoefficientGroup) -> tuple[Integers, Reals]:
        """(m,) number of the function that each coefficient is a multiple of, and (m,) the factor.

        NOTHING is the number of a coefficient that is zero at all samples.
        """
        values = source.values(self.samples)
        size = self._size(values)
        ratios = (values / size).T
        numbers = self._known(ratios)
        numbers[(values == 0.0).all(axis=0)] = NOTHING
        new = np.flatnonzero(numbers == _UNKNOWN)
        if new.size:
            numbers[new] = self._add(source, new, ratios[new], size[new])
        self._improve(source, numbers, size)
        return numbers, np.where(numbers == NOTHING, 0.0, size)

    def spanned(self, source: CoefficientGroup) -> Spanned | None:
        """Coefficients as combinations of few functions: what varies over elements by a few functions of position.

        A thickness t·(1 + Σ a_j f_j) of each element gives t and t³, polynomials of the amplitudes with as many terms
        as amplitudes allow, whatever the number of elements. None if the samples do not suffice or nothing is saved.
        """
        values = source.values(self.samples)
        size = self._size(values)
        ratios, span = values / size, self._spans.setdefault(source.kind, [])
        while True:
            basis = self._ratios[span].T
            weights = la.lstsq(basis, ratios, lapack_driver="gelsy")[0] if span else np.zeros((0, len(size)))
            off = ratios - basis @ weights
            worst = float((np.abs(off).max(axis=0) / np.abs(ratios).max(axis=0)).max(initial=0.0))
            new = [] if worst <= SPANNED else self.number(source.rows(_independent(off)))[0].tolist()
            more = [n for n in dict.fromkeys(new) if n not in span]
            if not more or len(span) + len(more) > len(self.samples) // 2:
                break
            span += more
        if worst > NEARLY_SPANNED or 2 * len(span) > len(size):
            return None
        return Spanned(np.array(span, np.int64), weights * size)

    def _size(self, values: Reals) -> Reals:
        """(m,) what coefficients (s, m) are multiples by: their nominal values, so that functions are 1 there."""
        vanishes = np.abs(values[0]) <= VANISHING * np.abs(values).max(axis=0)
        size = np.where(vanishes, self._mean @ values, values[0])
        size[size == 0.0] = 1.0
        return size

    def scale(self, numbers: Integers) -> Reals:
        """What the functions that stand for others are divided by, so that the factors above are right."""
        return np.asarray(self._sizes[numbers])

    def _improve(self, source: CoefficientGroup, numbers: Integers, size: Reals) -> None:
        """Let the largest of the multiples represent a function: a small one may be the result of a cancellation."""
        order = np.argsort(np.abs(size), kind="stable")
        order = order[numbers[order] != NOTHING]
        # the last of a kind in ascending order is the largest
        kinds, last = np.unique(numbers[order][::-1], return_index=True)
        rows = order[::-1][last]
        better = np.abs(size[rows]) > CLEARLY_LARGER * np.abs(self._sizes[kinds])
        if better.any():
            for i, kind in enumerate(kinds[better]):
                self.places[kind] = (len(self.sources), i)
            self.sources.append(source.rows(rows[better]))
            self._sizes[kinds[better]] = size[rows[better]]

    def _known(self, ratios: Reals) -> Integers:
        """(m,) number of the function with the same ratios, _UNKNOWN without one."""
        numbers = np.full(len(ratios), _UNKNOWN)
        at = np.searchsorted(self._keys, ratios @ self._key)
        for near in (at - 1, at):
            some = np.flatnonzero((near >= 0) & (near < len(self._keys)))
            candidate = self._order[near[some]]
            same = _alike(ratios[some], self._ratios[candidate])
            numbers[some[same]] = candidate[same]
        return numbers

    def _add(self, source: CoefficientGroup, rows: Integers, ratios: Reals, size: Reals) -> Integers:
        """Number new functions; (r,) their numbers."""
        order = np.argsort(ratios @ self._key, kind="stable")
        first = np.ones(len(order), bool)
        first[1:] = ~_alike(ratios[order[1:]], ratios[order[:-1]])
        numbers = np.empty(len(order), np.int64)
        numbers[order] = len(self) + np.cumsum(first) - 1
        chosen = order[first]
        self.places += [(len(self.sources), i) for i in range(len(chosen))]
        self.sources.append(source.rows(rows[chosen]))
        self._sizes = np.concatenate([self._sizes, size[chosen]])
        self._ratios = np.concatenate([self._ratios, ratios[chosen]])
        keys = ratios[chosen] @ self._key
        at = np.searchsorted(self._keys, keys)
        self._keys = np.insert(self._keys, at, keys)
        self._order = np.insert(self._order, at, numbers[chosen])
        return numbers


_UNKNOWN = -2
"""The number of a coefficient whose function is not in the book yet."""


def _alike(a: Reals, b: Reals) -> NDArray[np.bool_]:
    """True where rows (m, s) are equal but for rounding; never where one is not finite."""
    with np.errstate(invalid="ignore"):
        off, size = np.abs(a - b).max(axis=1, initial=0.0), np.abs(a).max(axis=1, initial=0.0)
        return np.asarray(off <= PROPORTIONAL * size)


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Some functions of a book: value table -> jet of shape (len(numbers),)."""

    book: CoefficientBook
    numbers: Integers

    def __call__(self, table: TableJet) -> Jet:
        parts = [source.jet(table) for source, _ in self._plan]
        kind = np.result_type(float, *(p.value for p in parts))
        moving = table.moving
        out = jet.constant(np.zeros(len(self.numbers), kind), moving.n_variables, moving.n_curved)
        scale = self.book.scale(self.numbers)
        for (_, places), part in zip(self._plan, parts):
            scaled = part / scale[places]
            out.value[places], out.grad[places], out.hess[places] = scaled.value, scaled.grad, scaled.hess
        return out

    @cached_property
    def _plan(self) -> list[tuple[CoefficientGroup, Integers]]:
        """Sources of the numbers and their places in the result, those of one function together."""
        entries = np.array([self.book.places[i] for i in self.numbers], np.int64).reshape(-1, 2)
        by_function: dict[tuple[object, ...], list[tuple[CoefficientGroup, Integers]]] = {}
        for s in np.unique(entries[:, 0]):
            places = np.flatnonzero(entries[:, 0] == s)
            source = self.book.sources[s].rows(entries[places, 1])
            by_function.setdefault((source.function, *source.roles, *source.facts), []).append((source, places))
        return [_joined(group) for group in by_function.values()]


def _joined(group: Sequence[tuple[CoefficientGroup, Integers]]) -> tuple[CoefficientGroup, Integers]:
    sources = [source for source, _ in group]
    roles = {r: np.concatenate([s.roles[r] for s in sources]) for r in sources[0].roles}
    facts = {f: np.concatenate([s.facts[f] for s in sources]) for f in sources[0].facts}
    return CoefficientGroup(sources[0].function, roles, facts), np.concatenate([places for _, places in group])
