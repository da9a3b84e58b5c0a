"""Stress laws of solids: MAT1, MAT9 and MAT11 as entries of the value table.

A law is the upper triangle C11 C12 … C66, row by row, in the order xx, yy, zz, xy, yz, zx with engineering shears.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from femtune.fem.fields import FieldRef
from femtune.files.nastran.building import Building, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.materials import Materials, Roles, shear_modulus
from femtune.parameters.jet import Jet

LAW = tuple(f"C{i}{j}" for i in range(1, 7) for j in range(i, 7))
"""Names of the entries of a law."""

_LEAST_EIGENVALUE = 1e-9
"""Smallest eigenvalue of a positive definite law whose diagonal is scaled to one; its inverse keeps seven digits."""
_LARGEST_POISSON_RATIO = 0.5
"""Limit of Poisson's ratio, at which λ is infinite."""


@dataclass(frozen=True)
class SolidLaw:
    """Positions of a material's law (by the names of `LAW`), of "rho" and of "GE"."""

    roles: Roles
    isotropic: bool


def lame(young: Jet, poisson: Jet) -> Jet:
    """λ = E ν / (1 + ν)(1 − 2ν)."""
    return young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))


def confined(young: Jet, poisson: Jet) -> Jet:
    """λ + 2μ = E (1 − ν) / (1 + ν)(1 − 2ν)."""
    return young * (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson))


def _turned(e: tuple[Jet, Jet, Jet], nu12: Jet, nu13: Jet, nu23: Jet) -> tuple[Jet, Jet, Jet, Jet]:
    """ν21, ν31, ν32 of an orthotropic material (νij / Ei = νji / Ej), and 1 − ν12ν21 − ν13ν31 − ν23ν32 − 2ν21ν32ν13."""
    nu21, nu31, nu32 = nu12 * e[1] / e[0], nu13 * e[2] / e[0], nu23 * e[2] / e[1]
    return nu21, nu31, nu32, 1.0 - nu12 * nu21 - nu13 * nu31 - nu23 * nu32 - 2.0 * nu21 * nu32 * nu13


def orthotropic_11(e1: Jet, e2: Jet, e3: Jet, nu12: Jet, nu13: Jet, nu23: Jet) -> Jet:
    """C11 = E1 (1 − ν23 ν32) / Δ."""
    _, _, nu32, rest = _turned((e1, e2, e3), nu12, nu13, nu23)
    return e1 * (1.0 - nu23 * nu32) / rest


def orthotropic_12(e1: Jet, e2: Jet, e3: Jet, nu12: Jet, nu13: Jet, nu23: Jet) -> Jet:
    """C12 = E1 (ν21 + ν31 ν23) / Δ."""
    nu21, nu31, _, rest = _turned((e1, e2, e3), nu12, nu13, nu23)
    return e1 * (nu21 + nu31 * nu23) / rest


def orthotropic_13(e1: Jet, e2: Jet, e3: Jet, nu12: Jet, nu13: Jet, nu23: Jet) -> Jet:
    """C13 = E1 (ν31 + ν21 ν32) / Δ."""
    nu21, nu31, nu32, rest = _turned((e1, e2, e3), nu12, nu13, nu23)
    return e1 * (nu31 + nu21 * nu32) / rest


def orthotropic_22(e1: Jet, e2: Jet, e3: Jet, nu12: Jet, nu13: Jet, nu23: Jet) -> Jet:
    """C22 = E2 (1 − ν13 ν31) / Δ."""
    _, nu31, _, rest = _turned((e1, e2, e3), nu12, nu13, nu23)
    return e2 * (1.0 - nu13 * nu31) / rest


def orthotropic_23(e1: Jet, e2: Jet, e3: Jet, nu12: Jet, nu13: Jet, nu23: Jet) -> Jet:
    """C23 = E2 (ν32 + ν12 ν31) / Δ."""
    _, nu31, nu32, rest = _turned((e1, e2, e3), nu12, nu13, nu23)
    return e2 * (nu32 + nu12 * nu31) / rest


def orthotropic_33(e1: Jet, e2: Jet, e3: Jet, nu12: Jet, nu13: Jet, nu23: Jet) -> Jet:
    """C33 = E3 (1 − ν12 ν21) / Δ."""
    nu21, _, _, rest = _turned((e1, e2, e3), nu12, nu13, nu23)
    return e3 * (1.0 - nu12 * nu21) / rest


@dataclass
class SolidLaws:
    """Laws by number of the material."""

    building: Building
    materials: Materials
    _library: Library[SolidLaw] = field(init=False)

    def __post_init__(self) -> None:
        self._library = Library(self._make)

    def get(self, mid: int, user: CardEntry) -> SolidLaw:
        """Law of a material that a PSOLID refers to.

        Raises
        ------
        FemtuneError : ``deck.unknown-material``, ``deck.material-type``, ``deck.material``
        """
        name = self.materials.find(mid, user).name
        if name not in _LAWS:
            raise user.error("deck.material-type/for-solid", at="MID", mid=mid, name=name)
        return self._library.get(mid, user)

    def _make(self, mid: int, user: CardEntry) -> SolidLaw:
        record = self.materials.find(mid, user)
        law, isotropic = _LAWS[record.name](self, record, mid, user)
        none = self.building.values.add(FieldRef(record.name, mid, "none"), 0.0)
        roles = {**dict.fromkeys(LAW, none), **law}
        _check_definite(self, record, roles)
        also = {role: self.building.value(record, mid, name) for role, name in (("rho", "RHO"), ("GE", "GE"))}
        return SolidLaw({**roles, **also}, isotropic)

    def derive(self, record: CardEntry, mid: int, name: str, rule: Callable[..., Jet], *sources: int) -> int:
        """An entry of a law derived from fields of the material's card."""
        return self.building.values.derive(FieldRef(record.name, mid, name), rule, *sources)

    def filled(self, record: CardEntry, mid: int, *names: str) -> dict[str, int]:
        """Entries of the fields that are filled."""
        return {name: self.building.value(record, mid, name) for name in names if not record.blank(name)}


