"""Memory of the making of a basis."""

from __future__ import annotations

import tracemalloc

import numpy as np
import scipy.sparse as sp

from femtune.model.linear.symmetric import symmetric
from femtune.model.reduce.estimate import orthonormal


def test_a_basis_takes_little_memory_beside_its_vectors() -> None:
    """Scaled vectors and the result, and products with the metric a few columns at a time."""
    n, columns = 4000, 100
    metric = symmetric(
        sp.diags_array([np.full(n - 1, -1.0), np.full(n, 2.5), np.full(n - 1, -1.0)], offsets=[-1, 0, 1])
    )
    vectors = np.random.default_rng(0).standard_normal((n, columns))
    tracemalloc.start()
    try:
        basis = orthonormal(vectors, metric)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    np.testing.assert_allclose(basis.T @ (metric.full() @ basis), np.eye(columns), atol=1e-12)
    assert peak < 3.0 * vectors.nbytes
