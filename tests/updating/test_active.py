"""Updates that move some parameters only, and every search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.residuals import UpdateProblem
from femtune.status import Status
from femtune.updating import (
    GaussNewton,
    LevenbergMarquardt,
    LineSearch,
    MinimumChange,
    Prior,
    Search,
    SensitivityMethod,
    Truncated,
    update,
)
from femtune.updating.regularisation import LinearModel, choose_weight

from .four_masses import TRUTH, chain_problem


@pytest.fixture(scope="module")
def problem() -> UpdateProblem:
    return chain_problem()


@pytest.mark.slow
def test_only_the_named_parameters_move(problem: UpdateProblem):
    start = problem.start(np.array([0.25, 0.0, 0.0]))
    result = update(problem, start=start, active=["c", "b"])
    assert result.active == ("b", "c")
    assert all(i.x[0] == 0.25 for i in result.history)
    np.testing.assert_allclose(result.x, TRUTH, atol=1e-7)
    assert result.status is Status.EXACT
    assert result.covariance.reasons == {0: "fixed in this update, σ not given"}
    # fewer unknowns are known better
    everything = update(problem)
    assert result.sd["b"] < everything.sd["b"]


def test_a_resting_parameter_at_its_bound_is_not_reported_as_such(problem: UpdateProblem):
    upper = problem.parameters.bounds[1][0]
    result = update(problem, start=problem.start(np.array([upper, 0.0, 0.0])), active=["b"])
    assert not result.history[0].at_bound
    assert result.x[0] == upper


@pytest.mark.slow
def test_a_resting_parameter_pulls_what_a_prior_says_goes_with_it(problem: UpdateProblem):
    sd = np.array([p.sd for p in problem.parameters.free[:2]])
    covariance = np.array([[1.0, 0.999], [0.999, 1.0]]) * np.outer(sd, sd) * 1e-8
    method = SensitivityMethod(regularisation=Prior(("a", "b"), [1.0, 1.0], covariance))
    result = update(problem, method, start=problem.start(np.array([0.1, 0.0, 0.0])), active=["b", "c"])
    assert result.x[1] == pytest.approx(0.0999 * sd[1] / sd[0], rel=1e-2)


@pytest.mark.quick(0)
@pytest.mark.parametrize("search", [GaussNewton(), LineSearch(), LevenbergMarquardt()])
def test_every_search_finds_the_truth(problem: UpdateProblem, search: Search):
    result = update(problem, SensitivityMethod(search=search))
    assert result.status.ok
    np.testing.assert_allclose(result.x, TRUTH, atol=1e-7)


@pytest.mark.slow
def test_the_line_search_descends_where_whole_steps_do_not(problem: UpdateProblem):
    start = problem.start(np.array([-0.45, 0.9, -0.45]))
    whole = update(problem, SensitivityMethod(search=GaussNewton()), start=start)
    part = update(problem, SensitivityMethod(search=LineSearch()), start=start)
    falling = [i.objective for i in part.history]
    assert falling == sorted(falling, reverse=True)
    np.testing.assert_allclose(part.x, TRUTH, atol=1e-6)
    assert len(whole.history) > 1


@pytest.mark.slow
@pytest.mark.parametrize("adapt", [False, True])
def test_a_weight_is_kept_or_adapted(problem: UpdateProblem, adapt: bool):
    """Noise calls for a constraint; adapted, its weight is that of the rule at the end."""
    (case,) = problem.cases
    noise = 1.0 + 0.01 * np.random.default_rng(5).standard_normal(4)
    noisy = replace(problem, cases=(replace(case, test=replace(case.test, freq_hz=case.test.freq_hz * noise)),))
    result = update(noisy, SensitivityMethod(regularisation=MinimumChange("gcv"), adapt=adapt))
    assert result.side.choice is not None
    point = result.after if adapt else result.before
    at = LinearModel(problem.parameters, point.x, point.residuals, point.jacobian, np.ones(3, bool))
    assert result.side.weight == pytest.approx(choose_weight(result.side, "gcv", at).weight)
    assert result.side.weight > 0.0


@pytest.mark.slow
def test_truncation_holds_a_combination(problem: UpdateProblem):
    spread = problem.parameters.prior[1]
    start = problem.start(np.zeros(3))
    s = np.linalg.svd(start.jacobian * spread, compute_uv=False)
    threshold = float(np.sqrt(s[1] * s[2]) / s[0])
    result = update(problem, SensitivityMethod(regularisation=Truncated(threshold)), start=start)
    assert len(result.side.held) == 1
    assert abs(result.side.held @ result.x).max() < 1e-8
    assert result.after.objective < result.before.objective
    # the gradient vanishes along what may move
    _, _, vt = np.linalg.svd(start.jacobian * spread)
    gradient = (result.after.jacobian * spread).T @ result.after.residuals
    assert np.abs(vt[:2] @ gradient).max() < 1e-4 * s[0] * np.linalg.norm(result.after.residuals)


def test_names_that_cannot_move(problem: UpdateProblem):
    with pytest.raises(FemtuneError, match="z is not a parameter") as caught:
        update(problem, active=["z"])
    assert caught.value.code == "update.unknown-parameter"
    with pytest.raises(FemtuneError, match="is empty") as caught:
        update(problem, active=[])
    assert caught.value.code == "update.nothing-moves"
