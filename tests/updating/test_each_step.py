"""A side constraint on the change of each iteration, as the textbook prints it, beside a few lines of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.residuals import ComparedCase, FrequencyResidual, UpdateProblem
from femtune.status import Status
from femtune.updating import (
    Distance,
    EachStep,
    GaussNewton,
    LevenbergMarquardt,
    Link,
    MinimumChange,
    SensitivityMethod,
    UpdateResult,
    update,
)
from structures.springs import factor_model, simulated_case, spring_structure

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
MASSES = np.array([1.0, 2.0, 1.5, 1.0])
GROUPS = {"a": [1], "b": [2], "c": [3]}
TRUTH = (0.25, -0.3, 0.15)
SD = 0.01


def case() -> ComparedCase:
    """Four frequencies with errors of a few per cent, so that residuals remain."""
    model = factor_model(spring_structure(CHAIN, MASSES), GROUPS)  # type: ignore[arg-type]
    made = simulated_case(model, TRUTH, range(4), 4)
    freq = made.test.freq_hz * [1.01, 0.99, 1.02, 0.99]
    return replace(made, test=replace(made.test, freq_hz=freq))


def updated(constraint: object, search: object = GaussNewton(), **more: object) -> UpdateResult:
    made = case()
    problem = UpdateProblem((made,), made.configured.model.parameters, (FrequencyResidual(SD, "eigenvalue"),))
    return update(problem, SensitivityMethod(regularisation=constraint, search=search, **more))  # type: ignore[arg-type]


def matrices(x: NDArray) -> tuple[NDArray, list[NDArray]]:
    """K of the chain and its derivatives by the relative changes of the first three springs."""
    parts = []
    for a, b, k in CHAIN:
        e = np.zeros(4)
        e[b] = 1.0
        if a >= 0:
            e[a] = -1.0
        parts.append(k * np.outer(e, e))
    return sum(p * f for p, f in zip(parts, [*(1.0 + x), 1.0])), parts[:3]


def textbook(mu: float, link: bool, iterations: int) -> list[NDArray]:
    """θ_{i+1} = θ_i + (GᵀWG + μ²W_θ)⁻¹GᵀW(z_m − z_i), z the eigenvalues, with the weights of each iteration."""
    measured = (2.0 * np.pi * case().test.freq_hz) ** 2
    x, found = np.zeros(3), [np.zeros(3)]
    for _ in range(iterations):
        stiffness, parts = matrices(x)
        values, shapes = la.eigh(stiffness, np.diag(MASSES))
        G = np.array([[phi @ part @ phi for part in parts] for phi in shapes.T])
        W = np.diag((SD * measured) ** -2)
        felt = np.diag(G.T @ W @ G)
        W_theta = np.mean(felt) / np.mean(1.0 / felt) * np.diag(1.0 / felt) if link else np.eye(3)
        x = x + np.linalg.solve(G.T @ W @ G + mu**2 * W_theta, G.T @ W @ (measured - values))
        found.append(x)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("link", [False, True])
@pytest.mark.parametrize("mu", [3.0, 30.0])
def test_iterates_are_those_of_the_textbook(link: bool, mu: float):
    constraint = Link(mu) if link else MinimumChange(mu)
    result = updated(EachStep(constraint), max_iterations=5)
    assert result.status is Status.MAX_ITERATIONS
    expected = textbook(mu, link, 5)
    assert len(result.history) == 6
    for iteration, x in zip(result.history, expected):
        np.testing.assert_allclose(iteration.x, x, atol=1e-9)


@pytest.mark.slow
def test_the_end_is_that_of_the_data_and_does_not_keep_changes_small():
    """With enough iterations the constraint has no effect; of the whole change it has."""
    search = LevenbergMarquardt()
    plain = updated(MinimumChange(0.0), search)
    for constraint in (MinimumChange(10.0), Link(0.5), Distance(10.0)):
        each = updated(EachStep(constraint), search, max_iterations=500)
        assert each.status is Status.CONVERGED
        np.testing.assert_allclose(each.x, plain.x, atol=1e-5)
        assert each.certificate is not None
        assert each.certificate.projected_gradient < 1e-2
        whole = updated(constraint, search)
        assert np.abs(whole.x - plain.x).max() > 1e-3
    few = updated(EachStep(MinimumChange(100.0)), max_iterations=2)
    more = updated(EachStep(MinimumChange(100.0)), max_iterations=4)
    assert np.linalg.norm(few.x) < np.linalg.norm(more.x) < np.linalg.norm(plain.x)


@pytest.mark.slow
def test_chi_square_in_the_history_is_that_of_the_data():
    result = updated(EachStep(MinimumChange(10.0)), LevenbergMarquardt(), max_iterations=6)
    assert result.history[-1].objective == pytest.approx(result.after.objective, rel=1e-12)
    objectives = [i.objective for i in result.history]
    assert objectives == sorted(objectives, reverse=True)


@pytest.mark.parametrize("search", [GaussNewton(), LevenbergMarquardt()])
def test_steps_below_the_tolerance_are_no_optimum(search: object):
    result = updated(EachStep(MinimumChange(1e7)), search)
    assert result.status is Status.SHORT_STEPS
    assert not result.status.ok


@pytest.mark.slow
def test_a_weight_by_a_rule_is_kept_or_adapted():
    kept = updated(EachStep(Link("gcv")), max_iterations=3)
    assert kept.side.choice is not None
    expected = textbook(kept.side.weight, True, 3)
    np.testing.assert_allclose(kept.x, expected[-1], atol=1e-9)
    adapted = updated(EachStep(Link("gcv")), max_iterations=3, adapt=True)
    assert adapted.side.choice is not None
    assert kept.side.choice.weight == kept.side.weight


def test_undetermined_combinations_stay_at_their_initial_values():
    """Two springs in one group of rows: the data see only what both do, and no rule moves the rest."""
    structure = spring_structure([(-1, 0, 400.0), (-1, 0, 500.0)], [1.0])
    made = simulated_case(factor_model(structure, {"a": [1], "b": [2]}), (0.3, 0.3), (0,), 1)
    problem = UpdateProblem((made,), made.configured.model.parameters, (FrequencyResidual(SD),))
    method = SensitivityMethod(regularisation=EachStep(MinimumChange(1.0)), search=GaussNewton(), max_iterations=200)
    result = update(problem, method)
    assert result.status is Status.UNDETERMINED
    assert result.smallest_change is None
    # steps are along the gradient (400, 500)
    assert result.x[0] / result.x[1] == pytest.approx(0.8, rel=1e-6)
