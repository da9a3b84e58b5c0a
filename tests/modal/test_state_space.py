"""StateSpace: evaluation, poles and modes against closed forms and scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import freqresp

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import StateSpace, freq_and_damping, pole_of, system_modes

_LINES = np.linspace(0.5, 30.0, 41)
_Y, _U = DofSet.parse(["1X+", "2X+"]), DofSet.parse(["2X+"])


def _two_masses(**facts: Any) -> StateSpace:
    """Receptances of two unit masses between springs of 1000, 1500, 1200 with a little viscous damping."""
    K = np.array([[2500.0, -1500.0], [-1500.0, 2700.0]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -2e-4 * K]])
    B = np.array([[0.0], [0.0], [0.0], [1.0]])
    parts = {"A": A, "B": B, "C": np.eye(2, 4), "D": np.zeros((2, 1))}
    return StateSpace(**({**parts, "responses": _Y, "references": _U, "kind": "receptance"} | facts))


def test_frf_is_the_inverse_dynamic_stiffness() -> None:
    K = np.array([[2500.0, -1500.0], [-1500.0, 2700.0]])
    omega = 2 * np.pi * _LINES[:, None, None]
    wanted = np.linalg.inv(K * (1 + 2e-4j * omega) - omega**2 * np.eye(2))[:, :, 1]
    np.testing.assert_allclose(_two_masses().frf(_LINES).values[:, 0], wanted.T, rtol=1e-10)


def test_frf_agrees_with_scipy_where_there_is_a_direct_term() -> None:
    one = _two_masses(D=np.array([[0.3], [-2.0]]))
    _, wanted = freqresp((one.A, one.B, one.C[1:], one.D[1:]), 2 * np.pi * _LINES)
    np.testing.assert_allclose(one.frf(_LINES).values[1, 0], wanted, rtol=1e-9)


def test_a_sampled_system_has_the_poles_of_the_continuous_one() -> None:
    one = _two_masses()
    sampled = _two_masses(A=expm(one.A / 200.0), sampling_hz=200.0)
    np.testing.assert_allclose(sampled.poles(), one.poles(), rtol=1e-9)


def test_a_delay_is_evaluated_on_the_unit_circle() -> None:
    delay = StateSpace(
        np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)), _U, _U, "receptance", 100.0
    )
    np.testing.assert_allclose(delay.frf(_LINES).values[0, 0], np.exp(-2j * np.pi * _LINES / 100.0), rtol=1e-12)
    assert delay.poles()[0].real == -np.inf


def test_a_system_without_states_is_its_direct_term() -> None:
    one = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.full((1, 1), 3.0), _U, _U, "accelerance")
    np.testing.assert_array_equal(one.frf(_LINES).values[0, 0], np.full(41, 3.0 + 0j))


def test_rigid_motion_is_a_double_pole_that_is_evaluated_all_the_same() -> None:
    mass = StateSpace([[0, 1], [0, 0]], [[0], [0.5]], [[1, 0]], [[0]], _U, _U, "receptance")  # type: ignore[arg-type]
    np.testing.assert_allclose(mass.frf(_LINES).values[0, 0], -0.5 / (2 * np.pi * _LINES) ** 2, rtol=1e-12)
    with pytest.raises(FemtuneError) as caught:
        mass.frf(np.array([0.0, 1.0]))
    assert caught.value.code == "system.at-pole"


def test_modes_sum_to_the_function() -> None:
    one = _two_masses()
    poles, shapes, participations = system_modes(one)
    terms = shapes[:, :, None] * participations[None, :, 0, None] / (2j * np.pi * _LINES - poles[:, None])
    np.testing.assert_allclose(terms.sum(axis=1), one.frf(_LINES).values[:, 0], rtol=1e-9)


def test_poles_say_frequency_and_damping_and_back() -> None:
    poles = pole_of(np.array([3.0, 8.0]), np.array([0.01, 0.3]))
    np.testing.assert_allclose(poles.imag, 2 * np.pi * np.array([3.0, 8.0]) * np.sqrt(1 - np.array([0.01, 0.3]) ** 2))
    freq, damping = freq_and_damping(poles)
    np.testing.assert_allclose([freq, damping], [[3.0, 8.0], [0.01, 0.3]])


@pytest.mark.parametrize(
    ("facts", "code"),
    [
        ({"B": np.ones((4, 2))}, "system.shape"),
        ({"C": np.ones((1, 4))}, "system.shape"),
        ({"C": np.full((2, 4), np.nan)}, "system.values"),
        ({"kind": "inertance"}, "frf.kind"),
    ],
)
def test_what_does_not_fit_is_refused(facts: dict[str, Any], code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _two_masses(**facts)
    assert caught.value.code == code
