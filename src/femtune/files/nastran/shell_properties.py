"""Sections of shells: PSHELL with up to four materials, and laminates, as positions in the value table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from operator import mul
from typing import Any

import numpy as np

from femtune.errors import FemtuneError, Notice, Where
from femtune.fem.fields import FieldRef
from femtune.fem.rules import makes_rules
from femtune.files.nastran.building import Building, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.laminates import Laminates
from femtune.files.nastran.materials import Properties
from femtune.files.nastran.plane_laws import PlaneLaw, PlaneLaws
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
    number : number of the card
    roles : positions of all values of the kernel except thickness and offset
    facts : "has_membrane", "has_bending", "has_coupling"
    thickness : position of its thickness, None if T is blank
    layered : True for plies, so that elements cannot give a thickness
    offset : position of the height of a laminate's middle above its reference plane, None if they coincide
    isotropic : True if all its materials are isotropic, so that it needs no direction
    """

    number: int
    roles: Mapping[str, int]
    facts: Mapping[str, bool]
    thickness: int | None
    layered: bool = False
    offset: int | None = None
    isotropic: bool = False


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

    def get(self, pid: int, user: CardEntry) -> ShellSection:
        """Section of a property that an element refers to.

        Raises
        ------
        FemtuneError : ``deck.unknown-property``, ``deck.property-type``, ``deck.shell-section``, ``deck.laminate``
            and those of its materials
        """
        self.properties.find(pid, user)
        return self._library.get(pid, user)

    def _make(self, pid: int, user: CardEntry) -> ShellSection:
        record = self.properties.find(pid, user)
        if record.name != "PSHELL":
            made = self._laminates.section(record, pid)
            return ShellSection(pid, made.roles, made.facts, made.thickness, True, made.offset, made.isotropic)
        return self._plain(record, pid)

    def _plain(self, record: CardEntry, pid: int) -> ShellSection:
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
            "has_membrane": membrane is not None,
            "has_bending": bending is not None,
            "has_coupling": record.integer("MID4", 0) > 0,
        }
        used = [record.integer(name, 0) for name in ("MID1", "MID2", "MID3", "MID4")]
        isotropic = all(self.laws.materials.records[mid].name == "MAT1" for mid in used if mid > 0)
        return ShellSection(pid, roles, facts, self._thickness(record, pid), isotropic=isotropic)

    def _law(self, record: CardEntry, name: str) -> PlaneLaw | None:
        mid = record.integer(name, 0)
        return self.laws.plane(mid, record, name) if mid else None

    def _entries(self, names: tuple[str, ...], law: PlaneLaw | None, record: CardEntry, pid: int) -> dict[str, int]:
        return dict(zip(names, law.law)) if law else dict.fromkeys(names, self._none(record, pid))

    def _bent(self, record: CardEntry, pid: int, bending: PlaneLaw | None) -> dict[str, int]:
        """Values of bending only: inertia ratio, transverse shear and the loss factors."""
        names = ("RI", "TS", *SHEAR, "GEB", "GES")
        if bending is None:
            return dict.fromkeys(names, self._none(record, pid))
        ratio = self.building.value(record, pid, "RI", 1.0)
        mid = record.integer("MID3", 0)
        if not mid:
            whole = self.building.values.add(FieldRef(record.name, pid, "whole"), 1.0)
            shear = self.laws.rigid(record.integer("MID2"), record, "MID2")
            return dict(zip(names, (ratio, whole, *shear, bending.loss, bending.loss)))
        share = self.building.value(record, pid, "TS", _SHEAR_THICKNESS_RATIO)
        shear = self.laws.shear(mid, record, "MID3")
        return dict(zip(names, (ratio, share, *shear, bending.loss, self.laws.loss(mid))))

    def _coupled(self, record: CardEntry, pid: int, laws: tuple[PlaneLaw | None, ...]) -> dict[str, int]:
        """Coupling of membrane and bending; MID4 applies where z is negative."""
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

    def _check_definite(self, record: CardEntry, laws: tuple[PlaneLaw | None, ...], inertia: int) -> None:
        """Check that the law of membrane, bending and coupling is positive semidefinite for unit thickness."""
        values = np.array(self.building.values.values)
        membrane, bending, coupling = (values[np.array(law.law)[_PLACES]] for law in laws if law)
        whole = np.block([[membrane, -coupling], [-coupling, bending * values[inertia] / 12.0]])
        if np.linalg.eigvalsh(whole / np.abs(whole).max())[0] < -_NEGATIVE_ROUNDING:
            raise _refused(record, "MID4", "deck.shell-section/not-definite")

    def _none(self, record: CardEntry, pid: int) -> int:
        return self.building.values.add(FieldRef(record.name, pid, "none"), 0.0)

    def _thickness(self, record: CardEntry, pid: int) -> int | None:
        return None if record.blank("T") else self.building.value(record, pid, "T")