def _isotropic(laws: SolidLaws, record: CardEntry, mid: int, user: CardEntry) -> tuple[Roles, bool]:
    """λ + 2μ, λ and μ; if a card gives E, NU and G, those of E and NU are used, as in Nastran."""
    at = laws.materials.continuum(mid, user)
    _check_isotropic(laws, record, at)
    stiff = laws.derive(record, mid, "C11", confined, at["E"], at["NU"])
    across = laws.derive(record, mid, "C12", lame, at["E"], at["NU"])
    shear = at["G"]
    if not any(record.blank(name) for name in ("E", "G", "NU")):
        shear = laws.derive(record, mid, "C44", shear_modulus, at["E"], at["NU"])
    return {
        **dict.fromkeys(("C11", "C22", "C33"), stiff),
        **dict.fromkeys(("C12", "C13", "C23"), across),
        **dict.fromkeys(("C44", "C55", "C66"), shear),
    }, True


def _check_isotropic(laws: SolidLaws, record: CardEntry, at: Roles) -> None:
    values = laws.building.values.values
    if values[at["G"]] == 0.0:
        raise record.error("deck.material/solid-shear-modulus", at="G")
    ratio = values[at["NU"]]
    if ratio >= _LARGEST_POISSON_RATIO:
        raise record.error("deck.material/incompressible", at="NU", ratio=ratio)
    if ratio <= -1.0:
        raise record.error("deck.material/solid-poisson-ratio", at="G", ratio=ratio)


def _anisotropic(laws: SolidLaws, record: CardEntry, mid: int, user: CardEntry) -> tuple[Roles, bool]:
    """Gij of MAT9 as given; blank ones have no values."""
    entries = laws.filled(record, mid, *(f"G{name[1:]}" for name in LAW))
    return {f"C{name[1:]}": at for name, at in entries.items()}, False


_MODULI = ("E1", "E2", "E3")
_RATIOS = ("NU12", "NU13", "NU23")
_RULES: dict[str, Callable[..., Jet]] = {
    "C11": orthotropic_11,
    "C12": orthotropic_12,
    "C13": orthotropic_13,
    "C22": orthotropic_22,
    "C23": orthotropic_23,
    "C33": orthotropic_33,
}
# xy, yz, zx
_SHEARS = {"C44": "G12", "C55": "G23", "C66": "G13"}


def _orthotropic(laws: SolidLaws, record: CardEntry, mid: int, user: CardEntry) -> tuple[Roles, bool]:
    """MAT11: three moduli, three ratios νij (contraction along j under tension along i) and three shear moduli."""
    for name in (*_MODULI, *_SHEARS.values()):
        if record.real(name) <= 0.0:
            raise record.error("deck.material/modulus-sign", at=name, name=name)
    at = [laws.building.value(record, mid, name) for name in (*_MODULI, *_RATIOS)]
    _check_ratios(record)
    law = {name: laws.derive(record, mid, name, rule, *at) for name, rule in _RULES.items()}
    return {**law, **{name: laws.building.value(record, mid, of) for name, of in _SHEARS.items()}}, False


def _check_ratios(record: CardEntry) -> None:
    """Check that the compliance of normal stresses is positive definite: each pair of axes, and all three."""
    e1, e2, e3, nu12, nu13, nu23 = (record.real(name, 0.0) for name in (*_MODULI, *_RATIOS))
    a, b, c = nu12 * nu12 * e2 / e1, nu13 * nu13 * e3 / e1, nu23 * nu23 * e3 / e2
    whole = 1.0 - a - b - c - 2.0 * nu12 * nu23 * nu13 * e3 / e1
    if max(a, b, c) >= 1.0 or whole <= _LEAST_EIGENVALUE:
        raise record.error("deck.material/orthotropic-solid-ratios", at="NU12")


def _check_definite(laws: SolidLaws, record: CardEntry, roles: Roles) -> None:
    """Check that the law, scaled to a unit diagonal, is positive definite."""
    law = np.zeros((6, 6))
    law[np.triu_indices(6)] = [laws.building.values.values[roles[name]] for name in LAW]
    diagonal = np.diag(law)
    if (diagonal > 0.0).all():
        scaled = law / np.sqrt(np.outer(diagonal, diagonal))
        if np.linalg.eigvalsh(scaled, UPLO="U")[0] > _LEAST_EIGENVALUE:
            return
    raise record.error("deck.material/solid-not-definite", at=record.names[1], record_name=record.name)


_LAWS = {"MAT1": _isotropic, "MAT9": _anisotropic, "MAT11": _orthotropic}
