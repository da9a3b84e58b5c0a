"""Materials by number. The isotropic one, MAT1, has any two of E, G and ν; the third is derived.

If a card gives all three and they agree, G is also derived from E and ν.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from femtune.errors import FemtuneError, Notice, did_you_mean
from femtune.fem.fields import FieldRef
from femtune.files.nastran.building import Building, FieldPlace, Library
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.catalogue import CATALOGUE
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


def shear_in_ratio(young: Jet, poisson: Jet, ratio: Jet) -> Jet:
    """G = r E / 2(1 + ν); r is 1 except for the rounding on the card."""
    return ratio * shear_modulus(young, poisson)


_LARGEST_DIFFERENCE = 0.01
"""Relative difference of G and E / 2(1 + ν) up to which a MAT1 is isotropic, as in Nastran's check of MAT1."""


@dataclass
class Materials:
    """Materials by number; positions of "E", "G", "rho" and "GE" of MAT1 in the value table.

    All material cards share their numbers. `plane_laws` has what shells make of them, `solid_laws` what solids do.
    """

    building: Building
    records: Mapping[int, CardEntry]
    _library: Library[Roles] = field(init=False)

    def __post_init__(self) -> None:
        self._library = Library(self._make)

    def find(self, mid: int, user: CardEntry, at: str = "MID") -> CardEntry:
        """The card of a material that field `at` of a card refers to (error ``deck.unknown-material``)."""
        if mid not in self.records:
            known = did_you_mean(str(mid), [str(k) for k in list(self.records)[:20]])
            raise user.error("deck.unknown-material", at=at, hint=known or "add a MAT1 card of that number", mid=mid)
        return self.records[mid]

    def get(self, mid: int, user: CardEntry) -> Roles:
        """Roles of an isotropic material that a card refers to.

        Raises
        ------
        FemtuneError : ``deck.unknown-material``, ``deck.material-type``, ``deck.material``
        """
        name = self.find(mid, user).name
        if name != "MAT1":
            raise user.error("deck.material-type", at="MID", mid=mid, name=name, user_name=user.name)
        roles = self.isotropic(mid, user)
        return {role: roles[role] for role in ("E", "G", "rho", "GE")}

    def isotropic(self, mid: int, user: CardEntry) -> Roles:
        """Roles of a MAT1 with "NU" (missing if only E is given, with G = 0)."""
        return self._library.get(mid, user)

    def continuum(self, mid: int, user: CardEntry) -> Roles:
        """The same for shells and solids, which need a Poisson's ratio (error ``deck.material``)."""
        roles, record = self.isotropic(mid, user), self.records[mid]
        if "NU" not in roles and not record.blank("NU") and not _is_ratio(record):
            raise record.error("deck.material/poisson-ratio", at="NU")
        return roles

    def _make(self, mid: int, user: CardEntry) -> Roles:
        record, b = self.records[mid], self.building
        _check(record)
        return {**self._elastic(record, mid), "rho": b.value(record, mid, "RHO"), "GE": b.value(record, mid, "GE")}

    def _elastic(self, record: CardEntry, mid: int) -> Roles:
        """E, G and ν; a blank third is derived from the other two."""
        b = self.building
        blanks = [name for name in ("E", "G", "NU") if record.blank(name)]
        if not blanks and not _is_ratio(record):
            b.notices.append(Notice("deck.implausible-ratio", where=record.where, mid=mid, ratio=record.text("NU")))
            return {name: b.value(record, mid, name) for name in ("E", "G")}
        # as in Nastran, both are 0 if two are blank
        blank = blanks[0] if len(blanks) == 1 else ""
        given = {n: b.value(record, mid, n) for n in ("E", "G", "NU") if n != blank and (blanks or n != "G")}
        if blank == "G":
            given["G"] = b.values.derive(FieldRef("MAT1", mid, "G"), shear_modulus, given["E"], given["NU"])
        elif blank == "E":
            given["E"] = b.values.derive(FieldRef("MAT1", mid, "E"), young_modulus, given["G"], given["NU"])
        elif blank == "NU" and record.real("G") != 0.0:
            given["NU"] = b.values.derive(FieldRef("MAT1", mid, "NU"), poisson_ratio, given["E"], given["G"])
        elif not blanks:
            given["G"] = self._shear(record, mid)
        return given

    def _shear(self, record: CardEntry, mid: int) -> int:
        """G of a card that also gives E and ν: derived from them if the material is isotropic, otherwise independent.

        It is derived with the ratio on the card, so that the values of the deck are kept to the last digit.
        """
        b = self.building
        young, shear, poisson = (record.real(name) for name in ("E", "G", "NU"))
        isotropic = young / (2.0 * (1.0 + poisson))
        if abs(shear - isotropic) > _LARGEST_DIFFERENCE * shear:
            b.notices.append(
                Notice(
                    "deck.inconsistent-shear",
                    where=record.where,
                    mid=mid,
                    shear=shear,
                    isotropic=isotropic,
                    difference=100.0 * (shear / isotropic - 1.0),
                )
            )
            return b.value(record, mid, "G")
        ref = FieldRef("MAT1", mid, "G")
        b.places[ref] = FieldPlace(record.card.position, (record.at("G"),))
        ratio = b.values.add(replace(ref, name="G ratio"), shear / isotropic)
        sources = b.value(record, mid, "E"), b.value(record, mid, "NU"), ratio
        return b.values.derive(ref, shear_in_ratio, *sources, nominal=shear)