_PLACES = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
_NEGATIVE_ROUNDING = 1e-9
"""Negative eigenvalue of a law, relative to its largest entry, that is a rounding error.

MID4 is given with seven to nine digits on a card and may make a law singular on purpose.
"""


def negative(value: Jet) -> Jet:
    """Nastran's coupling is ∫ −z G dz."""
    return -value


_SHEAR_THICKNESS_RATIO = 5.0 / 6.0
"""Default of TS/T: documented as 0.833333; element matrices of commercial Nastran show 5/6."""


def _check(record: CardEntry) -> None:
    """Errors for combinations of materials that are not modelled, and for impossible values."""
    first, second, third, fourth = (record.integer(f"MID{i}", 0) for i in (1, 2, 3, 4))
    if second == -1:
        raise _refused(record, "MID2", "deck.shell-section/plane-strain")
    if not first and not second:
        raise _refused(record, "MID1", "deck.shell-section/no-material")
    if third and not second:
        raise _refused(record, "MID3", "deck.shell-section/shear-without-bending")
    if fourth and not (first and second):
        raise _refused(record, "MID4", "deck.shell-section/coupling-without-both")
    _check_values(record)


def _check_values(record: CardEntry) -> None:
    """Check the ratios whose material is given."""
    counted = {"T": True, "RI": record.integer("MID2", 0) > 0, "TS": record.integer("MID3", 0) > 0}
    for name, words in (("T", "thickness T"), ("RI", "inertia ratio 12I/T**3"), ("TS", "shear ratio TS/T")):
        if counted[name] and not record.blank(name) and record.real(name) <= 0.0:
            raise _refused(record, name, "deck.shell-section/value-sign", quantity=words)


def _refused(record: CardEntry, at: str, code: str, **facts: Any) -> FemtuneError:
    return record.error(code, at=at, **facts)


# ----------------------------------------------------------------------------------------------------
# Thickness of a shell element: that of its property, or those at its corners and their mean.


_LARGEST_VARIATION = 0.2
"""Difference of the corner thicknesses, relative to their mean, above which a notice tells what is used.

Up to it the mean of t³ differs from the third power of the mean by at most 1 %.
"""


