"""Unit systems: a deck has no units, so the study declares its system and tests are converted to it."""

from __future__ import annotations

from dataclasses import dataclass

from femtune.errors import FemtuneError, did_you_mean

_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
_POUND_FORCE = 4.4482216152605
_MASSES = {
    "kg": 1.0,
    "g": 1e-3,
    "t": 1e3,
    "lbm": 0.45359237,
    "slug": _POUND_FORCE / 0.3048,
    "slinch": _POUND_FORCE / 0.0254,
}


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
        """length-mass-s; the name where it is none of the systems that have a word."""
        lengths = [name for name, size in _LENGTHS.items() if _same(size, self.length)]
        masses = [name for name, size in _MASSES.items() if _same(size, self.mass)]
        return f"{lengths[0]}-{masses[0]}-s" if lengths and masses else self.name


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-6 * abs(b)


SI = UnitSystem("m-kg-s", 1.0, 1.0)


def unit_system(name: str) -> UnitSystem:
    """The system called ``length-mass-s``, for example "m-kg-s", "mm-t-s", "mm-kg-s", "in-slinch-s".

    Raises
    ------
    FemtuneError : ``units.unknown``, listing the lengths and masses that are known
    """
    parts = name.split("-")
    if len(parts) == 3 and parts[0] in _LENGTHS and parts[1] in _MASSES and parts[2] == "s":
        return UnitSystem(name, _LENGTHS[parts[0]], _MASSES[parts[1]])
    known = [f"{length}-{mass}-s" for length in _LENGTHS for mass in _MASSES]
    raise FemtuneError(
        "units.unknown",
        values={"lengths": ", ".join(_LENGTHS), "masses": ", ".join(_MASSES)},
        hint=did_you_mean(name, known) if len(parts) == 3 else 'write for example units = "m-kg-s"',
        name=name,
    )
