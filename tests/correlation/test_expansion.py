"""Expansion of measured shapes: exact cases, independent dense solutions, limits, and the error at held-out sensors."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import block_diag, solve
from scipy.optimize import minimize

from femtune.correlation import dynamic_expansion, expand_shapes, minimum_residual, serep
from femtune.correlation.expansion import held_out_error, held_out_groups
from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.model import EigenSolution, solve_modes
from structures.springs import factor_model, sensor_rows, spring_structure

N = 9
SPRINGS = [(0, -1, 4.0), *((i, i + 1, 3.0 - 0.2 * i) for i in range(N - 1)), (2, 6, 0.7)]
SENSORS = (0, 2, 4, 7)


def _model(factor: float = 1.0, *, free: bool = False) -> tuple[EigenSolution, sp.csr_array]:
    springs = [(a, b, k * (factor if i == 4 else 1.0)) for i, (a, b, k) in enumerate(SPRINGS)]
    structure = spring_structure(springs[1:] if free else springs, np.linspace(1.0, 2.0, N))
    configured = factor_model(structure, {"k2": [2]})
    return solve_modes(configured.at(np.zeros(1)), N), sensor_rows(configured, SENSORS)


def _dense(solution: EigenSolution, hz: float) -> tuple[np.ndarray, np.ndarray]:
    K, M = solution.point.stiffness.toarray(), solution.point.mass.toarray()
    return K, K - (2.0 * np.pi * hz) ** 2 * M


def _aligned(found: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


@pytest.mark.parametrize("free", [False, True])
def test_the_model_s_own_shapes_are_reproduced_by_each_method(free: bool) -> None:
    solution, C = _model(free=free)
    for j in range(1, 4):
        wanted = solution.shapes[:, j]
        psi, hz = C @ wanted, float(solution.freq_hz[j])
        assert _aligned(serep(solution, C, range(4)).shape(psi), wanted) < 1e-12
        assert _aligned(dynamic_expansion(solution, C, hz).shape(psi), wanted) < 1e-10
        assert _aligned(minimum_residual(solution, C, hz, 1e-6).shape(psi), wanted) < 3e-6


def test_serep_with_all_modes_is_the_measured_shape_itself() -> None:
    """All DOFs measured and all modes in the basis: the expansion is the identity."""
    solution, _ = _model()
    C = sp.csr_array(sp.eye_array(N))
    psi = np.random.default_rng(0).standard_normal(N)
    np.testing.assert_allclose(serep(solution, C, range(N)).shape(psi), psi, rtol=1e-10)


def test_serep_is_the_published_transformation() -> None:
    """T = Φ Φ_a⁺ of `femtune.model.reduce.serep`, an independent implementation."""
    from femtune.model.reduce import serep as reduction  # noqa: PLC0415

    solution, C = _model()
    psi = np.array([1.0, -0.3, 0.2, 0.9])
    T = reduction(
        solution.point.stiffness, solution.point.mass, np.array(SENSORS), solution.shapes[:, :3]
    ).transformation
    np.testing.assert_allclose(serep(solution, C, range(3)).shape(psi), T @ psi, rtol=1e-10)


def test_dynamic_expansion_is_kidder_s_partitioned_solution() -> None:
    solution, C = _model()
    psi, hz = np.array([1.0, 0.4, -0.2, 0.7]), 0.21
    _, Z = _dense(solution, hz)
    rest = [i for i in range(N) if i not in SENSORS]
    wanted = np.zeros(N)
    wanted[list(SENSORS)] = psi
    wanted[rest] = -solve(Z[np.ix_(rest, rest)], Z[np.ix_(rest, SENSORS)] @ psi)
    np.testing.assert_allclose(dynamic_expansion(solution, C, hz).shape(psi), wanted, rtol=1e-9)


def test_dynamic_expansion_of_combinations_solves_its_stationary_conditions() -> None:
    """Sensors that are combinations of DOFs: Zφ = Cᵀμ and Cφ = ψ, by the bordered matrix."""
    solution, _ = _model()
    C = sp.csr_array(np.random.default_rng(3).standard_normal((3, N)))
    psi = np.array([1.0, -0.5, 0.3])
    _, Z = _dense(solution, 0.17)
    bordered = block_diag(Z, np.zeros((3, 3)))
    bordered[N:, :N], bordered[:N, N:] = C.toarray(), C.toarray().T
    wanted = solve(bordered, np.append(np.zeros(N), psi))[:N]
    np.testing.assert_allclose(dynamic_expansion(solution, C, 0.17).shape(psi), wanted, rtol=1e-8)


def test_dependent_sensors_are_fitted() -> None:
    """A sensor twice: the mean of both entries is expanded."""
    solution, C = _model()
    twice = sp.csr_array(sp.vstack([C, C[[0]]]))
    psi = np.array([1.0, 0.4, -0.2, 0.7])
    found = dynamic_expansion(solution, twice, 0.21).shape(np.append(psi, 1.2))
    psi[0] = 1.1
    np.testing.assert_allclose(found, dynamic_expansion(solution, C, 0.21).shape(psi), rtol=1e-6)


def test_minimum_residual_without_noise_solves_the_constrained_minimum() -> None:
    """Weight to infinity: minimum of rᵀKr with Cφ = ψ, by the bordered matrix of ZK⁻¹Z."""
    solution, C = _model()
    psi, hz = np.array([1.0, 0.4, -0.2, 0.7]), 0.21
    K, Z = _dense(solution, hz)
    bordered = block_diag(Z @ solve(K, Z), np.zeros((4, 4)))
    bordered[N:, :N], bordered[:N, N:] = C.toarray(), C.toarray().T
    wanted = solve(bordered, np.append(np.zeros(N), psi))[:N]
    np.testing.assert_allclose(minimum_residual(solution, C, hz, 1e-9).shape(psi), wanted, rtol=1e-6)


def test_minimum_residual_at_zero_frequency_is_the_static_expansion() -> None:
    """ω → 0 and weight → ∞: rᵀKr = φᵀKφ, minimal with Cφ = ψ, which is Guyan's and the dynamic expansion's limit."""
    solution, C = _model()
    psi = np.array([1.0, 0.4, -0.2, 0.7])
    static = dynamic_expansion(solution, C, 1e-9).shape(psi)
    np.testing.assert_allclose(minimum_residual(solution, C, 1e-9, 1e-10).shape(psi), static, rtol=1e-7)
    K = solution.point.stiffness.toarray()
    rest = [i for i in range(N) if i not in SENSORS]
    guyan = -solve(K[np.ix_(rest, rest)], K[np.ix_(rest, SENSORS)] @ psi)
    np.testing.assert_allclose(static[rest], guyan, rtol=1e-9)


def test_minimum_residual_with_noise_is_the_minimum_of_the_weighted_sum() -> None:
    solution, C = _model()
    psi, hz, noise = np.array([1.0, 0.4, -0.2, 0.7]), 0.21, 0.05
    found = minimum_residual(solution, C, hz, noise).shape(psi)
    K, Z = _dense(solution, hz)
    gap = psi - C @ found
    assert np.linalg.norm(gap) == pytest.approx(noise * np.linalg.norm(psi), rel=1e-6)
    load = Z @ solve(K, Z @ found)
    weight = float(load @ (C.T @ gap) / np.sum((C.T @ gap) ** 2))
    best = minimize(
        lambda v: (Z @ v) @ solve(K, Z @ v) + weight * np.sum((psi - C @ v) ** 2),
        found + 0.01,
        method="BFGS",
        tol=1e-12,
    )
    np.testing.assert_allclose(best.x, found, atol=1e-4 * np.abs(found).max())


@pytest.mark.parametrize("name", ["serep", "dynamic", "mdre"])
def test_held_out_entries_are_those_of_an_expansion_without_these_sensors(name: str) -> None:
    """The update of the small matrices equals a new expansion with the remaining sensors."""
    solution, _ = _model()
    configured = factor_model(spring_structure(SPRINGS, np.linspace(1.0, 2.0, N)), {"k2": [2]})
    every, some = sensor_rows(configured, range(6)), sensor_rows(configured, (0, 2, 3, 5))
    psi = np.array([1.0, np.nan, 0.4, -0.2, np.nan, 0.7])
    make = {
        "serep": lambda C: serep(solution, C, range(3)),
        "dynamic": lambda C: dynamic_expansion(solution, C, 0.21),
        "mdre": lambda C: minimum_residual(solution, C, 0.21, 0.02),
    }[name]
    wanted = every @ make(some).shape(psi[~np.isnan(psi)])
    np.testing.assert_allclose(make(every).predicted(psi), wanted, rtol=1e-8)
    np.testing.assert_allclose(every @ make(every).shape(psi), wanted, rtol=1e-8)


def _test(
    factor: float, noise: float = 0.0, sensors: int = 8
) -> tuple[EigenSolution, sp.csr_array, ModeSet, np.ndarray]:
    solution, _ = _model()
    truth, _ = _model(factor)
    configured = factor_model(spring_structure(SPRINGS, np.linspace(1.0, 2.0, N)), {"k2": [2]})
    C = sensor_rows(configured, range(sensors))
    shapes = C @ truth.shapes[:, :3]
    shapes = shapes + noise * np.random.default_rng(1).standard_normal(shapes.shape)
    dofs = DofSet.parse([f"{i + 1}X+" for i in range(sensors)])
    return solution, C, ModeSet(truth.freq_hz[:3], shapes, dofs), truth.shapes[:, :3]


@pytest.mark.slow
def test_the_held_out_error_is_zero_for_the_right_model_and_grows_with_its_error() -> None:
    worst = []
    for factor in (1.0, 0.9, 0.5):
        solution, C, test, _ = _test(factor)
        found = expand_shapes(solution, test, C, "dynamic", basis=range(3), noise=1e-7)
        assert found.groups == 8
        worst.append([float(found.held_out[name].max()) for name in ("serep", "dynamic", "mdre")])
    np.testing.assert_allclose(worst[0], 0.0, atol=2e-6)
    assert (np.array(worst[1]) > 1e-4).all()
    assert (np.array(worst[2]) > 2.0 * np.array(worst[1])).all()


def test_noise_passes_dynamic_expansion_and_is_smoothed_by_serep() -> None:
    solution, C, test, true = _test(1.0, noise=0.02)
    smooth = expand_shapes(solution, test, C, "serep", basis=range(3))
    rough = expand_shapes(solution, test, C, "dynamic", basis=range(3))
    noise = test.shapes - C @ true
    # SEREP keeps the projection of the noise on the modes at the sensors, the dynamic expansion all of it
    np.testing.assert_allclose(C @ rough.shapes - C @ true, noise, atol=1e-9)
    seen = C @ true
    np.testing.assert_allclose(C @ smooth.shapes - seen, seen @ np.linalg.pinv(seen) @ noise, atol=1e-9)
    assert (rough.misfit < 1e-10).all()
    assert (smooth.misfit > 0.01).all()


def test_what_cannot_be_expanded_is_nan() -> None:
    solution, C, test, _ = _test(0.9)
    shapes = test.shapes.copy()
    shapes[:, 1] = np.nan
    shapes[3:, 2] = np.nan
    test = ModeSet(test.freq_hz, shapes, test.dofs)
    found = expand_shapes(solution, test, C, "serep", basis=range(4))
    assert np.isfinite(found.shapes[:, 0]).all()
    assert np.isnan(found.shapes[:, 1:]).all()
    assert np.isnan(found.misfit[1:]).all()
    assert np.isnan(found.held_out["serep"][1:]).all()
    assert np.isfinite(found.held_out["dynamic"][[0, 2]]).all()
    none = expand_shapes(solution, test, C, "serep", basis=())
    assert np.isnan(none.shapes).all()


def test_sensors_of_a_node_are_left_out_together() -> None:
    dofs = DofSet.parse(["4X+", "4Y+", "9Z-", "4Z+", "7X+"])
    assert [g.tolist() for g in held_out_groups(dofs)] == [[0, 1, 3], [2], [4]]
    # two nodes: single sensors
    assert [g.tolist() for g in held_out_groups(dofs.select([0, 1, 2]))] == [[0], [1], [2]]
    assert held_out_groups(dofs.select([0])) == []
    many = held_out_groups(DofSet.parse([f"{i}Z+" for i in range(1, 26)]))
    assert len(many) == 10
    assert sorted(np.concatenate(many)) == list(range(25))


def test_without_groups_there_is_no_error() -> None:
    solution, C, test, _ = _test(0.9)
    assert np.isnan(held_out_error(serep(solution, C, range(2)), np.array(test.shapes[:, 0]), []))
