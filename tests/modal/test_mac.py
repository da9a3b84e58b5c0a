"""MAC and its kin against closed forms, invariances and hand results."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.errors import FemtuneError
from femtune.modal import auto_mac, comac, cross_orthogonality, mac, modal_scale_factor
from femtune.modal.shape_criteria import mac_where_defined, motion_agreement

NAN = np.nan


def _random(seed: int, n: int = 7, m: int = 3, *, kind: str = "complex") -> np.ndarray:
    rng = np.random.default_rng(seed)
    real = rng.normal(size=(n, m))
    return real + 1j * rng.normal(size=(n, m)) if kind == "complex" else real


def test_angle_between_plane_vectors() -> None:
    a = np.array([[1.0], [0.0]])
    b = np.array([[np.cos(0.3), 1.0], [np.sin(0.3), 1.0]])
    assert mac(a, b) == pytest.approx(np.array([[np.cos(0.3) ** 2, 0.5]]))


def test_complex_vectors_are_conjugated() -> None:
    # without the conjugate (1, i) would be orthogonal to itself and equal to its conjugate
    a = np.array([[1.0], [1.0j]])
    assert mac(a, a)[0, 0] == pytest.approx(1.0)
    assert mac(a, a.conj())[0, 0] == pytest.approx(0.0)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.floats(1e-150, 1e150), st.floats(0, 6.3))
def test_scaling_and_phase_do_not_matter(seed: int, size: float, phase: float) -> None:
    a, b = _random(seed), _random(seed + 1)
    factor = size * np.exp(1j * phase)
    assert mac(factor * a, b) == pytest.approx(mac(a, b), abs=1e-12)
    exchanged = mac(b, a).T
    assert exchanged == pytest.approx(mac(a, b), abs=1e-12)


@given(st.integers(0, 10**6), st.permutations(range(7)))
def test_order_of_rows_does_not_matter(seed: int, order: list[int]) -> None:
    a, b = _random(seed), _random(seed + 1)
    assert mac(a[order], b[order]) == pytest.approx(mac(a, b), abs=1e-12)


def test_missing_entries_are_left_out_pair_by_pair() -> None:
    a, b = _random(1), _random(2)
    a[0, 0] = NAN
    a[3, 2] = NAN
    b[5, 1] = NAN
    found = mac(a, b)
    for i, j in np.ndindex(3, 3):
        rows = ~(np.isnan(a[:, i]) | np.isnan(b[:, j]))
        x, y = a[rows, i], b[rows, j]
        expected = abs(np.vdot(x, y)) ** 2 / (np.vdot(x, x).real * np.vdot(y, y).real)
        assert found[i, j] == pytest.approx(expected)


def test_weighted_with_missing_entries_uses_the_common_rows() -> None:
    a, b = _random(3, kind="real"), _random(4, kind="real")
    weight = np.diag([1.0, 2, 3, 4, 5, 6, 7])
    complete = mac(a * np.sqrt(np.diag(weight))[:, None], b * np.sqrt(np.diag(weight))[:, None])
    assert mac(a, b, weight) == pytest.approx(complete)
    b[2, 1] = NAN
    rows = [0, 1, 3, 4, 5, 6]
    assert mac(a, b, weight)[0, 1] == pytest.approx(mac(a[rows], b[rows], weight[np.ix_(rows, rows)])[0, 1])


def test_no_common_motion_is_undefined() -> None:
    a = np.array([[1.0], [NAN], [0.0]])
    b = np.array([[NAN, 0.0], [1.0, 1.0], [1.0, 0.0]])
    assert np.isnan(mac(a, b)).all()


def test_a_shape_without_motion_is_an_error() -> None:
    with pytest.raises(FemtuneError, match=r"modal\.zero-shape") as caught:
        mac(np.eye(3), np.array([[1.0, 0.0], [0, 0], [0, NAN]]))
    assert caught.value.values == {"columns (from 1)": "2"}
    assert np.isnan(mac_where_defined(np.eye(3), np.zeros((3, 1)))).all()


def test_rows_must_agree() -> None:
    with pytest.raises(FemtuneError, match=r"modal\.rows-differ"):
        mac(np.eye(3), np.eye(4))


def test_auto_mac_of_orthogonal_shapes() -> None:
    q = np.linalg.qr(_random(5, kind="real"))[0]
    assert auto_mac(q) == pytest.approx(np.eye(3), abs=1e-12)


@given(st.integers(0, 10**6), st.complex_numbers(min_magnitude=0.1, max_magnitude=10))
def test_modal_scale_factor_recovers_a_complex_factor(seed: int, factor: complex) -> None:
    b = _random(seed)
    assert modal_scale_factor(factor * b, b) == pytest.approx(np.full(3, factor))


def test_modal_scale_factor_is_the_least_squares_one() -> None:
    a, b = _random(6), _random(7)
    a[2, 0] = NAN
    for i, c in enumerate(modal_scale_factor(a, b)):
        rows = ~np.isnan(a[:, i])
        assert c == pytest.approx(np.linalg.lstsq(b[rows, i : i + 1], a[rows, i], rcond=None)[0][0])


def test_comac_by_hand() -> None:
    # rows of unit columns: (0.6, 0.8) against (0.8, 0.6) and equal second columns
    test = np.array([[0.6, 1.0], [0.8, 0.0], [0.0, 0.0]])
    model = np.array([[0.8, 1.0], [0.6, 0.0], [0.0, 0.0]])
    first = (0.48 + 1.0) ** 2 / ((0.36 + 1.0) * (0.64 + 1.0))
    assert comac(test, model) == pytest.approx(np.array([first, 1.0, NAN]), nan_ok=True)


def test_comac_where_one_side_only_moves_is_zero() -> None:
    for rest in (0.0, 1e-13):
        moving, still = np.array([[1.0], [1.0]]), np.array([[1.0], [rest]])
        assert comac(moving, still) == pytest.approx(np.array([1.0, 0.0]))
        assert comac(still, moving) == pytest.approx(np.array([1.0, 0.0]))


def test_comac_does_not_depend_on_scaling_or_phase() -> None:
    a, b = _random(8), _random(9)
    assert comac(a * [1, 2j, -3], b * [5, 1, 1j]) == pytest.approx(comac(a, b))
    assert comac(a * [1, 2j, -3], a) == pytest.approx(np.ones(7))


def test_an_inverted_sensor_shows_in_the_agreement_and_not_in_comac() -> None:
    b = _random(10, n=12, kind="real")
    a = b.copy()
    a[4] *= -1
    assert comac(a, b)[4] == pytest.approx(1.0)
    assert motion_agreement(a, b)[4] == pytest.approx(-1.0)


def test_cross_orthogonality_is_the_identity_for_the_modes_themselves() -> None:
    mass = np.array([[2.0, 0.5, 0], [0.5, 1.0, 0.2], [0, 0.2, 3.0]])
    phi = np.linalg.inv(np.linalg.cholesky(mass)).T @ np.linalg.qr(_random(11, n=3, kind="real"))[0]
    assert cross_orthogonality(phi * [1, -2, 1j], 7 * phi, mass) == pytest.approx(np.eye(3), abs=1e-12)


def test_cross_orthogonality_by_hand() -> None:
    mass = np.diag([1.0, 4.0])
    test, model = np.array([[2.0], [1.0]]), np.array([[1.0, 0.0], [0.0, 1.0]])
    # ψᵀMψ = 8, φᵀMφ = 1 and 4, ψᵀMφ = 2 and 4
    assert cross_orthogonality(test, model, mass) == pytest.approx(np.array([[2, 2]]) / np.sqrt(8))


def test_cross_orthogonality_refuses_gaps_and_bad_masses() -> None:
    with pytest.raises(FemtuneError, match=r"modal\.missing-entries"):
        cross_orthogonality(np.array([[1.0], [NAN]]), np.eye(2), np.eye(2))
    with pytest.raises(FemtuneError, match=r"modal\.mass-not-positive"):
        cross_orthogonality(np.eye(2), np.eye(2), np.diag([1.0, -1.0]))


def test_comac_does_not_forgive_a_sign_that_changes_from_mode_to_mode() -> None:
    b = np.ones((8, 2))
    b[::2, 1] = -1.0
    a = b.copy()
    a[3, 0] = -1.0
    assert comac(a, b)[3] == pytest.approx(0.0)


def test_cross_orthogonality_conjugates_complex_test_shapes() -> None:
    test, mass = _random(12, n=3), np.diag([1.0, 2.0, 3.0])
    root = np.sqrt(np.diag(mass))[:, None]
    assert cross_orthogonality(test, test, mass) ** 2 == pytest.approx(mac(root * test, root * test))


def test_a_weighted_mac_is_the_same_whether_some_entries_are_unknown_or_not_there() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((6, 3)) + 1j * rng.standard_normal((6, 3)), rng.standard_normal((6, 4))
    root = rng.standard_normal((6, 6))
    weight = root @ root.T
    unknown = np.vstack([a, np.full((1, 3), np.nan)])
    more = np.eye(7)
    more[:6, :6] = weight
    np.testing.assert_allclose(mac(unknown, np.vstack([b, np.ones((1, 4))]), more), mac(a, b, weight), rtol=1e-12)
