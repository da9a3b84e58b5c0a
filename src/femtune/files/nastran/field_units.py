"""Physical nature of fields: their unit in a system of units, and whether they must be positive."""

from __future__ import annotations

import re
from dataclasses import dataclass

from femtune.fem.fields import FieldRef
from femtune.units import UnitSystem

_LENGTH = "L"
_AREA = "L²"
_SECOND_MOMENT = "L⁴"
_MASS = "M"
_MASS_PER_LENGTH = "M/L"
_MASS_PER_AREA = "M/L²"
_DENSITY = "M/L³"
_INERTIA = "M·L²"
_PRESSURE = "P"
_STIFFNESS = "F/L"
_ROTATIONAL_STIFFNESS = "F·L"
_DAMPING = "F·s/L"
_ROTATIONAL_DAMPING = "F·L·s"
_NONE = ""
_OPEN = ""
"""Unit of a field that may act on a translation or on a rotation."""


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


_FORCES = ((1.0, "N"), (1e3, "kN"), (1e-3, "mN"), (4.4482216152605, "lbf"))
_PRESSURES = {("N", "m"): "Pa", ("N", "mm"): "MPa", ("mN", "mm"): "kPa", ("kN", "m"): "kPa", ("lbf", "in"): "psi"}

_ANY = FieldNature(_OPEN, False)

# card, field (regular expressions), unit, positive; the first match applies
_TABLE = (
    (r"MAT1|MAT8|MAT11", r"[EG]\w*(?<!GE)", _PRESSURE, True),
    (r"MAT2|MAT9", r"G(\d)\1", _PRESSURE, True),
    (r"MAT2|MAT9", r"G\d\d", _PRESSURE, False),
    (r"MAT\d+", r"RHO", _DENSITY, True),
    (r"\w+", r"GE\d?", _NONE, True),
    (r"PARAM", r"G", _NONE, True),
    (r"MODAL", r"ZETA", _NONE, True),
    (r"PSHELL", r"T", _LENGTH, True),
    (r"PSHELL", r"RI|TS", _NONE, True),
    (r"CQUAD4|CTRIA3|CQUADR|CTRIAR|CQUAD8|CTRIA6|PCOMPG?", r"T\d*", _LENGTH, True),
    (r"PSHEAR|PTUBE", r"T|OD", _LENGTH, True),
    (r"CQUAD4|CTRIA3|CQUADR|CTRIAR|CQUAD8|CTRIA6", r"ZOFFS", _LENGTH, False),
    (r"PCOMPG?", r"Z0", _LENGTH, False),
    (r"PSHELL|PSHEAR|PCOMPG?", r"NSM", _MASS_PER_AREA, True),
    (r"PBARL|PBEAML", r"DIM\d+B?", _LENGTH, True),
    (r"P\w+|CONROD", r"NSMB?", _MASS_PER_LENGTH, True),
    (r"PBEAM", r"NSI[AB]", "M·L", True),
    (r"PBAR|PBEAM|PBEND|PBCOMP|CONROD|PROD", r"AB?", _AREA, True),
    (r"PBAR|PBEAM|PBEND|PBCOMP|CONROD|PROD", r"(I1|I2|J)B?", _SECOND_MOMENT, True),
    (r"PBAR|PBEAM|PBCOMP", r"I12B?", _SECOND_MOMENT, False),
    (r"PBAR|PBEAM|PBEND|PBCOMP", r"K[12]", _NONE, True),
    (r"PBEAM|PBCOMP", r"[MN][12][AB]?", _LENGTH, False),
    (r"CBAR|CBEAM", r"W\d[AB]", _LENGTH, False),
    (r"PBUSH", r"K[123]", _STIFFNESS, True),
    (r"PBUSH", r"K[456]", _ROTATIONAL_STIFFNESS, True),
    (r"PBUSH", r"B[123]", _DAMPING, True),
    (r"PBUSH", r"B[456]", _ROTATIONAL_DAMPING, True),
    (r"PGAP", r"K[ABT]", _STIFFNESS, True),
    (r"PWELD", r"D", _LENGTH, True),
    (r"PFAST", r"KT[123]", _STIFFNESS, True),
    (r"PFAST", r"KR[123]", _ROTATIONAL_STIFFNESS, True),
    (r"PFAST", r"MASS", _MASS, True),
    (r"PBUSH1D", r"K", _STIFFNESS, True),
    (r"PBUSH1D", r"C", _DAMPING, True),
    (r"PVISC", r"CE", _DAMPING, True),
    (r"PVISC", r"CR", _ROTATIONAL_DAMPING, True),
    # for a translation or for a rotation: the card does not determine it
    (r"CELAS2|CELAS4|PELAS|CDAMP2|CDAMP4|PDAMP|CMASS2|CMASS4|PMASS", r"[KBM]", _OPEN, True),
    (r"CONM2", r"M", _MASS, True),
    (r"CONM2", r"I(\d)\1", _INERTIA, True),
    (r"CONM2", r"I\d\d", _INERTIA, False),
    (r"CONM1", r"M([123])\1", _MASS, True),
    (r"CONM1", r"M([456])\1", _INERTIA, True),
    (r"STIFFNESS|MASS|VISCOUS", r"", _NONE, True),
)


def field_nature(ref: FieldRef) -> FieldNature:
    """Nature of a field of a deck; without a unit and not positive if it is unknown.

    Examples
    --------
    >>> from femtune.units import unit_system
    >>> field_nature(FieldRef("MAT1", 1, "E")).unit_in(unit_system("mm-t-s"))
    'MPa'
    """
    for card, name, unit, positive in _TABLE:
        if re.fullmatch(card, ref.card) and re.fullmatch(name, ref.name):
            return FieldNature(unit, positive)
    return _ANY
