"""The table of property and material values that element coefficients are functions of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femtune.parameters import jet
from femtune.parameters.jet import Jet


@dataclass(frozen=True, order=True)
class FieldRef:
    """A field of a card, for example ``PBAR 3 I1``; `region` is set where a part of its users was split off.

    A PARAM has no number: ``PARAM G`` has id 0.
    """

    card: str
    id: int
    name: str
    region: str = ""

    def __str__(self) -> str:
        tail = f" [{self.region}]" if self.region else ""
        number = f" {self.id}" if self.id else ""
        return f"{self.card}{number} {self.name}{tail}"


@dataclass(frozen=True)
class Derived:
    """An entry that follows from others: ``function(*sources)``, written for jets (G from E and ν)."""

    target: int
    function: Callable[..., Jet]
    sources: tuple[int, ...]


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

    @property
    def _positions(self) -> dict[FieldRef, int]:
        cached = self.__dict__.get("_index")
        if cached is None:
            cached = {ref: i for i, ref in enumerate(self.refs)}
            object.__setattr__(self, "_index", cached)
        return cached

    def is_derived(self, i: int) -> bool:
        """True where entry i follows from others."""
        return any(d.target == i for d in self.derived)

    def dependents(self, indices: Iterable[int]) -> set[int]:
        """The given entries and all that follow from them."""
        touched = set(indices)
        for d in self.derived:
            if touched & set(d.sources):
                touched.add(d.target)
        return touched

    def evaluate(self, assigned: Mapping[int, Jet], n_variables: int) -> Jet:
        """All entries as one jet of shape (n,), with `assigned` entries replaced and derived ones recomputed."""
        kind = complex if any(np.iscomplexobj(j.value) for j in assigned.values()) else float
        out = jet.constant(self.values.astype(kind), n_variables)
        for i, j in assigned.items():
            _put(out, i, j)
        touched = self.dependents(assigned)
        for d in self.derived:
            if d.target not in assigned and d.target in touched:
                _put(out, d.target, d.function(*(out[s] for s in d.sources)))
        return out

    def split(self, index: int, region: str) -> tuple[ValueTable, dict[int, int]]:
        """A copy of an entry, and of all that follow from it, under a region's name.

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


def _put(table: Jet, i: int, entry: Jet) -> None:
    table.value[i], table.grad[i], table.hess[i] = entry.value, entry.grad, entry.hess


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

    def derive(self, ref: FieldRef, function: Callable[..., Jet], *sources: int) -> int:
        """An entry that follows from others; `function` takes and returns jets."""
        known = ref in self._index
        nominal = function(*(jet.constant(self.values[s], 0) for s in sources))
        i = self.add(ref, float(nominal.value))
        if not known:
            self.derived.append(Derived(i, function, sources))
        return i

    def table(self) -> ValueTable:
        """The finished table."""
        return ValueTable(tuple(self.refs), np.array(self.values), tuple(self.derived))
