"""Updates with FRF residuals that search on reduced models: the end is the full model's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.executor import Processes, Serial
from femtune.model import (
    ConfiguredModel,
    EigenSolution,
    ModelPoint,
    SubspaceDerivative,
    constant_damping,
    solve_modes,
)
from femtune.model.full_model import direct
from femtune.model.response import frf, make_ports
from femtune.residuals import (
    FrequencyResidual,
    ModelWay,
    ShapeResidual,
    UpdateProblem,
    case_without_modes,
    frf_residual,
    state_at,
)
from femtune.residuals.frf import truncation
from femtune.residuals.frf.on_reduced import modes_for, served
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.frf.truncation import truncations
from femtune.testing import check_residual
from femtune.updating import (
    ReducedUpdate,
    ReductionRules,
    SensitivityMethod,
    StartRules,
    multi_start_reduced,
    on_reduced_model,
    update,
    update_reduced,
)
from femtune.updating.on_reduced_model import NOBODY, keep_functions, round_sentence, train, unassessed
from structures.springs import factor_model, simulated_case, spring_structure

TRUTH = np.array([0.1, -0.12, 0.2])
LINES = np.geomspace(0.1, 1.2, 120)
DAMPING = constant_damping(0.01)
RULES = ReductionRules(order=58)


@pytest.fixture(scope="module")
def chain() -> ConfiguredModel:
    """Sixty masses with uneven springs."""
    springs = [(i - 1, i, 900.0 * (1.0 + 0.1 * np.sin(i))) for i in range(60)]
    groups = {"a": list(range(1, 31)), "b": list(range(31, 61)), "m": [1010, 1011, 1012]}
    return factor_model(spring_structure(springs, [1.0] * 60), groups, bounds=(0.7, 1.3))


def _problem(chain: ConfiguredModel, noise: float = 0.0, count: int = 25) -> UpdateProblem:
    """FRFs at the truth by the direct solution, all modes damped, with noise."""
    ports = make_ports(chain, ["1X+", "33X+"], ["1X+", "20X+", "40X+", "60X+"])
    test = frf(solve_modes(chain.at(TRUTH), 60), ports, LINES, "accelerance", "direct", damping=DAMPING)
    random = np.random.default_rng(1).standard_normal((2, *test.values.shape))
    test = replace(test, values=test.values * (1.0 + noise * (random[0] + 1j * random[1])))
    way = ModelWay(damping=DAMPING, modes=(count, None))
    residual, _ = frf_residual(solve_modes(chain.at(np.zeros(3)), count), test, way=way)
    return UpdateProblem((case_without_modes(chain, (residual,)),), chain.model.parameters)


@pytest.fixture(scope="module")
def problem(chain: ConfiguredModel) -> UpdateProblem:
    return _problem(chain, 0.05)


@pytest.fixture(scope="module")
def found(problem: UpdateProblem) -> ReducedUpdate:
    return update_reduced(problem, SensitivityMethod(), RULES)


@pytest.mark.slow
def test_the_truth_is_found_without_noise(chain: ConfiguredModel) -> None:
    found = update_reduced(_problem(chain, count=40), SensitivityMethod(), RULES)
    assert found.certified
    np.testing.assert_allclose(found.result.x, TRUTH, atol=1e-4)


@pytest.mark.slow
def test_the_end_is_the_optimum_of_the_full_model(problem: UpdateProblem, found: ReducedUpdate) -> None:
    full = update(problem)
    assert found.certified
    assert found.functions is not None
    assert found.functions.shift <= RULES.frf_tolerance
    sd = np.sqrt(np.diag(full.covariance.matrix))
    assert np.abs((found.result.x - full.x) / sd).max() < 0.01
    np.testing.assert_allclose(found.result.covariance.matrix, full.covariance.matrix, rtol=1e-3)
    # residuals and modes at the end are the full model's
    there = problem.assess(found.result.x, problem.solved(found.result.x), derivatives=False)
    np.testing.assert_allclose(found.result.after.residuals, there.residuals, atol=0.02)
    (state,) = found.result.after.states
    assert state.case is problem.cases[0]
    # … and were checked by direct solutions
    (checked,) = truncations(state)
    assert checked.order is not None
    assert checked.order >= found.cases[0].order
    assert checked.largest < 0.02


@pytest.mark.slow
def test_the_shift_is_the_step_that_the_full_model_makes(problem: UpdateProblem) -> None:
    """Far from the nominal point, of which the basis is: the stated shift is that of Gauss-Newton steps."""
    search = train(problem, replace(RULES, order=10), problem.start(np.zeros(3)), NOBODY)
    x = np.array([-0.2, 0.15, -0.1])
    states = problem.solved(x)
    solutions = search.solutions(states)
    there = search.agreement(x, solutions, search.enriched(x, solutions)).functions
    assert there is not None
    full, near = problem.assess(x, states), search.reduced_problem().start(x)
    J = near.jacobian
    step = np.linalg.solve(J.T @ J, J.T @ (full.residuals - near.residuals))
    assert there.shift == pytest.approx(np.sqrt(step @ (J.T @ J) @ step), rel=0.05)
    assert there.largest == pytest.approx(np.abs(full.residuals - near.residuals).max(), rel=0.05)


@pytest.mark.slow
def test_models_are_not_compared_with_themselves(problem: UpdateProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing of the full model is above the threshold of an enrichment, all that is independent is kept."""
    search = train(problem, replace(RULES, order=10), problem.start(np.zeros(3)), NOBODY)
    x = np.array([-0.2, 0.15, -0.1])
    solutions = search.solutions(problem.solved(x))
    kept = search.enriched(x, solutions)
    usual = search.agreement(x, solutions, kept).functions
    monkeypatch.setattr(
        on_reduced_model, "finer_trainer", lambda trainer, _: on_reduced_model.with_thresholds(trainer, 1e9, 1e9)
    )
    whole = search.enriched(x, solutions)
    assert whole[0].model.order > kept[0].model.order > search.trained[0].model.order
    found = search.agreement(x, solutions, whole).functions
    assert usual is not None
    assert found is not None
    assert usual.compared
    assert found.compared
    assert found.shift == pytest.approx(usual.shift, rel=0.01)
    # the same models again have nothing to add, and are the full model there
    search.trained = whole
    again = search.enriched(x, solutions)
    itself = search.agreement(x, solutions, again)
    assert itself.functions is not None
    assert not itself.functions.compared
    assert itself.functions.shift == 0.0
    assert round_sentence(1, search, itself).endswith("which need no others for the FRFs")
    full, near = problem.assess(x, problem.solved(x)), search.reduced_problem().start(x)
    # the full model's own FRFs leave modes out
    assert np.abs(full.residuals - near.residuals).max() < 0.005


