"""Sections that vary along a beam: stations, their values, and the kind of element that they need."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from femtune.errors import Notice
from femtune.fem.fields import FieldRef
from femtune.fem.rules import makes_rules
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.sections import SECTION_ROLES, SHAPES, Shape
from femtune.parameters.jet import Jet

STATION_FLAGS = ("YES", "YESA", "NO")
_CONSTANT = ("A", "I1", "I2", "I12", "J", "K1", "K2", "NSM")
_LINES = ("N1", "N2", "M1", "M2", "NSI")
_NAMES = (*_CONSTANT, *_LINES)


@dataclass(frozen=True)
class BeamSection:
    """Positions of a section's values.

    Parameters
    ----------
    roles : positions by name for a constant section; with stations ``A@0``, ``A@1`` … from end A to end B
    stations : positions along the length, from 0 to 1; empty for a constant section on the element's axis
    """

    roles: Mapping[str, int]
    stations: tuple[float, ...] = ()


@dataclass(frozen=True)
class Stations:
    """Stations of a property card in the order of the beam.

    Parameters
    ----------
    x : from 0 (end A) to 1 (end B)
    starts : index of the first value of each on the card; None for end B if the card has no station there
    """

    x: tuple[float, ...]
    starts: tuple[int | None, ...]


def sort_stations(card: Card, first: int, starts: Sequence[int]) -> Stations:
    """Stations from the indices of their first values; X/XB precedes it and is blank at end B.

    Raises
    ------
    FemtuneError : ``deck.section`` if X/XB is not a fraction of the length, occurs twice, or is nowhere 1
    """
    at: dict[float, int] = {}
    for start in starts:
        x = card.real(start - 1, 1.0)
        if not 0.0 < x <= 1.0 or x in at:
            raise card.error(
                "deck.section/repeated-station",
                index=start - 1,
                x=x,
                card_name=card.name,
                problem="is given twice" if x in at else "is not on the beam",
            )
        at[x] = start
    if starts and 1.0 not in at:
        raise card.error("deck.section/no-end-station", index=starts[0] - 1, card_name=card.name)
    inner = sorted(x for x in at if x < 1.0)
    return Stations((0.0, *inner, 1.0), (first, *(at[x] for x in inner), at.get(1.0)))


def station_values(b: Building, record: CardEntry, pid: int, name: str, stations: Stations) -> list[int]:
    """Positions of a value at all stations.

    If all filled fields hold the same number, they are one value, which is written to all of them. Otherwise end B has
    a separate value, named with an appended B; if its field is blank it is that of A. Blank fields between the ends are
    interpolated.
    """
    card, offset = record.card, record.at(name) - (stations.starts[0] or 0)
    filled = [start + offset for start in stations.starts[1:] if start is not None and not card.blank(start + offset)]
    value = record.real(name, 0.0)
    if all(card.real(at) == value for at in filled):
        return [b.value(record, pid, name, also=tuple(filled))] * len(stations.x)
    first = b.value(record, pid, name)
    end = stations.starts[-1]
    last = first
    if end is not None and end + offset in filled:
        last = b.value(CardEntry(card, (f"{name}B",), end + offset), pid, f"{name}B")
    return [first, *_between(b, record, pid, name, stations, (first, last), set(filled), offset), last]


def _between(
    b: Building,
    record: CardEntry,
    pid: int,
    name: str,
    stations: Stations,
    ends: tuple[int, int],
    filled: set[int],
    offset: int,
) -> list[int]:
    out = []
    for x, start in zip(stations.x[1:-1], stations.starts[1:-1]):
        at = (start or 0) + offset
        if at in filled:
            out.append(b.values.add(FieldRef(record.name, pid, f"{name} at {x:g}"), record.card.real(at)))
        else:
            out.append(interpolated(b, FieldRef(record.name, pid, f"{name} at {x:g}"), x, ends))
    return out


def interpolated(b: Building, ref: FieldRef, x: float, ends: tuple[int, int]) -> int:
    """Position of a value between those of the two ends."""
    return ends[0] if ends[0] == ends[1] else b.values.derive(ref, _mean(x), *ends)


@makes_rules
def _mean(x: float) -> Callable[..., Jet]:
    return lambda first, last: first * (1.0 - x) + last * x


def beam_section(
    b: Building, record: CardEntry, table: Mapping[str, Sequence[int]], x: tuple[float, ...]
) -> BeamSection:
    """The section of a beam: constant on the element's axis if its values permit, otherwise with stations.

    Raises
    ------
    FemtuneError : ``deck.section`` for a section that stations cannot describe
    """

    def zero(*names: str) -> bool:
        return all(b.values.values[at] == 0.0 for name in names for at in table[name])

    constant = all(len(set(table[name])) == 1 for name in _CONSTANT)
    if constant and zero("N1", "N2", "NSI") and (zero("M1", "M2") or zero("NSM")):
        return BeamSection({name: table[name][0] for name in _CONSTANT})
    for k in range(len(x)):
        _check_station(record, {name: b.values.values[table[name][k]] for name in _NAMES}, x[k])
    return BeamSection({f"{name}@{k}": at for name in _NAMES for k, at in enumerate(table[name])}, x)


def _check_station(record: CardEntry, value: Mapping[str, float], x: float) -> None:
    positive = min(value["A"], value["I1"], value["I2"]) > 0.0 and value["J"] >= 0.0
    if not positive or value["I1"] * value["I2"] <= value["I12"] * value["I12"]:
        raise record.error("deck.section/station-values", x=x, record_name=record.name)


# ----------------------------------------------------------------------------------------------------
# PBEAM: values at stations along the beam, shear factors, added mass and neutral axis off the shear centre.


_PBEAM_NAMES = ("A", "I1", "I2", "I12", "J", "NSM")
_TAIL = (
    "K1",
    "K2",
    "S1",
    "S2",
    "NSIA",
    "NSIB",
    "CWA",
    "CWB",
    *(f"{n}{i}{e}" for n in "MN" for e in "AB" for i in "12"),
)


def read_pbeam(b: Building, record: CardEntry, pid: int) -> BeamSection:
    """The section of a PBEAM.

    Raises
    ------
    FemtuneError : ``deck.section`` (stations, shear relief, impossible values)
    """
    starts, tail_start = _stations(record)
    stations = sort_stations(record.card, record.at("A"), starts)
    tail = CardEntry(record.card, _TAIL, tail_start)
    _check_tail(b, tail)
    table = {name: station_values(b, record, pid, name, stations) for name in _PBEAM_NAMES}
    count = len(stations.x)
    table |= {name: [b.value(tail, pid, name, 1.0)] * count for name in ("K1", "K2")}
    table |= {name: _linear(b, tail, pid, name, stations.x) for name in ("NSI", "M1", "M2", "N1", "N2")}
    return beam_section(b, record, table, stations.x)


def _stations(record: CardEntry) -> tuple[list[int], int]:
    """Positions of the values of the other stations, and of K1."""
    at = 8 if record.card.text(8) in STATION_FLAGS else 16
    starts = []
    while record.card.text(at) in STATION_FLAGS:
        starts.append(at + 2)
        at += 16 if _has_recovery_line(record, at) else 8
    return starts, at


def _has_recovery_line(record: CardEntry, at: int) -> bool:
    """Stations NO and YESA have no stress recovery line, though some programs write a blank one."""
    return record.card.text(at) == "YES" or (
        len(record.card.fields) - at - 8 > len(_TAIL) and record.card.text(at + 8) not in STATION_FLAGS
    )


def _linear(b: Building, tail: CardEntry, pid: int, name: str, x: tuple[float, ...]) -> list[int]:
    """Positions of a value that is given at the ends; if B is blank, it is that of A."""
    first = b.value(tail, pid, f"{name}A")
    last = first if tail.blank(f"{name}B") else b.value(tail, pid, f"{name}B")
    inner = [interpolated(b, FieldRef(tail.name, pid, f"{name} at {at:g}"), at, (first, last)) for at in x[1:-1]]
    return [first, *inner, last]


def _check_tail(b: Building, tail: CardEntry) -> None:
    for name in ("S1", "S2"):
        if tail.real(name, 0.0) != 0.0:
            raise tail.error("deck.section/shear-relief", at=name, field=name)
    if any(tail.real(name, 0.0) != 0.0 for name in ("CWA", "CWB")):
        b.notices.append(Notice("deck.no-warping", where=tail.where, level="info", card=tail.card.record))


# ----------------------------------------------------------------------------------------------------
# PBARL and PBEAML: section values derived from the dimensions of a shape.


_LARGEST_DIMENSION = 1e12
"""Largest dimension, and inverse of the smallest, so that fourth powers stay within the limits of other values."""
_ZERO_BY_SYMMETRY = 1e-10
"""Product of inertia or offset of a symmetric section, relative to its size, that is a rounding error.

