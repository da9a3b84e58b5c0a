"""A better minimum than that where an update ends: other pairings and starts, on cases whose best minimum is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.modal import ModeSet
from femtune.residuals import FrequencyResidual, ShapeResidual, UpdateProblem
from femtune.residuals.pairing import completed, crossed, in_order, other_pairings
from femtune.updating import (
    GaussNewton,
    MinimumRules,
    SensitivityMethod,
    UpdateResult,
    look_further,
    update,
)
from femtune.updating.minimum import Valley, macs_of_pairs
from femtune.updating.sensitivity_method import Walk
from structures.springs import factor_model, simulated_case, spring_structure

TWO = [(-1, 0, 100.0), (-1, 1, 110.0), (0, 1, 1.5)]
"""Two masses on springs of their own with a weak link: close modes whose order is that of the springs."""


def crossing(noise: float = 0.02, seed: int = 0) -> UpdateProblem:
    """The truth has the springs the other way round, so that the modes of the model have to cross."""
    model = factor_model(spring_structure(TWO, [1.0, 1.0]), {"a": [1], "b": [2]})
    case = simulated_case(model, (0.35, -0.2), (0, 1), 2)
    rng = np.random.default_rng(seed)
    test = replace(case.test, shapes=case.test.shapes + noise * rng.standard_normal((2, 2)))
    return UpdateProblem(
        (replace(case, test=test),), model.model.parameters, (FrequencyResidual(0.003), ShapeResidual(0.03))
    )


def wrong_end(problem: UpdateProblem) -> UpdateResult:
    """Where an update ends whose pairs are held in the order of the frequencies at the nominal values, swapped."""
    held = replace(problem, pairing_held=True)
    at = problem.start(np.zeros(2))
    (state,) = at.states
    (first, _), (second, _) = state.groups
    swapped = tuple(sorted(((first, state.groups[1][1]), (second, state.groups[0][1]))))
    found = update(held, start=held.assess(at.x, [state.with_groups(swapped)]))
    return replace(found, before=at)


@pytest.mark.slow
def test_another_pairing_leads_out_of_a_wrong_minimum() -> None:
    problem = crossing()
    wrong, right = wrong_end(problem), update(problem)
    assert wrong.objective > 10.0 * right.objective
    found = look_further(problem, SensitivityMethod(), wrong, MinimumRules(starts=0))
    assert found.minimum is not None
    assert found.minimum.improved
    assert found.minimum.first_chi_square == pytest.approx(2.0 * wrong.objective)
    assert found.objective == pytest.approx(right.objective, rel=1e-6)
    np.testing.assert_allclose(found.x, right.x, atol=1e-5)
    # the way stands in the history, numbered on, with the event at its end
    assert [i.number for i in found.history] == list(range(len(found.history)))
    assert found.history[: len(wrong.history)] == wrong.history
    assert sum("a better minimum was found" in i.better_minimum for i in found.history) == 1
    assert found.history[found.number].objective == found.objective
    np.testing.assert_array_equal(found.before.x, wrong.before.x)
    # the same again
    again = look_further(problem, SensitivityMethod(), wrong, MinimumRules(starts=0))
    assert again.minimum == found.minimum
    np.testing.assert_array_equal(again.x, found.x)


def test_an_end_without_doubt_is_left_alone() -> None:
    problem = crossing()
    right = update(problem)
    found = look_further(problem, SensitivityMethod(), right)
    assert found.minimum is not None
    assert not found.minimum.reasons
    assert not found.minimum.trials
    assert found.history == right.history


@pytest.mark.slow
def test_a_method_that_is_stated_step_by_step_is_left_alone() -> None:
    problem = crossing()
    method = SensitivityMethod(search=GaussNewton())
    found = look_further(problem, method, wrong_end(problem))
    assert found.minimum is not None
    assert not found.minimum.trials


@pytest.mark.slow
def test_trials_stay_within_their_effort() -> None:
    problem = crossing(noise=0.2, seed=3)
    end = update(problem)
    rules = MinimumRules(starts=50, small_effort=2.0)
    found = look_further(problem, SensitivityMethod(), end, rules).minimum
    assert found is not None
    assert found.reasons
    assert found.trials
    # the last trial begins below the limit and ends on it, or after the least that a trial may take
    assert found.iterations <= max(2 * found.update_iterations, 10) + 10
    large = look_further(problem, SensitivityMethod(), end, MinimumRules(small_dofs=0)).minimum
    assert large is not None
    assert len(large.trials) <= 1
    assert all(t.kind == "pairing" for t in large.trials)


def test_points_with_different_pairs_are_compared_over_the_same_modes() -> None:
    problem = crossing()
    at = problem.start(np.zeros(2))
    (state,) = at.states
    whole = frozenset({0, 1})
    one = replace(at, states=(state.with_groups(state.groups[:1]),))
    one = problem.assess(one.x, one.states)
    assert one.objective < at.objective
    assert problem.over(one, (whole,)) == pytest.approx(at.objective)
    assert problem.over(at, (frozenset(),)) == at.objective
    # without a model mode for it there is nothing to compare
    assert completed(state.case, (((0,), (0,)),), replace(state.solution, wanted=1), {0, 1}) is None


def test_only_pairings_that_the_macs_leave_open_are_tried() -> None:
    problem = crossing(noise=0.0)
    (state,) = update(problem).after.states
    assert not other_pairings(0, state.case, state.groups, state.solution)
    # shapes between those of the two modes: either order will do
    turned = state.case.test.shapes @ np.array([[1.0, 1.0], [1.0, -1.0]])
    test = ModeSet(state.case.test.freq_hz, turned, state.case.test.dofs)
    (other,) = other_pairings(0, replace(state.case, test=test), state.groups, state.solution)
    assert set(other.groups) != set(state.groups)
    assert "test mode 1 with model mode 2 and test mode 2 with model mode 1" in other.sentence
    fixed = replace(state.case, test=test, fixed=((0, 0),))
    assert not other_pairings(0, fixed, state.groups, state.solution)


def tower(truth: tuple[float, ...], sensors: tuple[int, ...] = (1, 3, 5, 7, 9, 11)) -> UpdateProblem:
    """Six storeys with nearly the same springs in two directions, so that ten modes are five close pairs.

    Two factors on three parts in each direction are updated. Two masses of the structure are 15 % larger than those of
    the model, and no parameter. The test has no noise.
    """
    n = 6
    springs = [(i - 1, i, 100.0) for i in range(n)] + [(n + i - 1 if i else -1, n + i, 104.0) for i in range(n)]
    springs += [(i, n + i, 2.0) for i in range(n)]
    groups = {
        f"{d}{part}": [1 + n * k + 2 * part, 2 + n * k + 2 * part] for k, d in enumerate("xy") for part in range(3)
    }
    masses = [1.15 if i in (3, 9) else 1.0 for i in range(2 * n)]
    case = simulated_case(factor_model(spring_structure(springs, masses), groups), truth, sensors, 10)
    model = factor_model(spring_structure(springs, [1.0] * (2 * n)), groups)
    stated = (FrequencyResidual(0.003), ShapeResidual(0.02, of_largest=True))
    return UpdateProblem((replace(case, configured=model, count=12),), model.model.parameters, stated)


@pytest.mark.slow
def test_a_wrong_pairing_at_the_nominal_values_is_left() -> None:
    """A mass that is wrong and no parameter; at the nominal values some modes have the partners of their neighbours."""
    truth = (0.24, 0.24, 0.01, -0.14, -0.27, -0.08)
    problem = tower(truth)
    plain, best = update(problem), update(problem, start=problem.start(np.array(truth)))
    assert plain.status.ok
    assert min(macs_of_pairs(plain.after)) < 0.85
    assert plain.objective > 10.0 * best.objective
    # as on a large model, which has a single further update
    found = look_further(problem, SensitivityMethod(), plain, MinimumRules(small_dofs=0))
    assert found.status.ok
    assert found.objective == pytest.approx(best.objective, rel=1e-3)
    assert len(macs_of_pairs(found.after)) == 10
    assert min(macs_of_pairs(found.after)) > 0.95
    assert found.minimum is not None
    assert found.minimum.improved
    (trial,) = found.minimum.trials
    assert trial.sentence == "all pairs in the order of their frequencies"
    assert trial.iterations <= found.minimum.update_iterations + 10
    assert "the lowest MAC of a pair" in "; ".join(found.minimum.reasons)


@pytest.mark.slow
def test_a_start_with_a_small_sum_of_squares_leads_out_where_pairings_do_not() -> None:
    truth = (0.09, 0.32, 0.21, -0.17, -0.13, 0.3)
    problem = tower(truth)
    plain, best = update(problem), update(problem, start=problem.start(np.array(truth)))
    assert plain.objective > 10.0 * best.objective
    found = look_further(problem, SensitivityMethod(), plain, MinimumRules(swaps=0, starts=1, small_effort=1.0))
    assert found.objective == pytest.approx(best.objective, rel=1e-3)
    assert found.minimum is not None
    (*_, last) = found.minimum.trials
    assert last.sentence == "start 1 of 1, chosen from 40 points"
    assert last.better


def test_pairs_in_the_order_of_frequencies() -> None:
    (state,) = crossing().start(np.zeros(2)).states
    swapped = (((0,), (1,)), ((1,), (0,)))
    assert crossed(state.case, swapped)
    assert in_order(state.case, swapped) == (((0,), (0,)), ((1,), (1,)))
    assert not crossed(state.case, in_order(state.case, swapped))
    # close modes are one subspace without an order, and pairs that are fixed by hand stay
    assert not crossed(state.case, (((0, 1), (1, 0)),))
    assert in_order(replace(state.case, fixed=((0, 1),)), swapped) == swapped


@pytest.mark.slow
def test_a_start_is_given_up_where_its_steps_lead_back() -> None:
    problem = crossing(noise=0.2, seed=3)
    end, wrong = update(problem), wrong_end(problem)
    found = look_further(problem, SensitivityMethod(), end, MinimumRules(swaps=0, samples=8)).minimum
    assert found is not None
    back = [t for t in found.trials if t.leads_back]
    assert back
    assert not any(t.better for t in back)
    # a whole update from there ends at the same minimum
    valley = Valley.of(Walk(problem, np.ones(2, bool), end.side), end)
    rng, held = np.random.default_rng(1), 0
    for x in end.x + rng.uniform(-0.2, 0.2, (8, 2)):
        at = problem.start(x)
        if valley.holds(at):
            held += 1
            assert update(problem, start=at).objective == pytest.approx(end.objective, rel=1e-6)
    assert held
    # another minimum with other pairs, which is no part of the valley
    assert wrong.objective > 1.1 * end.objective
    assert not valley.holds(wrong.after)
