"""Superposed FRFs beside direct solutions: their error is below the stated one, and the estimate is no smaller."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.model import solve_modes
from femtune.model.damping import constant_damping
from femtune.model.kinds import FrfMethod
from femtune.model.response import ACCURACY, TIMES_HIGHEST_LINE, DampingRatios, frf, frf_with_error, make_ports

from .models import beam

CASES: dict[str, tuple[dict[str, object], DampingRatios | None]] = {
    "modal": ({"clamped": True}, constant_damping(0.01)),
    "free": ({"clamped": False}, constant_damping(0.01)),
    "dashpot": ({"clamped": True, "dashpots": [(-1, 45, 300.0)]}, constant_damping(0.01)),
    "loss factor": ({"clamped": True, "GE": 0.05}, None),
}


def _error(found: NDArray, exact: NDArray) -> float:
    """As `WithError.error`, at all lines."""
    size = np.maximum(np.abs(exact), 0.01 * np.abs(exact).max(axis=2, keepdims=True))
    return float((np.abs(found - exact) / size).max())


@pytest.mark.quick(0)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("method", ["real-modes", "complex-modes"])
def test_the_error_is_below_the_stated_one(case: str, method: FrfMethod) -> None:
    more, damping = CASES[case]
    at = beam(20, **more)  # type: ignore[arg-type]
    top = 863.5
    lines = np.linspace(top / 100, top, 60)
    ports = make_ports(at.configured, ["21Y+", "11Y+", "3Y+"], ["21Y+", "7Y+"])
    modes = solve_modes(at, max_hz=TIMES_HIGHEST_LINE * top)
    exact = frf(modes, ports, lines, "accelerance", "direct", damping=damping).values
    found = frf_with_error(modes, ports, lines, "accelerance", method, damping=damping)
    assert found.error is not None
    assert found.error <= ACCURACY
    assert _error(found.frfs.values, exact) <= ACCURACY
    before = _error(frf(modes, ports, lines, "accelerance", method, damping=damping).values, exact)
    assert before > 10 * ACCURACY
    few = frf_with_error(modes, ports, lines, "accelerance", method, damping=damping, add_vectors=False)
    assert few.error is not None
    # at a few of the lines
    assert 0.1 * before < few.error <= before * (1 + 1e-6)


@pytest.mark.slow
def test_too_few_modes_have_an_error_that_is_known() -> None:
    at = beam(20, clamped=True)
    lines, damping = np.linspace(5.0, 500.0, 40), constant_damping(0.01)
    ports = make_ports(at.configured, ["21Y+"], ["21Y+"])
    modes = solve_modes(at, 2)
    exact = frf(modes, ports, lines, "receptance", "direct", damping=damping).values
    for vectors in (True, False):
        found = frf_with_error(
            modes, ports, lines, "receptance", damping=damping, residual_vectors=vectors, add_vectors=False
        )
        assert found.error is not None
        assert 0.1 * _error(found.frfs.values, exact) < found.error <= _error(found.frfs.values, exact) * (1 + 1e-9)
    assert frf_with_error(modes, ports, lines, method="direct", damping=damping).error == 0.0
