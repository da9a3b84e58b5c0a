"""Natural frequencies of rods, beams and rings against closed forms, with the rates at which the error falls."""

from __future__ import annotations

import numpy as np
import pytest

from structures.beams import (
    I1,
    I2,
    RHO,
    SECTION,
    SUPPORTS,
    A,
    E,
    G,
    J,
    L,
    all_but,
    bending_errors,
    orders,
    straight_line,
)
from structures.frames import bars, dense_modes, make_structure, rods


def rate(errors: list[float]) -> float:
    """Order of the last halving of the mesh."""
    return float(np.log2(abs(errors[-2]) / abs(errors[-1])))


@pytest.mark.parametrize(("consistent", "expected"), [(False, 2.0), (True, 4.0)])
def test_fixed_free_rod_stretches(consistent: bool, expected: float):
    exact = np.sqrt(E / RHO) / (4.0 * L)
    errors = []
    for n in (4, 8, 16):
        xyz, pairs = straight_line(n)
        structure = make_structure(xyz, [rods(pairs, SECTION)], consistent_mass=consistent)
        errors.append(dense_modes(structure, all_but((0,), n + 1) | {0})[0] / exact - 1.0)
    assert abs(rate(errors) - expected) < 0.1
    assert abs(errors[-1]) < 1e-3


@pytest.mark.parametrize("consistent", [False, True])
def test_fixed_free_beam_twists(consistent: bool):
    exact = np.sqrt(G * J / (RHO * (I1 + I2))) / (4.0 * L)
    errors = []
    for n in (4, 8, 16):
        xyz, pairs = straight_line(n)
        structure = make_structure(xyz, [bars(pairs, SECTION, card="CBEAM")], consistent_mass=consistent)
        errors.append(dense_modes(structure, all_but((3,), n + 1) | {3})[0] / exact - 1.0)
    assert abs(rate(errors) - 2.0) < 0.1
    assert abs(errors[-1]) < 1e-3


BEAM_CASES = [(s, p, c) for s in SUPPORTS for p in (1, 2) for c in (False, True)]


@pytest.mark.quick(5)
@pytest.mark.parametrize(("support", "plane", "consistent"), BEAM_CASES)
def test_euler_beam(support: tuple[str, str], plane: int, consistent: bool):
    errors = bending_errors(support, plane, consistent, shear=False, rotary=False)
    # lumped mass without rotary inertia costs two orders where an end can turn and move
    expected = 2.0 if "free" in support and not consistent else 4.0
    # errors of 1e-8 are half rounding
    clear = np.abs(errors[-1]) > 3e-8
    assert clear.sum() >= 2
    assert np.abs(orders(errors[:, clear]) - expected).max() < 0.3
    assert np.abs(errors[-1]).max() < (1e-5 if consistent else 1e-2)


@pytest.mark.quick(10)
@pytest.mark.parametrize("rotary", [False, True])
@pytest.mark.parametrize(("support", "plane", "consistent"), BEAM_CASES)
def test_timoshenko_beam(support: tuple[str, str], plane: int, consistent: bool, rotary: bool):
    errors = bending_errors(support, plane, consistent, shear=True, rotary=rotary)
    assert np.abs(orders(errors) - 2.0).max() < 0.15
    assert np.abs(errors[-1]).max() < (6e-4 if consistent else 8e-3)


@pytest.mark.slow
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
        f = dense_modes(structure, all_but((0, 1, 5) if in_plane else (2, 3, 4), n))
        errors.append(f[np.argmin(np.abs(f - exact))] / exact - 1.0)
    assert abs(rate(errors) - 2.0) < 0.1
    assert abs(errors[-1]) < 2e-3
