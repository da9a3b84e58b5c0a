"""FRFs against closed forms, by each of the three ways."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.modal.kinds import FrfKind
from femtune.model import ModelPoint, solve_modes
from femtune.model.damping import constant_damping
from femtune.model.kinds import FrfMethod
from femtune.model.response import METHODS, DampingRatios, frf, make_ports

from .models import LENGTH, SECTION, beam, chain, point

ORDER = ("viscous", "hysteretic", "modal")
every_way = pytest.mark.parametrize("method", METHODS)


def _values(
    at: ModelPoint,
    ports: tuple[list[str], list[str]],
    freq_hz: NDArray,
    method: FrfMethod,
    kind: FrfKind = "receptance",
    count: int = 60,
    damping: DampingRatios | None = None,
) -> NDArray:
    made = make_ports(at.configured, *ports)
    return np.asarray(frf(solve_modes(at, count), made, freq_hz, kind, method, damping=damping).values)


@pytest.mark.quick(4)
@every_way
@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("what", ["viscous", "hysteretic", "modal", "all"])
def test_one_mass(method: FrfMethod, kind: FrfKind, what: str) -> None:
    m, k, c, eta, zeta = 2.0, 800.0, 3.0, 0.07, 0.02
    c, eta, zeta = (
        c * (what in ("viscous", "all")),
        eta * (what in ("hysteretic", "all")),
        zeta * (what in ("modal", "all")),
    )
    at = point(chain([(-1, 0, k)], [m], [(-1, 0, c)] if c else [], eta))
    f = np.linspace(0.0, 8.0, 41)
    found = _values(at, (["1X+"], ["1X-"]), f, method, kind, 1, constant_damping(zeta))[0, 0]
    w, wn = 2 * np.pi * f, np.sqrt(k / m)
    factor = {"receptance": 1.0, "mobility": 1j * w, "accelerance": -(w**2)}[kind]
    exact = -factor / (k * (1 + 1j * eta) - m * w**2 + 1j * w * (c + 2 * zeta * wn * m))
    np.testing.assert_allclose(found, exact, rtol=1e-10, atol=1e-18)


@pytest.mark.slow
@every_way
def test_two_masses_with_a_dashpot_on_one_of_them(method: FrfMethod) -> None:
    """H21 = k₂ / ((z₁ + k₂)(z₂ + k₂) − k₂²), written out; the damping couples the modes strongly."""
    m1, m2, k1, k2, c = 1.0, 2.0, 400.0, 250.0, 15.0
    at = point(chain([(-1, 0, k1), (0, 1, k2)], [m1, m2], [(-1, 0, c)]))
    f = np.linspace(0.0, 8.0, 81)
    w = 2 * np.pi * f
    z1, z2 = k1 - m1 * w**2 + 1j * w * c, -m2 * w**2
    determinant = (z1 + k2) * (z2 + k2) - k2**2
    found = _values(at, (["1X+"], ["1X+", "2X+"]), f, method, count=2)[:, 0]
    np.testing.assert_allclose(found, [(z2 + k2) / determinant, k2 / determinant], rtol=1e-9)


@every_way
def test_three_masses(method: FrfMethod) -> None:
    """λ = 1, 4, 8: the receptance is a quotient of polynomials in ω²."""
    springs = [(-1, 0, 1.0), (-1, 1, 1.0), (-1, 2, 1.0), (0, 1, 1.0), (1, 2, 1.0), (0, 2, 3.0)]
    at = point(chain(springs, [1.0] * 3))
    f = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.6])
    x = (2 * np.pi * f) ** 2
    determinant = (1 - x) * (4 - x) * (8 - x)
    found = _values(at, (["1X+"], ["1X+", "3X+"]), f, method, count=3)[:, 0]
    np.testing.assert_allclose(found, [((3 - x) * (5 - x) - 1) / determinant, (10 - 3 * x) / determinant], rtol=1e-9)


@every_way
def test_free_beam_moves_as_a_rigid_body_at_low_frequency(method: FrfMethod) -> None:
    """Accelerance at the tip 1/m + (L/2)²/(mL²/12) = 4/m, at the other −2/m; elastic parts are of order (f/f₁)²."""
    at = beam(10)
    mass = SECTION["rho"] * SECTION["A"] * LENGTH
    first = solve_modes(at, 3).freq_hz[2]
    found = _values(at, (["1Y+"], ["1Y+", "11Y+"]), np.array([1e-4 * first]), method, "accelerance", 6)
    np.testing.assert_allclose(found[:, 0, 0], [4 / mass, -2 / mass], rtol=2e-6)


@pytest.mark.slow
@every_way
def test_rod_with_a_loss_factor(method: FrfMethod) -> None:
    """Tip receptance of a clamped rod, tan(kL)/(E*Ak) with k = ω√(ρ/E*) and E* = E(1 + iη); errors fall as h²."""
    eta, f = 0.05, np.linspace(50.0, 6000.0, 23)
    modulus = SECTION["E"] * (1 + 1j * eta)
    k = 2 * np.pi * f * np.sqrt(SECTION["rho"] / modulus)
    exact = np.tan(k * LENGTH) / (modulus * SECTION["A"] * k)
    errors = []
    for n in (30, 60):
        at = beam(n, (0,), clamped=True, GE=eta)
        found = _values(at, ([f"{n + 1}X+"], [f"{n + 1}X+"]), f, method, count=n)[0, 0]
        errors.append(np.linalg.norm(found - exact) / np.linalg.norm(exact))
    assert errors[1] < 5e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
