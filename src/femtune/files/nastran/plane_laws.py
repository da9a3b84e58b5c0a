"""Stress laws of shells: plane stress and transverse shear of MAT1, MAT2 and MAT8, as entries of the value table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from femtune.errors import Notice
from femtune.fem.fields import FieldRef
from femtune.files.nastran.building import Building, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.materials import Materials, Roles, shear_modulus
from femtune.parameters.jet import Jet

Entries = tuple[int, ...]

RIGID_SHEAR = 1e3
"""Ratio of the transverse to the in-plane shear modulus of a shell that is rigid in transverse shear.

A thousandth of the shear flexibility remains, at most 2e-4 of a frequency for a plate with a thickness of a tenth of
its span. A larger factor costs digits: on plates with a thickness of a thousandth of their span, 1e4 already changes
the seventh digit by rounding, and 1e6 the fifth.
"""

_LEAST_EIGENVALUE = 1e-9
"""Smallest eigenvalue of a positive definite law relative to its size.

Its inverse keeps seven digits; the moduli of real materials differ by a few decades at most.
"""


@dataclass(frozen=True)
class PlaneLaw:
    """Positions of a material's law 11 12 13 22 23 33, of its density and of its loss factor."""

    law: Entries
    rho: int
    loss: int
    isotropic: bool


def isotropic_stiffness(young: Jet, poisson: Jet) -> Jet:
    """D11 = E / (1 − ν²), plane stress."""
    return young / (1.0 - poisson * poisson)


def isotropic_coupling(young: Jet, poisson: Jet) -> Jet:
    """D12 = ν E / (1 − ν²)."""
    return poisson * young / (1.0 - poisson * poisson)


def orthotropic_stiffness(along: Jet, across: Jet, poisson: Jet) -> Jet:
    """D11 = E1 / (1 − ν12 ν21) with ν21 = ν12 E2 / E1; D22 is E2 / E1 times it."""
    return along / (1.0 - poisson * poisson * across / along)


def transverse_stiffness(along: Jet, across: Jet, poisson: Jet) -> Jet:
    """D22 = E2 / (1 − ν12 ν21)."""
    return across / (1.0 - poisson * poisson * across / along)


def orthotropic_coupling(along: Jet, across: Jet, poisson: Jet) -> Jet:
    """D12 = ν12 E2 / (1 − ν12 ν21)."""
    return poisson * across / (1.0 - poisson * poisson * across / along)


def rigid_modulus(shear: Jet) -> Jet:
    """Transverse shear modulus of a shell that is rigid in transverse shear."""
    return RIGID_SHEAR * shear


@dataclass
class PlaneLaws:
    """Laws by number of the material."""

    building: Building
    materials: Materials
    _plane: Library[PlaneLaw] = field(init=False)
    _shear: Library[Entries] = field(init=False)

    def __post_init__(self) -> None:
        self._plane = Library(self._make_plane)
        self._shear = Library(self._make_shear)

    def plane(self, mid: int, user: CardEntry, at: str) -> PlaneLaw:
        """Law of membrane or bending that field `at` of a card refers to.

        Raises
        ------
        FemtuneError : ``deck.unknown-material``, ``deck.material``
        """
        self._check_name(mid, user, at)
        return self._plane.get(mid, user)

    def coupling(self, mid: int, user: CardEntry, at: str) -> PlaneLaw:
        """Law that couples membrane and bending; a MAT2 for it need not be positive definite."""
        self._check_name(mid, user, at)
        record = self.materials.records[mid]
        if record.name != "MAT2":
            return self._plane.get(mid, user)
        law = tuple(self.building.value(record, mid, name) for name in _PLANE_FIELDS)
        return PlaneLaw(law, self.building.value(record, mid, "RHO"), self.loss(mid), False)

    def shear(self, mid: int, user: CardEntry, at: str) -> Entries:
        """Positions of the transverse shear law 11 12 22 that field `at` of a card refers to."""
        self._check_name(mid, user, at)
        return self._shear.get(mid, user)

    def _check_name(self, mid: int, user: CardEntry, at: str) -> None:
        name = self.materials.find(mid, user, at).name
        if name not in _LAWS:
            raise user.error("deck.material-type/for-shell", at=at, mid=mid, name=name)

    def rigid(self, mid: int, user: CardEntry, at: str) -> Entries:
        """Transverse shear law 11 12 22 of a shell with bending material that is rigid in transverse shear."""
        law = self.plane(mid, user, at).law
        record = self.materials.find(mid, user, at)
        stiff = self.stiffened(record, mid, law[5])
        return stiff, self.none(record, mid), stiff

    def loss(self, mid: int) -> int:
        """Position of a material's loss factor."""
        return self.building.value(self.materials.records[mid], mid, "GE")

    def stiffened(self, record: CardEntry, mid: int, shear: int) -> int:
        """Entry of a transverse shear modulus that is rigid, from the in-plane one."""
        return self.building.values.derive(FieldRef(record.name, mid, "rigid shear"), rigid_modulus, shear)

    def none(self, record: CardEntry, mid: int) -> int:
        """The entry of a material's law that is zero."""
        return self.building.values.add(FieldRef(record.name, mid, "none"), 0.0)

    def _make_plane(self, mid: int, user: CardEntry) -> PlaneLaw:
        record = self.materials.find(mid, user)
        law, isotropic = _LAWS[record.name](self, record, mid, user)
        return PlaneLaw(law, self.building.value(record, mid, "RHO"), self.loss(mid), isotropic)

    def _make_shear(self, mid: int, user: CardEntry) -> Entries:
        record = self.materials.find(mid, user)
        return _SHEAR_LAWS[record.name](self, record, mid, user)

    def derive(self, record: CardEntry, mid: int, name: str, rule: Callable[..., Jet], *sources: int) -> int:
        """An entry of a law derived from fields of the material's card."""
        return self.building.values.derive(FieldRef(record.name, mid, name), rule, *sources)


