"""Cases with residuals of their own: with and without test modes; modes are solved only where something asks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.study_file.residual import TABLES
from femtune.kinds import loaded
from femtune.model import EigenSolution, ModelPoint
from femtune.model.full_model import direct
from femtune.residuals import (
    CaseState,
    FrequencyResidual,
    Residual,
    ResidualBlock,
    ShapeResidual,
    UpdateProblem,
    case_without_modes,
)
from femtune.updating import ReductionRules, SensitivityMethod, update, update_reduced
from structures.springs import factor_model, simulated_case, spring_structure


@dataclass(frozen=True)
class Corner(Residual):
    """The first diagonal entry of K against a given one."""

    wanted: float
    sd: float = 1.0
    label = "corner"

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        point = state.full
        slopes = [d[0, 0] for d in point.stiffness_derivatives] if derivatives else []
        scale = self.wanted * self.sd
        values = np.array([(point.stiffness[0, 0] - self.wanted) / scale])
        return [self.block(state.case.name, "K", values, np.array([slopes]) / scale, self.sd)]


class Counting:
    """Counts the solutions for modes."""

    def __init__(self) -> None:
        self.solved = 0

    def modes(self, point: ModelPoint, count: int | None, max_hz: float | None) -> EigenSolution:
        self.solved += 1
        return direct.modes(point, count, max_hz)

    def derivative(self, *args: object) -> object:
        return direct.derivative(*args)  # type: ignore[arg-type]


MODEL = factor_model(spring_structure([(-1, 0, 900.0), (0, 1, 700.0), (-1, 1, 50.0)], [1.0, 2.0]), {"a": [1], "b": [2]})


def test_a_case_without_modes_is_not_solved_for_them():
    solver = Counting()
    case = case_without_modes(MODEL, (Corner(1780.0),), solver=solver)
    problem = UpdateProblem((case,), MODEL.model.parameters)
    result = update(problem, SensitivityMethod())
    assert result.after.objective < 1e-12
    assert solver.solved == 0
    assert result.after.states[0].solved is None
    # … and it can be, when something asks
    assert result.after.states[0].solution.freq_hz[0] > 0.0
    assert solver.solved == 1


def test_own_residuals_come_after_those_of_the_modes():
    case = replace(simulated_case(MODEL, (0.1, -0.2), (0, 1), 2), residuals=(Corner(1600.0),))
    problem = UpdateProblem((case,), MODEL.model.parameters, (FrequencyResidual(0.01), ShapeResidual(0.1)))
    start = problem.start(np.zeros(2))
    assert [b.kind for b in start.blocks] == ["frequency", "shape", "frequency", "shape", "corner"]
    assert isinstance(case.residuals[0], Residual)


@pytest.mark.parametrize("sd", [1e-200, 1e200])
def test_numbers_that_overflow_are_refused_with_the_residual(sd: float):
    problem = UpdateProblem((case_without_modes(MODEL, (Corner(1600.0, sd),)),), MODEL.model.parameters)
    with pytest.raises(FemtuneError, match="corner: the residuals or their weights") as error:
        problem.start(np.zeros(2))
    assert error.value.code == "residual.out-of-range"
    assert error.value.values["standard deviation"] == sd


def test_modes_that_are_not_compared_need_no_partner():
    far = simulated_case(MODEL, (0.1, -0.2), (0, 1), 2)
    far = replace(far, test=replace(far.test, freq_hz=10.0 * far.test.freq_hz), residuals=(Corner(1600.0),))
    silent = UpdateProblem((far,), MODEL.model.parameters)
    assert [b.kind for b in silent.start(np.zeros(2)).blocks] == ["corner"]
    with pytest.raises(FemtuneError, match=r"correlate\.no-pairs"):
        replace(silent, residuals=(FrequencyResidual(0.01),)).start(np.zeros(2))


def test_without_modes_nothing_is_reduced():
    solver = Counting()
    case = case_without_modes(MODEL, (Corner(1780.0),), solver=solver)
    found = update_reduced(UpdateProblem((case,), MODEL.model.parameters), SensitivityMethod(), ReductionRules())
    assert found.certified
    assert found.cases == ()
    assert found.rounds[0].startswith("no model was reduced")
    assert found.result.after.objective < 1e-12
    assert solver.solved == 0


@pytest.mark.slow
def test_only_what_modes_serve_is_reduced():
    """Both configurations are compared; the one without modes stays on the full model."""
    springs = [(i - 1, i, 900.0) for i in range(60)]
    long = factor_model(spring_structure(springs, [1.0] * 60), {"a": list(range(1, 31)), "b": list(range(31, 61))})
    modal = simulated_case(long, (0.1, -0.2), range(0, 60, 5), 3)  # type: ignore[arg-type]
    other = case_without_modes(long, (Corner(1.1 * 1800.0),))
    problem = UpdateProblem((modal, other), long.model.parameters, (FrequencyResidual(0.01),))
    found = update_reduced(problem, SensitivityMethod(), ReductionRules(order=30))
    assert found.certified
    assert [c.order < 60 for c in found.cases] == [True]
    np.testing.assert_allclose(found.result.x, [0.1, -0.2], atol=1e-6)


def test_the_class_that_a_table_names_is_of_its_kind():
    classes = {kind: loaded(table.made_by) for kind, table in TABLES.items()}
    assert {kind: made.key for kind, made in classes.items()} == {kind: kind for kind in TABLES}
    assert len({made.label for made in classes.values()}) == len(TABLES)
