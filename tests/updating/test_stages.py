"""Stages that pass what they know upward: against one update of everything, and against the scatter of many tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.model import Configuration, configure
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase, FrequencyResidual, UpdateProblem, direct
from femtune.updating import NoRegularisation, SensitivityMethod, update
from femtune.updating.remembered import RememberingSolver
from femtune.updating.stages import SetByHand, Stage, first_belief, learned, run_stages, set_by_hand
from structures.springs import factor_model, simulated_case, spring_structure

SPRINGS = [(-1, 0, 1e4), (0, 1, 1e4), (1, 2, 5e3), (2, 3, 1e4), (3, -1, 1e4)]
GROUPS = {"left": [1, 2], "joint": [3], "right": [4, 5]}
TRUTH = np.array([0.1, -0.3, -0.15])
SD = {"left": 0.03, "right": 0.03, "whole": 0.005}
STATES = {"left": frozenset({3, 4, 5, 1003, 1004}), "right": frozenset({1, 2, 3, 1001, 1002}), "whole": frozenset()}
NAMES = ["left", "joint", "right"]


def _cases(seed: int | None) -> dict[str, ComparedCase]:
    """The parts and the whole, tested with noise on their frequencies."""
    model = factor_model(spring_structure(SPRINGS, [1.0, 1.3, 0.8, 1.1]), GROUPS).model
    rng = np.random.default_rng(seed)
    found = {}
    for name, off in STATES.items():
        configured = configure(model, Configuration(name, off))
        n = configured.n_free
        case = simulated_case(configured, list(TRUTH), range(n), n)
        scatter = SD[name] * rng.standard_normal(n) if seed is not None else np.zeros(n)
        test = ModeSet(case.test.freq_hz * (1.0 + scatter), case.test.shapes, case.test.dofs)
        found[name] = replace(case, test=test)
    return found


def _stage(cases: dict[str, ComparedCase], name: str, parameter: str, **more: object) -> Stage:
    case = cases[name]
    return Stage(
        name,
        (parameter,),
        lambda x: UpdateProblem((case,), case.configured.model.parameters, (FrequencyResidual(SD[name]),)),
        **more,
    )  # type: ignore[arg-type]


def _bottom_up(cases: dict[str, ComparedCase], **more: object):
    parameters = cases["whole"].configured.model.parameters
    plan = [("left", "left"), ("right", "right"), ("whole", "joint")]
    return run_stages([_stage(cases, *one, **more) for one in plan], first_belief(parameters))


@pytest.mark.slow
def test_without_noise_the_truth_is_found():
    results = _bottom_up(_cases(None), prior=False)
    np.testing.assert_allclose(results[-1].belief.x, TRUTH, atol=1e-7)
    assert [r.best.status.ok for r in results] == [True, True, True]
    assert results[-1].belief.found.all()
    # parameters that rest are not touched
    assert results[0].belief.x[1] == 0.0
    assert results[0].belief.x[2] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("tests", [16, pytest.param(40, marks=pytest.mark.long)])
def test_what_rests_makes_what_moves_uncertain(tests):
    """Normalised errors of the joint scatter as χ² says, which they do not without the parts' share."""
    joint, own, large = [], [], 0
    for seed in range(tests):
        result = _bottom_up(_cases(seed), prior=False)[-1]
        error = result.belief.values["joint"] - 0.7
        joint.append(error / result.belief.sd["joint"])
        own.append(error * np.linalg.norm(result.best.after.jacobian[:, 1]))
        large += result.misfit["frequency"].large
    assert chi2.ppf(0.001, tests) < np.sum(np.square(joint)) < chi2.ppf(0.999, tests)
    assert np.sum(np.square(own)) > chi2.ppf(0.999, tests)
    # a right model is suspected once in a hundred tests
    assert large <= binom.ppf(0.999, tests, 0.01)


@pytest.mark.slow
def test_the_belief_of_stages_is_that_of_one_linear_estimate():
    """Everything moves in the last stage with the belief as prior: the covariance is that of all data at once."""
    cases = _cases(None)
    parameters = cases["whole"].configured.model.parameters
    plan = [_stage(cases, "left", "left"), _stage(cases, "right", "right")]
    whole = _stage(cases, "whole", "joint")
    results = run_stages([*plan, replace(whole, parameters=tuple(NAMES))], first_belief(parameters))
    problems = [UpdateProblem((case,), parameters, (FrequencyResidual(SD[name]),)) for name, case in cases.items()]
    at_once = np.vstack([problem.start(results[-1].belief.x).jacobian for problem in problems])
    own = np.diag(1.0 / parameters.prior[1] ** 2)
    np.testing.assert_allclose(results[-1].belief.covariance, np.linalg.inv(at_once.T @ at_once + own), rtol=2e-3)


