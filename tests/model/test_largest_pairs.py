"""The largest eigenvalues of a symmetric matrix where LAPACK's fast routine gives up."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from femtune.model.eigen.pairs import largest


def test_the_other_routine_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    Q = la.qr(rng.standard_normal((12, 12)))[0]
    matrix = Q @ np.diag([1.0, 2.0, *[3.0] * 7, 4.0, 5.0, 6.0]) @ Q.T
    theta, vectors = largest(matrix, 3)
    solve = la.eigh

    def gives_up(matrix, **options):
        if options.get("driver") != "evd":
            raise la.LinAlgError("Internal Error.")
        return solve(matrix, **options)

    monkeypatch.setattr(la, "eigh", gives_up)
    other, others = largest(matrix, 3)
    np.testing.assert_allclose(theta, [4.0, 5.0, 6.0], rtol=1e-12)
    np.testing.assert_allclose(other, theta, rtol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(vectors * others, axis=0)), 1.0, rtol=1e-10)
