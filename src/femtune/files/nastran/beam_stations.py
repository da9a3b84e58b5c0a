"""Sections that change along a beam: stations, what they hold, and which element their values need."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from femtune.fem.values import FieldRef
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import Card
from femtune.files.nastran.record import Record
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
    roles : of a constant section by name; with stations ``A@0``, ``A@1`` … from end A to end B
    stations : where on the length, from 0 to 1; empty for a constant section on the element's axis
    """

    roles: Mapping[str, int]
    stations: tuple[float, ...] = ()


@dataclass(frozen=True)
class Stations:
    """Stations of a property card in the order of the beam.

    Parameters
    ----------
    x : from 0 (end A) to 1 (end B)
    starts : index of the first value of each on the card; None for end B where the card has no station there
    """

    x: tuple[float, ...]
    starts: tuple[int | None, ...]


def sort_stations(card: Card, first: int, starts: Sequence[int]) -> Stations:
    """Stations from the indices of their first values; X/XB stands before it, blank at end B.

    Raises
    ------
    FemtuneError : ``deck.section`` where X/XB is no fraction of the length, stands twice, or is nowhere 1
    """
    found: dict[float, int] = {}
    for start in starts:
        x = card.real(start - 1, 1.0)
        if not 0.0 < x <= 1.0 or x in found:
            what = f"X/XB = {x:g} of {card.name} " + ("stands twice" if x in found else "lies off the beam")
            raise card.error(
                "deck.section", what, index=start - 1, hint="give each station an X/XB above 0 and up to 1"
            )
        found[x] = start
    if starts and 1.0 not in found:
        raise card.error("deck.section", f"{card.name} has stations but none with X/XB = 1, which is end B",
                         index=starts[0] - 1, hint="add the station of end B")  # fmt: skip
    inner = sorted(x for x in found if x < 1.0)
    return Stations((0.0, *inner, 1.0), (first, *(found[x] for x in inner), found.get(1.0)))


def station_values(b: Building, record: Record, pid: int, name: str, stations: Stations) -> list[int]:
    """Positions of a value at all stations.

    Where every filled field holds the same number it is one value, written to all of them. Otherwise end B has its own,
    named with a B behind it; it follows A where its field is blank. Between the ends a blank field is interpolated.
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
        last = b.value(Record(card, (f"{name}B",), end + offset), pid, f"{name}B")
    return [first, *_between(b, record, pid, name, stations, (first, last), set(filled), offset), last]


def _between(
    b: Building,
    record: Record,
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


def _mean(x: float) -> Callable[..., Jet]:
    return lambda first, last: first * (1.0 - x) + last * x


def beam_section(b: Building, record: Record, table: Mapping[str, Sequence[int]], x: tuple[float, ...]) -> BeamSection:
    """The section of a beam: constant on the element's axis where its values allow, with stations otherwise.

    Raises
    ------
    FemtuneError : ``deck.section`` where a section with stations is impossible
    """

    def zero(*names: str) -> bool:
        return all(b.values.values[at] == 0.0 for name in names for at in table[name])

    constant = all(len(set(table[name])) == 1 for name in _CONSTANT)
    if constant and zero("N1", "N2", "NSI") and (zero("M1", "M2") or zero("NSM")):
        return BeamSection({name: table[name][0] for name in _CONSTANT})
    for k in range(len(x)):
        _check_station(record, {name: b.values.values[table[name][k]] for name in _NAMES}, x[k])
    return BeamSection({f"{name}@{k}": at for name in _NAMES for k, at in enumerate(table[name])}, x)


def _check_station(record: Record, value: Mapping[str, float], x: float) -> None:
    positive = min(value["A"], value["I1"], value["I2"]) > 0.0 and value["J"] >= 0.0
    if not positive or value["I1"] * value["I2"] <= value["I12"] * value["I12"]:
        raise record.error(
            "deck.section",
            f"at X/XB = {x:g} the section of {record.name} needs A, I1, I2 > 0, J ≥ 0 and I1 I2 > I12²",
            hint="correct its values there; a beam that changes along its length cannot do without them",
        )
