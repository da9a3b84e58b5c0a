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


@pytest.mark.parametrize(
    ("name", "length", "force"),
    [
        ("in-lbf-s", 0.0254, 4.4482216152605),
        ("kip-in-s", 0.0254, 4448.2216152605),
        ("in-kip-s", 0.0254, 4448.2216152605),
        ("kip-ft-s", 0.3048, 4448.2216152605),
        ("in-lbf-s2/in-s", 0.0254, 4.4482216152605),
        ("mm-N-s", 1e-3, 1.0),
        ("m-kN-s", 1.0, 1e3),
    ],
)
def test_a_system_named_by_its_force(name: str, length: float, force: float) -> None:
    found = unit_system(name)
    assert (found.length, found.force) == pytest.approx((length, force), rel=1e-12)
    # a body of weight 1 lbf has a mass of 1/386.0886 lbf s2/in: standard gravity in in/s2
    assert unit_system("in-lbf-s").mass / unit_system("in-lbm-s").mass == pytest.approx(386.0886, rel=1e-6)


def test_pound_systems_have_the_same_size_by_either_name() -> None:
    for one, other in (("in-lbf-s", "in-slinch-s"), ("ft-lbf-s", "ft-slug-s"), ("mm-N-s", "mm-t-s")):
        assert unit_system(one).mass == pytest.approx(unit_system(other).mass, rel=1e-12)
        assert unit_system(one).word == unit_system(other).word


@pytest.mark.parametrize("name", ["lbf-lbf-s", "in-lbf", "lbf-s2/in-s", "in-lbf-s2/in", "kip-s", "in-foo-s"])
def test_what_is_no_system_of_a_force_is_refused(name: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        unit_system(name)
    assert caught.value.code == "units.unknown"
