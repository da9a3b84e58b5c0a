"""Labels of units of many programs: their size and kind, by hand."""

from __future__ import annotations

import math

import pytest

from femtune.unit_labels import frequency_factor, meanings, time_factor, unit_label

G, LBF, INCH = 9.80665, 4.4482216152605, 0.0254
MOTION = {
    "G's": 9.80665,
    "ms-2": 1.0,
    "mms^-2": 1e-3,
    "ms-1": 1.0,
    "m": 1.0, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mil": 1e-3 * INCH, "Inches": INCH,
    "mm/s": 1e-3, "m/sec": 1.0, "ips": INCH, "in/s": INCH, "µm/s": 1e-6,
    "m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "m/s**2": 1.0, "(m/s²)": 1.0, "m s-2": 1.0, "m/s/s": 1.0, "M/S2": 1.0,
    "µm/s2": 1e-6, "mil/s2": 1e-3 * INCH, "in/sec^2": INCH, "ft/s2": 0.3048,
    "g": G, "G": G, "g's": G, "Gs": G, "gn": G, "mg": 1e-3 * G, "gal": 0.01, "Gal": 0.01, "m/s2 RMS": 1.0,
    "grms": G, "g(rms)": G, "m/s² [peak]": 1.0,
}  # fmt: skip
FORCES = {
    "uN": 1e-6, "N": 1.0, "kN": 1e3, "KN": 1e3, "mN": 1e-3, "MN": 1e6, "daN": 10.0, "kgf": G, "kp": G,
    "lbf": LBF, "LB": LBF,
    "kip": 1e3 * LBF, "ozf": LBF / 16, "dyn": 1e-5, "tonf": 1e3 * G, "klbf": 1e3 * LBF, "N-rms": 1.0}  # fmt: skip
RATIOS = {
    "g/N": (G, "accelerance"), "G/LBF": (G / LBF, "accelerance"), "m/s^2/N": (1.0, "accelerance"),
    "(m/s²)/N": (1.0, "accelerance"), "m/(s²·N)": (1.0, "accelerance"), "in/(lbf-sec^2)": (INCH / LBF, "accelerance"),
    "1/kg": (1.0, "accelerance"), "mm/s/N": (1e-3, "mobility"), "(m/s)/kgf": (1.0 / G, "mobility"),
    "[m/s²]/[N]": (1.0, "accelerance"), "g (peak)/N": (G, "accelerance"),
    "µm/N": (1e-6, "receptance"), "mm/kN": (1e-6, "receptance"), "m s^-2 N^-1": (1.0, "accelerance"),
}  # fmt: skip
KINDS = ("receptance", "mobility", "accelerance")


@pytest.mark.parametrize(("label", "size"), MOTION.items())
def test_motion(label: str, size: float) -> None:
    found = unit_label(label)
    assert found is not None
    assert found.factor == pytest.approx(size, rel=1e-12)
    assert found.dimension[:2] == (1, 0)
    assert found.motion in ("displacement", "velocity", "acceleration")


@pytest.mark.parametrize(("label", "size"), FORCES.items())
def test_force(label: str, size: float) -> None:
    found = unit_label(label)
    assert found is not None
    assert (found.factor, found.is_force) == (pytest.approx(size, rel=1e-12), True)


@pytest.mark.parametrize(("label", "wanted"), RATIOS.items())
def test_motion_over_force(label: str, wanted: tuple[float, str]) -> None:
    found = unit_label(label)
    assert found is not None
    assert found.factor == pytest.approx(wanted[0], rel=1e-12)
    assert found.dimension == (1, -1, -KINDS.index(wanted[1]))


@pytest.mark.parametrize(
    "label", ["", "NONE", "mV", "V", "EU", "dB", "m/", "/s", "m//s", "(m", "furlong", "1e5", "m^99"]
)
def test_labels_that_say_nothing_or_are_not_understood(label: str) -> None:
    assert unit_label(label) is None


def test_axes() -> None:
    assert frequency_factor("rad/s") == pytest.approx(1.0 / (2.0 * math.pi))
    assert frequency_factor("deg/s") == pytest.approx(1.0 / 360.0)
    assert [frequency_factor(x) for x in ("Hz", "kHz", "1/s", "CPS", "m/s", "s")] == [1.0, 1e3, 1.0, 1.0, None, None]
    assert [frequency_factor(x) for x in ("rpm", "1/min", "U/min")] == [pytest.approx(1 / 60)] * 3
    assert [time_factor(x) for x in ("s", "ms", "sec", "min", "Hz")] == [1.0, 1e-3, 1.0, 60.0, None]


def test_several_meanings() -> None:
    """A gram in a unit of force, and a product behind a quotient."""
    assert (1e-5, (0, 1, 0)) in [(pytest.approx(m.factor), m.dimension) for m in meanings("g.cm/s2")]
    assert (0, 1, 0) in [m.dimension for m in meanings("kg.m/s2")]
    assert (1, 1, 0) in [m.dimension for m in meanings("lbm.ft/s2.ft")]
