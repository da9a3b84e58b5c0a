"""Updates that search on reduced models: the end is the full model's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.model.plates import three_thirds

from femtune.model import ConfiguredModel, EigenSolution
from femtune.residuals import CaseState, ComparedCase, FrequencyResidual, ShapeResidual, UpdateProblem
from femtune.updating import Iteration, ReducedUpdate, ReductionRules, SensitivityMethod, update, update_reduced
from structures.springs import simulated_case

TRUTH = (0.15, -0.12, 0.08)
ROWS = tuple(range(2, 300, 15))


@pytest.fixture(scope="module")
def plate() -> ConfiguredModel:
    return three_thirds()


def _problem(case: ComparedCase) -> UpdateProblem:
    return UpdateProblem((case,), case.configured.model.parameters, (FrequencyResidual(0.01), ShapeResidual(0.05)))


@pytest.fixture(scope="module")
def case(plate: ConfiguredModel) -> ComparedCase:
    exact = simulated_case(plate, TRUTH, ROWS, 14)
    flexible = slice(6, 14)
    # a test that the model cannot repeat exactly, so that the end depends on all of it
    scatter = 1.0 + 0.01 * np.random.default_rng(0).standard_normal(8)
    test = replace(exact.test, freq_hz=exact.test.freq_hz[flexible] * scatter, shapes=exact.test.shapes[:, flexible],
                   labels=exact.test.labels[flexible])  # fmt: skip
    return replace(exact, test=test)


@pytest.fixture(scope="module")
def told() -> list[Iteration]:
    return []


@pytest.fixture(scope="module")
def found(case: ComparedCase, told: list[Iteration]) -> ReducedUpdate:
    return update_reduced(_problem(case), SensitivityMethod(), ReductionRules(1e-5, 20, 200), told.append)


@pytest.mark.slow
def test_the_end_is_that_of_the_full_model(case: ComparedCase, found: ReducedUpdate) -> None:
    full = update(_problem(case))
    assert found.certified
    assert found.result.status is full.status
    np.testing.assert_allclose(found.result.x, full.x, atol=2e-4)
    assert found.result.after.objective == pytest.approx(full.after.objective, rel=1e-3)
    np.testing.assert_allclose(found.result.covariance.matrix, full.covariance.matrix, rtol=0.02, atol=1e-8)
    assert isinstance(found.result.after.states[0].solution, EigenSolution)


@pytest.mark.slow
def test_what_it_cost_and_how_right_it_is_is_said(case: ComparedCase, found: ReducedUpdate) -> None:
    (facts,) = found.cases
    assert facts.configuration == case.name
    assert facts.certified_error <= 1e-5
    assert facts.order < 200
    assert 2 <= facts.full_solutions <= 20
    assert f"order {facts.order}" in found.rounds[-1]
    assert "within the tolerance" in found.rounds[-1]


@pytest.mark.slow
def test_iterations_are_numbered_on_over_all_searches(found: ReducedUpdate, told: list[Iteration]) -> None:
    assert [i.number for i in found.result.history] == list(range(len(found.result.history)))
    assert told == list(found.result.history)
    np.testing.assert_array_equal(found.result.history[-1].x, found.result.x)


@pytest.mark.slow
def test_a_budget_that_does_not_suffice_is_said(case: ComparedCase) -> None:
    short = update_reduced(_problem(case), SensitivityMethod(), ReductionRules(1e-15, 4, 200))
    assert not short.certified
    assert short.cases[0].full_solutions == 4
    assert "above the tolerance" in short.rounds[-1]
    assert short.cases[0].certified_error > 1e-15


class _ForgetsAPair(UpdateProblem):
    """Away from the initial values the last pair is below the gates of a fresh pairing, which a search keeps."""

    def solved(self, x: np.ndarray) -> list[CaseState]:
        states = super().solved(x)
        return [s.with_groups(s.groups[:-1]) for s in states] if x.any() else states


@pytest.mark.slow
def test_the_end_has_the_pairs_of_the_search(case: ComparedCase, found: ReducedUpdate) -> None:
    plain = _problem(case)
    problem = _ForgetsAPair(plain.cases, plain.parameters, plain.residuals)
    kept = update_reduced(problem, SensitivityMethod(), ReductionRules(1e-5, 20, 200)).result
    assert [s.groups for s in kept.after.states] == [s.groups for s in found.result.after.states]
    # the sum of squares of the result is that of its residuals
    assert kept.after.objective == pytest.approx(kept.objective, rel=1e-3)
