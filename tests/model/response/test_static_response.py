"""Static response, free structures among them, with derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.model.response import Signal, make_ports, static_response

from .models import LENGTH, SECTION, beam, chain, configured, point

FACTORS = {"k": ("K", 1), "l": ("K", 2), "m": ("M", 2)}
PAIR = Signal(parse_dof("99X+"), {parse_dof("1X+"): -1.0, parse_dof("3X+"): 1.0}, "pulled apart")


def test_three_springs_of_the_static_example() -> None:
    """k₁ and k₃ to ground, k₂ between; u = (9, 4)/14.8 under (1, 0) for (1.2, 0.8, 1)."""
    at = point(
        chain([(-1, 0, 1.2), (0, 1, 0.8), (-1, 1, 1.0)], [1.0, 1.0]), {"a": ("K", 1), "b": ("K", 2), "c": ("K", 3)}
    )
    found = static_response(at, make_ports(at.configured, ["1X+"], ["1X+", "2X+"]))
    u = np.array([9.0, 4.0]) / 14.8
    np.testing.assert_allclose(found.values[:, 0], u, rtol=1e-13)
    flexibility = np.array([[9.0, 4.0], [4.0, 10.0]]) / 14.8
    forces = np.array([[1.2 * u[0], 0.8 * (u[0] - u[1]), 0.0], [0.0, 0.8 * (u[1] - u[0]), u[1]]])
    # factors on k: dK/dx u are the spring forces
    np.testing.assert_allclose(found.gradient[:, 0, :], -flexibility @ forces, rtol=1e-12)
    assert not found.inertia_relief


def test_clamped_beam_under_a_tip_load() -> None:
    """PL³/3EI and PL²/2EI, which the beam element gives exactly."""
    at = beam(4, clamped=True)
    found = static_response(at, make_ports(at.configured, ["5Y+"], ["5Y+", "5RZ+"]))
    stiffness = SECTION["E"] * SECTION["I1"]
    np.testing.assert_allclose(
        found.values[:, 0], [LENGTH**3 / (3 * stiffness), LENGTH**2 / (2 * stiffness)], rtol=1e-9
    )


def test_a_free_chain_pulled_apart() -> None:
    """Springs stretch by 1/k each; the motion has no mean, weighed by the masses."""
    at = point(chain([(0, 1, 4.0), (1, 2, 5.0)], [1.0, 2.0, 3.0]), FACTORS)
    found = static_response(at, make_ports(at.configured, [PAIR], ["1X+", "2X+", "3X+"]))
    u = found.values[:, 0]
    np.testing.assert_allclose(np.diff(u), [0.25, 0.2], rtol=1e-10)
    assert u @ [1.0, 2.0, 3.0] == pytest.approx(0.0, abs=1e-12)
    assert found.inertia_relief
    assert found.input_names == ("pulled apart",)


@pytest.mark.slow
@pytest.mark.parametrize("free", [True, False])
def test_gradient_by_differences(free: bool) -> None:
    springs = [(0, 1, 4.0), (1, 2, 5.0)] if free else [(0, 1, 4.0), (1, 2, 5.0), (-1, 2, 3.0)]
    model = configured(chain(springs, [1.0, 2.0, 3.0]), FACTORS)
    ports = make_ports(model, [PAIR], ["1X+", "3X-"])
    found = static_response(model.at(np.zeros(3)), ports)
    h = 1e-4
    for i in range(3):
        a, b, c, d = (static_response(model.at(s * h * np.eye(3)[i]), ports).values for s in (1, -1, 2, -2))
        np.testing.assert_allclose(found.gradient[..., i], (8 * (a - b) - (c - d)) / (12 * h), rtol=1e-7, atol=1e-9)


def test_gradient_by_complex_step() -> None:
    model = configured(chain([(-1, 0, 4.0), (0, 1, 5.0)], [1.0, 2.0, 3.0][:2]), FACTORS)
    ports = make_ports(model, ["2X+"], ["1X+", "2X+"])
    found = static_response(model.at(np.zeros(3)), ports)
    for i in range(3):
        stepped = static_response(model.at(1e-30j * np.eye(3)[i]), ports).values.imag / 1e-30
        np.testing.assert_allclose(found.gradient[..., i], stepped, rtol=1e-9, atol=1e-18)


def test_a_load_that_nothing_holds_is_refused_with_the_motions_that_are_free() -> None:
    at = beam(4)
    with pytest.raises(FemtuneError) as caught:
        static_response(at, make_ports(at.configured, ["5Y+"], ["1Y+"]))
    assert caught.value.code == "response.static-free"
    assert caught.value.values == {"unconstrained motions": "Y, RZ"}


def test_a_free_beam_bent_in_three_points() -> None:
    """Deflection of the middle below the ends: PL³/48EI for a load of P = 2 between two supports."""
    at = beam(4)
    bend = Signal(parse_dof("9Y+"), {parse_dof("1Y+"): 1.0, parse_dof("5Y+"): 1.0, parse_dof("3Y+"): -2.0})
    found = static_response(at, make_ports(at.configured, [bend], ["1Y+", "3Y+", "5Y+"]))
    ends, middle = 0.5 * (found.values[0, 0] + found.values[2, 0]), found.values[1, 0]
    assert ends - middle == pytest.approx(2.0 * LENGTH**3 / (48 * SECTION["E"] * SECTION["I1"]), rel=1e-8)
