"""Laminates: PCOMP and PCOMPG as sections of shells whose stiffness is derived from the plies.

The section's thickness is one; its laws are A, 12 D, B (about the laminate's middle) and the transverse shear, so that
every coefficient of the kernel is an entry of these. Z0 offsets the middle from the reference plane.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from femtune.errors import FemtuneError, Notice
from femtune.fem.fields import FieldRef
from femtune.files.nastran import laminate_laws as laws_of
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.plane_laws import PlaneLaw, PlaneLaws, rigid_modulus

# ----------------------------------------------------------------------------------------------------
# Plies of PCOMP (four fields each, numbered from the bottom) and of PCOMPG (one line each, with global numbers).


_FIRST_PLY = 8
"""Index of the first field of the plies: the first of the first continuation."""
_FIELDS = {"PCOMP": (4, ("MID", "T", "THETA", "SOUT")), "PCOMPG": (8, ("GPLYID", "MID", "T", "THETA", "SOUT"))}

_THINNEST_PLY = 1e-15
"""Smallest thickness of a ply, and inverse of the largest.

Flexibilities contain sixth powers of thicknesses (1e±90) times squares of moduli, which then do not overflow.
"""


@dataclass(frozen=True)
class Ply:
    """A ply: its material, and positions of its thickness and of its angle in degrees.

    `record` and `at` are the card and the field that give the material.
    """

    mid: int
    law: PlaneLaw
    thickness: int
    theta: int
    record: CardEntry
    at: str


def read_plies(building: Building, record: CardEntry, pid: int, laws: PlaneLaws) -> list[Ply]:
    """The plies from the bottom to the top; blank materials and thicknesses are those of the previous ply.

    Raises
    ------
    FemtuneError : ``deck.laminate`` and errors of fields and materials
    """
    plies: list[Ply] = []
    for number, ply in _ply_records(record):
        before = plies[-1] if plies else None
        plies.append(_read(building, ply, pid, number, before, laws))
    if not plies:
        raise record.error("deck.laminate/no-plies", record_name=record.name)
    return plies


def _ply_records(record: CardEntry) -> Iterator[tuple[int, CardEntry]]:
    """Number and fields of every ply with a filled field; the names of the fields end with the number."""
    width, names = _FIELDS[record.name]
    seen: set[int] = set()
    for start in range(_FIRST_PLY, len(record.card.fields), width):
        if all(record.card.blank(i) for i in range(start, start + len(names))):
            continue
        number = len(seen) + 1
        if record.name == "PCOMPG":
            number = record.card.integer(start)
            if number in seen:
                raise record.card.error("deck.laminate/repeated-ply", index=start, number=number)
        seen.add(number)
        yield number, CardEntry(record.card, tuple(f"{name}{number}" for name in names), start)


def _read(building: Building, ply: CardEntry, pid: int, number: int, before: Ply | None, laws: PlaneLaws) -> Ply:
    mid, thickness, theta, output = (f"{name}{number}" for name in ("MID", "T", "THETA", "SOUT"))
    if ply.text(output) not in ("", "YES", "NO"):
        raise ply.error("deck.field-value/ply-output", at=output)
    if before is None or not ply.blank(mid):
        named, source, at = ply.integer(mid), ply, mid
    else:
        named, source, at = before.mid, before.record, before.at
    law = laws.plane(named, source, at)
    angle = building.value(ply, pid, theta)
    return Ply(named, law, _thickness(building, ply, pid, thickness, before), angle, source, at)


def _thickness(building: Building, ply: CardEntry, pid: int, name: str, before: Ply | None) -> int:
    if ply.blank(name) and before is not None:
        return before.thickness
    thickness = ply.real(name)
    if thickness <= 0.0:
        raise ply.error("deck.laminate/thickness-sign", at=name)
    if not _THINNEST_PLY < thickness < 1.0 / _THINNEST_PLY:
        raise ply.error("deck.laminate/thickness-size", at=name)
    return building.value(ply, pid, name)


ENTRIES = ("11", "12", "13", "22", "23", "33")
SHEAR = ("11", "12", "22")
# parts of a laminate by LAM: membrane, bending, coupling, transverse shear by the plies
_OPTIONS = {
    "": (True, True, True, True),
    "SYM": (True, True, False, True),
    "MEM": (True, False, False, False),
    "BEND": (False, True, False, False),
    "SMEAR": (True, True, False, False),
    "SMCORE": (True, True, False, False),
}


@dataclass(frozen=True)
class LaminateSection:
    """Positions of a laminate's values, its flags, and the position of its middle's offset (None without Z0).

    `isotropic` is True if all plies are, so that it needs no direction.
    """

    roles: Mapping[str, int]
    facts: Mapping[str, bool]
    thickness: int
    offset: int | None
    isotropic: bool


@dataclass
class Laminates:
    """Sections of PCOMP and PCOMPG; plies of the same material and angle share their law."""

    building: Building
    laws: PlaneLaws
    _turned: dict[tuple[int, int], dict[str, int]] = field(default_factory=dict)

    def section(self, record: CardEntry, pid: int) -> LaminateSection:
        """The section of a PCOMP or PCOMPG.

        Raises
        ------
        FemtuneError : ``deck.laminate``, and those of its materials and fields
        """
        option = record.text("LAM")
        _check(record, option)
        plies = read_plies(self.building, record, pid, self.laws)
        if option == "SMCORE" and len(plies) < 2:
            raise _refused(record, "LAM", "deck.laminate/sandwich")
        stack = [*plies, *reversed(plies)] if option == "SYM" else plies
        self._tell_of_damping(record, plies)
        return _Sums(self, record, pid, stack, option).section()

    def _tell_of_damping(self, record: CardEntry, plies: Sequence[Ply]) -> None:
        values = self.building.values.values
        if record.blank("GE") and any(values[ply.law.loss] != 0.0 for ply in plies):
            self.building.notices.append(Notice("deck.ply-damping", where=record.where))

    def turned(self, ply: Ply) -> dict[str, int]:
        """Entries of a ply in the laminate's axes: Q11 … Q33, Ex, Ey, H11, H12, H22."""
        key = (ply.mid, ply.theta)
        if key not in self._turned:
            self._turned[key] = self._plain(ply) if ply.law.isotropic else self._oriented(ply)
        return self._turned[key]

    def _plain(self, ply: Ply) -> dict[str, int]:
        """An isotropic ply, independent of the angle."""
        a, b, _, d, zero, _ = ply.law.law
        shear = self.laws.shear(ply.mid, ply.record, ply.at)[0]
        modulus = self._derive(f"ply material {ply.mid} E", laws_of.plain_modulus, a, b, d)
        flexible = self._derive(f"ply material {ply.mid} 1/G", laws_of.reciprocal, shear)
        out = {f"Q{name}": at for name, at in zip(ENTRIES, ply.law.law)}
        return out | {"Ex": modulus, "Ey": modulus, "H11": flexible, "H12": zero, "H22": flexible}

    def _oriented(self, ply: Ply) -> dict[str, int]:
        name = f"ply material {ply.mid} at {ply.theta}"
        law, theta = ply.law.law, ply.theta
        shear = self.laws.shear(ply.mid, ply.record, ply.at)
        a, b, _, d, _, f = law
        out = {f"Q{e}": self._derive(f"{name} Q{e}", laws_of.turned_stiffness(e), *law, theta) for e in ENTRIES}
        for i, axis in enumerate("xy"):
            out[f"E{axis}"] = self._derive(f"{name} E{axis}", laws_of.turned_modulus(i), a, b, d, f, theta)
        for e in SHEAR:
            out[f"H{e}"] = self._derive(f"{name} H{e}", laws_of.turned_flexibility(e), *shear, theta)
        return out

    def _derive(self, name: str, rule: Callable[..., Any], *sources: int) -> int:
        return self.building.values.derive(FieldRef("", 0, name), rule, *sources)


