"""Sections of bars and beams: PBAR, PBEAM, PBARL, PBEAML, as positions in the value table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from femtune.fem.values import FieldRef
from femtune.files.nastran.building import Building, Library
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.materials import Materials
from femtune.files.nastran.properties import Properties
from femtune.files.nastran.record import Record
from femtune.files.nastran.sections import SECTION_ROLES, SHAPES, Shape

Roles = Mapping[str, int]

# fourth powers of dimensions stay numbers
_LARGEST = 1e60
_STATION = ("YES", "YESA", "NO")
_TAIL_NAMES = "K1 K2 S1 S2 NSIA NSIB CWA CWB M1A M2A M1B M2B N1A N2A N1B N2B"
_BEAM_TAIL = tuple(_TAIL_NAMES.split())
_NOT_MODELLED = ("S1", "S2", "NSIA", "NSIB", "CWA", "CWB", *_BEAM_TAIL[8:])


@dataclass
class BarProperties:
    """Values of the bar kernel by property number: E G A I1 I2 I12 J K1 K2 rho NSM."""

    building: Building
    properties: Properties
    materials: Materials
    _library: Library[Roles] = field(init=False)

    def __post_init__(self) -> None:
        self._library = Library(self._make)

    def get(self, pid: int, user: Record) -> Roles:
        """Roles of a property, asked for by an element."""
        self.properties.find(pid, user)
        return self._library.get(pid, user)

    def _make(self, pid: int, user: Record) -> Roles:
        record = self.properties.find(pid, user)
        material = self.materials.get(record.integer("MID"), record)
        section = _READERS[record.name](self.building, record, pid)
        if self.building.values.values[material["G"]] == 0.0:
            # without a shear modulus there is no shear flexibility either
            none = self.building.values.add(FieldRef(record.name, pid, "no shear flexibility"), 0.0)
            section = {**section, "K1": none, "K2": none}
        return {**material, **section}


def _pbar(b: Building, record: Record, pid: int) -> dict[str, int]:
    return {name: b.value(record, pid, name) for name in ("A", "I1", "I2", "I12", "J", "K1", "K2", "NSM")}


def _pbeam(b: Building, record: Record, pid: int) -> dict[str, int]:
    """A beam of constant section; the values of all stations are written back together."""
    starts, tail_start = _stations(record)
    names = record.names[2:8]
    for start in starts:
        _check_constant(record, names, start)
    roles = {n: b.value(record, pid, n, also=_written(record, record.at(n), starts, names)) for n in names}
    tail = Record(record.card, _BEAM_TAIL, tail_start)
    _check_tail(tail)
    return {**roles, **{name: b.value(tail, pid, name, 1.0) for name in ("K1", "K2")}}


def _stations(record: Record) -> tuple[list[int], int]:
    """Positions of the values of the further stations, and of K1."""
    at = 8 if record.card.text(8) in _STATION else 16
    starts = []
    while record.card.text(at) in _STATION:
        starts.append(at + 2)
        at += 16 if _has_recovery_line(record, at) else 8
    return starts, at


def _has_recovery_line(record: Record, at: int) -> bool:
    """Stations NO and YESA have no stress recovery line, though some programs write a blank one."""
    return record.card.text(at) == "YES" or (
        len(record.card.fields) - at - 8 > len(_BEAM_TAIL) and record.card.text(at + 8) not in _STATION
    )


def _check_constant(record: Record, names: tuple[str, ...], start: int) -> None:
    for i, name in enumerate(names):
        here = record.real(name, 0.0)
        there = record.card.real(start + i, here)
        if there != here:
            raise record.card.error(
                "deck.section",
                f"{record.name} is tapered: {name} changes from {here:g} to {there:g}; constant sections are read",
                index=start + i,
                hint="divide the beam into elements of constant section",
            )


def _written(record: Record, own: int, starts: list[int], names: tuple[str, ...]) -> tuple[int, ...]:
    """Fields of the other stations that repeat a value."""
    offset = own - record.at(names[0])
    return tuple(s + offset for s in starts if not record.card.blank(s + offset))


def _check_tail(tail: Record) -> None:
    for name in _NOT_MODELLED:
        if tail.real(name, 0.0) != 0.0:
            raise tail.error(
                "deck.section",
                f"field {name} of PBEAM (warping, shear relief, offset of mass or neutral axis) is not modelled",
                at=name,
                hint="set it to 0 if it does not matter, or move the offset to WA and WB of the CBEAM",
            )


def _shaped(b: Building, record: Record, pid: int) -> dict[str, int]:
    """PBARL and PBEAML: section values follow from the dimensions."""
    shape = _shape(record)
    names = (*shape.dimensions, "NSM")
    own = Record(record.card, names, 8)
    starts = _shaped_stations(own, shape) if record.name == "PBEAML" else []
    for start in starts:
        _check_constant(own, names, start)
    _check_dimensions(own, shape)
    at = {n: b.value(own, pid, n, also=_written(own, own.at(n), starts, names)) for n in names}
    dims = [at[name] for name in shape.dimensions]
    roles = {n: b.values.derive(FieldRef(record.name, pid, n), shape.formulas[n], *dims) for n in SECTION_ROLES}
    return {**roles, "I12": b.values.add(FieldRef(record.name, pid, "I12"), 0.0), "NSM": at["NSM"]}


def _shape(record: Record) -> Shape:
    name = record.text("TYPE")
    if name not in SHAPES:
        raise record.error(
            "deck.section",
            f"section '{name}' of {record.name} is not known",
            at="TYPE",
            hint=f"known sections: {', '.join(SHAPES)}; for another give a PBAR or PBEAM with its A, I1, I2 and J",
        )
    return SHAPES[name]


def _shaped_stations(own: Record, shape: Shape) -> list[int]:
    """Positions of the dimensions of further stations: SO, X/XB, DIM1 … NSM after each other."""
    at, starts = 8 + shape.n + 1, []
    while own.card.text(at) in _STATION:
        starts.append(at + 2)
        at += 2 + shape.n + 1
    return starts


def _check_dimensions(own: Record, shape: Shape) -> None:
    dims = [own.real(name) for name in shape.dimensions]
    if not shape.valid(*dims):
        raise own.error("deck.section", shape.rule, at="DIM1", hint="correct the dimensions")
    if max(dims) > _LARGEST or min(d for d in dims if d) < 1 / _LARGEST:
        raise own.error("deck.section", "the section's moments of inertia are beyond all numbers", at="DIM1",
                        hint="correct the dimensions")  # fmt: skip


_READERS = {"PBAR": _pbar, "PBEAM": _pbeam, "PBARL": _shaped, "PBEAML": _shaped}
assert set(_READERS) <= set(CATALOGUE)
