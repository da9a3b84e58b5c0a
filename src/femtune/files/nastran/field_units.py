"""Physical nature of fields: their unit in a system of units, and whether they must be positive."""

from __future__ import annotations

import re
from dataclasses import dataclass

from femtune.fem.fields import FACTORS, FieldRef
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.units import POUND_FORCE, UnitSystem


@dataclass(frozen=True)
class FieldNature:
    """Unit of a field in letters F, L, M, P (force, length, mass, pressure), and whether it cannot be negative."""

    unit: str
    positive: bool

    def unit_in(self, system: UnitSystem) -> str:
        """Text of the unit; "" for a number without one, and if the card does not determine it."""
        length, mass = system.word.split("-")[:2] if system.word.count("-") == 2 else ("", "")
        if not self.unit or not length:
            return ""
        force = next((name for size, name in _FORCES if abs(system.force / size - 1.0) < 1e-6), f"({mass}·{length}/s²)")
        pressure = _PRESSURES.get((force, length), f"{force}/{length}²")
        names = {"F": force, "L": length, "M": mass, "P": pressure}
        return re.sub("[FLMP]", lambda letter: names[letter[0]], self.unit)


_FORCES = ((1.0, "N"), (1e3, "kN"), (1e-3, "mN"), (POUND_FORCE, "lbf"))
_PRESSURES = {("N", "m"): "Pa", ("N", "mm"): "MPa", ("mN", "mm"): "kPa", ("kN", "m"): "kPa", ("lbf", "in"): "psi"}

_OF_THE_MODEL = {("PARAM", "G"): "1", ("MODAL", "ZETA"): "1", **{(factor, ""): "1" for factor in FACTORS}}
"""Units of values that no card of the catalogue has, as `CardKind.units`."""


def field_nature(ref: FieldRef) -> FieldNature:
    """Nature of a field of a deck; without a unit and not positive if it is unknown.

    Examples
    --------
    >>> from femtune.units import unit_system
    >>> field_nature(FieldRef("MAT1", 1, "E")).unit_in(unit_system("mm-t-s"))
    'MPa'
    """
    kind = CATALOGUE.get(ref.card)
    unit = _OF_THE_MODEL.get((ref.card, ref.name), "" if kind is None else kind.unit(ref.name))
    if not unit:
        return FieldNature("", False)
    positive = not unit.startswith("±")
    return FieldNature("" if unit in ("1", "?") else unit.removeprefix("±"), positive)