@dataclass
class _Sums:
    """The entries of one laminate, `plies` from the bottom to the top."""

    laminates: Laminates
    record: CardEntry
    pid: int
    plies: Sequence[Ply]
    option: str

    def section(self) -> LaminateSection:
        """Roles and facts of the kernel."""
        membrane, bending, coupling, sheared = _OPTIONS[self.option]
        loss = self._value("GE")
        law = self._law(membrane)
        roles = {f"M{name}": at for name, at in law.items()}
        roles |= {f"B{name}": at for name, at in self._bent(bending).items()}
        roles |= {f"S{name}": at for name, at in self._shear(bending, sheared).items()}
        roles |= {f"C{name}": at for name, at in self._coupled(coupling).items()}
        roles |= {"rho": self._sum("mass", laws_of.membrane_sum, self._of(lambda ply: ply.law.rho), self._thicknesses)}
        roles |= {"NSM": self._value("NSM"), **dict.fromkeys(("RI", "TS"), self._one)}
        roles |= dict.fromkeys(("GE", "GEB", "GES", "GEC"), loss)
        facts = {"has_membrane": membrane, "has_bending": bending}
        offset = None if self.record.blank("Z0") else self._offset()
        return LaminateSection(roles, facts | {"has_coupling": coupling}, self._one, offset, self._isotropic)

    @property
    def _isotropic(self) -> bool:
        return all(ply.law.isotropic for ply in self.plies)

    @property
    def _one(self) -> int:
        return self._values.add(FieldRef(self.record.name, self.pid, "whole"), 1.0)

    @property
    def _none(self) -> int:
        return self._values.add(FieldRef(self.record.name, self.pid, "none"), 0.0)

    @property
    def _values(self) -> Any:
        return self.laminates.building.values

    def _value(self, name: str) -> int:
        return self.laminates.building.value(self.record, self.pid, name)

    @property
    def _thicknesses(self) -> list[int]:
        return [ply.thickness for ply in self.plies]

    @property
    def _height(self) -> int:
        return self._sum("thickness", laws_of.thickness, self._thicknesses)

    @property
    def _middles(self) -> list[int]:
        names = [f"middle of ply {k + 1}" for k in range(len(self.plies))]
        return [self._sum(name, laws_of.middle_height(k), self._thicknesses) for k, name in enumerate(names)]

    def _of(self, choose: Callable[[Ply], int]) -> list[int]:
        return [choose(ply) for ply in self.plies]

    def _turned(self, name: str) -> list[int]:
        return [self.laminates.turned(ply)[name] for ply in self.plies]

    def _sum(self, name: str, rule: Callable[..., Any], *sources: Sequence[int]) -> int:
        flat = [at for group in sources for at in group]
        return int(self._values.derive(FieldRef(self.record.name, self.pid, name), rule, *flat))

    def _entries(self, make: Callable[[str], int], wanted: bool) -> dict[str, int]:
        """The six entries of a law; those of isotropic plies are fewer values."""
        if not wanted:
            return dict.fromkeys(ENTRIES, self._none)
        if not self._isotropic:
            return {name: make(name) for name in ENTRIES}
        a, b, f = make("11"), make("12"), make("33")
        return dict(zip(ENTRIES, (a, b, self._none, a, self._none, f)))

    def _law(self, wanted: bool) -> dict[str, int]:
        def entry(name: str) -> int:
            return self._sum(f"A{name}", laws_of.membrane_sum, self._turned(f"Q{name}"), self._thicknesses)

        return self._entries(entry, wanted)

    def _coupled(self, wanted: bool) -> dict[str, int]:
        def entry(name: str) -> int:
            sources = self._turned(f"Q{name}"), self._thicknesses, self._middles
            return self._sum(f"B{name}", laws_of.coupling_sum, *sources)

        return self._entries(entry, wanted)

    def _bent(self, wanted: bool) -> dict[str, int]:
        def entry(name: str) -> int:
            Q, t = self._turned(f"Q{name}"), self._thicknesses
            if self.option == "SMEAR":
                return self._sum(f"D{name}", laws_of.smeared_bending, [self._law(True)[name]], [self._height])
            if self.option == "SMCORE":
                return self._sum(f"D{name}", laws_of.cored_bending, Q, t)
            return self._sum(f"D{name}", laws_of.bending_sum, Q, t, self._middles)

        return self._entries(entry, wanted)

    def _shear(self, bent: bool, sheared: bool) -> dict[str, int]:
        if not bent:
            return dict.fromkeys(SHEAR, self._none)
        if not sheared:
            rigid = self._sum("rigid shear", rigid_modulus, [self._law(True)["33"]])
            return {"11": rigid, "12": self._none, "22": rigid}
        flexible = self._flexible("x", "11")
        if self._isotropic:
            stiff = self._sum("shear", laws_of.reciprocal, [flexible])
            return {"11": stiff, "12": self._none, "22": stiff}
        other = self._flexible("y", "22")
        moduli = self._turned("Ex"), self._turned("Ey"), self._turned("H12")
        between = self._sum(
            "shear flexibility 12", laws_of.shear_flexibility_between, *moduli, self._thicknesses, self._middles
        )
        both = [flexible, between, other]
        return {name: self._sum(f"shear {name}", laws_of.shear_inverse(name), both) for name in SHEAR}

    def _flexible(self, axis: str, entry: str) -> int:
        sources = self._turned(f"E{axis}"), self._turned(f"H{entry}"), self._thicknesses, self._middles
        return self._sum(f"shear flexibility {entry}", laws_of.shear_flexibility, *sources)

    def _offset(self) -> int:
        return self._sum("offset", laws_of.middle_offset, [self._value("Z0")], [self._height])


def _check(record: CardEntry, option: str) -> None:
    if option not in _OPTIONS:
        known = ", ".join(name for name in _OPTIONS if name)
        raise _refused(record, "LAM", "deck.laminate/unknown-option", option=option, known=known)
    if option not in ("", "SYM") and not record.blank("Z0"):
        raise _refused(record, "Z0", "deck.laminate/offset-with-option", option=option)


def _refused(record: CardEntry, at: str, code: str, **facts: Any) -> FemtuneError:
    return record.error(code, at=at, **facts)
