"""Unit systems: a deck has no units, so the study declares its system and tests are converted to it."""

from __future__ import annotations

import re
from dataclasses import dataclass

from femtune.errors import FemtuneError, did_you_mean

_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
POUND_FORCE = 4.4482216152605
"""lbf in newtons, exact by definition: 0.45359237 kg times the standard gravity of 9.80665 m/s²."""
_MASSES = {
    "kg": 1.0,
    "g": 1e-3,
    "t": 1e3,
    "lbm": 0.45359237,
    "slug": POUND_FORCE / 0.3048,
    "slinch": POUND_FORCE / 0.0254,
}


_FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "lbf": POUND_FORCE, "kip": 1e3 * POUND_FORCE}
_OF_FORCE = re.compile(rf"(?P<force>{'|'.join(_FORCES)})[-*·.]?s(?:2|\^2|²)/(?P<length>{'|'.join(_LENGTHS)})")
"""A unit of mass that is written as force·s²/length, such as lbf-s2/in."""


@dataclass(frozen=True)
class UnitSystem:
    """A coherent system: length and mass in SI units, time in seconds; force = mass·length/s².

    `length` and `mass` are the size of one unit in metres and kilograms.
    """

    name: str
    length: float
    mass: float

    @property
    def force(self) -> float:
        """One unit of force in newtons."""
        return self.mass * self.length

    def length_from(self, other: UnitSystem) -> float:
        """Factor that turns a length of `other` into one of this system."""
        return other.length / self.length

    def mass_from(self, other: UnitSystem) -> float:
        """Factor that turns a mass of `other` into one of this system."""
        return other.mass / self.mass

    @property
    def word(self) -> str:
        """length-mass-s, or the name of a system that has no such word."""
        lengths = [name for name, size in _LENGTHS.items() if _same(size, self.length)]
        masses = [name for name, size in _MASSES.items() if _same(size, self.mass)]
        return f"{lengths[0]}-{masses[0]}-s" if lengths and masses else self.name


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-6 * abs(b)


SI = UnitSystem("m-kg-s", 1.0, 1.0)


def _by_force(name: str) -> UnitSystem | None:
    """The system of a length and a force, or None; lbm and lbf are never confused."""
    if spelled := _OF_FORCE.search(name):
        rest = name.replace(spelled[0], "mass").split("-")
        force, per, length = spelled["force"], spelled["length"], rest[0]
        if rest[1:] == ["mass", "s"] and length in _LENGTHS:
            return UnitSystem(name, _LENGTHS[length], _FORCES[force] / _LENGTHS[per])
        return None
    first, _, second = name.removesuffix("-s").partition("-")
    length, force = (first, second) if first in _LENGTHS else (second, first)
    if not name.endswith("-s") or length not in _LENGTHS or force not in _FORCES:
        return None
    return UnitSystem(name, _LENGTHS[length], _FORCES[force] / _LENGTHS[length])


def unit_system(name: str) -> UnitSystem:
    """The system called ``length-mass-s``, for example "m-kg-s", "mm-t-s", "mm-kg-s", "in-slinch-s".

    A force may replace the mass, before or after the length: in "in-lbf-s" and "kip-ft-s" the unit of mass is lbf·s²/in
    and kip·s²/ft, with which force = mass·length/s². The mass may also be written as "in-lbf-s2/in-s".

    Raises
    ------
    FemtuneError : ``units.unknown``, listing the lengths and masses that are known
    """
    parts = name.split("-")
    if len(parts) == 3 and parts[0] in _LENGTHS and parts[1] in _MASSES and parts[2] == "s":
        return UnitSystem(name, _LENGTHS[parts[0]], _MASSES[parts[1]])
    if (system := _by_force(name)) is not None:
        return system
    known = [f"{length}-{mass}-s" for length in _LENGTHS for mass in _MASSES]
    raise FemtuneError(
        "units.unknown",
        values={"lengths": ", ".join(_LENGTHS), "masses": ", ".join(_MASSES), "forces": ", ".join(_FORCES)},
        hint=did_you_mean(name, known) if len(parts) == 3 else 'write for example units = "m-kg-s"',
        name=name,
    )


def force_unit(units: UnitSystem) -> str:
    """Name of the unit of force: N, kN, mN or lbf where it is one of these, else mass.length/s2."""
    for name, size in (("N", 1.0), ("mN", 1e-3), ("kN", 1e3), ("lbf", 4.4482216152605)):
        if abs(units.force / size - 1.0) < 1e-12:
            return name
    length, mass, _ = units.name.split("-")
    return f"{mass}.{length}/s2"


_PER_TIME = {"receptance": "", "mobility": "/s", "accelerance": "/s²"}


def frf_unit(kind: str, units: UnitSystem) -> str:
    """Unit of a function between a force and a translation: "m/s²/N"."""
    force = force_unit(units)
    length = units.name.split("-", maxsplit=1)[0]
    return f"{length}{_PER_TIME[kind]}/{force if '/' not in force else f'({force})'}"
