"""Bending of uniform beams in all supports: exact natural frequencies, and the errors of the bar element.

A benchmark with a known answer: the frequencies are roots of the characteristic equation of Timoshenko's beam (Euler's
where shear and rotary inertia vanish), found without a finite element.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from femtune.arrays import Reals
from femtune.fem import FieldRef, Structure
from femtune.model import Configuration
from structures.frames import Part, bars, dense_modes, make_structure, masses

E, G, RHO, A, I1, I2, J, L = 2.0e11, 8.0e10, 7800.0, 2.0e-3, 3.0e-6, 5.0e-7, 1.0e-6, 1.5
SECTION = {"E": E, "G": G, "A": A, "I1": I1, "I2": I2, "J": J, "rho": RHO}
SHEAR_FACTORS = {1: 0.85, 2: 0.3}

# what each support leaves: deflection, slope, moment, shear force that vanish at an end
ENDS = {"free": (2, 3), "clamped": (0, 1), "pinned": (0, 2)}
SUPPORTS = (
    ("free", "free"),
    ("clamped", "free"),
    ("clamped", "clamped"),
    ("clamped", "pinned"),
    ("pinned", "pinned"),
)
Support = tuple[str, str]


def orders(errors: Reals) -> Reals:
    """Orders of convergence between two meshes (2, modes), one twice as fine as the other."""
    return np.asarray(np.log2(np.abs(errors[0]) / np.abs(errors[1])))


def straight_line(n: int) -> tuple[Reals, NDArray[np.int64]]:
    """Coordinates (n + 1, 3) and pairs (n, 2) of n equal elements along x, L long."""
    x = np.linspace(0.0, L, n + 1)
    return np.stack([x, 0 * x, 0 * x], axis=1), np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)


def all_but(components: tuple[int, ...], n: int) -> set[int]:
    """DOFs to hold so that only the given components (0 to 5) of n nodes are left."""
    return {6 * i + c for i in range(n) for c in range(6) if c not in components}


def held_for_bending(support: Support, n: int, plane: int) -> set[int]:
    """DOFs to hold for bending of n elements in one plane (1 or 2) with the given supports."""
    v, theta = (1, 5) if plane == 1 else (2, 4)
    held = all_but((v, theta), n + 1)
    for end, node in zip(support, (0, n)):
        held |= {6 * node + c for c, k in ((v, 0), (theta, 1)) if k in ENDS[end]}
    return held


def exact_frequency(support: Support, near: float, inertia: float, shear: float, rotary: float) -> float:
    """Root nearest to a frequency in Hz of the characteristic equation.

    State (w, ψ, M, Q) with M = EIψ′ and Q = κAG(w′ − ψ): M′ = −Q − ρIω²ψ, Q′ = −ρAω²w. `shear` is 1/κAG and
    `rotary` is ρI; both zero is Euler's beam. Moment and shear force are counted in EI/L and EI/L², x in L.
    """
    s, m, r = shear * E * inertia / L**2, RHO * A * L**4 / (E * inertia), rotary * L**2 / (E * inertia)
    left = [k for k in range(4) if k not in ENDS[support[0]]]

    def determinant(f: float) -> float:
        w2 = (2.0 * np.pi * f) ** 2
        slope = np.array([[0, 1, 0, s], [0, 0, 1, 0], [0, -r * w2, 0, -1], [-m * w2, 0, 0, 0]], dtype=float)
        return float(np.linalg.det(expm(slope)[np.ix_(ENDS[support[1]], left)]))

    width = 0.02
    return float(brentq(determinant, near * (1.0 - width), near * (1.0 + width), xtol=1e-12 * near, rtol=1e-14))


def bending_errors(support: Support, plane: int, consistent: bool, shear: bool, rotary: bool) -> Reals:
    """(2, 3) relative errors of the first three elastic modes with 16 and 32 elements."""
    inertia = I1 if plane == 1 else I2
    found = np.array([_frequencies(n, support, plane, consistent, shear, rotary) for n in (16, 32)])
    flexibility = 1.0 / (SHEAR_FACTORS[plane] * A * G) if shear else 0.0
    exact = [exact_frequency(support, x, inertia, flexibility, rotary * RHO * inertia) for x in found[-1]]
    return np.asarray(found / exact - 1.0)


def _frequencies(n: int, support: Support, plane: int, consistent: bool, shear: bool, rotary: bool) -> Reals:
    xyz, pairs = straight_line(n)
    share = np.full(n + 1, RHO * (I1 if plane == 1 else I2) * L / n)
    share[[0, -1]] *= 0.5
    parts = [bars(pairs, {**SECTION, **({"K1": SHEAR_FACTORS[1], "K2": SHEAR_FACTORS[2]} if shear else {})})]
    parts += [masses(range(n + 1), {"M": 0.0, "I22": share, "I33": share})] if rotary else []
    f = dense_modes(make_structure(xyz, parts, consistent_mass=consistent), held_for_bending(support, n, plane))
    return np.asarray(f[f > 1e-3 * f[3]][:3])


# ----------------------------------------------------------------------------------------------------
# Three beams in line, the middle one thinner and off the axis of the others: a benchmark with known frequencies.
#
# Spans 0.3, 0.4 and 0.3 m of ten elements, breadth 0.2 m, depth 0.1 m outside and 0.05 m in the middle, 25 mm off axis,
# fixed ends, steel, consistent mass. Source: Mottershead, Link and Friswell (2011), section 6; the depths and the
# offset are recovered from their frequencies.


ELEMENTS, MIDDLE = 10, (4, 5, 6, 7)
"""Number of elements, and those of the middle beam."""
YOUNG_GPA, OFFSET_M = 210.0, 0.025
"""True values."""
TRUE_HZ = (563.90, 1030.52, 2126.51, 3001.34, 3808.26)
"""Frequencies at the true values; the fourth mode is axial."""
CLAMPED = Configuration(supports_added=((1, "126"), (11, "126"), *((n, "345") for n in range(1, 12))))
"""Both ends fixed, motion in the plane only."""
OFFSETS = tuple(FieldRef("CBAR", e, name) for e in MIDDLE for name in ("W2A", "W2B"))
"""Fields of the offset, after `with_offsets`: −a in all of them is an offset a."""
MODULI = tuple(FieldRef("CBAR", e, "E") for e in range(1, ELEMENTS + 1))
"""Fields of Young's modulus, Pa."""

