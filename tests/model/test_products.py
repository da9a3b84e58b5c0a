"""Products with terms and derivatives beside the assembled matrices."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.errors import FemtuneError
from femtune.model import ModelPoint, products
from femtune.model.linear import memory
from femtune.model.linear.symmetric import symmetric
from femtune.model.products import derivative_energies, derivative_product, derivative_projections, projections

from .plates import two_halves


@pytest.fixture(scope="module")
def point() -> ModelPoint:
    return two_halves(5, 4).at(np.array([0.1, -0.2, 0.05]))


def _vectors(point: ModelPoint, count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((point.configured.n_free, count))


@pytest.mark.parametrize("kind", ["stiffness", "mass"])
def test_projections_add_up_to_the_projected_matrix(point: ModelPoint, kind: str) -> None:
    left, right = _vectors(point, 3, 0), _vectors(point, 2, 1)
    total = np.zeros((3, 2))
    for at, sandwich in projections(point.configured, kind, left, right).items():  # type: ignore[arg-type]
        c = point.coefficients[at]
        total += sandwich[0] if c is None else np.tensordot(c.value, sandwich, (0, 0))
    np.testing.assert_allclose(total, left.T @ (getattr(point, kind) @ right), rtol=1e-11)


@pytest.mark.parametrize("same", [True, False])
def test_projections_on_more_vectors_than_are_multiplied_at_a_time(point: ModelPoint, same: bool) -> None:
    left = _vectors(point, 2 * products.COLUMNS_AT_ONCE + 5, 6)
    right = left if same else _vectors(point, products.COLUMNS_AT_ONCE + 3, 7)
    total = np.zeros((left.shape[1], right.shape[1]))
    for at, sandwich in projections(point.configured, "stiffness", left, right).items():
        c = point.coefficients[at]
        total += sandwich[0] if c is None else np.tensordot(c.value, sandwich, (0, 0))
    expected = left.T @ (point.stiffness @ right)
    np.testing.assert_allclose(total, expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("kind", ["stiffness", "mass"])
def test_derivative_products_equal_those_of_assembled_derivatives(point: ModelPoint, kind: str) -> None:
    left, right = _vectors(point, 3, 2), _vectors(point, 4, 3)
    matrices = getattr(point, f"{kind}_derivatives")
    for i, matrix in enumerate(matrices):
        expected = matrix @ right
        size = np.abs(expected).max() + 1e-300
        np.testing.assert_allclose(derivative_product(point, kind, i, right), expected, atol=1e-12 * size)  # type: ignore[arg-type]
    both = np.array([left.T @ (m @ right) for m in matrices])
    np.testing.assert_allclose(derivative_projections(point, kind, left, right), both, atol=1e-11 * np.abs(both).max())  # type: ignore[arg-type]
    own = np.array([np.einsum("ij,ij->j", right, m @ right) for m in matrices])
    np.testing.assert_allclose(derivative_energies(point, kind, right), own, atol=1e-11 * np.abs(own).max())  # type: ignore[arg-type]


@pytest.mark.parametrize("many", [0, 10**6])
def test_columns_one_by_one_or_summed_first(point: ModelPoint, monkeypatch: pytest.MonkeyPatch, many: int) -> None:
    monkeypatch.setattr(products, "MANY_COLUMNS", many)
    vectors = _vectors(point, 4, 5)
    own = np.array([np.einsum("ij,ij->j", vectors, m @ vectors) for m in point.stiffness_derivatives])
    size = np.abs(own).max()
    np.testing.assert_allclose(derivative_energies(point, "stiffness", vectors), own, atol=1e-11 * size)
    both = np.array([vectors.T @ (m @ vectors) for m in point.stiffness_derivatives])
    np.testing.assert_allclose(derivative_projections(point, "stiffness", vectors, vectors), both, atol=1e-11 * size)
    for i, matrix in enumerate(point.stiffness_derivatives):
        expected = matrix @ vectors
        found = derivative_product(point, "stiffness", i, vectors)
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_projections_on_one_basis_are_symmetric_and_those_on_two(point: ModelPoint) -> None:
    vectors = _vectors(point, 4, 6)
    once = projections(point.configured, "stiffness", vectors, vectors)
    twice = projections(point.configured, "stiffness", vectors, vectors.copy())
    for i, sandwich in once.items():
        np.testing.assert_allclose(sandwich, twice[i], atol=1e-11 * np.abs(sandwich).max())
        np.testing.assert_array_equal(sandwich, np.swapaxes(sandwich, 1, 2))


def test_projections_that_do_not_fit_are_refused(point: ModelPoint, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 1000)
    monkeypatch.setattr(memory, "NEGLIGIBLE_BYTES", 0)
    with pytest.raises(FemtuneError, match="on a basis") as caught:
        projections(point.configured, "stiffness", _vectors(point, 9, 0), _vectors(point, 9, 0))
    assert caught.value.code == "model.memory"


def test_the_upper_triangle_stands_for_the_whole_matrix() -> None:
    full = sp.random_array((40, 40), density=0.1, random_state=3, format="csr")
    full = sp.csr_array(full + full.T)
    kept = symmetric(full)
    x = np.random.default_rng(4).standard_normal((40, 3))
    np.testing.assert_allclose(kept @ x, full @ x, atol=1e-14)
    np.testing.assert_allclose(kept @ x[:, 0], full @ x[:, 0], atol=1e-14)
    np.testing.assert_allclose(kept.diagonal(), full.diagonal(), atol=0)
    np.testing.assert_allclose(kept.full().toarray(), full.toarray(), atol=0)
    np.testing.assert_allclose(kept.plus(-2.0, kept).full().toarray(), -full.toarray(), atol=1e-15)
