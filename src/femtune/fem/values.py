"""The table of property and material values that element coefficients are functions of."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.fem.fields import FieldRef
from femtune.parameters import jet
from femtune.parameters.jet import Jet


@dataclass(frozen=True)
class Derived:
    """An entry derived from others: ``function(*sources)``, written for jets (G from E and ν)."""

    target: int
    function: Callable[..., Jet]
    sources: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TableJet:
    """The value table at a point of parameters; only entries that move carry derivatives.

    Parameters
    ----------
    value : (n,) all entries
    rows : (n,) row in `moving` of each entry that moves; −1, the last row with zero derivatives, for all others
    moving : (m + 1,) jet of the entries that move
    """

    value: NDArray
    rows: NDArray[np.int64]
    moving: Jet

    def __getitem__(self, at: int | NDArray[np.int64]) -> Jet:
        rows = self.rows[at]
        return Jet(self.value[at], self.moving.grad[rows], self.moving.hess[rows])

    def without_derivatives(self) -> TableJet:
        """The values alone: jets of no variables."""
        return TableJet(
            self.value, self.rows, Jet(self.moving.value, self.moving.grad[:, :0], self.moving.hess[:, :0, :0])
        )

    def put(self, at: NDArray[np.int64], entries: Jet) -> None:
        """Set entries that move."""
        rows = self.rows[at]
        self.value[at], self.moving.grad[rows], self.moving.hess[rows] = entries.value, entries.grad, entries.hess


@dataclass(frozen=True, eq=False)
class _Rule:
    """Derived entries of one function: `targets` (m,) and `sources` (k, m); sources belong to earlier rules."""

    function: Callable[..., Jet]
    targets: NDArray[np.int64]
    sources: NDArray[np.int64]


@dataclass(frozen=True)
class ValueTable:
    """Values by FieldRef; derived entries come after their sources.

    `values` is (n,) and holds the nominal value of derived entries too.
    """

    refs: tuple[FieldRef, ...]
    values: NDArray[np.float64]
    derived: tuple[Derived, ...] = ()

    def index(self, ref: FieldRef) -> int | None:
        """Position of a field, or None."""
        return self._positions.get(ref)

    @cached_property
    def _positions(self) -> dict[FieldRef, int]:
        return {ref: i for i, ref in enumerate(self.refs)}

    @cached_property
    def _targets(self) -> frozenset[int]:
        return frozenset(d.target for d in self.derived)

    @cached_property
    def _followers(self) -> dict[int, list[int]]:
        """The entries that are directly derived from an entry."""
        out: dict[int, list[int]] = {}
        for d in self.derived:
            for source in d.sources:
                out.setdefault(source, []).append(d.target)
        return out

    @cached_property
    def _rules(self) -> list[_Rule]:
        """Derived entries grouped by function, in an order in which sources come first."""
        depth: dict[int, int] = {}
        groups: dict[tuple[int, int, Callable[..., Jet]], list[Derived]] = {}
        for d in self.derived:
            depth[d.target] = 1 + max(depth.get(s, 0) for s in d.sources)
            groups.setdefault((depth[d.target], len(d.sources), d.function), []).append(d)
        ordered = sorted(groups.items(), key=lambda item: item[0][0])
        return [
            _Rule(function, np.array([d.target for d in group]), np.array([d.sources for d in group]).T)
            for (_, _, function), group in ordered
        ]

    def is_derived(self, i: int) -> bool:
        """True if entry i is derived from others."""
        return i in self._targets

    def with_own(self, refs: Iterable[FieldRef]) -> ValueTable:
        """The table in which some fields are independent values, even if they are derived ones."""
        chosen = {self._positions[ref] for ref in refs if ref in self._positions}
        if chosen.isdisjoint(self._targets):
            return self
        return replace(self, derived=tuple(d for d in self.derived if d.target not in chosen))

    def followers(self, refs: Iterable[FieldRef], wanted: Container[FieldRef]) -> list[FieldRef]:
        """The wanted fields (of any region) that are derived from the given fields and are not among them."""
        given = {self._positions[ref] for ref in refs if ref in self._positions}
        derived = (self.refs[i] for i in sorted(self.dependents(given) - given) if self.is_derived(i))
        return [ref for ref in derived if replace(ref, region="") in wanted]

    def following(self, values: Mapping[FieldRef, float], wanted: Container[FieldRef]) -> dict[FieldRef, float]:
        """Values of the `followers` of fields that have new values."""
        followers = self.followers(values, wanted)
        if not followers:
            return {}
        at = {self._positions[ref]: value for ref, value in values.items() if ref in self._positions}
        table = self.evaluate({i: jet.constant(value, 0) for i, value in at.items()}, 0)
        return {ref: float(table.value[self._positions[ref]]) for ref in followers}

    def dependents(self, indices: Iterable[int]) -> set[int]:
        """The given entries and all that are derived from them."""
        touched, left = set(indices), list(indices)
        while left:
            new = [i for i in self._followers.get(left.pop(), ()) if i not in touched]
            touched.update(new)
            left += new
        return touched

    def evaluate(self, assigned: Mapping[int, Jet], n_variables: int) -> TableJet:
        """All entries, with `assigned` ones replaced and derived ones recomputed."""
        return self.assign([(np.array([i]), j) for i, j in assigned.items()], n_variables)

    def assign(self, assigned: Sequence[tuple[NDArray[np.int64], Jet]], n_variables: int) -> TableJet:
        """As `evaluate`, many entries at once: positions (m,) and a jet of shape (m,), or one for all of them."""
        kind = complex if any(np.iscomplexobj(j.value) for _, j in assigned) else float
        given = np.zeros(len(self.values), bool)
        for at, _ in assigned:
            given[at] = True
        moves = self._moving(given)
        rows = np.where(moves, np.cumsum(moves) - 1, -1)
        # the last row stays zero
        curved = min((j.n_curved for _, j in assigned), default=n_variables)
        moving = jet.constant(np.zeros(moves.sum() + 1, kind), n_variables, curved)
        out = TableJet(self.values.astype(kind), rows, moving)
        for at, j in assigned:
            out.put(at, j)
        for rule in self._rules:
            self._recompute(out, rule, moves[rule.targets] & ~given[rule.targets])
        return out

    def _moving(self, given: NDArray[np.bool_]) -> NDArray[np.bool_]:
        moves = given.copy()
        for rule in self._rules:
            moves[rule.targets[moves[rule.sources].any(axis=0)]] = True
        return moves

    def _recompute(self, table: TableJet, rule: _Rule, wanted: NDArray[np.bool_]) -> None:
        if wanted.any():
            table.put(rule.targets[wanted], rule.function(*(table[at] for at in rule.sources[:, wanted])))

    def split(self, index: int, region: str) -> tuple[ValueTable, dict[int, int]]:
        """A copy of an entry, and of all entries derived from it, under a region's name.

        Returns the longer table and the map from old to new positions.
        """
        moved: dict[int, int] = {}
        refs, derived = list(self.refs), list(self.derived)
        for old in sorted(self.dependents([index]), key=lambda i: (i != index, i)):
            moved[old] = len(refs)
            refs.append(replace(self.refs[old], region=region))
        for d in self.derived:
            if d.target in moved:
                sources = tuple(moved.get(s, s) for s in d.sources)
                derived.append(Derived(moved[d.target], d.function, sources))
        values = np.concatenate([self.values, self.values[list(moved)]])
        return ValueTable(tuple(refs), values, tuple(derived)), moved

    def split_each(self, index: int, regions: Sequence[str]) -> tuple[ValueTable, list[dict[int, int]]]:
        """As `split`, for many regions at once, with a map of positions for each."""
        parts = sorted(self.dependents([index]), key=lambda i: (i != index, i))
        rules = [d for d in self.derived if d.target in parts and d.target != index]
        first, size = len(self.refs), len(parts)
        moved = [{old: first + size * k + j for j, old in enumerate(parts)} for k in range(len(regions))]
        refs = tuple(replace(self.refs[old], region=region) for region in regions for old in parts)
        derived = tuple(
            Derived(targets[d.target], d.function, tuple(targets.get(s, s) for s in d.sources))
            for targets in moved
            for d in rules
        )
        values = np.concatenate([self.values, np.tile(self.values[parts], len(regions))])
        return ValueTable((*self.refs, *refs), values, (*self.derived, *derived)), moved

    def copies_of(self, index: int) -> set[int]:
        """Entries of the same field for regions, and the entries derived from them."""
        ref = self.refs[index]
        copies = [
            i for i, r in enumerate(self.refs) if i != index and r.region and replace(r, region=ref.region) == ref
        ]
        return self.dependents(copies)

    def extended(self, entries: Mapping[FieldRef, float]) -> ValueTable:
        """The table with additional entries at its end; existing ones stay as they are."""
        new = {ref: value for ref, value in entries.items() if self.index(ref) is None}
        values = np.concatenate([self.values, np.array(list(new.values()), float)])
        return ValueTable((*self.refs, *new), values, self.derived)


@dataclass
class ValueTableBuilder:
    """Collects entries while a deck is read; the same field twice is one entry."""

    refs: list[FieldRef] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    derived: list[Derived] = field(default_factory=list)
    _index: dict[FieldRef, int] = field(default_factory=dict)

    def add(self, ref: FieldRef, value: float) -> int:
        """Position of the entry, new or known."""
        if ref not in self._index:
            self._index[ref] = len(self.refs)
            self.refs.append(ref)
            self.values.append(float(value))
        return self._index[ref]

    def derive(self, ref: FieldRef, function: Callable[..., Jet], *sources: int, nominal: float | None = None) -> int:
        """Add an entry derived from others; `function` takes and returns jets of one shape, element by element.

        Entries that share the function itself are computed together. `nominal` is its value, if known.
        """
        known = self._index.get(ref)
        if known is not None:
            return known
        if nominal is None:
            nominal = float(function(*(jet.constant(self.values[s], 0) for s in sources)).value)
        i = self.add(ref, nominal)
        self.derived.append(Derived(i, function, sources))
        return i

    def table(self) -> ValueTable:
        """The finished table."""
        return ValueTable(tuple(self.refs), np.array(self.values), tuple(self.derived))