The sums over rectangles have errors of a few 1e-16; a real asymmetry is far above.
"""


def read_pbarl(b: Building, record: CardEntry, pid: int) -> BeamSection:
    """The section of a PBARL; the offset between shear centre and neutral axis is ignored, as in Nastran.

    Raises
    ------
    FemtuneError : ``deck.section``
    """
    shape = _shape(record)
    entry = CardEntry(record.card, (*shape.dimensions, "NSM"), 8)
    _check_dimensions(entry, shape, [entry.real(name) for name in shape.dimensions])
    at = [b.value(entry, pid, name) for name in shape.dimensions]
    roles = _derived(b, FieldRef(record.name, pid, ""), shape, at)
    return BeamSection({**{n: roles[n] for n in SECTION_ROLES[:7]}, "NSM": b.value(entry, pid, "NSM")})


def read_pbeaml(b: Building, record: CardEntry, pid: int) -> BeamSection:
    """The section of a PBEAML, at one or more stations; the element's axis passes through the shear centres.

    Raises
    ------
    FemtuneError : ``deck.section``
    """
    shape = _shape(record)
    entry = CardEntry(record.card, (*shape.dimensions, "NSM"), 8)
    stations = sort_stations(record.card, 8, _starts(entry, shape))
    _check_dimensions(entry, shape, [entry.real(name) for name in shape.dimensions])
    dims = [station_values(b, entry, pid, name, stations) for name in shape.dimensions]
    table = {"NSM": station_values(b, entry, pid, "NSM", stations)}
    sections: list[dict[str, int]] = []
    for k, x in enumerate(stations.x):
        at = [positions[k] for positions in dims]
        _check_dimensions(entry, shape, [b.values.values[i] for i in at])
        same = next((j for j in range(k) if all(p[j] == p[k] for p in dims)), None)
        name = f" at {x:g}" if k else ""
        made = _derived(b, FieldRef(record.name, pid, name), shape, at) if same is None else sections[same]
        sections.append(made)
    table |= {role: [section[role] for section in sections] for role in SECTION_ROLES}
    none = b.values.add(FieldRef(record.name, pid, "zero"), 0.0)
    table |= {name: [none] * len(stations.x) for name in ("M1", "M2", "NSI")}
    return beam_section(b, record, table, stations.x)


def _derived(b: Building, ref: FieldRef, shape: Shape, at: Sequence[int]) -> dict[str, int]:
    """Positions of the properties derived from the dimensions at given positions; `ref` names the station."""
    nominal = shape.properties(*(b.values.values[i] for i in at))
    sizes = {"I12": math.sqrt(nominal["I1"] * nominal["I2"]), "N1": math.sqrt(nominal["A"])}
    sizes["N2"] = sizes["N1"]
    roles, formulas = {}, shape.formulas
    for role in SECTION_ROLES:
        role_ref = FieldRef(ref.card, ref.id, f"{role}{ref.name}")
        if abs(nominal[role]) <= _ZERO_BY_SYMMETRY * sizes.get(role, 0.0):
            roles[role] = b.values.add(role_ref, 0.0)
        else:
            roles[role] = b.values.derive(role_ref, formulas[role], *at)
    return roles


def _shape(record: CardEntry) -> Shape:
    name = record.text("TYPE")
    if name not in SHAPES:
        raise record.error(
            "deck.section/unknown-shape", at="TYPE", name=name, record_name=record.name, shapes=", ".join(SHAPES)
        )
    return SHAPES[name]


def _starts(entry: CardEntry, shape: Shape) -> list[int]:
    """Positions of the dimensions of further stations, each with SO, X/XB, DIM1 … NSM in sequence."""
    card, at, starts = entry.card, 8 + shape.n + 1, []
    while at < len(card.fields):
        if card.text(at, "YES") not in STATION_FLAGS:
            raise card.error("deck.section/no-station-word", index=at, card_name=card.name, n=shape.n)
        starts.append(at + 2)
        at += 2 + shape.n + 1
    return starts


def _check_dimensions(entry: CardEntry, shape: Shape, dims: Sequence[float]) -> None:
    if not shape.valid(*dims):
        raise entry.error("deck.section/shape-rule", at="DIM1", rule=shape.rule)
    if max(dims) > _LARGEST_DIMENSION or min(d for d in dims if d) < 1 / _LARGEST_DIMENSION:
        raise entry.error("deck.section/too-large", at="DIM1")
