"""Grid points and scalar points: GRID, GRDSET, SPOINT, with the coordinate systems that they refer to."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.fem.structure import NodeTable
from femtune.files.nastran.building import Building, Library, duplicate, listed_numbers
from femtune.files.nastran.card import LARGEST_COORDINATE, Card, CardEntry
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.columns import Columns, columns_of
from femtune.files.nastran.coordinates import BASIC, CoordinateSystem, CoordinateSystems
from femtune.files.nastran.lines import parse_number

# ----------------------------------------------------------------------------------------------------
# GRID cards of a large deck, read by whole columns.


# indices of the fields of a GRID card
_POSITION_SYSTEM = 1
_FIRST_COORDINATE = 2
_DISPLACEMENT_SYSTEM = 5
_PERMANENT_CONSTRAINTS = 6


@dataclass(frozen=True, eq=False)
class CardRecords(Mapping[int, CardEntry]):
    """Records by number, each created on access."""

    cards: Mapping[int, Card]

    def __getitem__(self, number: int) -> CardEntry:
        card = self.cards[number]
        return CardEntry(card, CATALOGUE[card.name].fields)

    def __iter__(self) -> Iterator[int]:
        return iter(self.cards)

    def __len__(self) -> int:
        return len(self.cards)

    def __contains__(self, number: object) -> bool:
        return number in self.cards


@dataclass(frozen=True, eq=False)
class PlainGrids:
    """Grid points of plain columns, in ascending order of their numbers.

    Parameters
    ----------
    records : cards by number
    xyz : (n, 3) coordinates, for those that are `simple`
    simple : (n,) True if coordinates and displacements are in the basic frame and simply spelled
    supported : (n,) True if field PS is filled
    """

    records: CardRecords
    xyz: NDArray[np.float64]
    simple: NDArray[np.bool_]
    supported: NDArray[np.bool_]


def plain_grids(cards: tuple[Card, ...]) -> PlainGrids | None:
    """Columns of GRID cards; None if a number is not simply spelled or is repeated."""
    columns = columns_of(cards)
    if columns is None:
        return None
    numbers, plain = columns.integers(0)
    order = np.argsort(numbers, kind="stable")
    ascending = numbers[order]
    if not plain.all() or ascending[0] <= 0 or not (np.diff(ascending) > 0).all():
        return None
    simple = _basic(columns, _POSITION_SYSTEM) & _basic(columns, _DISPLACEMENT_SYSTEM)
    xyz = np.empty((len(cards), 3))
    for i in range(3):
        xyz[:, i], given = columns.reals(_FIRST_COORDINATE + i)
        simple &= given & (np.abs(xyz[:, i]) <= LARGEST_COORDINATE)
    records = CardRecords(dict(zip(ascending.tolist(), (cards[i] for i in order.tolist()))))
    return PlainGrids(records, xyz[order], simple[order], ~columns.blank(_PERMANENT_CONSTRAINTS)[order])


def _basic(columns: Columns, index: int) -> NDArray[np.bool_]:
    system, plain = columns.integers(index)
    return np.asarray(columns.blank(index) | (plain & (system == 0)))


@dataclass
class Grids:
    """Grid points by number with their coordinate systems; `table` is their node table, when it is complete."""

    records: Mapping[int, CardEntry]
    system_records: Mapping[int, CardEntry]
    plain: PlainGrids | None = None
    basic: CoordinateSystem = BASIC
    systems: CoordinateSystems = field(init=False)
    _locations: Library[NDArray[np.float64]] = field(init=False)
    table: NodeTable = field(init=False)

    def __post_init__(self) -> None:
        self.systems = CoordinateSystems(self.system_records, self.location, self.basic)
        self._locations = Library(self._locate)

    def location(self, number: int, user: CardEntry) -> NDArray[np.float64]:
        """Basic coordinates of a grid point that a card refers to.

        Raises
        ------
        FemtuneError : ``deck.unknown-grid`` and errors of the grid point's coordinate system
        """
        if number not in self.records:
            raise unknown_grid(number, user)
        return self._locations.get(number, user)

    def _locate(self, number: int, user: CardEntry) -> NDArray[np.float64]:
        record = self.records[number]
        system = self.systems.get(record.integer("CP", 0), record)
        return system.point(np.array(record.reals("X1", "X2", "X3")))

    def displacement_system(self, number: int) -> CoordinateSystem:
        """System of a grid point's displacements."""
        record = self.records[number]
        cd = record.integer("CD", 0)
        if cd == -1:
            raise record.error("deck.fluid-point", at="CD", number=number)
        return self.systems.get(cd, record)

    @cached_property
    def points(self) -> frozenset[int]:
        """Numbers of all grid points and scalar points."""
        return frozenset([*self.records, *self.table.scalar_points.tolist()])

    def row(self, number: int, user: CardEntry) -> int:
        """Row of the node table (error ``deck.unknown-grid``, or that of the grid point)."""
        if not self.table.has_grid(number):
            raise unknown_grid(number, user)
        row = self.table.position(number)
        if math.isnan(self.table.xyz[row, 0]):
            self.location(number, user)
        return row

    def rows(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the node table of many grid points, −1 for missing and invalid ones."""
        ids = self.table.ids
        if not len(ids):
            return np.full(numbers.shape, -1)
        at = np.minimum(np.searchsorted(ids, numbers), len(ids) - 1)
        known = (ids[at] == numbers) & ~np.isnan(self.table.xyz[at, 0])
        return np.where(known, at, -1)

    def dofs(self, row: int) -> list[int]:
        """The six g-set DOFs of a row of the node table, −1 for ground."""
        return [6 * row + i for i in range(6)] if row >= 0 else [-1] * 6

    def dof(self, number: int, component: int, user: CardEntry) -> int:
        """g-set DOF of a component of a grid point or scalar point."""
        try:
            return self.table.dof(number, component, user.where)
        except FemtuneError as error:
            if error.code == "model.unknown-node":
                raise unknown_grid(number, user) from error
            raise

    def vector(self, row: int, components: list[float]) -> NDArray[np.float64]:
        """A vector given in the displacement frame of a grid point, in the basic frame."""
        return self.table.frames[row] @ np.array(components)


def unknown_grid(number: int, user: CardEntry) -> FemtuneError:
    """Error for a card that refers to a grid point that does not exist."""
    return user.error("deck.unknown-grid", number=number)


def read_grids(building: Building) -> Grids:
    """Grid points, scalar points and coordinate systems of the deck."""
    systems = building.records("CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S")
    # reading by columns does not apply defaults of GRDSET, and takes coordinates in the basic frame of the whole model
    apart = building.deck.by_name("GRDSET") or building.basic is not BASIC
    plain = None if apart else plain_grids(building.deck.by_name("GRID"))
    records = _grid_records(building) if plain is None else plain.records
    grids = Grids(records, building.by_number(_distinct(building, systems), "coordinate system"), plain, building.basic)
    _check_systems(building, grids)
    grids.table = _node_table(building, grids)
    return grids


def _distinct(building: Building, systems: list[CardEntry]) -> list[CardEntry]:
    """Coordinate systems without those that are repeated with the same data, as in files of superelements."""
    distinct: dict[tuple[str, ...], CardEntry] = {}
    for record in systems:
        key = record.name, *(_spelled(record.card.text(record.at(name))) for name in record.names)
        if key in distinct:
            number = f"coordinate system {record.card.text(record.start)}"
            building.notices.append(
                Notice("deck.repeated-grid/system", where=record.where, level="info", system=number)
            )
        distinct.setdefault(key, record)
    return list(distinct.values())


def _spelled(text: str) -> str:
    """One spelling for each number; blank is zero."""
    number = parse_number(text)
    return text if text and number is None else str(number or 0.0)


def _check_systems(building: Building, grids: Grids) -> None:
    for number, record in grids.system_records.items():
        with building.errors.catch():
            grids.systems.get(number, record)


def _grid_records(building: Building) -> dict[int, CardEntry]:
    """Grid points by number; like Nastran, accepts an identical repeated one."""
    records: dict[int, CardEntry] = {}
    for record in building.records("GRID", defaults=building.defaults("GRDSET")):
        with building.errors.catch():
            number = _positive(record)
            if number not in records:
                records[number] = record
            elif _same(record, records[number]):
                building.notices.append(_repeated(record, number))
            else:
                raise duplicate(record.card, f"grid point {number}", records[number].card)
    return records


def _positive(record: CardEntry) -> int:
    number: int = record.integer("ID")
    if number <= 0:
        raise record.error("deck.field-value/grid-number", at="ID")
    return number


def _same(a: CardEntry, b: CardEntry) -> bool:
    numbers = all(a.real(x, 0.0) == b.real(x, 0.0) for x in ("X1", "X2", "X3"))
    return numbers and all(a.text(x, "0") == b.text(x, "0") for x in ("CP", "CD", "PS"))


def _repeated(record: CardEntry, number: int) -> Notice:
    return Notice("deck.repeated-grid", where=record.where, level="info", number=number)


def _node_table(building: Building, grids: Grids) -> NodeTable:
    ids = np.array(sorted(grids.records), dtype=np.int64)
    xyz = np.full((len(ids), 3), np.nan)
    frames = np.tile(np.eye(3), (len(ids), 1, 1))
    left = np.arange(len(ids))
    if grids.plain is not None:
        xyz[grids.plain.simple] = grids.plain.xyz[grids.plain.simple]
        left = np.flatnonzero(~grids.plain.simple)
    for row, number in zip(left.tolist(), ids[left].tolist()):
        with building.errors.catch():
            xyz[row] = grids.location(number, grids.records[number])
            frames[row] = grids.displacement_system(number).frame(xyz[row])
    return NodeTable(ids, xyz, frames, _scalar_points(building, grids.records))


def _scalar_points(building: Building, grids: Mapping[int, CardEntry]) -> NDArray[np.int64]:
    numbers: set[int] = set()
    for record in building.records("SPOINT"):
        with building.errors.catch():
            numbers |= _spoint_numbers(record, grids)
    return np.array(sorted(numbers | _implied_scalars(building, grids)), dtype=np.int64)


def _spoint_numbers(record: CardEntry, grids: Mapping[int, CardEntry]) -> set[int]:
    numbers = set(listed_numbers(record, record.card.fields))
    if min(numbers, default=1) <= 0:
        raise record.error("deck.field-value/spoint-number")
    both = sorted(numbers & set(grids))
    if both:
        raise duplicate(record.card, f"point {both[0]}", grids[both[0]].card)
    return numbers


def _implied_scalars(building: Building, grids: Mapping[int, CardEntry]) -> set[int]:
    """Points that scalar elements refer to without a component: they become scalar points, as in Nastran."""
    numbers = set()
    for record in building.records(*_SCALAR_ELEMENTS):
        with building.errors.catch():
            for end in "12":
                number = record.integer(("G" if "G1" in record.names else "S") + end, 0)
                if number > 0 and number not in grids and _no_component(record, end):
                    numbers.add(number)
    return numbers


_SCALAR_ELEMENTS = tuple(f"{kind}{i}" for kind in ("CELAS", "CMASS", "CDAMP") for i in (1, 2, 3, 4))


def _no_component(record: CardEntry, end: str) -> bool:
    """True if an end is a scalar point; elements between scalar points have no components."""
    return "G1" not in record.names or record.component("C" + end, "0") == "0"


def permanent_constraints(building: Building, grids: Grids) -> NDArray[np.int64]:
    """g-set DOFs held by field PS of GRID and GRDSET."""
    held = []
    plain = grids.plain
    supported = list(grids.records) if plain is None else grids.table.ids[plain.supported].tolist()
    for number in supported:
        with building.errors.catch():
            row, record = grids.table.position(number), grids.records[number]
            held += [6 * row + int(c) - 1 for c in record.component("PS") if c != "0"]
    return np.array(sorted(held), dtype=np.int64)
