"""Natural frequencies of rods, beams and rings against closed forms, with the rates at which the error falls."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from femtune.testing.structures import bars, dense_modes, make_structure, masses, rods

E, G, RHO, A, I1, I2, J, L = 2.0e11, 8.0e10, 7800.0, 2.0e-3, 3.0e-6, 5.0e-7, 1.0e-6, 1.5
SECTION = {"E": E, "G": G, "A": A, "I1": I1, "I2": I2, "J": J, "rho": RHO}

# what each support leaves: deflection, slope, moment, shear force that vanish at an end
ENDS = {"free": (2, 3), "clamped": (0, 1), "pinned": (0, 2)}
SUPPORTS = [("free", "free"), ("clamped", "free"), ("clamped", "clamped"), ("clamped", "pinned"), ("pinned", "pinned")]


def rate(errors: list[float]) -> float:
    """Order of the last halving of the mesh."""
    return float(np.log2(abs(errors[-2]) / abs(errors[-1])))


def rates(errors: np.ndarray) -> np.ndarray:
    """Orders between two meshes (2, modes), one twice as fine as the other."""
    return np.asarray(np.log2(np.abs(errors[0]) / np.abs(errors[1])))


def line(n: int) -> tuple[np.ndarray, np.ndarray]:
    x = np.linspace(0.0, L, n + 1)
    return np.stack([x, 0 * x, 0 * x], axis=1), np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)


def only(components: tuple[int, ...], n: int) -> set[int]:
    """Held DOFs such that only the given components of n nodes are left."""
    return {6 * i + c for i in range(n) for c in range(6) if c not in components}


@pytest.mark.parametrize(("consistent", "expected"), [(False, 2.0), (True, 4.0)])
def test_fixed_free_rod_stretches(consistent: bool, expected: float):
    exact = np.sqrt(E / RHO) / (4.0 * L)
    errors = []
    for n in (4, 8, 16):
        xyz, pairs = line(n)
        structure = make_structure(xyz, [rods(pairs, SECTION)], consistent_mass=consistent)
        errors.append(dense_modes(structure, only((0,), n + 1) | {0})[0] / exact - 1.0)
    assert abs(rate(errors) - expected) < 0.1
    assert abs(errors[-1]) < 1e-3


@pytest.mark.parametrize("consistent", [False, True])
def test_fixed_free_beam_twists(consistent: bool):
    exact = np.sqrt(G * J / (RHO * (I1 + I2))) / (4.0 * L)
    errors = []
    for n in (4, 8, 16):
        xyz, pairs = line(n)
        structure = make_structure(xyz, [bars(pairs, SECTION, card="CBEAM")], consistent_mass=consistent)
        errors.append(dense_modes(structure, only((3,), n + 1) | {3})[0] / exact - 1.0)
    assert abs(rate(errors) - 2.0) < 0.1
    assert abs(errors[-1]) < 1e-3


def hold(support: tuple[str, str], n: int, plane: int) -> set[int]:
    """DOFs to hold for bending in one plane with the given supports."""
    v, theta = (1, 5) if plane == 1 else (2, 4)
    held = only((v, theta), n + 1)
    for end, node in zip(support, (0, n)):
        held |= {6 * node + c for c, k in ((v, 0), (theta, 1)) if k in ENDS[end]}
    return held


def exact_frequency(support: tuple[str, str], near: float, inertia: float, shear: float, rotary: float) -> float:
    """Root nearest to a frequency in Hz of the characteristic equation of a Timoshenko beam.

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


BEAM_CASES = [(s, p, c) for s in SUPPORTS for p in (1, 2) for c in (False, True)]


def beam_errors(support: tuple[str, str], plane: int, consistent: bool, shear: bool, rotary: bool) -> np.ndarray:
    """(2, 3) relative errors of the first three elastic modes with 16 and 32 elements."""
    inertia, factor = (I1, 0.85) if plane == 1 else (I2, 0.3)
    found = []
    for n in (16, 32):
        xyz, pairs = line(n)
        share = np.full(n + 1, RHO * inertia * L / n)
        share[[0, -1]] *= 0.5
        parts = [bars(pairs, {**SECTION, **({"K1": 0.85, "K2": 0.3} if shear else {})})]
        parts += [masses(range(n + 1), {"M": 0.0, "I22": share, "I33": share})] if rotary else []
        f = dense_modes(make_structure(xyz, parts, consistent_mass=consistent), hold(support, n, plane))
        found.append(f[f > 1e-3 * f[3]][:3])
    flexibility = 1.0 / (factor * A * G) if shear else 0.0
    exact = [exact_frequency(support, x, inertia, flexibility, rotary * RHO * inertia) for x in found[-1]]
    return np.array(found) / exact - 1.0


@pytest.mark.parametrize(("support", "plane", "consistent"), BEAM_CASES)
def test_euler_beam(support: tuple[str, str], plane: int, consistent: bool):
    errors = beam_errors(support, plane, consistent, shear=False, rotary=False)
    # lumped mass without rotary inertia costs two orders where an end can turn and move
    expected = 2.0 if "free" in support and not consistent else 4.0
    # errors of 1e-8 are half rounding
    clear = np.abs(errors[-1]) > 3e-8
    assert clear.sum() >= 2
    assert np.abs(rates(errors[:, clear]) - expected).max() < 0.3
    assert np.abs(errors[-1]).max() < (1e-5 if consistent else 1e-2)


@pytest.mark.parametrize("rotary", [False, True])
@pytest.mark.parametrize(("support", "plane", "consistent"), BEAM_CASES)
def test_timoshenko_beam(support: tuple[str, str], plane: int, consistent: bool, rotary: bool):
    errors = beam_errors(support, plane, consistent, shear=True, rotary=rotary)
    assert np.abs(rates(errors) - 2.0).max() < 0.15
    assert np.abs(errors[-1]).max() < (6e-4 if consistent else 8e-3)


@pytest.mark.parametrize("in_plane", [True, False])
@pytest.mark.parametrize("consistent", [False, True])
def test_ring(in_plane: bool, consistent: bool):
    """Inextensional ring: Love's formulas, in plane and out of plane (torsion without its own inertia)."""
    R, n_wave = 0.8, 2
    stiff = {**SECTION, "A": 1e4 * A, "rho": 1e-4 * RHO}
    numerator = n_wave**2 * (n_wave**2 - 1) ** 2
    if in_plane:
        square = E * I1 / (RHO * A * R**4) * numerator / (n_wave**2 + 1)
    else:
        square = E * I2 / (RHO * A * R**4) * numerator / (n_wave**2 + E * I2 / (G * J))
    exact = np.sqrt(square) / (2.0 * np.pi)
    errors = []
    for n in (16, 32, 64):
        angle = 2.0 * np.pi * np.arange(n) / n
        xyz = R * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        pairs = np.stack([np.arange(n), (np.arange(n) + 1) % n], axis=1)
        # plane 1 is the ring's own plane: v points outwards
        part = bars(pairs, stiff)
        part.facts["orientation"][:] = xyz
        structure = make_structure(xyz, [part], consistent_mass=consistent)
        f = dense_modes(structure, only((0, 1, 5) if in_plane else (2, 3, 4), n))
        errors.append(f[np.argmin(np.abs(f - exact))] / exact - 1.0)
    assert abs(rate(errors) - 2.0) < 0.1
    assert abs(errors[-1]) < 2e-3
