"""Unit systems against the definitions of the units."""

from __future__ import annotations

import pytest

from femtune.errors import FemtuneError
from femtune.units import SI, unit_system


@pytest.mark.parametrize(
    ("name", "newtons"),
    [
        ("m-kg-s", 1.0),
        ("mm-t-s", 1.0),
        ("mm-kg-s", 1e-3),
        ("cm-g-s", 1e-5),
        ("in-slinch-s", 0.45359237 * 9.80665),
        ("ft-slug-s", 0.45359237 * 9.80665),
        ("ft-lbm-s", 0.45359237 * 0.3048),
    ],
)
def test_the_unit_of_force_follows(name: str, newtons: float) -> None:
    assert unit_system(name).force == pytest.approx(newtons, rel=1e-12)


def test_the_same_plate_in_two_systems() -> None:
    mm, inch = unit_system("mm-t-s"), unit_system("in-slinch-s")
    assert mm.length_from(inch) == pytest.approx(25.4)
    assert 2.0 * inch.mass_from(SI) * SI.mass_from(inch) == pytest.approx(2.0)
    # steel: 7850 kg/m3 is 7.85e-9 t/mm3 and 7.345e-4 slinch/in3
    assert 7850.0 * mm.mass_from(SI) / mm.length_from(SI) ** 3 == pytest.approx(7.85e-9)
    assert 7850.0 * inch.mass_from(SI) / inch.length_from(SI) ** 3 == pytest.approx(7.345e-4, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "hint"), [("mm-to-s", "mm-t-s"), ("m-kg-ms", "m-kg-s"), ("SI", "m-kg-s"), ("", "units =")]
)
def test_another_name_gets_a_hint(name: str, hint: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        unit_system(name)
    assert caught.value.code == "units.unknown"
    assert hint in caught.value.hint
