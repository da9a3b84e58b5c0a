"""Sections of shells: PSHELL with its up to four materials, and laminates, as positions in the value table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from femtune.errors import FemtuneError
from femtune.fem.values import FieldRef
from femtune.files.nastran.building import Building, Library
from femtune.files.nastran.laminates import Laminates
from femtune.files.nastran.plane_laws import PlaneLaw, PlaneLaws
from femtune.files.nastran.properties import Properties
from femtune.files.nastran.record import Record
from femtune.parameters.jet import Jet

MEMBRANE = ("M11", "M12", "M13", "M22", "M23", "M33")
BENDING = ("B11", "B12", "B13", "B22", "B23", "B33")
SHEAR = ("S11", "S12", "S22")
COUPLING = ("C11", "C12", "C13", "C22", "C23", "C33")


@dataclass(frozen=True)
class ShellSection:
    """One PSHELL, PCOMP or PCOMPG.

    Parameters
    ----------
    number : its number
    roles : positions of all values of the kernel but thickness and offset
    facts : "isotropic", "has_membrane", "has_bending", "has_coupling"
    thickness : position of its thickness, None where T is blank
    layered : True where plies make it, so that its elements have no thickness of their own
    offset : position of the height of a laminate's middle above its reference plane, None where that is its middle
    """

    number: int
    roles: Mapping[str, int]
    facts: Mapping[str, bool]
    thickness: int | None
    layered: bool = False
    offset: int | None = None


@dataclass
class ShellProperties:
    """Sections of shells by property number."""

    building: Building
    properties: Properties
    laws: PlaneLaws
    _library: Library[ShellSection] = field(init=False)
    _laminates: Laminates = field(init=False)

    def __post_init__(self) -> None:
        self._library = Library(self._make)
        self._laminates = Laminates(self.building, self.laws)

    def get(self, pid: int, user: Record) -> ShellSection:
        """Section of a property, asked for by an element.

        Raises
        ------
        FemtuneError : ``deck.unknown-property``, ``deck.property-type``, ``deck.shell-section``, ``deck.laminate``
            and those of its materials
        """
        self.properties.find(pid, user)
        return self._library.get(pid, user)

    def _make(self, pid: int, user: Record) -> ShellSection:
        record = self.properties.find(pid, user)
        if record.name != "PSHELL":
            made = self._laminates.section(record, pid)
            return ShellSection(pid, made.roles, made.facts, made.thickness, True, made.offset)
        return self._plain(record, pid)

    def _plain(self, record: Record, pid: int) -> ShellSection:
        _check(record)
        membrane, bending = (self._law(record, name) for name in ("MID1", "MID2"))
        first = membrane or bending
        assert first is not None
        roles = {
            **self._entries(MEMBRANE, membrane, record, pid),
            **self._entries(BENDING, bending, record, pid),
            **self._bent(record, pid, bending),
            **self._coupled(record, pid, (membrane, bending)),
            "rho": first.rho,
            "NSM": self.building.value(record, pid, "NSM"),
            "GE": first.loss if membrane else self._none(record, pid),
        }
        facts = {
            "isotropic": membrane is None or membrane.isotropic,
            "has_membrane": membrane is not None,
            "has_bending": bending is not None,
            "has_coupling": record.integer("MID4", 0) > 0,
        }
        return ShellSection(pid, roles, facts, self._thickness(record, pid))

    def _law(self, record: Record, name: str) -> PlaneLaw | None:
        mid = record.integer(name, 0)
        return self.laws.plane(mid, record, name) if mid else None

    def _entries(self, names: tuple[str, ...], law: PlaneLaw | None, record: Record, pid: int) -> dict[str, int]:
        return dict(zip(names, law.law)) if law else dict.fromkeys(names, self._none(record, pid))

    def _bent(self, record: Record, pid: int, bending: PlaneLaw | None) -> dict[str, int]:
        """What acts in bending only: inertia ratio, transverse shear and the loss factors."""
        names = ("RI", "TS", *SHEAR, "GEB", "GES")
        if bending is None:
            return dict.fromkeys(names, self._none(record, pid))
        ratio = self.building.value(record, pid, "RI", 1.0)
        mid = record.integer("MID3", 0)
        if not mid:
            whole = self.building.values.add(FieldRef(record.name, pid, "whole"), 1.0)
            shear = self.laws.rigid(record.integer("MID2"), record, "MID2")
            return dict(zip(names, (ratio, whole, *shear, bending.loss, bending.loss)))
        share = self.building.value(record, pid, "TS", _SHEAR_SHARE)
        shear = self.laws.shear(mid, record, "MID3")
        return dict(zip(names, (ratio, share, *shear, bending.loss, self.laws.loss(mid))))

    def _coupled(self, record: Record, pid: int, laws: tuple[PlaneLaw | None, ...]) -> dict[str, int]:
        """What couples membrane and bending; MID4 counts where z is negative."""
        names, mid = (*COUPLING, "GEC"), record.integer("MID4", 0)
        if not mid:
            return dict.fromkeys(names, self._none(record, pid))
        law = self.laws.coupling(mid, record, "MID4")
        self._check_definite(record, (*laws, law), self.building.value(record, pid, "RI", 1.0))
        turned = [
            self.building.values.derive(FieldRef(record.name, pid, name), negative, at)
            for name, at in zip(COUPLING, law.law)
        ]
        return dict(zip(names, (*turned, law.loss)))

    def _check_definite(self, record: Record, laws: tuple[PlaneLaw | None, ...], inertia: int) -> None:
        """Membrane, bending and coupling of a shell of unit thickness resist every strain."""
        values = np.array(self.building.values.values)
        membrane, bending, coupling = (values[np.array(law.law)[_PLACES]] for law in laws if law)
        whole = np.block([[membrane, -coupling], [-coupling, bending * values[inertia] / 12.0]])
        if np.linalg.eigvalsh(whole / np.abs(whole).max())[0] < -_ROUNDING:
            what = "membrane, bending and coupling (MID4) together have a strain whose energy is negative"
            raise _refused(record, "MID4", what, "correct the moduli of MID4: they are too large for MID1 and MID2")

    def _none(self, record: Record, pid: int) -> int:
        return self.building.values.add(FieldRef(record.name, pid, "none"), 0.0)

    def _thickness(self, record: Record, pid: int) -> int | None:
        return None if record.blank("T") else self.building.value(record, pid, "T")


_PLACES = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
# of the largest modulus, below which a negative energy is rounding
_ROUNDING = 1e-9


def negative(value: Jet) -> Jet:
    """Nastran's coupling is ∫ −z G dz."""
    return -value


