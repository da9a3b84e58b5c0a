"""Units of fields and which are positive by nature."""

from __future__ import annotations

import pytest

from femtune.fem.fields import FieldRef
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.field_units import field_nature
from femtune.units import unit_system


@pytest.mark.parametrize(
    ("card", "name", "metre", "millimetre", "positive"),
    [
        ("MAT1", "E", "Pa", "MPa", True),
        ("MAT1", "NU", "", "", False),
        ("MAT1", "GE", "", "", True),
        ("MAT1", "RHO", "kg/m³", "t/mm³", True),
        ("MAT9", "G44", "Pa", "MPa", True),
        ("MAT9", "G45", "Pa", "MPa", False),
        ("PSHELL", "T", "m", "mm", True),
        ("PSHELL", "NSM", "kg/m²", "t/mm²", True),
        ("PBAR", "NSM", "kg/m", "t/mm", True),
        ("PBAR", "I1", "m⁴", "mm⁴", True),
        ("PBAR", "I12", "m⁴", "mm⁴", False),
        ("PBEAM", "AB", "m²", "mm²", True),
        ("PBEAM", "N1A", "m", "mm", False),
        ("PBUSH", "K4", "N·m", "N·mm", True),
        ("PBUSH", "B1", "N·s/m", "N·s/mm", True),
        ("CONM2", "I33", "kg·m²", "t·mm²", True),
        ("CONM2", "I21", "kg·m²", "t·mm²", False),
        ("CELAS2", "K", "", "", True),
        ("GENERIC", "JOINT S1-2", "", "", False),
    ],
)
def test_units(card: str, name: str, metre: str, millimetre: str, positive: bool) -> None:
    nature = field_nature(FieldRef(card, 1, name))
    assert nature.unit_in(unit_system("m-kg-s")) == metre
    assert nature.unit_in(unit_system("mm-t-s")) == millimetre
    assert nature.positive is positive


@pytest.mark.parametrize(
    ("system", "pressure", "stiffness"),
    [
        ("mm-kg-s", "kPa", "mN/mm"),
        ("in-slinch-s", "psi", "lbf/in"),
        ("ft-slug-s", "lbf/ft²", "lbf/ft"),
        ("m-t-s", "kPa", "kN/m"),
        ("cm-g-s", "(g·cm/s²)/cm²", "(g·cm/s²)/cm"),
    ],
)
def test_forces_have_their_names(system: str, pressure: str, stiffness: str) -> None:
    units = unit_system(system)
    assert field_nature(FieldRef("MAT1", 1, "E")).unit_in(units) == pressure
    assert field_nature(FieldRef("PBUSH", 1, "K1")).unit_in(units) == stiffness


def test_every_field_of_a_material_or_section_that_is_no_angle_or_ratio_has_a_unit() -> None:
    without = {
        (kind.name, name)
        for kind in CATALOGUE.values()
        for name in kind.values
        if not field_nature(FieldRef(kind.name, 1, name)).unit_in(unit_system("m-kg-s"))
    }
    # ratios, loss factors, angles, and scalar elements, whose card does not say what they move
    ratio = {"RI", "TS", "K1", "K2", "F1", "F2", "THETA1", "NU"}
    scalar = {"CELAS2", "CELAS4", "PELAS", "CDAMP2", "CDAMP4", "PDAMP", "CMASS2", "CMASS4", "PMASS", "CONM1"}
    left = {(c, n) for c, n in without if n not in ratio and not n.startswith(("NU", "GE")) and c not in scalar}
    assert left == set()
