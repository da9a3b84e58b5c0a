"""Energy maps and error localisation on chains and a bar frame."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.model import Configuration, eigenvalue_derivatives, solve_modes
from femtune.selection import energy_map, residual_energy
from structures.springs import factor_model, sensor_rows, spring_structure

SPRINGS = [(0, -1, 4.0), (0, 1, 3.0), (1, 2, 2.0), (2, 3, 2.0), (3, 4, 1.0), (4, 5, 1.0)]
GROUPS = {f"k{i}": (i,) for i in range(1, 7)}


def _chain(more=None, configuration=None):
    structure = spring_structure(SPRINGS, [1.0, 1.0, 2.0, 1.0, 1.0, 0.5])
    groups = {"k3": [3], "m2": [1002], **(more or {})}
    return factor_model(structure, groups, configuration=configuration)


def test_shares_are_those_of_a_spring_and_of_a_mass():
    model = _chain()
    solution = solve_modes(model.at(np.zeros(2)), 4)
    found = energy_map(solution)
    phi, values = solution.shapes[:, :4], solution.eigenvalues[:4]
    at = found.groups.index("3")
    np.testing.assert_allclose(found.strain[at], 2.0 * (phi[2] - phi[1]) ** 2 / values)
    np.testing.assert_allclose(found.kinetic[found.groups.index("1002")], phi[1] ** 2)
    np.testing.assert_allclose(found.strain.sum(axis=0), 1.0)
    np.testing.assert_allclose(found.kinetic.sum(axis=0), 1.0)


def test_shares_are_the_logarithmic_derivatives_of_the_eigenvalues():
    model = _chain()
    x = np.array([0.3, -0.2])
    solution = solve_modes(model.at(x), 4)
    found = energy_map(solution, {"k3": (3,), "m2": (1002,)})
    slopes = eigenvalue_derivatives(solution)[:4] / solution.eigenvalues[:4, None] * (1.0 + x)
    np.testing.assert_allclose(found.strain[0], slopes[:, 0])
    np.testing.assert_allclose(-found.kinetic[1], slopes[:, 1])
    # a mass has no strain energy, a spring no kinetic one
    np.testing.assert_array_equal([found.strain[1], found.kinetic[0]], np.zeros((2, 4)))


def test_elements_that_are_off_have_no_energy_and_rigid_motions_no_share():
    model = _chain(configuration=Configuration(elements_off=frozenset({1})))
    found = energy_map(solve_modes(model.at(np.zeros(2)), 3), GROUPS)
    assert np.isnan(found.strain[:, 0]).all()
    np.testing.assert_array_equal(found.strain[0, 1:], 0.0)
    np.testing.assert_allclose(found.strain[:, 1:].sum(axis=0), 1.0)
    assert found.strongest(1)[0][1] == found.strain[:, 1].max()


def _measured(wrong, modes=3, sensors=(0, 2, 3, 5), noise=0.0):
    truth = _chain({wrong: [int(wrong[1:])]} if wrong != "k3" else None)
    x = np.zeros(len(truth.model.parameters.free))
    x[truth.model.parameters.index(wrong)] = -0.3
    solution = solve_modes(truth.at(x), modes)
    rows = sensor_rows(truth, sensors)
    shapes = rows @ solution.shapes[:, :modes]
    shapes = shapes * (1.0 + noise * np.random.default_rng(0).standard_normal(shapes.shape))
    return rows, shapes, solution.freq_hz


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["k1", "k2", "k3", "k4", "k5", "k6"])
def test_the_residual_gathers_at_the_spring_that_is_wrong(wrong):
    model = _chain()
    solution = solve_modes(model.at(np.zeros(2)), 6)
    rows, shapes, hz = _measured(wrong, sensors=range(6))
    total = sum(
        residual_energy(solution, rows, shapes[:, i], hz[i], GROUPS, noise=1e-6).share
        * residual_energy(solution, rows, shapes[:, i], hz[i], GROUPS, noise=1e-6).error ** 2
        for i in range(3)
    )
    assert list(GROUPS)[int(np.argmax(total))] == wrong


def test_few_sensors_with_noise_still_point_at_it():
    model = _chain()
    solution = solve_modes(model.at(np.zeros(2)), 6)
    rows, shapes, hz = _measured("k3", noise=0.005)
    found = [residual_energy(solution, rows, shapes[:, i], hz[i], GROUPS, noise=0.005) for i in range(3)]
    total = sum(f.share * f.error**2 for f in found)
    assert list(GROUPS)[int(np.argmax(total))] == "k3"
    assert all(f.misfit == pytest.approx(0.005, rel=1e-3) for f in found)


def test_the_expansion_solves_its_minimum():
    """Against a direct minimum of rᵀKr + γ|Cφ − ψ|² with γ such that the misfit is the noise."""
    model = _chain()
    solution = solve_modes(model.at(np.zeros(2)), 6)
    rows, shapes, hz = _measured("k2")
    found = residual_energy(solution, rows, shapes[:, 1], hz[1], GROUPS, noise=0.02)
    K, M, C = solution.point.stiffness.toarray(), solution.point.mass.toarray(), rows.toarray()
    Z = K - (2.0 * np.pi * hz[1]) ** 2 * M
    psi = shapes[:, 1]
    gap = C.T @ (psi - C @ found.expanded)
    load = Z @ np.linalg.solve(K, Z @ found.expanded)
    weight = (load @ gap) / (gap @ gap)
    np.testing.assert_allclose(load, weight * gap, atol=1e-8 * np.abs(load).max())
    assert weight > 0.0
    assert np.linalg.norm(psi - C @ found.expanded) == pytest.approx(0.02 * np.linalg.norm(psi), rel=1e-6)
    r = np.linalg.solve(K, Z @ found.expanded)
    assert found.error == pytest.approx(np.sqrt((r @ K @ r) / (found.expanded @ K @ found.expanded)), rel=1e-8)
    assert found.share.sum() == pytest.approx(1.0)


def test_a_mode_of_the_model_itself_leaves_nothing():
    model = _chain()
    solution = solve_modes(model.at(np.zeros(2)), 6)
    rows = sensor_rows(model, (0, 2, 4))
    found = residual_energy(solution, rows, rows @ solution.shapes[:, 2], float(solution.freq_hz[2]), GROUPS)
    assert found.error < 1e-6


def test_a_shape_without_entries_is_refused():
    model = _chain()
    solution = solve_modes(model.at(np.zeros(2)), 6)
    with pytest.raises(FemtuneError, match="cannot be expanded") as error:
        residual_energy(solution, sensor_rows(model, (0,)), np.array([np.nan]), 1.0, GROUPS)
    assert error.value.code == "select.expansion"