@dataclass
class Thicknesses:
    """Positions of the thicknesses of one card's elements, and the elements whose corners differ much.

    `made_even` is False if the elements have the varying thickness instead of its means.
    """

    building: Building
    corners: tuple[str, ...]
    made_even: bool = True
    uneven: list[Where] = field(default_factory=list)

    def get(self, record: CardEntry, eid: int, section: ShellSection, corners: list[int] | None) -> int:
        """Position of an element's thickness: that of its property, or the mean of those at its corners.

        Raises
        ------
        FemtuneError : ``deck.shell-section`` if there is none
        """
        if corners is None:
            return self._of_property(record, section)
        return self.building.values.derive(FieldRef(record.name, eid, "T"), corner_mean(len(corners)), *corners)

    def inertia(self, record: CardEntry, eid: int, section: ShellSection, corners: list[int] | None) -> int:
        """Position of the bending inertia relative to that of the mean thickness.

        It is the property's value, times the mean of t³ over the element divided by the third power of the mean if
        the thickness varies.
        """
        own = section.roles["RI"]
        if corners is None or not self.made_even or not section.facts["has_bending"]:
            return own
        rule = bending_ratio(len(corners))
        return self.building.values.derive(FieldRef(record.name, eid, "bending inertia"), rule, own, *corners)

    def at_corners(self, record: CardEntry, eid: int, section: ShellSection) -> list[int] | None:
        """Positions of the thickness at each corner, None if all are the property's.

        Raises
        ------
        FemtuneError : ``deck.shell-section`` for impossible thicknesses, ``deck.field-value`` for TFLAG
        """
        given, relative = self._given(record, section)
        if not given:
            return None
        corners = [self._corner(record, eid, section, name, name in given, relative) for name in self.corners]
        self._check(record, dict(zip(self.corners, (self.building.values.values[i] for i in corners))))
        return corners

    def _corner(
        self, record: CardEntry, eid: int, section: ShellSection, name: str, given: bool, relative: bool
    ) -> int:  # fmt: skip
        if not given:
            return self._of_property(record, section)
        value = self.building.value(record, eid, name)
        if not relative:
            return value
        ref = FieldRef(record.name, eid, f"{name} thickness")
        return self.building.values.derive(ref, mul, value, self._of_property(record, section))

    def _given(self, record: CardEntry, section: ShellSection) -> tuple[list[str], bool]:
        """Names of the fields that are filled, and whether they are factors."""
        if len(record.card.fields) <= min(record.at("TFLAG"), record.at(self.corners[0])):
            return [], False
        given = [name for name in self.corners if not record.blank(name)]
        if given and section.layered:
            raise record.error("deck.shell-section/thickness-of-laminate", at=given[0], names=self._names)
        return given, self._relative(record)

    def _of_property(self, record: CardEntry, section: ShellSection) -> int:
        if section.thickness is None:
            raise record.error("deck.shell-section/no-thickness", section_number=section.number, names=self._names)
        return section.thickness

    @property
    def _names(self) -> str:
        return f"{self.corners[0]} to {self.corners[-1]}"

    def _relative(self, record: CardEntry) -> bool:
        """TFLAG: 0 or blank for thicknesses, 1 for factors of the property's thickness."""
        flag: int = record.integer("TFLAG", 0)
        if flag not in (0, 1):
            raise record.error("deck.field-value/thickness-flag", at="TFLAG", record_name=record.name)
        return flag == 1

    def _check(self, record: CardEntry, corners: dict[str, float]) -> None:
        worst = min(corners, key=corners.__getitem__)
        if corners[worst] < 0.0 or max(corners.values()) == 0.0:
            raise record.error("deck.shell-section/corner-thickness", at=worst, names=self._names)
        every = corners.values()
        if self.made_even and max(every) - min(every) > _LARGEST_VARIATION * sum(every) / len(every):
            self.uneven.append(record.where)

    def notices(self, card: str) -> list[Notice]:
        """Notices of elements with varying thickness."""
        if not self.uneven:
            return []
        n = len(self.uneven)
        return [
            Notice(
                "deck.uneven-thickness",
                where=self.uneven[0],
                n=n,
                card=card,
                plural="s" if n > 1 else "",
                names=self._names,
            )
        ]


@cache
@makes_rules
def corner_mean(n: int) -> Callable[..., Any]:
    """Mean of the thicknesses at n corners."""

    def mean(first: Any, *others: Any) -> Any:
        return sum(others, start=first) / float(n)

    return mean


@cache
@makes_rules
def bending_ratio(n: int) -> Callable[..., Any]:
    """An inertia ratio times the mean of t³ over an element of n corners, relative to the third power of the mean.

    The thickness is interpolated linearly between three corners, or bilinearly between four.
    """
    shares = _CUBIC_POINTS[n]

    def ratio(inertia: Any, *corners: Any) -> Any:
        mean = sum(corners[1:], start=corners[0]) / float(n)
        cubes = None
        for weight, point in shares:
            t = _weighted(point, corners) / mean
            cube = t * t * t * weight
            cubes = cube if cubes is None else cubes + cube
        return inertia * cubes

    return ratio


def _weighted(weights: tuple[float, ...], values: tuple[Any, ...]) -> Any:
    total = values[0] * weights[0]
    for weight, value in zip(weights[1:], values[1:]):
        total = total + value * weight
    return total


_NEAR = 0.5 + 0.5 / 3.0**0.5
_FAR = 0.5 - 0.5 / 3.0**0.5
"""Weights of the two ends of a side at its two Gauss points."""
_CUBIC_POINTS: dict[int, tuple[tuple[float, tuple[float, ...]], ...]] = {
    # four points integrate a cubic over a triangle exactly (Strang and Fix)
    3: (
        (-9.0 / 16.0, (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0)),
        (25.0 / 48.0, (0.6, 0.2, 0.2)),
        (25.0 / 48.0, (0.2, 0.6, 0.2)),
        (25.0 / 48.0, (0.2, 0.2, 0.6)),
    ),
    # and 2 × 2 Gauss points a bicubic over a square
    4: tuple(
        (0.25, ((1.0 - x) * (1.0 - y), x * (1.0 - y), x * y, (1.0 - x) * y))
        for x in (_FAR, _NEAR)
        for y in (_FAR, _NEAR)
    ),
}
"""Weights of points in an element of three or four corners, and the shares of the corners at each point."""
