"""Whether the declared units fit the materials of the deck: moduli and densities of engineering materials.

A warning is given if no material of the deck is possible in the declared units and one of them is a common
engineering material in other units. Where the materials are possible but none is common, it is given only if one is a
common metal in other units, in which all the others are possible too: E = 210000 and RHO = 7.85e-9 are steel in mm-t-s
and a light rubber in mm-kg-s. Both conditions together avoid warnings of models with fictitious materials.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from femtune.errors import Notice
from femtune.units import UnitSystem, unit_system

if TYPE_CHECKING:
    from femtune.fem.structure import Structure
    from femtune.files.built_model import BuiltModel
    from femtune.files.study_file import StudyFile

POSSIBLE_MODULUS = (1e5, 5e12)
"""Young's modulus in Pa of what a model may contain, from soft foam to stiffened connections, smeared values too."""
POSSIBLE_DENSITY = (1.0, 23e3)
"""Density in kg/m³ of what a model may contain, from honeycomb core to platinum, smeared values too."""
POSSIBLE_SPEED = (8.0, 25e3)
"""Wave speed sqrt(E/ρ) in m/s of what a model may contain."""

COMMON = {
    "steel": (185e9, 220e9, 7600.0, 8200.0),
    "aluminium": (63e9, 78e9, 2550.0, 2900.0),
    "titanium": (95e9, 125e9, 4300.0, 4700.0),
    "magnesium": (40e9, 47e9, 1700.0, 1900.0),
    "copper or brass": (90e9, 140e9, 8200.0, 9000.0),
    "cast iron": (80e9, 180e9, 6900.0, 7400.0),
    "concrete": (18e9, 50e9, 2200.0, 2600.0),
    "carbon fibre": (30e9, 250e9, 1450.0, 1700.0),
    "glass fibre": (15e9, 55e9, 1750.0, 2150.0),
    "plastic": (1.2e9, 5e9, 900.0, 1450.0),
}
"""Lowest and highest Young's modulus in Pa and density in kg/m³ of common engineering materials."""

_METALS = ("steel", "aluminium", "titanium", "magnesium", "copper or brass", "cast iron")
"""Materials whose modulus and density are so narrowly known that they tell systems of units apart."""
SYSTEMS = (
    "m-kg-s", "mm-t-s", "mm-kg-s", "cm-kg-s", "in-slinch-s", "in-lbm-s", "ft-slug-s", "ft-lbm-s", "in-kip-s", "ft-kip-s"
)  # fmt: skip
"""Systems that a deck is compared with."""

_GRAVITY = 9.80665
"""Standard acceleration of gravity in m/s²."""
_MODULI = {"MAT1": "E", "MAT2": "G11", "MAT8": "E1", "MAT9": "G11", "MAT11": "E1"}
"""Field of a material card that has the modulus along its first axis."""


@dataclass(frozen=True)
class Material:
    """Modulus and density (times PARAM WTMASS) of one card, in units of the deck."""

    name: str
    modulus: float
    density: float

    def modulus_si(self, units: UnitSystem) -> float:
        return self.modulus * units.force / units.length**2

    def density_si(self, units: UnitSystem) -> float:
        return self.density * units.mass / units.length**3

    def weight_density_si(self, units: UnitSystem) -> float:
        """Density in kg/m³ if the deck has a weight per volume."""
        return self.density * units.force / units.length**3 / _GRAVITY

    def common(self, units: UnitSystem) -> str:
        """Name of the common material with these values; "" if there is none."""
        return _common(self.modulus_si(units), self.density_si(units))

    def common_weight(self, units: UnitSystem) -> str:
        """The same if the density is a weight per volume."""
        return _common(self.modulus_si(units), self.weight_density_si(units))

    def is_possible(self, units: UnitSystem) -> bool:
        modulus, density = self.modulus_si(units), self.density_si(units)
        return (
            _within(modulus, POSSIBLE_MODULUS)
            and _within(density, POSSIBLE_DENSITY)
            and _within((modulus / density) ** 0.5, POSSIBLE_SPEED)
        )


