"""Aligned modes of repeated pairs and triples against central differences along single directions."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.modal import rotate_to
from femtune.model import ConfiguredModel, EigenSolution, solve_modes, subspace_derivative
from femtune.residuals.aligned import AlignedModes, align
from femtune.testing.derivatives import check_directional
from structures.springs import factor_model, sensor_rows, spring_structure


def ring(n: int = 6) -> ConfiguredModel:
    """Equal masses in a ring with ground springs: pairs of equal frequencies. Parameters break the symmetry."""
    springs = [(i, (i + 1) % n, 40.0) for i in range(n)] + [(-1, i, 10.0) for i in range(n)]
    groups = {"a": [1], "b": [2, 3], "c": [n + 3], "m": [1002]}
    return factor_model(spring_structure(springs, [1.0] * n), groups)


def tetrahedron() -> ConfiguredModel:
    """Four equal masses, all joined to all: one single mode, then three equal ones."""
    pairs = [(i, j, 30.0) for i in range(4) for j in range(i)] + [(-1, i, 7.0) for i in range(4)]
    groups = {"a": [1], "b": [2], "c": [9], "m": [1003]}
    return factor_model(spring_structure(pairs, [1.0] * 4), groups)


def aligned_at(model: ConfiguredModel, x: np.ndarray, members: list[int], test: np.ndarray) -> AlignedModes:
    solution = solve_modes(model.at(x), max(members) + 1)
    return align(subspace_derivative(solution, members, sensor_rows(model, range(test.shape[0]))), test)


def flat(aligned: AlignedModes) -> np.ndarray:
    return np.concatenate([aligned.eigenvalues, aligned.shapes.ravel()])


def jacobian(aligned: AlignedModes) -> np.ndarray:
    k = aligned.eigenvalue_gradients.shape[-1]
    return np.vstack([aligned.eigenvalue_gradients, aligned.shape_gradients.reshape(-1, k)])


def turned_shapes(model: ConfiguredModel, members: list[int], t: int) -> np.ndarray:
    """t test shapes: the cluster's vectors turned, mixed a little and spoilt by noise, in any scale."""
    solution = solve_modes(model.at(np.zeros(4)), max(members) + 1)
    rng = np.random.default_rng(5)
    turn = np.linalg.qr(rng.standard_normal((len(members),) * 2))[0][:, :t]
    test = solution.shapes[:, members] @ (turn + 0.1 * rng.standard_normal(turn.shape))
    return (test + 0.05 * rng.standard_normal(test.shape)) * rng.uniform(-3.0, 3.0, t)


CASES = {
    "pair": (ring, [1, 2], 2),
    "pair, one test mode": (ring, [1, 2], 1),
    "second pair": (ring, [3, 4], 2),
    "triple": (tetrahedron, [1, 2, 3], 3),
    "triple, two test modes": (tetrahedron, [1, 2, 3], 2),
    "triple, one test mode": (tetrahedron, [1, 2, 3], 1),
    "single": (ring, [0], 1),
}


@pytest.mark.quick(0, gate=10)
@pytest.mark.parametrize("apart", [0.0, 1e-7, 1e-3, 0.2])
@pytest.mark.parametrize("name", CASES)
def test_gradients(name: str, apart: float):
    """At exact repetition, in its neighbourhood and away from it: the functions are smooth throughout."""
    make, members, t = CASES[name]
    model = make()
    test = turned_shapes(model, members, t)
    x = apart * np.array([1.0, -0.5, 0.3, 0.2])
    whole = jacobian(aligned_at(model, x, members, test))
    for direction in [*np.eye(4), np.array([0.5, -1.0, 0.7, 0.3])]:
        check_directional(lambda y: flat(aligned_at(model, y, members, test)), whole, x, direction, 1e-7)


def test_gradients_with_entries_that_were_not_measured():
    model = ring()
    test = turned_shapes(model, [1, 2], 2)
    test[0, 0] = test[3, 1] = np.nan
    whole = jacobian(aligned_at(model, np.zeros(4), [1, 2], test))
    for direction in np.eye(4):
        check_directional(lambda y: flat(aligned_at(model, y, [1, 2], test)), whole, np.zeros(4), direction, 1e-7)


@pytest.mark.parametrize("measured", [True, False])
def test_the_rotation_is_that_of_the_correlation(measured: bool):
    model = tetrahedron()
    test = turned_shapes(model, [1, 2, 3], 2)
    if not measured:
        test[2, 1] = np.nan
    solution: EigenSolution = solve_modes(model.at(np.zeros(4)), 4)
    shapes = solution.shapes[:, 1:4]
    found = align(subspace_derivative(solution, [1, 2, 3]), test)
    np.testing.assert_allclose(found.shapes, rotate_to(shapes, test).aligned, atol=1e-12)


def test_aligned_eigenvalues_do_not_depend_on_the_solver_s_vectors():
    """Any basis of the pair gives the same functions; their sum is the trace."""
    model = ring()
    test = turned_shapes(model, [1, 2], 2)
    found = aligned_at(model, np.zeros(4), [1, 2], test)
    np.testing.assert_allclose(found.eigenvalues, 10.0 + 40.0 * 2.0 * (1 - np.cos(np.pi / 3)), rtol=1e-12)
    x = np.array([0.1, 0.0, 0.2, 0.0])
    moved = aligned_at(model, x, [1, 2], test)
    assert moved.eigenvalues.sum() == pytest.approx(solve_modes(model.at(x), 3).eigenvalues[1:3].sum(), rel=1e-12)


def test_a_shape_outside_the_subspace_is_refused():
    model = ring()
    uniform = np.ones((6, 1))
    solution = solve_modes(model.at(np.zeros(4)), 3)
    derivative = subspace_derivative(solution, [1, 2])
    exact = derivative.shapes - uniform @ (uniform.T @ derivative.shapes) / 6
    blind = type(derivative)(
        derivative.eigenvalues, derivative.stiffness, derivative.mass, derivative.outside, 0 * exact
    )
    with pytest.raises(FemtuneError, match=r"residual\.unseen-mode"):
        align(blind, uniform)
