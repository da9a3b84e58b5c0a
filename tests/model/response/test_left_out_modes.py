"""FRFs without the terms of some modes, and their derivatives, beside dense algebra at complex parameters."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model import ConfiguredModel, solve_modes
from femtune.model.damping import constant_damping
from femtune.model.kinds import FrfMethod
from femtune.model.response import METHODS, Ports, frf_gradient, make_ports, survey_functions

from .models import chain, configured

SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (0, 2, 150.0)]
FACTORS = {"k": ("K", 2), "m": ("M", 3), "c": ("B", 1), "g": ("GE", 2)}
LINES = np.linspace(0.5, 9.0, 12)
ZETA = 0.03


def _model() -> tuple[ConfiguredModel, Ports]:
    model = configured(chain(SPRINGS, [1.0, 2.0, 1.5, 1.0], [(-1, 1, 3.0), (2, 3, 5.0)], 0.02), FACTORS)
    return model, make_ports(model, ["1X+", "3X+"], ["1X+", "2X-", "4X+"])


def _terms(model: ConfiguredModel, ports: Ports, x: NDArray, members: list[int], zeta: float) -> NDArray:
    """(outputs, inputs, lines) CQ (QᵀZQ)⁻¹ QᵀB of modes of complex matrices, shapes with φᵀMφ = 1."""
    point = model.at(x)
    K, M, D, H = (np.array(A.toarray()) for A in (point.stiffness, point.mass, point.viscous, point.hysteretic))
    values, shapes = la.eig(K, M)
    order = np.argsort(values.real)[members]
    Q, values = shapes[:, order], values[order]
    Q = Q / np.sqrt(np.einsum("ij,ij->j", Q, M @ Q))
    C, B = ports.outputs.toarray(), ports.inputs.toarray()
    out = []
    for s in 2j * np.pi * LINES:
        Z = np.diag(values + 2.0 * zeta * np.sqrt(values) * s) + s**2 * (Q.T @ M @ Q) + s * (Q.T @ D @ Q)
        out.append(C @ Q @ la.solve(Z + 1j * (Q.T @ H @ Q), Q.T @ B))
    return np.moveaxis(np.array(out), 0, -1)


@pytest.mark.quick(0)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("members", [[1], [1, 2], [0, 3]])
@pytest.mark.parametrize("zeta", [0.0, ZETA])
def test_their_terms_are_taken_away_with_their_derivatives(method: FrfMethod, members: list[int], zeta: float) -> None:
    model, ports = _model()
    modes, damping = solve_modes(model.at(np.zeros(4)), 4), constant_damping(zeta) if zeta else None
    whole, part = (
        frf_gradient(modes, ports, LINES, "receptance", method, damping=damping, left_out=left_out)
        for left_out in ((), members)
    )
    terms = _terms(model, ports, np.zeros(4), members, zeta)
    taken = whole.frfs.values - part.frfs.values
    np.testing.assert_allclose(taken, terms, atol=1e-9 * np.abs(terms).max())
    h = 1e-6
    for i in range(4):
        ends = (_terms(model, ports, s * h * np.eye(4)[i], members, zeta) for s in (1j, -1j))
        exact = np.subtract(*ends) / (2j * h)
        slope = (whole.gradient - part.gradient)[..., i]
        assert np.abs(slope - exact).max() <= 1e-7 * np.abs(exact).max()
    values = survey_functions(modes, ports, LINES, "receptance", method, damping=damping, left_out=members)
    np.testing.assert_allclose(values, part.frfs.values, atol=1e-6 * np.abs(whole.frfs.values).max())


def test_the_other_modes_alone_are_left_where_nothing_is_truncated() -> None:
    model, ports = _model()
    modes, damping = solve_modes(model.at(np.zeros(4)), 4), constant_damping(ZETA)
    found = frf_gradient(modes, ports, LINES, damping=damping, left_out=[0, 1, 2, 3])
    whole = frf_gradient(modes, ports, LINES, damping=damping)
    assert np.abs(found.frfs.values).max() <= 1e-9 * np.abs(whole.frfs.values).max()
    assert np.abs(found.gradient).max() <= 1e-8 * np.abs(whole.gradient).max()


def test_they_need_modes() -> None:
    model, ports = _model()
    with pytest.raises(FemtuneError) as caught:
        frf_gradient(model.at(np.zeros(4)), ports, LINES, method="direct", left_out=[1])
    assert caught.value.code == "response.modes-needed"
