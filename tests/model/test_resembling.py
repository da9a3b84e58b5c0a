"""Frequencies in the span of vectors that are not independent, as those of a model of few degrees of freedom."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from femtune.model.resembling import resembling_hz


@pytest.mark.parametrize("more", [0, 1, 3])
def test_dependent_vectors_add_nothing(more: int) -> None:
    """Modes of a random system are found in their own span, whatever combinations of them are repeated."""
    rng = np.random.default_rng(1)
    stiffness = (a := rng.normal(size=(6, 6))) @ a.T + 6.0 * np.eye(6)
    mass = np.diag(rng.uniform(1.0, 2.0, 6))
    eigenvalues, modes = la.eigh(stiffness, mass)
    basis = np.hstack([modes[:, :4], modes[:, :4] @ rng.normal(size=(4, more)), np.zeros((6, more and 1))])
    found = resembling_hz(modes[:, :3], basis, stiffness, mass)
    np.testing.assert_allclose(found, np.sqrt(eigenvalues[:3]) / (2.0 * np.pi), rtol=1e-9)
