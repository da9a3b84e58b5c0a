"""Complex symmetric factors, and complex right-hand sides of real ones, by each solver at hand."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.model import available_solvers
from femtune.model.solvers.factorise import factorise


@pytest.mark.parametrize("solver", available_solvers())
@pytest.mark.parametrize("imaginary", [0.0, 0.3])
@pytest.mark.parametrize("columns", [(), (3,)])
def test_solves(solver: str, imaginary: float, columns: tuple[int, ...]) -> None:
    n, random = 200, np.random.default_rng(0)
    half = sp.random_array((n, n), density=0.02, rng=random)
    real = half + half.T + sp.diags_array(np.linspace(3.0, 9.0, n))
    matrix = sp.csr_array(real + 1j * imaginary * (half + half.T + sp.eye_array(n)) if imaginary else real)
    factor = factorise(matrix, solver)
    for b in (random.standard_normal((n, *columns)), random.standard_normal((n, *columns)) + 2j):
        x = factor.solve(b)
        assert np.iscomplexobj(x) == bool(imaginary or np.iscomplexobj(b))
        np.testing.assert_allclose(matrix @ x, b, atol=1e-10)
    assert (factor.negative_pivots is None) == bool(imaginary)