def read_materials(building: Building) -> Materials:
    """The materials of the deck; each is checked when an element uses it."""
    records = building.by_number(building.records("MAT1", "MAT2", "MAT8", "MAT9", "MAT11"), "material")
    building.notices += [_negative_density(record) for record in records.values() if _is_negative(record)]
    return Materials(building, records)


def _is_negative(record: CardEntry) -> bool:
    """True for a density below zero; one that is not a number is an error when the material is used."""
    try:
        return not record.blank("RHO") and record.real("RHO") < 0.0
    except FemtuneError:
        return False


def _negative_density(record: CardEntry) -> Notice:
    density = record.real("RHO")
    return Notice(
        "deck.negative-density",
        where=record.where,
        record_name=record.name,
        mid=record.integer("MID"),
        density=density,
    )


def _check(record: CardEntry) -> None:
    blanks = {name for name in ("E", "G", "NU") if record.blank(name)}
    if {"E", "G"} <= blanks or blanks == {"E", "NU"}:
        raise record.error("deck.material", blanks=" and ".join(sorted(blanks)))
    for name in {"E", "G"} - blanks:
        smallest_allowed = record.real(name) > 0.0 if name == "E" else record.real(name) >= 0.0
        if not smallest_allowed:
            raise record.error("deck.material/modulus-sign", at=name, name=name)
    # bars and rods do not need it if they have E and G
    if (blanks or record.real("G") <= 0.0) and not record.blank("NU") and not _is_ratio(record):
        raise record.error("deck.material/poisson-ratio", at="NU")


def _is_ratio(record: CardEntry) -> bool:
    return -1.0 < record.real("NU") <= 0.5


# ----------------------------------------------------------------------------------------------------
# Property cards by number, and those that an element may use.


_NO_PROPERTIES = ("PARAM", "PAERO", "PLOAD", "PLOT", "POINT", "PRES", "PSET", "PVAL", "PANEL")


@dataclass(frozen=True)
class Properties:
    """Property cards of one element's family, and the names of all other property cards by number."""

    own: Mapping[int, CardEntry]
    others: Mapping[int, str]

    def find(self, pid: int, user: CardEntry) -> CardEntry:
        """The property card of a number that an element refers to.

        Raises
        ------
        FemtuneError : ``deck.unknown-property``, ``deck.property-type``
        """
        if pid in self.own:
            return self.own[pid]
        *others, last = CATALOGUE[user.name].properties
        expected = f"{', '.join(others)} or {last}" if others else last
        if pid in self.others:
            raise user.error(
                "deck.property-type", pid=pid, others=self.others[pid], user_name=user.name, expected=expected
            )
        known = did_you_mean(str(pid), [str(k) for k in list(self.own)[:20]])
        raise user.error("deck.unknown-property", hint=known or f"add a {expected} card of that number", pid=pid)


def read_properties(building: Building, element: str) -> Properties:
    """Property cards for one element card; a number given twice in the family is an error."""
    family = CATALOGUE[element].properties
    return Properties(building.by_number(building.records(*family), "property"), _names(building, family))


def _names(building: Building, family: tuple[str, ...]) -> dict[int, str]:
    """Names of the property cards of other families, read or not, by number."""
    names = {}
    for name, cards in building.deck.names.items():
        if name.startswith("P") and name not in family and not name.startswith(_NO_PROPERTIES):
            names.update({card.integer(0, 0): name for card in cards if card.is_integer(0)})
    return names
