"""Four-storey laboratory frame: published stiffness changes from modes 1 and 2 at three floors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from femtune.dofs import Dof, DofSet
from femtune.fem import FieldRef
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, configure, parametric_model, solve_modes
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase, FrequencyResidual, MacResidual, ShapeResidual, UpdateProblem
from femtune.residuals.dynamic import DynamicResidual
from femtune.testing import check_residual
from femtune.updating import SensitivityMethod, UpdateResult, update

# units in-lbf-s: weights in lbf, PARAM WTMASS = 1/g
DECK = """SOL 103
CEND
BEGIN BULK
SPOINT  1       THRU    4
PARAM   WTMASS  .002590
CELAS2  101     10.0    1
CELAS2  102     10.0    1       0       2
CELAS2  103     10.0    2       0       3
CELAS2  104     10.0    3       0       4
CMASS2  201     12.06   1
CMASS2  202     12.06   2
CMASS2  203     12.06   3
CMASS2  204     12.06   4
ENDDATA
""".replace("PARAM   WTMASS  .002590", f"PARAM*  WTMASS          {1 / 386.088:.13f}")

# METHODS: published, and recomputed to the fourth digit
BY_MAC = [-0.2603, -0.2159, -0.1283, 0.5327]
BY_DIFFERENCE = [-0.2477, -0.2689, -0.1188, 0.5775]
BY_FORCE = [-0.2719, -0.2510, -0.1164, 0.5330]
UPPER_MODES = {"dynamic": (4.224, 5.577), "mac": (4.283, 5.571), "difference": (4.214, 5.626)}


@pytest.fixture(scope="session")
def measured(shared_data: Path) -> ModeSet:
    data = scipy.io.loadmat(shared_data / "frame_4storey" / "FourStoryStructure.mat")
    dofs = DofSet(Dof(i, "S") for i in (1, 2, 3))
    return ModeSet(data["test_frequency"].ravel()[:2], data["test_mode"][:3, :2], dofs)


def _problem(tmp_path: Path, test: ModeSet, form: str) -> UpdateProblem:
    path = tmp_path / "chain.bdf"
    path.write_text(DECK)
    structure = build_structure(read_deck(path)).structure
    storeys = [Parameter(f"k{i}", 1.0, 0.0, 2.0) for i in range(1, 5)]
    assignments = [Assignment(f"k{i}", FieldRef("CELAS2", 100 + i, "K")) for i in range(1, 5)]
    model = configure(parametric_model(structure, ParameterSet(tuple(storeys)), assignments), Configuration())
    # storey stiffnesses may go down to a mechanism: the bound is not reached
    assert model.free.tolist() == [0, 1, 2, 3]
    case = ComparedCase(model, test, sp.eye_array(3, 4, format="csr"), count=4)
    of_shapes = MacResidual(1.0) if form == "mac" else ShapeResidual(1.0, "largest-entry")
    residuals = (FrequencyResidual(1.0, "eigenvalue"), of_shapes)
    return UpdateProblem((case,), model.model.parameters, residuals)


def _run(tmp_path: Path, test: ModeSet, form: str) -> UpdateResult:
    return update(_problem(tmp_path, test, form), SensitivityMethod(max_iterations=100, smallest_change=0.0))


@pytest.mark.slow
@pytest.mark.parametrize(("form", "published"), [("mac", BY_MAC), ("difference", BY_DIFFERENCE)])
def test_published_changes_and_predictions(tmp_path: Path, measured: ModeSet, form: str, published: list[float]):
    result = _run(tmp_path, measured, form)
    assert result.status.ok
    np.testing.assert_allclose(result.x, published, atol=1e-4)
    found = solve_modes(result.after.states[0].solution.point, 4).freq_hz
    np.testing.assert_allclose(found[2:], UPPER_MODES[form], atol=6e-4)


def test_nominal_frequencies_are_those_of_a_uniform_chain(tmp_path: Path, measured: ModeSet):
    problem = _problem(tmp_path, measured, "mac")
    found = problem.start(np.zeros(4)).states[0].solution.freq_hz
    omega = 2.0 * np.sqrt(10.0 / (12.06 / 386.088)) * np.sin(np.pi * np.array([1, 3, 5, 7]) / 18)
    np.testing.assert_allclose(2 * np.pi * found, omega, rtol=1e-9)


@pytest.mark.slow
def test_published_changes_by_the_dynamic_residual(tmp_path: Path, measured: ModeSet):
    """(K − λ_e M)ψ with the motion of the fourth floor as an unknown."""
    problem = _problem(tmp_path, measured, "mac")
    case = replace(problem.cases[0], residuals=(DynamicResidual(1.0),))
    problem = UpdateProblem((case,), problem.parameters, ())
    result = update(problem, SensitivityMethod(max_iterations=100, smallest_change=0.0))
    assert result.status.ok
    np.testing.assert_allclose(result.x, BY_FORCE, atol=1e-4)
    found = solve_modes(result.after.states[0].point, 4).freq_hz
    np.testing.assert_allclose(found[2:], UPPER_MODES["dynamic"], atol=6e-4)
    check_residual(problem, np.array([0.1, -0.1, 0.05, 0.2]))
