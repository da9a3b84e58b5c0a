"""The equation error: what vanishes at the truth, its gradient, and starts from anywhere on reduced models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.model.reduce import reduce_model
from femtune.residuals import FrequencyResidual, MacResidual, PairingRules, ShapeResidual, UpdateProblem
from femtune.residuals.state import reduced_case
from femtune.updating import ReductionRules, SensitivityMethod, StartRules, equation_error_phases, multi_start_reduced
from structures.springs import factor_model, simulated_case, spring_structure

N = 40
TRUTH = np.array([0.5, -0.6, 0.8, -0.3])
SENSORS = (0, 4, 9, 14, 19, 24, 29, 34, 39)


@pytest.fixture(scope="module")
def problem() -> UpdateProblem:
    springs = [(-1, 0, 900.0)] + [(i, i + 1, 500.0 + 60.0 * i) for i in range(N - 1)] + [(-1, 20, 80.0)]
    groups = {"a": range(1, 11), "b": range(11, 21), "c": range(21, 41), "m": range(1010, 1020)}
    model = factor_model(spring_structure(springs, [1.0 + 0.1 * i for i in range(N)]), groups, bounds=(0.1, 2.0))
    rules = PairingRules(frequency_gate=1.0, mac_gate=0.0)
    case = simulated_case(model, TRUTH, SENSORS, 4, count=8, rules=rules)  # type: ignore[arg-type]
    return UpdateProblem((case,), model.model.parameters, (FrequencyResidual(0.1), ShapeResidual(0.1)))


@pytest.fixture(scope="module")
def reduced(problem: UpdateProblem) -> UpdateProblem:
    """On a basis of everything, which leaves nothing out."""
    (case,) = problem.cases
    model = reduce_model(case.configured, np.eye(N), case.sensors)
    return replace(problem, cases=(reduced_case(case, model),))


def test_modes_come_in_one_after_the_other(reduced: UpdateProblem):
    counts = [len({b.mode for b in p.start(np.zeros(4)).blocks}) for p in equation_error_phases(reduced)]
    assert counts == [1, 2, 3, 4]


def test_it_vanishes_at_the_truth_and_only_there(reduced: UpdateProblem):
    phase = equation_error_phases(reduced)[-1]
    assert phase.start(TRUTH).objective < 1e-18
    assert phase.start(np.zeros(4)).objective > 1e-4


def test_its_gradient_is_exact(reduced: UpdateProblem):
    """Kaufman's Jacobian is not ∂r/∂x, but Jᵀr is the gradient of ½rᵀr: by central differences."""
    phase, x, h = equation_error_phases(reduced)[-1], np.array([0.2, 0.1, -0.3, 0.4]), 1e-5
    at = phase.start(x)
    differences = [(phase.start(x + h * e).objective - phase.start(x - h * e).objective) / (2 * h) for e in np.eye(4)]
    np.testing.assert_allclose(at.jacobian.T @ at.residuals, differences, rtol=1e-6)


def test_entries_and_modes_that_do_not_count_are_left_out(problem: UpdateProblem, reduced: UpdateProblem):
    (case,) = reduced.cases
    shapes = np.array(case.test.shapes)
    shapes[1, 0] = np.nan
    some = replace(case, test=replace(case.test, shapes=shapes), left_out={3: "doubtful"})
    phases = equation_error_phases(replace(reduced, cases=(some,)))
    assert len(phases) == 3
    assert [len(b.values) for b in phases[-1].start(TRUTH).blocks] == [N + 8, N + 9, N + 9]
    assert phases[-1].start(TRUTH).objective < 1e-18


@pytest.mark.quick(0, gate=1)
@pytest.mark.parametrize("form", ["difference", "mac"])
def test_starts_from_anywhere_find_the_truth(problem: UpdateProblem, form: str):
    of_shapes = MacResidual(1.0) if form == "mac" else ShapeResidual(1.0)
    asked = replace(problem, residuals=(FrequencyResidual(1.0, "eigenvalue"), of_shapes))
    found = multi_start_reduced(
        asked, SensitivityMethod(), ReductionRules(1e-8, 20, 25), StartRules(10, seed=4, hops=2)
    )
    assert [s.partition(" starts")[0] for s in found.starts.sentences] == ["10 of 10"]
    for s in found.starts.starts:
        np.testing.assert_allclose(s.end, TRUTH, atol=1e-6)
    assert found.update.certified


def test_without_a_reduced_model(problem: UpdateProblem):
    phase = equation_error_phases(problem)[0]
    with pytest.raises(FemtuneError, match="requires a reduced model") as caught:
        phase.start(np.zeros(4))
    assert caught.value.code == "update.needs-reduction"
