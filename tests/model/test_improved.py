"""Inverse iteration from vectors near the modes, beside solutions of the full eigenproblem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

from femtune.model import EigenSolution, solve_modes
from femtune.model.eigen.improved import improved_modes
from structures.springs import factor_model, spring_structure


@pytest.fixture(scope="module")
def near() -> tuple[EigenSolution, np.ndarray]:
    """Modes of a chain with other springs, and the eigenvalues of the chain by a dense solution."""
    springs = [(i - 1, i, 900.0 * (1.0 + 0.1 * np.sin(i))) for i in range(60)]
    model = factor_model(spring_structure(springs, [1.0] * 60), {"a": list(range(1, 31)), "b": list(range(31, 61))})
    there, point = solve_modes(model.at(np.array([0.2, -0.1])), 12), model.at(np.zeros(2))
    values = la.eigh(point.stiffness.toarray(), point.mass.toarray(), eigvals_only=True)
    shapes = there.shapes[:, :16]
    return replace(there, point=point, shapes=shapes, eigenvalues=there.eigenvalues[:16], wanted=12), values


def test_each_step_makes_the_eigenvalues_better(near: tuple[EigenSolution, np.ndarray]) -> None:
    start, exact = near
    errors = []
    for steps in (1, 2, 3):
        found = improved_modes(start, steps)
        off = found.eigenvalues[:8] / exact[:8] - 1.0
        # Rayleigh and Ritz: never below
        assert (off > -1e-12).all()
        errors.append(off.max())
        gram = found.shapes.T @ (start.point.mass @ found.shapes)
        np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-9)
        stiff = found.shapes.T @ (start.point.stiffness @ found.shapes)
        np.testing.assert_allclose(stiff, np.diag(found.eigenvalues), atol=1e-9 * found.eigenvalues.max())
    # a part of λ_k in a mode of λ_j falls by λ_j/λ_k, the error of the eigenvalue by its square
    slowest = (exact[7] / exact[16]) ** 2
    assert errors[1] < max(slowest * errors[0], 1e-12) * 1.5
    assert errors[2] < max(slowest * errors[1], 1e-12) * 1.5
    assert found.wanted == 12
    assert found.sturm_count == -1