def _isotropic(laws: PlaneLaws, record: CardEntry, mid: int, user: CardEntry) -> tuple[Entries, bool]:
    at = _elastic(laws, record, mid, user)
    stiff = laws.derive(record, mid, "D11", isotropic_stiffness, at["E"], at["NU"])
    coupling = laws.derive(record, mid, "D12", isotropic_coupling, at["E"], at["NU"])
    none = laws.none(record, mid)
    return (stiff, coupling, none, stiff, none, _in_plane_shear(laws, record, mid, at)), True


def _in_plane_shear(laws: PlaneLaws, record: CardEntry, mid: int, at: Roles) -> int:
    """D33 = E / 2(1 + ν): of a card with E, NU and G, the latter is for transverse shear only, as in Nastran."""
    if any(record.blank(name) for name in ("E", "G", "NU")):
        return at["G"]
    return laws.derive(record, mid, "D33", shear_modulus, at["E"], at["NU"])


_LARGEST_POISSON_RATIO = 0.5 + 1e-6
"""Poisson's ratio of a stable isotropic solid, with an allowance for the rounding of E and G to seven digits.

A given ratio is checked with its card; one derived from E and G may be larger.
"""


def _elastic(laws: PlaneLaws, record: CardEntry, mid: int, user: CardEntry) -> Roles:
    """Positions of E, G and NU of a MAT1 that makes a shell stiff."""
    at = laws.materials.continuum(mid, user)
    values = laws.building.values.values
    if values[at["G"]] == 0.0:
        raise record.error("deck.material/shell-shear-modulus", at="G")
    if not -1.0 < values[at["NU"]] < 1.0:
        raise record.error("deck.material/shell-poisson-ratio", at="G", ratio=values[at["NU"]])
    notices = laws.building.notices
    if values[at["NU"]] > _LARGEST_POISSON_RATIO and not any(
        n.code == "deck.inconsistent-shear" and n.where == record.where for n in notices
    ):
        notices.append(
            Notice("deck.inconsistent-shear/implied", where=record.where, mid=mid, ratio=float(values[at["NU"]]))
        )
    return at


def _isotropic_shear(laws: PlaneLaws, record: CardEntry, mid: int, user: CardEntry) -> Entries:
    shear = _elastic(laws, record, mid, user)["G"]
    return shear, laws.none(record, mid), shear


_PLANE_FIELDS = ("G11", "G12", "G13", "G22", "G23", "G33")


def _anisotropic(laws: PlaneLaws, record: CardEntry, mid: int, user: CardEntry) -> tuple[Entries, bool]:
    law = tuple(laws.building.value(record, mid, name) for name in _PLANE_FIELDS)
    _check_definite(laws, record, law, [[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    return law, False


def _anisotropic_shear(laws: PlaneLaws, record: CardEntry, mid: int, user: CardEntry) -> Entries:
    law = tuple(laws.building.value(record, mid, name) for name in ("G11", "G12", "G22"))
    _check_definite(laws, record, law, [[0, 1], [1, 2]])
    return law


def _check_definite(laws: PlaneLaws, record: CardEntry, law: Entries, places: list[list[int]]) -> None:
    values = np.array([laws.building.values.values[i] for i in law])[np.array(places)]
    size = np.abs(values).max()
    if size == 0.0 or np.linalg.eigvalsh(values / size)[0] <= _LEAST_EIGENVALUE:
        raise record.error("deck.material/plane-not-definite", at="G11", record_name=record.name)


def _orthotropic(laws: PlaneLaws, record: CardEntry, mid: int, user: CardEntry) -> tuple[Entries, bool]:
    _check_orthotropic(record)
    at = [laws.building.value(record, mid, name) for name in ("E1", "E2", "NU12")]
    shear = laws.building.value(record, mid, "G12")
    stiff = laws.derive(record, mid, "D11", orthotropic_stiffness, *at)
    coupling = laws.derive(record, mid, "D12", orthotropic_coupling, *at)
    across = laws.derive(record, mid, "D22", transverse_stiffness, *at)
    none = laws.none(record, mid)
    return (stiff, coupling, none, across, none, shear), False


def _check_orthotropic(record: CardEntry) -> None:
    for name in ("E1", "E2", "G12"):
        if record.real(name, 0.0 if name == "G12" else ...) <= 0.0:
            raise record.error("deck.material/modulus-sign", at=name, name=name)
    if record.real("NU12") * record.real("NU12") * record.real("E2") >= record.real("E1"):
        raise record.error("deck.material/orthotropic-ratio", at="NU12")


def _orthotropic_shear(laws: PlaneLaws, record: CardEntry, mid: int, user: CardEntry) -> Entries:
    """G1Z and G2Z; if one is blank or 0, the shell is rigid in that direction."""
    _check_orthotropic(record)
    shear = laws.building.value(record, mid, "G12")
    both = []
    for name in ("G1Z", "G2Z"):
        if record.real(name, 0.0) < 0.0:
            raise record.error("deck.material/transverse-shear", at=name, name=name)
        rigid = record.real(name, 0.0) == 0.0
        both.append(laws.stiffened(record, mid, shear) if rigid else laws.building.value(record, mid, name))
    return both[0], laws.none(record, mid), both[1]


_LAWS = {"MAT1": _isotropic, "MAT2": _anisotropic, "MAT8": _orthotropic}
_SHEAR_LAWS = {"MAT1": _isotropic_shear, "MAT2": _anisotropic_shear, "MAT8": _orthotropic_shear}
