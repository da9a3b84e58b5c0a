"""Clusters, rotations and principal angles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import subspace_angles
from scipy.stats import ortho_group

from femtune.errors import FemtuneError
from femtune.modal import clusters, mac, principal_angles_deg, rotate_to
from femtune.modal.subspace import mostly_real, projection


def _turn(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])


def test_chains_of_close_modes() -> None:
    freq = np.array([30.0, 10.0, 10.09, 10.18, 20.0])
    assert clusters(freq) == ((1, 2, 3), (4,), (0,))
    assert clusters(freq, 1e-4) == ((1,), (2,), (3,), (4,), (0,))
    assert clusters(np.zeros(0)) == ()


def test_rigid_body_modes_are_one_cluster() -> None:
    assert clusters(np.array([0.0, 1e-7, 3e-5, 5.0, 80.0])) == ((0, 1, 2), (3,), (4,))


def test_gap_is_relative_to_the_higher_mode() -> None:
    assert clusters(np.array([99.0, 100.0])) == ((0, 1),)
    assert clusters(np.array([98.9, 100.0])) == ((0,), (1,))


@pytest.mark.slow
@settings(max_examples=50)
@given(st.integers(0, 10**6), st.integers(2, 4))
def test_a_rotation_is_undone_although_sensors_see_no_orthogonal_vectors(seed: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    model = rng.normal(size=(12, m))
    q = ortho_group.rvs(m, random_state=seed)
    scale = rng.uniform(0.1, 10, size=m) * rng.choice([-1, 1], size=m)
    found = rotate_to(model, model @ q * scale)
    assert np.abs(np.sum(found.q * q, axis=0)) == pytest.approx(np.ones(m))
    assert np.diag(mac(model @ q, found.aligned)) == pytest.approx(np.ones(m))
    assert found.q.T @ found.q == pytest.approx(np.eye(m), abs=1e-12)
    assert found.principal_angles_deg == pytest.approx(np.zeros(m), abs=1e-5)


@given(st.floats(-44, 44))
def test_the_angle_in_a_plane(degrees: float) -> None:
    model = np.linalg.qr(np.random.default_rng(0).normal(size=(9, 2)))[0]
    found = rotate_to(model, model @ _turn(degrees))
    assert found.angle_deg == pytest.approx(abs(degrees), abs=1e-5)
    assert found.nearest == (0, 1)
    assert found.independence == pytest.approx(1.0)


def test_exchanged_and_negative_vectors_are_no_rotation() -> None:
    model = np.random.default_rng(1).normal(size=(9, 3))
    found = rotate_to(model, model[:, [2, 0, 1]] * [-1, 1, -5])
    assert found.nearest == (2, 0, 1)
    assert found.angle_deg == pytest.approx(0.0, abs=1e-5)


def test_fewer_test_vectors_take_their_best_in_the_subspace() -> None:
    rng = np.random.default_rng(2)
    model, test = rng.normal(size=(9, 3)), rng.normal(size=(9, 1))
    found = rotate_to(model, test)
    assert mac(test, found.aligned)[0, 0] == pytest.approx(projection(model, test)[0])
    assert found.q.shape == (3, 1)
    basis = np.linalg.qr(model)[0]
    assert projection(model, test)[0] == pytest.approx(np.sum((basis.T @ test) ** 2) / np.sum(test**2))


def test_more_test_vectors_than_model_vectors() -> None:
    rng = np.random.default_rng(9)
    model = rng.normal(size=(9, 2))
    found = rotate_to(model, model @ rng.normal(size=(2, 3)))
    assert sorted(found.nearest) == [-1, 0, 1]
    assert found.q @ found.q.T == pytest.approx(np.eye(2), abs=1e-12)


def test_missing_entries_do_not_spoil_the_rotation() -> None:
    model = np.random.default_rng(3).normal(size=(10, 2))
    test = model @ _turn(30)
    expected = rotate_to(model, test).q
    test[[0, 4], 0] = np.nan
    test[7, 1] = np.nan
    found = rotate_to(model, test)
    assert found.q == pytest.approx(expected)
    assert np.isfinite(found.aligned).all()


def test_the_share_in_a_subspace_depends_on_no_scale_and_on_common_entries_only() -> None:
    model, test = np.random.default_rng(3).normal(size=(10, 2)), np.random.default_rng(4).normal(size=(10, 1))
    share = projection(model, test)
    assert 0.01 < share[0] < 0.99
    for size in (1e-200, 1e200):
        assert projection(model, size * test) == pytest.approx(share)
        assert projection(size * model, test) == pytest.approx(share)
    more_model, more_test = np.vstack([model, [[np.nan, 3.0], [1.0, 1.0]]]), np.vstack([test, [[2.0], [np.nan]]])
    assert projection(more_model, more_test) == pytest.approx(share)


def test_complex_phases_are_turned_away() -> None:
    model = np.random.default_rng(4).normal(size=(10, 2))
    test = model @ _turn(30) * np.exp(1j * np.array([0.7, -2.0]))
    found = rotate_to(model, test)
    assert np.isrealobj(found.q)
    assert np.diag(mac(test, found.aligned)) == pytest.approx(np.ones(2))


def test_the_same_motion_twice_is_seen() -> None:
    model = np.random.default_rng(5).normal(size=(10, 2))
    assert rotate_to(model, model[:, [0, 0]]).independence == pytest.approx(0.0, abs=1e-12)


def test_principal_angles_agree_with_scipy() -> None:
    rng = np.random.default_rng(6)
    a, b = rng.normal(size=(10, 3)), rng.normal(size=(10, 2)) + 1j * rng.normal(size=(10, 2))
    expected = np.sort(np.degrees(subspace_angles(a.astype(complex), b)))
    assert principal_angles_deg(a, b) == pytest.approx(expected)


def test_nothing_in_common_is_undefined() -> None:
    a, b = np.array([[1.0], [np.nan]]), np.array([[np.nan], [1.0]])
    assert np.isnan(principal_angles_deg(a, b)).all()


def test_a_complex_model_is_refused() -> None:
    with pytest.raises(FemtuneError, match=r"modal\.complex-model"):
        rotate_to(np.eye(3)[:, :2] * 1j, np.eye(3)[:, :2])


def test_the_scaling_of_noisy_test_vectors_does_not_turn_the_rotation() -> None:
    rng = np.random.default_rng(11)
    model, test = rng.normal(size=(9, 2)), rng.normal(size=(9, 2))
    assert rotate_to(model, test * [100.0, 0.01]).q == pytest.approx(rotate_to(model, test).q)


def test_a_complex_shape_is_turned_to_its_largest_real_part() -> None:
    real, imaginary = np.array([1.0, 2.0, -2.0]), np.array([0.2, -0.2, -0.1])  # orthogonal to each other
    turned = mostly_real(np.exp(0.7j) * (real + 1j * imaginary))
    assert turned == pytest.approx(real)
