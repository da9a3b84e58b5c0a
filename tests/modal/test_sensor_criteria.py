"""eCOMAC, MAC without a sensor, FDAC and its frequency shift: closed forms and plain loops."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.modal import comac, enhanced_comac, fdac, frequency_shift, mac, mac_without_each


def _shapes(n: int = 7, m: int = 3) -> np.ndarray:
    return np.random.default_rng(4).standard_normal((n, m))


def test_ecomac_of_proportional_shapes_is_zero() -> None:
    phi = _shapes()
    np.testing.assert_allclose(enhanced_comac(phi * [2.0, -1e-6, 30.0], phi), 0.0, atol=1e-15)


def test_ecomac_of_a_reversed_sensor_is_its_relative_amplitude() -> None:
    """To first order in its share of the shape: with e reversed, the scale factor is (1 − 2e²/|φ|²)."""
    phi = np.ones((50, 2))
    phi[3] = [0.5, -0.2]
    psi = phi.copy()
    psi[3] *= -1.0
    factor = 1.0 - 2.0 * phi[3] ** 2 / np.sum(phi**2, axis=0)
    found = enhanced_comac(psi, phi)
    assert found[3] == pytest.approx(np.mean(np.abs(-phi[3] - factor * phi[3])) / 2.0)
    assert found[3] == pytest.approx(0.35, rel=0.01)
    assert found[0] == pytest.approx(np.mean(1.0 - factor) / 2.0)
    # what the COMAC cannot see: the sign is wrong in every mode
    assert comac(psi, phi)[3] == pytest.approx(1.0)


def test_ecomac_of_complex_shapes_ignores_their_phase_and_unmeasured_entries() -> None:
    phi = _shapes()
    psi = phi * np.exp(1j * np.array([0.3, 2.0, -1.0]))
    psi[2, 0] = psi[5] = np.nan
    found = enhanced_comac(psi, phi)
    assert np.isnan(found[5])
    np.testing.assert_allclose(np.delete(found, 5), 0.0, atol=1e-14)


def test_mac_without_each_dof_is_the_mac_of_the_others() -> None:
    phi = _shapes()
    psi = phi + 0.3 * np.random.default_rng(5).standard_normal(phi.shape) + 0.1j * _shapes()
    psi[2, 1] = np.nan
    found = mac_without_each(psi, phi)
    for k in range(7):
        rest = np.arange(7) != k
        for r in range(3):
            if (k, r) == (2, 1):
                assert np.isnan(found[k, r])
            else:
                assert found[k, r] == pytest.approx(mac(psi[rest][:, [r]], phi[rest][:, [r]])[0, 0])


def test_the_mac_without_the_wrong_sensor_is_one() -> None:
    phi = _shapes()
    psi = phi.copy()
    psi[4] *= -1.0
    found = mac_without_each(psi, phi)
    np.testing.assert_allclose(found[4], 1.0)
    assert (found[np.arange(7) != 4] < 1.0).all()


def test_mac_without_a_dof_needs_two_others() -> None:
    found = mac_without_each(np.array([[1.0], [2.0]]), np.array([[1.0], [2.1]]))
    assert np.isnan(found).all()
    still = mac_without_each(np.array([[1.0], [0.0], [0.0]]), np.array([[1.0], [0.2], [0.1]]))
    assert np.isnan(still[0, 0])
    with pytest.raises(FemtuneError):
        mac_without_each(np.ones((3, 1)), np.ones((2, 1)))


def _frfs(hz: np.ndarray, factor: float = 1.0) -> np.ndarray:
    """Receptance to one force of a chain with structural damping; stiffness times factor²."""
    n = 6
    K = factor**2 * 1e4 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) * (1.0 + 0.03j)
    force = np.eye(n)[:, 1]
    return np.stack([np.linalg.solve(K - (2.0 * np.pi * f) ** 2 * np.eye(n), force) for f in hz], axis=1)


@pytest.mark.slow
def test_the_fdac_of_a_stiffer_model_is_one_along_the_frequency_ratio() -> None:
    """Stiffness times s² is the same deflection shape at s times the frequency."""
    test_hz, model_hz = np.linspace(4.0, 30.0, 201), np.linspace(3.0, 34.0, 311)
    for factor in (1.0, 1.06, 0.9):
        values = fdac(_frfs(test_hz), _frfs(model_hz, factor))
        exact = fdac(_frfs(test_hz), _frfs(factor * test_hz, factor))
        np.testing.assert_allclose(np.diag(exact), 1.0, rtol=1e-12)
        found = frequency_shift(values, test_hz, model_hz)
        assert found is not None
        assert found.ratio == pytest.approx(factor, abs=1e-3)
        assert found.mean > 0.99
        if factor != 1.0:
            assert found.mean_unshifted < found.mean - 0.05


def test_fdac_against_a_plain_loop_with_unmeasured_responses() -> None:
    rng = np.random.default_rng(0)
    t, m = (rng.standard_normal((4, k)) + 1j * rng.standard_normal((4, k)) for k in (5, 6))
    t[2] = np.nan
    m[:, 3] = 0.0
    found = fdac(t, m)
    rows = [0, 1, 3]
    for i in range(5):
        for j in (0, 1, 2, 4, 5):
            a, b = t[rows, i], m[rows, j]
            assert found[i, j] == pytest.approx(abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a) * np.vdot(b, b)).real)
    assert np.isnan(found[:, 3]).all()


def test_no_shift_without_a_common_range() -> None:
    assert frequency_shift(np.ones((3, 3)), np.array([1.0, 2.0, 3.0]), np.array([10.0, 11.0, 12.0])) is None
    assert frequency_shift(np.ones((2, 1)), np.array([1.0, 2.0]), np.array([1.0])) is None
    lines = np.array([1.0, 2.0, 3.0])
    same = frequency_shift(np.ones((3, 3)), lines, lines)
    assert same is not None
    assert same.ratio == pytest.approx(1.0)
    rising = frequency_shift(np.tile(np.linspace(0.0, 1.0, 9), (3, 1)), lines, np.linspace(0.1, 9.0, 9))
    assert rising is not None
    assert np.isnan(rising.ratio)
