"""Materials by number. The isotropic one, MAT1, has any two of E, G and ν; the third is derived."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from femtune.errors import FemtuneError, Notice, did_you_mean
from femtune.fem.values import FieldRef
from femtune.files.nastran.building import Building, Library
from femtune.files.nastran.record import Record
from femtune.parameters.jet import Jet

Roles = Mapping[str, int]


def shear_modulus(young: Jet, poisson: Jet) -> Jet:
    """G = E / 2(1 + ν)."""
    return young / (2.0 * (1.0 + poisson))


def young_modulus(shear: Jet, poisson: Jet) -> Jet:
    """E = 2(1 + ν) G."""
    return 2.0 * (1.0 + poisson) * shear


def poisson_ratio(young: Jet, shear: Jet) -> Jet:
    """ν = E / 2G − 1."""
    return young / (2.0 * shear) - 1.0


@dataclass
class Materials:
    """Materials by number; positions of "E", "G", "rho" and "GE" of MAT1 in the value table.

    All material cards share their numbers. `plane_laws` has what shells make of them, `solid_laws` what solids do.
    """

    building: Building
    records: Mapping[int, Record]
    _library: Library[Roles] = field(init=False)

    def __post_init__(self) -> None:
        self._library = Library(self._make)

    def find(self, mid: int, user: Record, at: str = "MID") -> Record:
        """The card of a material, asked for by field `at` of a card (error ``deck.unknown-material``)."""
        if mid not in self.records:
            known = did_you_mean(str(mid), [str(k) for k in list(self.records)[:20]])
            raise user.error("deck.unknown-material", f"material {mid} does not exist", at=at,
                             hint=known or "add a MAT1 card of that number")  # fmt: skip
        return self.records[mid]

    def get(self, mid: int, user: Record) -> Roles:
        """Roles of an isotropic material, asked for by a card.

        Raises
        ------
        FemtuneError : ``deck.unknown-material``, ``deck.material-type``, ``deck.material``
        """
        name = self.find(mid, user).name
        if name != "MAT1":
            raise user.error("deck.material-type", f"material {mid} is a {name}; {user.name} needs a MAT1", at="MID",
                             hint="refer to a MAT1 card")  # fmt: skip
        found = self.isotropic(mid, user)
        return {role: found[role] for role in ("E", "G", "rho", "GE")}

    def isotropic(self, mid: int, user: Record) -> Roles:
        """Roles of a MAT1 with "NU" (not there where E alone is given with G = 0)."""
        return self._library.get(mid, user)

    def _make(self, mid: int, user: Record) -> Roles:
        record, b = self.records[mid], self.building
        _check(record)
        return {**self._elastic(record, mid), "rho": b.value(record, mid, "RHO"), "GE": b.value(record, mid, "GE")}

    def _elastic(self, record: Record, mid: int) -> Roles:
        """E, G and ν; a third that is blank follows from the two that are given."""
        b = self.building
        blanks = [name for name in ("E", "G", "NU") if record.blank(name)]
        # Nastran takes 0 for both where two are blank
        blank = blanks[0] if len(blanks) == 1 else ""
        given = {n: b.value(record, mid, n) for n in ("E", "G", "NU") if n != blank}
        if blank == "G":
            given["G"] = b.values.derive(FieldRef("MAT1", mid, "G"), shear_modulus, given["E"], given["NU"])
        elif blank == "E":
            given["E"] = b.values.derive(FieldRef("MAT1", mid, "E"), young_modulus, given["G"], given["NU"])
        elif blank == "NU" and record.real("G") != 0.0:
            given["NU"] = b.values.derive(FieldRef("MAT1", mid, "NU"), poisson_ratio, given["E"], given["G"])
        return given


def read_materials(building: Building) -> Materials:
    """The materials of the deck; each is checked when an element uses it."""
    records = building.by_number(building.records("MAT1", "MAT2", "MAT8", "MAT9", "MAT11"), "material")
    building.notices += [_negative_density(record) for record in records.values() if _is_negative(record)]
    return Materials(building, records)


def _is_negative(record: Record) -> bool:
    """True for a density below zero; one that is no number is told where the material is used."""
    try:
        return not record.blank("RHO") and record.real("RHO") < 0.0
    except FemtuneError:
        return False


def _negative_density(record: Record) -> Notice:
    density = record.real("RHO")
    what = f"the density of {record.name} {record.integer('MID')} is negative ({density:g}): it takes mass away"
    return Notice("deck.negative-density", what, record.where)


def _check(record: Record) -> None:
    blanks = {name for name in ("E", "G", "NU") if record.blank(name)}
    if {"E", "G"} <= blanks or blanks == {"E", "NU"}:
        raise record.error("deck.material", f"MAT1 leaves {' and '.join(sorted(blanks))} blank",
                           hint="give E and NU, or E and G, or G and NU")  # fmt: skip
    for name in {"E", "G"} - blanks:
        smallest_allowed = record.real(name) > 0.0 if name == "E" else record.real(name) >= 0.0
        if not smallest_allowed:
            raise record.error("deck.material", f"{name} of a material should be positive", at=name,
                               hint="correct the modulus")  # fmt: skip
    if not record.blank("NU") and not -1.0 < record.real("NU") <= 0.5:
        raise record.error("deck.material", "Poisson's ratio should lie between -1 and 0.5", at="NU",
                           hint="correct NU")  # fmt: skip