# Nastran's default of Ts/T, in its digits
_SHEAR_SHARE = 0.833333


def _check(record: Record) -> None:
    """Materials that are named in a way that is not modelled, and values that no plate has."""
    first, second, third, fourth = (record.integer(f"MID{i}", 0) for i in (1, 2, 3, 4))
    if second == -1:
        raise _refused(record, "MID2", "plane strain (MID2 = -1) is not modelled", "give the shell a bending material")
    if not first and not second:
        raise _refused(record, "MID1", "PSHELL names no material: MID1 and MID2 are blank", "fill MID1, MID2 or both")
    if third and not second:
        raise _refused(record, "MID3", "PSHELL has a material of transverse shear (MID3) but none of bending (MID2)",
                       "fill MID2, or leave MID3 blank")  # fmt: skip
    if fourth and not (first and second):
        raise _refused(record, "MID4", "PSHELL couples membrane and bending (MID4) but lacks one of them",
                       "fill MID1 and MID2, or leave MID4 blank")  # fmt: skip
    _check_values(record)


def _check_values(record: Record) -> None:
    """The ratios count where their material is named."""
    counted = {"T": True, "RI": record.integer("MID2", 0) > 0, "TS": record.integer("MID3", 0) > 0}
    for name, words in (("T", "thickness T"), ("RI", "inertia ratio 12I/T**3"), ("TS", "shear ratio TS/T")):
        if counted[name] and not record.blank(name) and record.real(name) <= 0.0:
            raise _refused(record, name, f"the {words} of a shell should be positive", "correct the value")


def _refused(record: Record, at: str, what: str, hint: str) -> FemtuneError:
    return record.error("deck.shell-section", what, at=at, hint=hint)
