"""Residuals of functions where the model has repeated modes, and parameters that split them."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.model import ConfiguredModel, EigenSolution, solve_modes
from femtune.model.damping import constant_damping
from femtune.model.kinds import FrfMethod
from femtune.model.response import METHODS, frf, make_ports
from femtune.residuals import (
    Band,
    ModelWay,
    UpdateProblem,
    antiresonance_residual,
    case_without_modes,
    frf_residual,
    measured_antiresonances,
)
from femtune.residuals.case import Residual
from femtune.testing import check_residual
from structures.springs import factor_model, spring_structure

SPLIT = np.array([0.2, 0.1, 0.1])
LINES = np.linspace(0.3, 2.4, 600)
at_and_beside = pytest.mark.parametrize("x", [(0.0, 0.0, 0.0), (0.05, -0.02, 0.0)])


def ring() -> ConfiguredModel:
    """Two pairs of repeated modes at nominal; two springs and a mass split them, each in its own way."""
    springs = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    return factor_model(spring_structure(springs, [1.0] * 6), {"a": [1], "b": [3], "m": [1002]})


def solved(x: np.ndarray) -> EigenSolution:
    return solve_modes(ring().at(x), 6)


def problem_of(residual: Residual) -> UpdateProblem:
    case = case_without_modes(ring(), (residual,), count=6)
    return UpdateProblem((case,), case.configured.model.parameters)


def test_the_modes_are_repeated() -> None:
    hz = solved(np.zeros(3)).freq_hz
    np.testing.assert_allclose(hz[[1, 3]], hz[[2, 4]], rtol=1e-9)
    assert np.diff(solved(SPLIT).freq_hz).min() > 1e-3 * hz[0]


@pytest.mark.slow
@at_and_beside
@pytest.mark.parametrize("method", METHODS)
def test_jacobian_of_functions(method: FrfMethod, x: tuple[float, ...]) -> None:
    damping = constant_damping(0.02)
    test = frf(solved(SPLIT), make_ports(ring(), ["1X+"], ["1X+", "2X+", "4X+"]), LINES, damping=damping)
    way = ModelWay(method, (6, None), damping)
    residual, _ = frf_residual(solved(np.zeros(3)), test, Band(most=40), way=way)
    check_residual(problem_of(residual), np.array(x), length=0.001)


@pytest.mark.slow
@at_and_beside
def test_jacobian_of_antiresonances(x: tuple[float, ...]) -> None:
    """Zeros of a driving point that is a node of one mode of each pair."""
    ports = make_ports(ring(), ["1X+"], ["1X+", "2X+", "4X+"])
    test = frf(solved(SPLIT), ports, LINES, damping=constant_damping(0.002))
    residual, _ = antiresonance_residual(solved(np.zeros(3)), test, measured_antiresonances(test))
    problem = problem_of(residual)
    assert len(problem.start(np.zeros(3)).blocks) > 2
    check_residual(problem, np.array(x))
