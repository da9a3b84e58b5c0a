"""PBEAM: values at stations along the beam, shear factors, added mass and neutral axis beside the shear centre."""

from __future__ import annotations

from femtune.errors import Notice
from femtune.fem.values import FieldRef
from femtune.files.nastran.beam_stations import (
    STATION_FLAGS,
    BeamSection,
    beam_section,
    interpolated,
    sort_stations,
    station_values,
)
from femtune.files.nastran.building import Building
from femtune.files.nastran.record import Record

_NAMES = ("A", "I1", "I2", "I12", "J", "NSM")
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


def read_pbeam(b: Building, record: Record, pid: int) -> BeamSection:
    """The section of a PBEAM.

    Raises
    ------
    FemtuneError : ``deck.section`` (stations, shear relief, impossible values)
    """
    starts, tail_start = _stations(record)
    stations = sort_stations(record.card, record.at("A"), starts)
    tail = Record(record.card, _TAIL, tail_start)
    _check_tail(b, tail)
    table = {name: station_values(b, record, pid, name, stations) for name in _NAMES}
    count = len(stations.x)
    table |= {name: [b.value(tail, pid, name, 1.0)] * count for name in ("K1", "K2")}
    table |= {name: _linear(b, tail, pid, name, stations.x) for name in ("NSI", "M1", "M2", "N1", "N2")}
    return beam_section(b, record, table, stations.x)


def _stations(record: Record) -> tuple[list[int], int]:
    """Positions of the values of the further stations, and of K1."""
    at = 8 if record.card.text(8) in STATION_FLAGS else 16
    starts = []
    while record.card.text(at) in STATION_FLAGS:
        starts.append(at + 2)
        at += 16 if _has_recovery_line(record, at) else 8
    return starts, at


def _has_recovery_line(record: Record, at: int) -> bool:
    """Stations NO and YESA have no stress recovery line, though some programs write a blank one."""
    return record.card.text(at) == "YES" or (
        len(record.card.fields) - at - 8 > len(_TAIL) and record.card.text(at + 8) not in STATION_FLAGS
    )


def _linear(b: Building, tail: Record, pid: int, name: str, x: tuple[float, ...]) -> list[int]:
    """Positions of a value that is given at the ends; blank at B it is that of A."""
    first = b.value(tail, pid, f"{name}A")
    last = first if tail.blank(f"{name}B") else b.value(tail, pid, f"{name}B")
    inner = [interpolated(b, FieldRef(tail.name, pid, f"{name} at {at:g}"), at, (first, last)) for at in x[1:-1]]
    return [first, *inner, last]


def _check_tail(b: Building, tail: Record) -> None:
    for name in ("S1", "S2"):
        if tail.real(name, 0.0) != 0.0:
            what = f"field {name} of PBEAM (shear relief due to taper) is not modelled"
            raise tail.error("deck.section", what, at=name, hint="set it to 0 if it does not matter")
    if any(tail.real(name, 0.0) != 0.0 for name in ("CWA", "CWB")):
        what = f"the warping coefficients of {tail.card.record} count only with scalar points SA and SB; ignored"
        b.notices.append(Notice("deck.no-warping", what, tail.where, "info"))
