"""One structure from several that are numbered separately, joined at pairs of points (superelements in parts)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Integers
from femtune.fem.assembled import AssembledMatrix
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ConstraintRows, ElementBatch, NodeTable, Structure, join_constraints
from femtune.fem.values import Derived, ValueTable

S = TypeVar("S")
_LARGEST_INCREASE = 2**62
"""Largest increase of a number: half of the range of 64-bit integers, so that the sum with any number fits."""
_SAME_PLACE = 1e-6
"""Distance between joined points, relative to the size of the model, up to which they become one point.

About the rounding of coordinates of seven digits in decks that were written separately; points that are further apart
keep their places and are joined by equations.
"""


@dataclass(frozen=True)
class Increase:
    """Increases that make the numbers of a part unique: for points, elements and other cards."""

    points: int = 0
    elements: int = 0
    cards: int = 0

    def __bool__(self) -> bool:
        return bool(self.points or self.elements or self.cards)


@dataclass(frozen=True)
class StructurePart:
    """A structure that is joined to others.

    Parameters
    ----------
    structure : the part with its original numbers
    number : number of the superelement, 0 for the residual structure
    support_set, multipoint_set : sets that are active in the part; None for those of the residual structure
    """

    structure: Structure
    number: int = 0
    support_set: int | None = None
    multipoint_set: int | None = None

    def is_of_element(self, ref: FieldRef) -> bool:
        """Whether a value is a field of an element's card and so has the element's number."""
        return self.structure.element_kinds.get(ref.id) == ref.card

    def in_whole(self, ref: FieldRef, more: Increase) -> FieldRef:
        """Reference in the whole to a value of the part."""
        if ref.id or not self.number:
            return replace(ref, id=ref.id + (more.elements if self.is_of_element(ref) else more.cards))
        # a value of the whole part: PARAM G, the factor of a matrix
        return replace(ref, name=f"{ref.name}.{self.number}")


Selection = Callable[[StructurePart], int | None]
"""The number of the set that a part selects."""

Point = tuple[int, int]
"""Index of a part, and number of a point in it."""


@dataclass(frozen=True, eq=False)
class _Places:
    """Where rows and DOFs of a part lie in the whole: `rows` of its grid points, `dofs` of its g-set."""

    rows: Integers
    dofs: Integers

    def row(self, at: Integers) -> Integers:
        return np.asarray(np.where(at < 0, -1, self.rows[at]))

    def dof(self, at: Integers) -> Integers:
        return np.asarray(np.where(at < 0, -1, self.dofs[at]))


@dataclass(frozen=True)
class Joined:
    """The whole, and the increases of the numbers of each part."""

    structure: Structure
    increases: tuple[Increase, ...]


def join(parts: Sequence[StructurePart], pairs: Iterable[tuple[Point, Point]]) -> Joined:
    """One structure from parts, the residual structure first.

    Points that are joined become one where they lie in one place and have the same displacement frame; otherwise
    equations make their displacements and rotations equal. A number that occurs in two parts is increased in the later
    one by the number of the superelement times a power of ten.

    Parameters
    ----------
    parts : the parts; the whole has the settings of the first, and the elements of the others keep theirs
    pairs : points that are joined

    Raises
    ------
    OverflowError : if an increased number does not fit in 64 bits
    """
    joined = _Joining(parts, pairs)
    return Joined(joined.structure(), joined.increases)


class _Joining:
    """One assembly of parts."""

    def __init__(self, parts: Sequence[StructurePart], pairs: Iterable[tuple[Point, Point]]) -> None:
        self.parts = parts
        self.step = 10 ** len(str(max(1, *(_largest(part.structure) for part in parts))))
        if self.step * max(1, *(part.number for part in parts)) > _LARGEST_INCREASE:
            raise OverflowError("numbers of the parts are too large")
        self.same, self.tied = self._classes(pairs)
        self.increases = self._increases()
        self.nodes, self.places = self._nodes()
        self.starts = np.cumsum([0, *(len(p.structure.values.refs) for p in parts)])

    def _classes(self, pairs: Iterable[tuple[Point, Point]]) -> tuple[dict[Point, Point], list[tuple[Point, Point]]]:
        """The point that replaces each joined one, and the pairs that are joined by equations."""
        stands: dict[Point, Point] = {}

        def first(point: Point) -> Point:
            while point in stands:
                point = stands[point]
            return point

        for a, b in pairs:
            one, other = sorted((first(a), first(b)))
            if one != other:
                stands[other] = one
        representative = {point: first(point) for point in stands}
        tied = [(point, of) for point, of in representative.items() if not self._alike(point, of)]
        apart = {point for point, _ in tied}
        return {point: of for point, of in representative.items() if point not in apart}, tied

    def _alike(self, a: Point, b: Point) -> bool:
        one, other = (self.parts[i].structure.nodes for i, _ in (a, b))
        if one.has_scalar(a[1]) or other.has_scalar(b[1]):
            return True
        i, j = one.position(a[1]), other.position(b[1])
        reach = _SAME_PLACE * max(float(np.abs(t.xyz).max(initial=0.0)) for t in (one, other))
        near = float(np.abs(one.xyz[i] - other.xyz[j]).max()) <= reach
        return near and bool(np.allclose(one.frames[i], other.frames[j], atol=1e-9))

    def _increases(self) -> tuple[Increase, ...]:
        points: set[int] = set()
        elements: set[int] = set()
        cards: set[tuple[str, int]] = set()
        increases = []
        for i, part in enumerate(self.parts):
            own_points = {n for n in _points(part.structure) if (i, n) not in self.same}
            own_elements = _elements(part.structure)
            own_cards = {(r.card, r.id) for r in part.structure.values.refs if r.id and not part.is_of_element(r)}
            more = part.number * self.step
            increase = Increase(
                more * (not own_points.isdisjoint(points)),
                more * (not own_elements.isdisjoint(elements)),
                more * (not own_cards.isdisjoint(cards)),
            )
            points |= {n + increase.points for n in own_points}
            elements |= {n + increase.elements for n in own_elements}
            cards |= {(card, n + increase.cards) for card, n in own_cards}
            increases.append(increase)
        return tuple(increases)

    def _nodes(self) -> tuple[NodeTable, list[_Places]]:
        kept = [
            np.array([(i, r) not in self.same for r in part.structure.nodes.ids.tolist()], bool)
            for i, part in enumerate(self.parts)
        ]
        tables = [part.structure.nodes for part in self.parts]
        ids = [t.ids[keep] + more.points for t, keep, more in zip(tables, kept, self.increases)]
        scalars = [
            [n + more.points for n in t.scalar_points.tolist() if (i, n) not in self.same]
            for i, (t, more) in enumerate(zip(tables, self.increases))
        ]
        numbers = np.concatenate(ids)
        order = np.argsort(numbers, kind="stable")
        nodes = NodeTable(
            numbers[order],
            np.concatenate([t.xyz[keep] for t, keep in zip(tables, kept)])[order],
            np.concatenate([t.frames[keep] for t, keep in zip(tables, kept)])[order],
            np.array(sorted(n for some in scalars for n in some), np.int64),
        )
        return nodes, [self._place(i, nodes) for i in range(len(self.parts))]

    def _number(self, point: Point) -> int:
        """Number in the whole."""
        i, number = self.same.get(point, point)
        return number + self.increases[i].points

    def _place(self, i: int, nodes: NodeTable) -> _Places:
        table = self.parts[i].structure.nodes
        rows = np.array([nodes.position(self._number((i, n))) for n in table.ids.tolist()], np.int64)
        grid = (6 * rows[:, None] + np.arange(6)).ravel()
        scalar = [nodes.dof(self._number((i, n)), 0) for n in table.scalar_points.tolist()]
        return _Places(rows, np.concatenate([grid, np.array(scalar, np.int64)]))

    def structure(self) -> Structure:
        main = self.parts[0]
        each = list(zip(self.parts, self.increases, self.places, self.starts.tolist()))
        rigid = [_rows(part.structure.rigid, place, more.elements) for part, more, place, _ in each]
        kinds = [{n + m.elements: kind for n, kind in p.structure.element_kinds.items()} for p, m, _, _ in each]
        return replace(
            main.structure,
            nodes=self.nodes,
            values=self._values(),
            batches=tuple(self._batch(b, *of) for of in each for b in of[0].structure.batches),
            rigid=join_constraints([*rigid, self._ties()]),
            multipoint_sets=self._equations(),
            support_sets=self._supports(),
            permanent=np.unique(np.concatenate([place.dof(p.structure.permanent) for p, _, place, _ in each])),
            default_support_set=self._default(_support_set),
            default_multipoint_set=self._default(_multipoint_set),
            element_kinds={n: kind for some in reversed(kinds) for n, kind in some.items()},
            dof_sets={name: np.sort(self.places[0].dof(at)) for name, at in main.structure.dof_sets.items()},
            assembled=tuple(self._assembled(m, *of[2:]) for of in each for m in of[0].structure.assembled),
        )

    def _default(self, selected: Selection) -> int | None:
        """Number of the selected set: that of the residual structure, or else of the first part that selects one."""
        return next((n for part in self.parts if (n := selected(part)) is not None), None)

    def _supports(self) -> dict[int, Integers]:
        sets = self._by_number(_support_set, lambda part: part.structure.support_sets, _Places.dof)
        return {n: np.unique(np.concatenate([np.zeros(0, np.int64), *dofs])) for n, dofs in sets.items()}

    def _equations(self) -> dict[int, ConstraintRows]:
        sets = self._by_number(
            _multipoint_set, lambda part: part.structure.multipoint_sets, lambda place, rows: _rows(rows, place)
        )
        return {n: join_constraints(rows) for n, rows in sets.items()}

    def _by_number(
        self, selected: Selection, sets: Callable[[StructurePart], Mapping[int, S]], placed: Callable[[_Places, S], S]
    ) -> dict[int, list[S]]:
        """Sets of all parts by number; selected sets get the number of the default, whatever theirs was."""
        chosen = self._default(selected)
        gathered: dict[int, list[S]] = {} if chosen is None else {chosen: []}
        for part, place in zip(self.parts, self.places):
            for number, members in sets(part).items():
                active = number == selected(part)
                if active or number != chosen:
                    key = chosen if active and chosen is not None else number
                    gathered.setdefault(key, []).append(placed(place, members))
        return gathered

    def _ties(self) -> ConstraintRows:
        """Equations that equate the displacements and rotations of two points, each in its displacement frame."""
        ties = []
        for a, b in self.tied:
            rows = [self.places[i].rows[self.parts[i].structure.nodes.position(n)] for i, n in (a, b)]
            turn = self.nodes.frames[rows[0]].T @ self.nodes.frames[rows[1]]
            block = np.kron(np.eye(2), turn)
            dofs, other = (6 * row + np.arange(6) for row in rows)
            at, to = np.nonzero(block)
            equations = np.arange(6)
            ties.append(
                ConstraintRows(
                    dofs,
                    np.concatenate([equations, at]),
                    np.concatenate([dofs, other[to]]),
                    np.concatenate([np.ones(6), -block[at, to]]),
                    np.zeros(6, np.int64),
                )
            )
        return join_constraints(ties)

    def _values(self) -> ValueTable:
        tables = [part.structure.values for part in self.parts]
        refs = [
            part.in_whole(ref, more)
            for part, more in zip(self.parts, self.increases)
            for ref in part.structure.values.refs
        ]
        derived = [
            Derived(d.target + start, d.function, tuple(s + start for s in d.sources))
            for table, start in zip(tables, self.starts.tolist())
            for d in table.derived
        ]
        return ValueTable(tuple(refs), np.concatenate([t.values for t in tables]), tuple(derived))

    def _batch(
        self, batch: ElementBatch, part: StructurePart, more: Increase, place: _Places, start: int
    ) -> ElementBatch:
        whole = _settings(self.parts[0].structure)
        return replace(
            batch,
            ids=batch.ids + more.elements,
            nodes=place.row(batch.nodes),
            dofs=place.dof(batch.dofs),
            roles={name: at + start for name, at in batch.roles.items()},
            settings={name: value for name, value in _settings(part.structure).items() if value != whole[name]},
        )

    def _assembled(self, matrix: AssembledMatrix, place: _Places, start: int) -> AssembledMatrix:
        n, entries = self.nodes.n_dofs, sp.coo_array(matrix.upper)
        row, col = place.dofs[entries.row], place.dofs[entries.col]
        upper = sp.csr_array((entries.data, (np.minimum(row, col), np.maximum(row, col))), shape=(n, n))
        upper.sort_indices()
        return replace(matrix, upper=upper, roles={name: at + start for name, at in matrix.roles.items()})


def _settings(structure: Structure) -> dict[str, Any]:
    """Settings that the element kernels read from a structure and that may differ among the parts."""
    return {
        "mass_factor": structure.mass_factor,
        "consistent_mass": structure.consistent_mass,
        "lumped_along": structure.lumped_along,
        "drilling": structure.drilling,
        "normals_within": structure.normals_within,
    }


def _support_set(part: StructurePart) -> int | None:
    return part.support_set


def _multipoint_set(part: StructurePart) -> int | None:
    return part.multipoint_set


def _rows(rows: ConstraintRows, place: _Places, more: int = 0) -> ConstraintRows:
    owner = np.where(rows.owner > 0, rows.owner + more, rows.owner)
    return replace(rows, dependent=place.dof(rows.dependent), dof=place.dof(rows.dof), owner=owner)


def _points(structure: Structure) -> list[int]:
    return [*structure.nodes.ids.tolist(), *structure.nodes.scalar_points.tolist()]


def _elements(structure: Structure) -> set[int]:
    return {*structure.element_kinds, *(int(n) for b in structure.batches for n in b.ids)}


def _largest(structure: Structure) -> int:
    numbers = [*_points(structure), *_elements(structure), *(ref.id for ref in structure.values.refs)]
    return max(numbers, default=1)
