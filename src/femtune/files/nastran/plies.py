"""Plies of PCOMP (four fields each, numbered from the bottom) and of PCOMPG (a line each, with global numbers)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from femtune.errors import FemtuneError
from femtune.files.nastran.building import Building
from femtune.files.nastran.plane_laws import PlaneLaw, PlaneLaws
from femtune.files.nastran.record import Record

_FIRST = 8
_FIELDS = {"PCOMP": (4, ("MID", "T", "THETA", "SOUT")), "PCOMPG": (8, ("GPLYID", "MID", "T", "THETA", "SOUT"))}

_THINNEST = 1e-15
"""Sixth powers of thicknesses stand beside squares of moduli: within these bounds none overflows."""


@dataclass(frozen=True)
class Ply:
    """A ply: its material, and positions of its thickness and of its angle in degrees.

    `record` and `at` are the card and the field that named the material last.
    """

    mid: int
    law: PlaneLaw
    thickness: int
    theta: int
    record: Record
    at: str


def read_plies(building: Building, record: Record, pid: int, laws: PlaneLaws) -> list[Ply]:
    """The plies from the bottom to the top; blank materials and thicknesses are those of the ply before.

    Raises
    ------
    FemtuneError : ``deck.laminate`` and errors of fields and materials
    """
    plies: list[Ply] = []
    for number, ply in _ply_records(record):
        before = plies[-1] if plies else None
        plies.append(_read(building, ply, pid, number, before, laws))
    if not plies:
        raise record.error("deck.laminate", f"{record.name} has no plies", hint="give each ply material and thickness")
    return plies


def _ply_records(record: Record) -> Iterator[tuple[int, Record]]:
    """Number and fields of every ply that has any field filled; the fields' names end with the number."""
    width, names = _FIELDS[record.name]
    seen: set[int] = set()
    for start in range(_FIRST, len(record.card.fields), width):
        if all(record.card.blank(i) for i in range(start, start + len(names))):
            continue
        number = len(seen) + 1
        if record.name == "PCOMPG":
            number = record.card.integer(start)
            if number in seen:
                raise record.card.error("deck.laminate", f"PCOMPG has the global ply {number} twice", index=start,
                                        hint="number the plies of a laminate apart")  # fmt: skip
        seen.add(number)
        yield number, Record(record.card, tuple(f"{name}{number}" for name in names), start)


def _read(building: Building, ply: Record, pid: int, number: int, before: Ply | None, laws: PlaneLaws) -> Ply:
    mid, thickness, theta, output = (f"{name}{number}" for name in ("MID", "T", "THETA", "SOUT"))
    if ply.text(output) not in ("", "YES", "NO"):
        raise ply.error("deck.field-value", "SOUT of a ply should be YES, NO or blank", at=output,
                        hint="check that each ply has its four fields in order")  # fmt: skip
    if before is None or not ply.blank(mid):
        named, source, at = ply.integer(mid), ply, mid
    else:
        named, source, at = before.mid, before.record, before.at
    law = laws.plane(named, source, at)
    angle = building.value(ply, pid, theta)
    return Ply(named, law, _thickness(building, ply, pid, thickness, before), angle, source, at)


def _thickness(building: Building, ply: Record, pid: int, name: str, before: Ply | None) -> int:
    if ply.blank(name) and before is not None:
        return before.thickness
    thickness = ply.real(name)
    if thickness <= 0.0:
        raise _refused(ply, name, "should be positive")
    if not _THINNEST < thickness < 1.0 / _THINNEST:
        raise _refused(ply, name, "is beyond all sizes")
    return building.value(ply, pid, name)


def _refused(ply: Record, name: str, why: str) -> FemtuneError:
    return ply.error("deck.laminate", f"the thickness of a ply {why}", at=name, hint="correct the value")
