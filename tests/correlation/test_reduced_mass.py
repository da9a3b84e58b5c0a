"""Static reduction to the sensors against hand results and its own optimality."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import eigh

from femtune.correlation import NotTested, ReducedMass, reduce_mass
from femtune.dofs import Dof, DofSet
from femtune.modal import ModeSet


def _chain(n: int, *, free: bool = False) -> tuple[np.ndarray, np.ndarray]:
    K = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    if free:
        K[0, 0] = K[-1, -1] = 1.0
    return 1e4 * K, np.diag(np.linspace(1.0, 2.0, n))


def _modes(K: np.ndarray, M: np.ndarray, C: np.ndarray, m: int) -> ModeSet:
    lam, phi = eigh(K, M)
    dofs = DofSet(Dof(i + 1, "X") for i in range(len(C)))
    return ModeSet(np.sqrt(np.maximum(lam[:m], 0)) / (2 * np.pi), C @ phi[:, :m], dofs)


def _reduce(K: np.ndarray, M: np.ndarray, C: np.ndarray, m: int = 3) -> ReducedMass | NotTested:
    return reduce_mass(sp.csc_matrix(K), sp.csc_matrix(M), C, _modes(K, M, C, m))


def test_guyan_by_partition() -> None:
    K, M = _chain(9)
    keep, drop = [1, 4, 7], [0, 2, 3, 5, 6, 8]
    T = np.zeros((9, 3))
    T[keep] = np.eye(3)
    T[drop] = -np.linalg.solve(K[np.ix_(drop, drop)], K[np.ix_(drop, keep)])
    found = _reduce(K, M, np.eye(9)[keep])
    assert isinstance(found, ReducedMass)
    assert found.mass == pytest.approx(T.T @ M @ T)
    assert found.stiffness == pytest.approx(T.T @ K @ T)
    reduced = np.sqrt(eigh(found.stiffness, found.mass, eigvals_only=True))
    full = np.sqrt(eigh(K, M, eigvals_only=True))[:3]
    assert found.frequency_error[:2] == pytest.approx((reduced / full - 1)[:2])


def test_sensors_that_are_combinations() -> None:
    K, M = _chain(6)
    C = np.array([[0.5, 0.5, 0, 0, 0, 0], [0, 0, 0, 0, 1.0, -1.0]])
    found = _reduce(K, M, C)
    assert isinstance(found, ReducedMass)
    # Lagrange multipliers: minimal strain energy for given sensor readings
    system = np.block([[K, C.T], [C, np.zeros((2, 2))]])
    T = np.linalg.solve(system, np.vstack([np.zeros((6, 2)), np.eye(2)]))[:6]
    assert found.mass == pytest.approx(T.T @ M @ T)


def test_all_dofs_are_exact() -> None:
    K, M = _chain(5)
    found = _reduce(K, M, np.eye(5), m=5)
    assert isinstance(found, ReducedMass)
    assert found.mass == pytest.approx(M)
    assert found.frequency_error == pytest.approx(np.zeros(5), abs=1e-9)


def test_a_free_structure() -> None:
    K, M = _chain(30, free=True)
    C = np.eye(30)[::4]
    found = _reduce(K, M, C, m=4)
    assert isinstance(found, ReducedMass)
    # the rigid-body motion is represented: all readings one gives the whole mass and no strain energy
    ones = np.ones(len(C))
    assert ones @ found.mass @ ones == pytest.approx(M.sum(), rel=1e-3)
    assert ones @ found.stiffness @ ones < 1e-4 * K.max()
    assert found.frequency_error[0] == 0.0
    keep = np.arange(0, 30, 4)
    drop = np.setdiff1d(np.arange(30), keep)
    T = np.zeros((30, len(keep)))
    T[keep] = np.eye(len(keep))
    T[drop] = -np.linalg.solve(K[np.ix_(drop, drop)], K[np.ix_(drop, keep)])
    guyan = np.sqrt(eigh(T.T @ K @ T, T.T @ M @ T, eigvals_only=True)[1:4])
    full = np.sqrt(eigh(K, M, eigvals_only=True)[1:4])
    assert found.frequency_error[1:] == pytest.approx(guyan / full - 1, abs=2e-4)


def test_a_solver_of_the_caller_is_used() -> None:
    K, M = _chain(9)
    C = np.eye(9)[[1, 4, 7]]
    calls = []

    def solve(b: np.ndarray) -> np.ndarray:
        calls.append(b.shape)
        return np.linalg.solve(K, b)

    found = reduce_mass(sp.csr_array(K), sp.csr_array(M), sp.csr_array(C), _modes(K, M, C, 3), solve=solve)
    expected = _reduce(K, M, C)
    assert isinstance(found, ReducedMass)
    assert isinstance(expected, ReducedMass)
    assert found.mass == pytest.approx(expected.mass)
    assert calls == [(9, 3)]


def test_a_sensor_that_repeats_others_is_dropped() -> None:
    K, M = _chain(6)
    C = np.eye(6)[[0, 2, 4, 4]]
    C[3] = 0.5 * (C[0] + C[1])
    found = _reduce(K, M, C)
    assert isinstance(found, ReducedMass)
    # any three of 1, 2, 4 and the third are independent; the third is no combination and must stay
    assert len(found.kept) == 3
    assert 2 in found.kept
    assert found.dropped == tuple(f"{i + 1}X+" for i in range(4) if i not in found.kept)
    kept = list(found.kept)
    alone = _reduce(K, M, C[kept])
    assert isinstance(alone, ReducedMass)
    assert alone.dropped == ()
    assert found.mass == pytest.approx(alone.mass)
    assert found.frequency_error == pytest.approx(alone.frequency_error, nan_ok=True)


def test_seven_sensors_on_three_motions_keep_three() -> None:
    K, M = _chain(8)
    mix = np.random.default_rng(5).standard_normal((7, 3))
    found = _reduce(K, M, mix @ np.eye(8)[[1, 4, 6]])
    assert isinstance(found, ReducedMass)
    assert len(found.kept) == 3
    assert len(found.dropped) == 4
    plain = _reduce(K, M, np.eye(8)[[1, 4, 6]])
    assert isinstance(plain, ReducedMass)
    # the same space of motions gives the same reduced frequencies
    assert eigh(found.stiffness, found.mass, eigvals_only=True) == pytest.approx(
        eigh(plain.stiffness, plain.mass, eigvals_only=True)
    )


def test_a_sensor_on_a_held_point() -> None:
    K, M = _chain(6)
    C = np.eye(6)[[0, 2]]
    C[1] = 0.0
    found = _reduce(K, M, C)
    assert isinstance(found, NotTested)
    assert "cannot move in the model: 2X+" in found.reason


def test_only_rigid_body_modes() -> None:
    K, M = _chain(4, free=True)
    modes = ModeSet(np.zeros(1), np.ones((4, 1)), DofSet(Dof(i + 1, "X") for i in range(4)))
    found = reduce_mass(sp.csc_matrix(K), sp.csc_matrix(M), np.eye(4), modes)
    assert str(found) == "not tested: the model has rigid-body modes only"


def test_a_mechanism_is_told() -> None:
    K, M = _chain(6)
    K[:, 5] = K[5, :] = 0.0
    modes = ModeSet(np.array([3.0, 4.0]), np.eye(6)[:2, :2], DofSet([Dof(1, "X"), Dof(2, "X")]))
    found = reduce_mass(sp.csc_matrix(K), sp.csc_matrix(M), np.eye(6)[[0, 5]], modes)
    assert isinstance(found, NotTested)
    assert "mechanism" in found.reason