@pytest.mark.slow
def test_the_start_of_a_large_model_is_on_the_basis_of_its_training(
    problem: UpdateProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """FRFs and derivatives there are those of the full model; the training goes on with the basis."""
    monkeypatch.setattr(on_reduced_model, "RANKED_FROM", 10)
    x = np.zeros(3)
    states = problem.solved(x)
    keep_functions(problem, RULES, states)
    at = problem.assess(x, states)
    (known,) = [r.known(states[0]) for r in problem.cases[0].residuals]
    assert known.order < 58
    full = problem.assess(x, problem.solved(x))
    np.testing.assert_allclose(at.residuals, full.residuals, atol=1e-3)
    np.testing.assert_allclose(at.jacobian, full.jacobian, atol=2e-3 * np.abs(full.jacobian).max())
    search = train(problem, RULES, at, NOBODY)
    assert search.trained[0].certified[0].order == known.order
    # direct solutions of a large model take too long, which is said
    monkeypatch.setattr(truncation, "MOST_DOFS", 10)
    (found,) = truncations(states[0])
    assert (found.order, found.large, len(found.lines_hz)) == (known.order, 60, 0)


@pytest.mark.slow
def test_a_training_of_a_large_model_by_inverse_iteration_ends_at_the_same_optimum(
    problem: UpdateProblem, found: ReducedUpdate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(on_reduced_model, "RANKED_FROM", 10)
    steps = []
    real = direct.improved
    monkeypatch.setattr(type(direct), "improved", lambda self, s, n: steps.append(s.point.x) or real(s, n))
    ranked = update_reduced(problem, SensitivityMethod(), RULES)
    assert ranked.certified
    assert steps
    sd = np.sqrt(np.diag(found.result.covariance.matrix))
    assert np.abs((ranked.result.x - found.result.x) / sd).max() < 0.02


@pytest.mark.slow
def test_what_was_compared_is_said(found: ReducedUpdate) -> None:
    (facts,) = found.cases
    assert facts.functions == 1
    assert facts.order < 60
    assert "static responses there change the FRF residuals by" in found.rounds[-1]
    assert found.rounds[-1].endswith("within the tolerance of 0.01")


@pytest.mark.slow
def test_a_tolerance_that_is_not_reached_is_said(problem: UpdateProblem) -> None:
    short = update_reduced(problem, SensitivityMethod(), replace(RULES, full_solutions=2, frf_tolerance=1e-9))
    assert not short.certified
    assert short.rounds[-1].endswith("above the tolerance of 1e-09")


@pytest.mark.quick(1)
@pytest.mark.parametrize("x", [np.zeros(3), TRUTH])
def test_the_jacobian_on_a_reduced_model(found: ReducedUpdate, x: np.ndarray) -> None:
    assert found.search is not None
    check_residual(found.search.reduced_problem(), x, length=0.001)


@pytest.mark.slow
def test_modes_and_functions_share_a_reduced_model(chain: ConfiguredModel, problem: UpdateProblem) -> None:
    modal = simulated_case(chain, TRUTH, range(0, 60, 5), 4)
    both = replace(modal, residuals=problem.cases[0].residuals)
    mixed = replace(problem, cases=(both,), residuals=(FrequencyResidual(0.01), ShapeResidual(0.1)))
    found = update_reduced(mixed, SensitivityMethod(), RULES)
    assert found.certified
    full = update(mixed)
    sd = np.sqrt(np.diag(full.covariance.matrix))
    assert np.abs((found.result.x - full.x) / sd).max() < 0.01


@pytest.mark.slow
def test_starts_end_at_the_optimum(problem: UpdateProblem) -> None:
    found = multi_start_reduced(problem, SensitivityMethod(), RULES, StartRules(count=3))
    assert found.update.certified
    assert found.update.functions is not None
    full = update(problem)
    sd = np.sqrt(np.diag(full.covariance.matrix))
    assert np.abs((found.starts.best.x - full.x) / sd).max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("with_modes", [False, pytest.param(True, marks=pytest.mark.long)])
def test_starts_in_processes_give_the_same_numbers(
    chain: ConfiguredModel, problem: UpdateProblem, with_modes: bool
) -> None:
    if with_modes:
        modal = simulated_case(chain, TRUTH, range(0, 60, 5), 4)
        both = replace(modal, residuals=problem.cases[0].residuals)
        problem = replace(problem, cases=(both,), residuals=(FrequencyResidual(0.01), ShapeResidual(0.1)))
    rules = StartRules(count=3, samples=6)
    one, other = (
        multi_start_reduced(problem, SensitivityMethod(), RULES, rules, executor=executor)
        for executor in (Serial(), Processes(2))
    )
    assert [s.end.tobytes() for s in one.starts.starts] == [s.end.tobytes() for s in other.starts.starts]
    assert [s.objective for s in one.starts.samples] == [s.objective for s in other.starts.samples]
    assert one.starts.best.x.tobytes() == other.starts.best.x.tobytes()
    assert other.update.certified


@pytest.mark.parametrize(
    ("way", "is_served"),
    [
        (ModelWay(modes=(5, None), limit="count = 5"), False),
        (ModelWay(modes=(40, None), residual_vectors=False), False),
        (ModelWay(modes=(58, None), limit="count = 58"), True),
        (ModelWay("direct"), True),
    ],
)
def test_truncated_functions_stay_on_the_full_model(problem: UpdateProblem, way: ModelWay, is_served: bool) -> None:
    (case,) = problem.cases
    (residual,) = case.residuals
    limited = replace(residual, way=way)  # type: ignore[type-var]
    state = state_at(replace(case, residuals=(limited,)), np.zeros(3))
    assert served(state) == ((limited,) if is_served else ())


@pytest.mark.slow
def test_the_full_model_is_not_asked_for_derivatives_where_the_search_begins(
    chain: ConfiguredModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The residuals and derivatives there are those of the reduced model, equal to those of the full one."""
    problem = _problem(chain, 0.05, count=40)
    full = problem.start(np.zeros(3))
    asked: list[object] = []
    compare = FrfResidual.compare
    monkeypatch.setattr(FrfResidual, "compare", lambda *given: asked.append(given) or compare(*given))
    before = update_reduced(problem, SensitivityMethod(), RULES).result.before
    assert not asked
    assert np.abs(before.residuals - full.residuals).max() < 0.01
    assert np.abs(before.jacobian - full.jacobian).max() < 1e-3 * np.abs(full.jacobian).max()


@pytest.mark.slow
def test_modes_that_are_known_where_the_training_begins_are_not_solved_again(problem: UpdateProblem) -> None:
    counted = Counting()
    (case,) = problem.cases
    once = replace(problem, cases=(replace(case, solver=counted),))
    before = unassessed(once)
    modes_for(before.states[0], served(before.states[0])[0])
    search = train(once, RULES, before, NOBODY)
    assert len(counted.points) == len(search.trained[0].certified)
    assert len({tuple(x) for x in counted.points}) == len(counted.points)


@pytest.mark.slow
def test_where_a_search_of_a_large_model_ends_its_modes_start_from_those_of_the_reduced_one(
    problem: UpdateProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the full model is asked for there comes with modes that are nearly its own, and is found all the same."""
    monkeypatch.setattr(on_reduced_model, "RANKED_FROM", 0)
    (case,) = problem.cases
    plain = update_reduced(problem, SensitivityMethod(), RULES)
    counted = Counting()
    found = update_reduced(replace(problem, cases=(replace(case, solver=counted),)), SensitivityMethod(), RULES)
    last = counted.starts[-1]
    assert last is not None
    full = solve_modes(last.point, last.wanted)
    np.testing.assert_allclose(last.eigenvalues[: last.wanted], full.eigenvalues[: last.wanted], rtol=1e-3)
    assert counted.starts[0] is None
    assert found.certified
    np.testing.assert_allclose(found.result.x, plain.result.x, atol=1e-12)


def test_a_count_of_modes_that_is_too_small_for_the_functions_is_not_solved_for(problem: UpdateProblem) -> None:
    counted = Counting()
    (case,) = problem.cases
    (residual,) = case.residuals
    state = state_at(replace(case, solver=counted, count=1, max_hz=None), np.zeros(3))
    way = ModelWay().settled(state, residual.highest_hz)  # type: ignore[attr-defined]
    assert len(counted.points) == 1
    assert way.modes is not None
    assert (way.modes[0] or 0) > 1


@dataclass
class Counting:
    """Solves, and keeps the points at which it was asked."""

    points: list[np.ndarray] = field(default_factory=list)
    starts: list[EigenSolution | None] = field(default_factory=list)

    def modes(
        self, point: ModelPoint, count: int | None, max_hz: float | None, start: EigenSolution | None = None
    ) -> EigenSolution:
        self.points.append(point.x)
        self.starts.append(start)
        return direct.modes(point, count, max_hz, start)

    def improved(self, start: EigenSolution, steps: int) -> EigenSolution:
        self.points.append(start.point.x)
        return direct.improved(start, steps)

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        return direct.derivative(solution, members, rows)
