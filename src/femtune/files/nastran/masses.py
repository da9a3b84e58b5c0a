"""Masses at grid points: CONM2 (mass, offset, inertia) and CONM1 (a symmetric 6 × 6 matrix)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import add

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.fem.elements.discrete import CONCENTRATED_MASS, GENERAL_MASS
from femtune.fem.elements.shells.normals import areas
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch, NodeTable
from femtune.files.nastran.building import BatchRows, Building
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.constraints import read_unions
from femtune.files.nastran.control import check_selected
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.lists import IntegerList, read_list
from femtune.files.nastran.reading import ElementReading


def read_masses(reading: ElementReading) -> list[ElementBatch]:
    """Batches of CONM2 and of CONM1."""
    building, grids = reading.building, reading.grids
    batches = []
    for card, kind in (("CONM2", CONCENTRATED_MASS.key), ("CONM1", GENERAL_MASS.key)):
        rows = BatchRows(kind, card)
        for record in building.records(card):
            with building.errors.catch():
                _add(rows, record, building, grids)
        batches += rows.batches()
    return batches


def _add(rows: BatchRows, record: CardEntry, building: Building, grids: Grids) -> None:
    eid, row = record.integer("EID"), grids.row(record.integer("G"), record)
    roles = {name: building.value(record, eid, name) for name in CATALOGUE[record.name].values}
    facts = _offset(record, grids, row) if record.name == "CONM2" else {"frame": _axes(record, grids, row)}
    rows.add(eid, [row], grids.dofs(row), roles, facts)


def _offset(record: CardEntry, grids: Grids, row: int) -> dict[str, NDArray]:
    """Offset of the centre of gravity and axes of the inertia; with CID −1 it is given as a point in basic."""
    x = np.array(record.reals("X1", "X2", "X3"))
    if record.integer("CID", 0) == -1:
        return {"offset": grids.basic.point(x) - grids.table.xyz[row], "frame": grids.basic.axes}
    frame = _axes(record, grids, row)
    return {"offset": frame @ x, "frame": frame}


def _axes(record: CardEntry, grids: Grids, row: int) -> NDArray[np.float64]:
    return grids.systems.get(record.integer("CID", 0), record).frame(grids.table.xyz[row])


# ----------------------------------------------------------------------------------------------------
# Non-structural mass by NSM, NSM1, NSML, NSML1 and NSMADD, for the set that case control selects.


# index of each number, rows in the order of the numbers, and start and end of each number's rows
_Order = tuple[Mapping[int, int], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]

_CARDS = ("NSM", "NSM1", "NSML", "NSML1")
# TYPE and the property cards of its elements; PBARL counts as PBAR, PBEAML and PBCOMP as PBEAM, as in Nastran
_BARS = ("PBAR", "PBARL")
_BEAMS = ("PBEAM", "PBEAML", "PBCOMP")
_FAMILIES = {
    **dict.fromkeys(_BARS, _BARS),
    **dict.fromkeys(_BEAMS, _BEAMS),
    **{k.name: (k.name,) for k in CATALOGUE.values() if "NSM" in k.values and k.name not in (*_BARS, *_BEAMS)},
    "ELEMENT": (),
}
_MOST_NAMED = 5
"""Number of unknown elements that a notice lists."""


@dataclass(frozen=True)
class _MassEntry:
    """Mass of the elements of a list: per length or area, or, if `total`, a mass that is distributed over them."""

    record: CardEntry
    kind: str
    value: float
    numbers: IntegerList
    total: bool


@dataclass(frozen=True)
class _Elements:
    """Elements that carry non-structural mass: their numbers, property cards and lengths or areas."""

    ids: NDArray[np.int64]
    cards: NDArray[np.str_]
    properties: NDArray[np.int64]
    size: Reals
    area: NDArray[np.bool_]

    def rows(self, entry: _MassEntry) -> tuple[NDArray[np.int64], Reals]:
        """Rows of the elements of an entry, and how often each is listed, as in Nastran."""
        every = entry.kind == "ELEMENT"
        numbers, order, starts, ends = self._by_element if every else self._by_property
        count = _named(entry.numbers, numbers)
        rows = np.concatenate([order[:0], *(order[starts[i] : ends[i]] for i in count)])
        times = np.repeat(np.array(list(count.values())), [ends[i] - starts[i] for i in count])
        meant = slice(None) if every else np.isin(self.cards[rows], _FAMILIES[entry.kind])
        return rows[meant], times[meant].astype(float)

    @cached_property
    def _by_element(self) -> _Order:
        return _ordered(self.ids)

    @cached_property
    def _by_property(self) -> _Order:
        return _ordered(self.properties)


def add_nonstructural_mass(building: Building, nodes: NodeTable, batches: Sequence[ElementBatch]) -> list[ElementBatch]:
    """Batches whose NSM is that of their property plus the mass of the selected cards.

    The NSM of the property remains a value that may be updated. Errors are gathered (``deck.nonstructural-mass`` and
    those of fields); ``deck.nonstructural-unused`` tells of cards without effect.
    """
    chosen = _selected(building)
    bearing = [i for i, b in enumerate(batches) if _mass_roles(b)]
    out = list(batches)
    if not bearing:
        building.notices += [_nobody(entry, "") for entry in chosen]
    if not chosen or not bearing:
        return out
    tables = [_table(building, nodes, batches[i]) for i in bearing]
    elements = _Elements(
        ids=np.concatenate([t.ids for t in tables]),
        cards=np.concatenate([t.cards for t in tables]),
        properties=np.concatenate([t.properties for t in tables]),
        size=np.concatenate([t.size for t in tables]),
        area=np.concatenate([t.area for t in tables]),
    )
    added = _added(building, elements, chosen)
    for i, extra in zip(bearing, np.split(added, np.cumsum([len(t.ids) for t in tables])[:-1])):
        out[i] = _with_added(building, batches[i], extra)
    return out


def _selected(building: Building) -> list[_MassEntry]:
    records = building.records(*_CARDS)
    known = {record.card.integer(0, 0) for record in records if record.card.is_integer(0)}
    unions = read_unions(building, "NSMADD", known)
    number = building.deck.case_control.nsm
    check_selected(building, "NSM", number, {*known, *unions})
    if number is None and records:
        building.notices.append(Notice("deck.nonstructural-unused/not-selected", where=records[0].where))
    wanted = unions.get(number, [number]) if number is not None else []
    entries: list[_MassEntry] = []
    for record in records:
        with building.errors.catch():
            if record.card.integer(0) in wanted:
                entries += _entries(record)
    return entries


def _entries(record: CardEntry) -> list[_MassEntry]:
    kind, total = record.text("TYPE"), record.name.startswith("NSML")
    if kind not in _FAMILIES:
        raise record.error("deck.nonstructural-mass", at="TYPE", kind=kind or "no type", families=", ".join(_FAMILIES))
    card = record.card
    if record.name.endswith("1"):
        words = ["THRU" if word.upper() == "TO" else word for word in card.fields[3:]]
        return [_MassEntry(record, kind, card.real(2), read_list(words, record.where), total)]
    pairs = [at for at in range(2, len(card.fields), 2) if not (card.blank(at) and card.blank(at + 1))]
    return [_MassEntry(record, kind, card.real(at + 1), IntegerList((card.integer(at),)), total) for at in pairs]


def _mass_roles(batch: ElementBatch) -> list[str]:
    """Roles of non-structural mass; a tapered beam has one per station."""
    return [name for name in batch.roles if name.partition("@")[0] == "NSM"]


def _table(building: Building, nodes: NodeTable, batch: ElementBatch) -> _Elements:
    refs = [building.values.refs[int(at)] for at in batch.roles[_mass_roles(batch)[0]]]
    area = batch.nodes.shape[1] > 2
    size = areas(nodes, batch) if area else _lengths(nodes, batch)
    cards, properties = np.array([r.card for r in refs]), np.array([r.id for r in refs], dtype=np.int64)
    return _Elements(batch.ids, cards, properties, size, np.full(len(batch), area))


def _lengths(nodes: NodeTable, batch: ElementBatch) -> Reals:
    """Lengths between the two ends, including offsets."""
    ends = [nodes.xyz[batch.nodes[:, k]] + batch.facts.get(f"offset_{end}", 0.0) for k, end in enumerate("ab")]
    return np.asarray(np.linalg.norm(ends[1] - ends[0], axis=1))


def _added(building: Building, elements: _Elements, entries: Iterable[_MassEntry]) -> Reals:
    """Mass per length or area that the entries add to each element."""
    out = np.zeros(len(elements.ids))
    for entry in entries:
        with building.errors.catch():
            rows, times = elements.rows(entry)
            building.notices += _unused(entry, elements, rows)
            out[rows] += entry.value * (times / _spread(entry, elements, rows, times) if entry.total else times)
    return out


def _ordered(numbers: NDArray[np.int64]) -> _Order:
    distinct, starts = np.unique(np.sort(numbers), return_index=True)
    places = {int(number): i for i, number in enumerate(distinct)}
    return places, np.argsort(numbers, kind="stable"), starts, np.append(starts[1:], len(numbers))


def _named(numbers: IntegerList, places: Mapping[int, int]) -> dict[int, int]:
    """Indices of the numbers in a list, and how often each is listed."""
    named, spans = Counter(numbers.singles), numbers.spans
    asked = places if spans or numbers.every else [n for n in named if n in places]
    count = {places[n]: numbers.every + named[n] + sum(n in span for span in spans) for n in asked}
    return {place: times for place, times in count.items() if times}


def _spread(entry: _MassEntry, elements: _Elements, rows: NDArray[np.int64], times: Reals) -> float:
    """Length or area over which a total is distributed (1 if there is none)."""
    kinds = elements.area[rows]
    if kinds.any() and not kinds.all():
        raise entry.record.error("deck.nonstructural-mass/lines-and-areas")
    return float(times @ elements.size[rows]) or 1.0


def _unused(entry: _MassEntry, elements: _Elements, rows: NDArray[np.int64]) -> Iterable[Notice]:
    """Notices of listed numbers that do not exist, which Nastran also ignores."""
    known = set((elements.ids if entry.kind == "ELEMENT" else elements.properties)[rows].tolist())
    lost = sorted(set(entry.numbers.singles) - known)
    if lost or not known:
        shown = ", ".join(map(str, lost[:_MOST_NAMED])) + (" …" if len(lost) > _MOST_NAMED else "")
        yield _nobody(entry, shown)


def _nobody(entry: _MassEntry, numbers: str) -> Notice:
    return Notice(
        "deck.nonstructural-unused",
        where=entry.record.where,
        record_name=entry.record.name,
        entry_kind=entry.kind,
        numbers=numbers or "that it lists",
    )


def _with_added(building: Building, batch: ElementBatch, extra: Reals) -> ElementBatch:
    roles = dict(batch.roles)
    for name in _mass_roles(batch):
        at = zip(batch.roles[name].tolist(), extra.tolist())
        roles[name] = np.array([_sum(building, i, more) if more else i for i, more in at], dtype=np.int64)
    return replace(batch, roles=roles)


def _sum(building: Building, of_property: int, more: float) -> int:
    """Position of the property's NSM plus a constant."""
    values, ref = building.values, building.values.refs[of_property]
    added = values.add(FieldRef("", 0, f"added mass {more!r}"), more)
    name = f"{ref.name} + {more!r}"
    return values.derive(
        FieldRef(ref.card, ref.id, name), add, of_property, added, nominal=values.values[of_property] + more
    )
