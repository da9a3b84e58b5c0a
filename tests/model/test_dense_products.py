"""Products of tall blocks by the library's threads, beside numpy."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from femtune.model.linear import dense_products
from femtune.model.linear.dense_products import in_any_order


@pytest.mark.parametrize("order", list(itertools.product("CF", "CF")))
@pytest.mark.parametrize("shape", [(700, 9, 5), (9, 700, 9), (700, 700, 1), (3, 1, 700)])
def test_products_in_any_order(
    order: tuple[str, str], shape: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dense_products, "LIBRARY_FROM", 1)
    rng, (a, b, c) = np.random.default_rng(1), shape
    A, B = (np.asarray(rng.standard_normal(s), order=o) for s, o in zip(((a, b), (b, c)), order))
    exact = np.einsum("ij,jk->ik", A, B)
    np.testing.assert_allclose(in_any_order(A, B), exact, atol=1e-12)
    # transposed views, views with gaps, and numbers of another kind
    np.testing.assert_allclose(in_any_order(B.T, A.T), exact.T, atol=1e-12)
    np.testing.assert_allclose(in_any_order(A[::2], B[:, ::-1]), exact[::2, ::-1], atol=1e-12)
    np.testing.assert_allclose(in_any_order(A, (1j * B)).imag, exact, atol=1e-12)