_BREADTH, _DENSITY, _LENGTH = 0.2, 7860.0, 0.1


def three_beams(offset_m: float = OFFSET_M, mass_offset_m: float | None = None) -> Structure:
    """The beams as bars between grid points on the axis of the outer ones.

    Parameters
    ----------
    offset_m : of the middle beam, in the direction −y
    mass_offset_m : of its mass, where that differs from the one of its stiffness; elements 1001 … are the mass then
    """
    parts = [_part(offset_m)]
    if mass_offset_m is not None:
        parts = [_with(parts[0], rho=0.0), _with(_part(mass_offset_m), E=0.0, G=0.0)]
    xyz = [[_LENGTH * i, 0.0, 0.0] for i in range(ELEMENTS + 1)]
    return make_structure(xyz, parts, consistent_mass=True, lumped_along=0.0)


def _part(offset_m: float) -> Part:
    middle = np.isin(np.arange(1, ELEMENTS + 1), MIDDLE)
    depth = np.where(middle, 0.05, 0.1)
    E = 1e9 * YOUNG_GPA
    values: dict[str, ArrayLike] = {"E": E, "G": E / 2.6, "A": _BREADTH * depth, "I1": _BREADTH * depth**3 / 12.0,
              "I2": _BREADTH**3 * depth / 12.0, "J": 1e-5, "rho": _DENSITY}  # fmt: skip
    part = bars([[i, i + 1] for i in range(ELEMENTS)], values)
    arms = np.where(middle[:, None], [0.0, -offset_m, 0.0], 0.0)
    return Part(part.kind, part.card, part.connection, part.values, {**part.facts, "offset_a": arms, "offset_b": arms})


def _with(part: Part, **values: float) -> Part:
    return Part(part.kind, part.card, part.connection, {**part.values, **values}, part.facts)


# ----------------------------------------------------------------------------------------------------
# A structure of bars whose modes, all that there are, commercial Nastran lists.


def solar_array() -> tuple[Structure, list[int]]:
    """A mast of four bars with a cross bar at its end, consistent mass, and its held DOFs.

    Superelements 300 and 400 of ``with_se.dat``, a deck of pyYeti, on their fixed interface; commercial Nastran lists
    all of their modes, `SOLAR_ARRAY` (Hz).
    """
    xyz = [[150.0, -30.0, 150.0], *([150.0, -y, 150.0] for y in (330.0, 630.0, 930.0, 1230.0))]
    xyz += [[-150.0, -1230.0, 150.0], [450.0, -1230.0, 150.0]]
    section = {"E": 6.894e7, "G": 2.62e7, "A": 28.274, "I1": 63.617, "I2": 63.617, "J": 127.23, "rho": 2.74e-6}
    pairs = [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [4, 6]]
    part = bars(pairs, section, orientation=(0.0, 0.0, 1.0))
    return make_structure(xyz, [part], consistent_mass=True), list(range(6))


SOLAR_ARRAY = [
    1.651802, 1.676309, 7.026223, 10.92276, 14.00951, 25.15967, 42.26025, 46.96917, 53.66366, 68.26115, 93.78841,
    101.0555, 171.3940, 182.3487, 235.4550, 254.2636, 276.0296, 339.3789, 435.3642, 453.0683, 516.0363, 557.4849,
    663.5831, 823.3283, 934.7117, 948.3007, 2783.779, 4122.540, 4547.438, 5953.975, 6123.915,
]  # fmt: skip
