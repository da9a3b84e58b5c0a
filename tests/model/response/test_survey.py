"""FRFs for a survey: those of direct solutions but for the last digits, and zeros where these are zero."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.model import ConfiguredModel, EigenSolution, constant_damping, solve_modes
from femtune.model.response import frf, make_ports, survey_functions
from structures.springs import factor_model, spring_structure

LINES = np.geomspace(0.05, 0.6, 30)
DAMPING = constant_damping(0.02)


@pytest.fixture(scope="module", params=["free", "held"])
def chain(request: pytest.FixtureRequest) -> ConfiguredModel:
    """Forty masses in a row, held at one end or free."""
    first = [(-1, 0, 500.0)] if request.param == "held" else []
    springs = first + [(i - 1, i, 900.0 * (1.0 + 0.1 * np.sin(i))) for i in range(1, 40)]
    return factor_model(spring_structure(springs, [1.0] * 40), {"a": list(range(1, len(springs) + 1))})


@pytest.fixture(scope="module")
def solved(chain: ConfiguredModel) -> EigenSolution:
    return solve_modes(chain.at(np.zeros(1)), 15)


def test_residual_vectors_at_the_shift_serve_as_well_as_static_ones(
    chain: ConfiguredModel, solved: EigenSolution
) -> None:
    """Five modes lie below twice the highest line; the lower half of the lines is compared with direct solutions."""
    ports = make_ports(chain, ["3X+", "20X+"], ["3X+", "11X+", "40X+"])
    found = survey_functions(solved, ports, LINES, "accelerance", damping=DAMPING)
    exact = frf(solved, ports, LINES, "accelerance", "direct", damping=DAMPING).values
    assert np.abs(found / exact - 1.0).max() < 1e-4


@pytest.mark.slow
def test_the_direct_way_is_the_direct_solution(chain: ConfiguredModel, solved: EigenSolution) -> None:
    ports = make_ports(chain, ["3X+"], ["11X+"])
    found = survey_functions(solved, ports, LINES, "mobility", "direct", damping=DAMPING)
    exact = frf(solved, ports, LINES, "mobility", "direct", damping=DAMPING).values
    np.testing.assert_allclose(found, exact, rtol=1e-12)


def test_without_residual_vectors_the_modes_are_all(chain: ConfiguredModel, solved: EigenSolution) -> None:
    ports = make_ports(chain, ["3X+"], ["11X+", "12X+"])
    found = survey_functions(solved, ports, LINES, "receptance", damping=DAMPING, residual_vectors=False)
    exact = frf(solved, ports, LINES, "receptance", damping=DAMPING, residual_vectors=False).values
    np.testing.assert_allclose(found, exact, rtol=1e-10)