def unit_notices(file: StudyFile, built: BuiltModel) -> tuple[Notice, ...]:
    """A warning if the materials are those of another system of units than the declared one."""
    declared = file.study.unit_system
    materials = list(materials_of(built.structure))
    if not materials:
        return ()
    if any(material.is_possible(declared) for material in materials):
        return _of_metal(file, materials, declared)
    for material in materials:
        explanation = _explained(material, declared)
        if explanation is not None:
            code, facts = explanation
            return (
                Notice(
                    code,
                    where=file.where("study", "units"),
                    material=material.name,
                    modulus=material.modulus,
                    density=material.density,
                    declared=declared.name,
                    **facts,
                ),
            )
    return ()


def weight_densities(built: BuiltModel) -> tuple[Notice, ...]:
    """A warning if the density of a metal is a weight per volume, for a deck whose units nobody has declared.

    The material is then a metal in none of the systems, and one with its weight density in some of them.
    """
    systems = [unit_system(name) for name in SYSTEMS]
    materials = list(materials_of(built.structure))
    if any(material.common(units) for material in materials for units in systems):
        return ()
    for material in materials:
        for units in systems:
            if material.common_weight(units) in _METALS:
                facts: dict[str, Any] = {"material": material.name, "modulus": material.modulus}
                facts["density"] = material.density
                facts |= {"fitting": units.name, "common": material.common_weight(units)}
                factor = f"{units.length / _GRAVITY:.5g}"
                return (Notice("deck.weight-density", level="info", **facts, factor=factor),)
    return ()


def _of_metal(file: StudyFile, materials: list[Material], declared: UnitSystem) -> tuple[Notice, ...]:
    """A warning if no material is common in the declared units, and in other units all are possible and one is a
    metal."""
    if any(material.common(declared) for material in materials):
        return ()
    for units in (unit_system(name) for name in SYSTEMS if name != declared.word):
        metals = [(m, name) for m in materials if (name := m.common(units)) in _METALS]
        if metals and all(m.is_possible(units) for m in materials):
            material, common = metals[0]
            facts: dict[str, Any] = {
                "material": material.name, "modulus": material.modulus, "density": material.density,
                "declared": declared.name, "fitting": units.name, "common": common,
                "gpa": material.modulus_si(declared) / 1e9, "density_si": material.density_si(declared),
            }  # fmt: skip
            return (Notice("study.units-doubtful/uncommon", where=file.where("study", "units"), **facts),)
    return ()


def materials_of(structure: Structure) -> Iterator[Material]:
    """Materials that elements use, with a modulus and a density."""
    table = structure.values
    for ref, value in zip(table.refs, table.values):
        if _MODULI.get(ref.card) == ref.name and not ref.region and value > 0.0:
            at = table.index(type(ref)(ref.card, ref.id, "RHO"))
            density = 0.0 if at is None else float(table.values[at]) * structure.mass_factor
            if density > 0.0:
                yield Material(f"{ref.card} {ref.id}", float(value), density)


def _explained(material: Material, declared: UnitSystem) -> tuple[str, dict[str, str]] | None:
    """The units in which a material is common: with both values, with a weight density, or with each value alone."""
    systems = [unit_system(name) for name in SYSTEMS if name != declared.word]
    for units in systems:
        common = material.common(units)
        if common:
            return "study.units-doubtful", {"fitting": units.name, "common": common}
    for units in (declared, *systems):
        common = material.common_weight(units)
        if common:
            factor = f"{units.length / _GRAVITY:.5g}"
            return "study.units-doubtful/weight", {"fitting": units.name, "common": common, "factor": factor}
    for of_modulus, of_density in itertools.permutations((declared, *systems), 2):
        common = _common(material.modulus_si(of_modulus), material.density_si(of_density))
        if common in _METALS:
            facts = {"of_modulus": of_modulus.name, "of_density": of_density.name, "common": common}
            return "study.units-doubtful/mixed", facts
    return None


def _common(modulus: float, density: float) -> str:
    """Name of the common material with such values in SI units; "" if there is none."""
    fits = (
        name
        for name, (e_low, e_high, rho_low, rho_high) in COMMON.items()
        if e_low <= modulus <= e_high and rho_low <= density <= rho_high
    )
    return next(fits, "")


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]