@pytest.mark.slow
def test_seeds_that_meet_and_the_error_sums():
    cases = _cases(3)
    seeds = ({"left": 0.8}, {"left": 1.5}, {"left": 2.9})
    result = run_stages([_stage(cases, "left", "left", seeds=seeds)], first_belief(_parameters(cases)))[0]
    assert len(result.runs) == 3
    assert [round(float(run.history[0].x[0]), 12) for run in result.runs] == [0.0, -0.2, 0.5]
    # modes 60 % off are not paired
    assert list(result.refused) == [3]
    assert "could be paired" in result.refused[3]
    assert result.agreed == (True, True, True)
    sums = {s.label: s for s in result.error_sums}
    assert set(sums) == {"1", "2"}
    assert sum(s.after**2 for s in sums.values()) < sum(s.before**2 for s in sums.values())
    # before the stage: the model's frequencies at the nominal values beside the test's
    test, nominal = cases["left"].test.freq_hz, result.runs[0].before.states[0].solution.freq_hz
    assert sums["1"].before == pytest.approx(abs(nominal[0] / test[0] - 1.0), rel=1e-9)


def _parameters(cases: dict[str, ComparedCase]) -> ParameterSet:
    return cases["whole"].configured.model.parameters


def test_a_parameter_at_its_bound_keeps_what_was_believed_of_it():
    cases = _cases(None)
    model = factor_model(spring_structure(SPRINGS, [1.0, 1.3, 0.8, 1.1]), GROUPS,
                         more=[Parameter("left", 1.0, 0.5, 1.05)]).model  # fmt: skip
    case = replace(cases["left"], configured=configure(model, cases["left"].configured.configuration))
    problem = UpdateProblem((case,), model.parameters, (FrequencyResidual(SD["left"]),))
    start = first_belief(model.parameters)
    after = learned(start, update(problem, active=["left"])).belief
    assert after.values["left"] == pytest.approx(1.05)
    assert not after.found.any()
    np.testing.assert_allclose(after.covariance, start.covariance)


def test_modes_are_not_solved_again_where_nothing_changed():
    case = _cases(None)["left"]
    calls: list[int] = []

    class Counting:
        def modes(self, point, count, max_hz):
            calls.append(1)
            return direct.modes(point, count, max_hz)

        def derivative(self, solution, members, rows):
            return direct.derivative(solution, members, rows)

    solver, configured = RememberingSolver(Counting()), case.configured
    first = solver.modes(configured.at(np.array([0.1, 0.0, 0.0])), 2, None)
    # springs that are not there: the matrices stay as they are
    again = solver.modes(configured.at(np.array([0.1, 0.5, 0.0])), 2, None)
    assert len(calls) == 1
    np.testing.assert_array_equal(again.eigenvalues, first.eigenvalues)
    assert again.point.x[1] == 0.5
    assert not np.array_equal(solver.modes(configured.at(np.zeros(3)), 2, None).eigenvalues, first.eigenvalues)
    assert len(calls) == 2


def test_unknown_parameters_are_refused():
    cases = _cases(None)
    with pytest.raises(FemtuneError) as caught:
        run_stages([_stage(cases, "left", "middle")], first_belief(_parameters(cases)))
    assert caught.value.code == "update.unknown-parameter"


def test_a_stage_may_have_a_side_constraint_of_its_own():
    cases = _cases(None)
    stage = _stage(cases, "left", "left", prior=False, method=SensitivityMethod(regularisation=NoRegularisation()))
    result = run_stages([stage], first_belief(_parameters(cases)))[0]
    assert result.best.side.word == "none"
    assert result.belief.sd["left"] == pytest.approx(result.best.sd["left"], rel=1e-6)


@pytest.mark.slow
def test_values_set_by_hand_are_known_as_well_as_stated():
    """They are the prior of the next stage, and earlier data say no more of them."""
    cases = _cases(None)
    first = _bottom_up(cases)[1].belief
    parameters = first.parameters
    found = set_by_hand(first, [SetByHand("left", value=1.3, sd=0.02), SetByHand("right", add=0.05)])
    assert found.values == pytest.approx({**first.values, "left": 1.3, "right": first.values["right"] + 0.05})
    assert found.sd["left"] == pytest.approx(0.02)
    assert found.sd["right"] == pytest.approx(parameters.free[parameters.index("right")].sd)
    assert found.covariance[0, 2] == 0.0
    prior = found.prior()
    assert prior.names == ("left", "right")
    assert list(prior.mean) == pytest.approx([1.3, first.values["right"] + 0.05])
    # the joint, set first, is moved by its own data as if nothing had been known of it
    stages = [
        _stage(cases, "left", "left"),
        _stage(cases, "whole", "joint", by_hand=(SetByHand("left", 1.1, sd=1e-6),)),
    ]
    (_, last) = run_stages(stages, first_belief(parameters))
    assert last.belief.values["left"] == pytest.approx(1.1, abs=1e-9)
    assert last.earlier.values["left"] == pytest.approx(1.1, abs=1e-3)
    assert not last.belief.found[0]
    with pytest.raises(FemtuneError, match="outside the bounds"):
        set_by_hand(first, [SetByHand("left", add=10.0)])
