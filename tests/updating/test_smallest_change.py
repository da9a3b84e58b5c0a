"""The minimum within the bounds and the smallest change near it, beside solvers of SciPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize

from femtune.arrays import Reals
from femtune.modal import ModeSet
from femtune.parameters import Parameter
from femtune.residuals import (
    CaseState,
    FrequencyResidual,
    Residual,
    ResidualBlock,
    ShapeResidual,
    UpdateProblem,
    case_without_modes,
)
from femtune.status import Status
from femtune.updating import GaussNewton, LineSearch, SensitivityMethod, update
from structures.springs import factor_model, simulated_case, spring_structure

MINIMUM = SensitivityMethod(smallest_change=0.0)


def lattice(seed: int, n: int = 24, k: int = 17, n_sensors: int = 14) -> UpdateProblem:
    """Masses in a line with springs to three neighbours, each with its own hidden error; k − 4 groups and 4 springs to
    ground, whose bounds span seven decades."""
    rng = np.random.default_rng(seed)
    springs = [(i, j, 1e6 * rng.uniform(0.5, 2.0)) for i in range(n) for j in range(i + 1, min(i + 4, n))]
    ground = [(i, -1, 1e5) for i in (0, n // 3, 2 * n // 3, n - 1)]
    parts = np.array_split(rng.permutation(len(springs)), k - 4)
    groups = {f"k{i}": [int(j) + 1 for j in part] for i, part in enumerate(parts)}
    groups |= {f"g{i}": [len(springs) + 1 + i] for i in range(4)}
    limits = {name: (0.8, 1.4) if name.startswith("k") else (1e-6, 11.0) for name in groups}
    own = [Parameter(name, 1.0, *limits[name]) for name in groups]
    masses = rng.uniform(1.0, 3.0, n)
    model = factor_model(spring_structure(springs + ground, masses), groups, more=own)
    true = [(a, b, v * float(np.exp(0.4 * rng.standard_normal()))) for a, b, v in springs + ground]
    sensors = sorted(int(i) for i in rng.choice(n, n_sensors, replace=False))
    there = factor_model(spring_structure(true, masses), groups, more=own)
    found = simulated_case(there, np.zeros(k), sensors, 5).test
    frequencies = found.freq_hz * (1.0 + 0.002 * rng.standard_normal(5))
    shapes = found.shapes * (1.0 + 0.02 * rng.standard_normal(found.shapes.shape))
    case = simulated_case(model, np.zeros(k), sensors, 5, count=9)
    case = replace(case, test=ModeSet(frequencies, shapes, found.dofs, source="simulated"))
    return UpdateProblem((case,), model.model.parameters, (FrequencyResidual(0.002), ShapeResidual(0.05)))


def rival(problem: UpdateProblem, x: Reals) -> float:
    """The sum of squares where a general solver ends."""
    start = problem.start(x)
    lower, upper = problem.parameters.bounds
    found = least_squares(
        lambda v: problem.follow(v, start, derivatives=False).residuals,
        np.clip(x, lower + 1e-9, upper - 1e-9),
        lambda v: problem.follow(v, start).jacobian,
        (lower, upper), ftol=1e-12, xtol=1e-12, gtol=1e-12, max_nfev=200,
    )  # fmt: skip
    return 2.0 * float(found.cost)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 5, *(pytest.param(seed, marks=pytest.mark.long) for seed in (3, 8))])
@pytest.mark.parametrize("k", [17, pytest.param(30, marks=pytest.mark.long)])
def test_no_general_solver_ends_lower(seed: int, k: int):
    problem = lattice(seed, k=k)
    result = update(problem, MINIMUM)
    assert result.status.ok
    assert len(result.at_bound) >= 4
    chi_square = 2.0 * result.objective
    assert chi_square <= rival(problem, np.zeros(k)) * (1.0 + 1e-6)
    assert rival(problem, result.x) >= chi_square * (1.0 - 1e-6)
    assert result.certificate is not None
    assert result.certificate.projected_gradient < 1e-3
    assert result.certificate.predicted_decrease < 1e-9
    assert set(result.certificate.multipliers) == set(result.at_bound)
    assert min(result.certificate.multipliers.values()) >= 0.0


def tower(seed: int, gap: float, storeys: int = 5, modes: int = 6) -> UpdateProblem:
    """Two chains of nearly equal stiffness, tied by soft springs, so that modes are close and turn into each other."""
    rng = np.random.default_rng(seed)
    one = [(max(i - 1, 0), i if i else -1, 1e6) for i in range(storeys)]
    two = [(a + storeys, b + storeys if b >= 0 else -1, k * (1.0 - gap)) for a, b, k in one]
    ties = [(i, storeys + i, 2e4) for i in range(storeys)]
    groups = {f"k{i}": [i + 1] for i in range(2 * storeys)}
    own = [Parameter(name, 1.0, 0.5, 1.8) for name in groups]
    model = factor_model(spring_structure([*one, *two, *ties], np.ones(2 * storeys)), groups, more=own)
    changed = [
        (a, b, k * float(rng.uniform(0.7, 1.4) * np.exp(0.15 * rng.standard_normal()))) for a, b, k in [*one, *two]
    ]
    changed += [(a, b, k * float(np.exp(0.5 * rng.standard_normal()))) for a, b, k in ties]
    there = factor_model(spring_structure(changed, np.exp(0.1 * rng.standard_normal(2 * storeys))), groups, more=own)
    sensors = list(range(1, 2 * storeys, 2))
    found = simulated_case(there, np.zeros(2 * storeys), sensors, modes).test
    frequencies = found.freq_hz * (1.0 + 0.003 * rng.standard_normal(modes))
    shapes = found.shapes * (1.0 + 0.03 * rng.standard_normal(found.shapes.shape))
    case = simulated_case(model, np.zeros(2 * storeys), sensors, modes, count=modes + 3)
    case = replace(case, test=ModeSet(frequencies, shapes, found.dofs, source="simulated"))
    return UpdateProblem((case,), model.model.parameters, (FrequencyResidual(0.003), ShapeResidual(0.03)))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "gap"), [(21, 0.1), (3, 0.05)])
def test_modes_whose_pairing_alternates_end_at_a_minimum_as_a_subspace(seed: int, gap: float):
    """The objective with two single modes and with their subspace differ, and each leads to the other."""
    problem = tower(seed, gap)
    result = update(problem, MINIMUM)
    assert result.status.ok
    (said,) = [text for text in result.events if "alternated" in text]
    (together,) = [tests for tests, _ in result.after.states[0].groups if len(tests) == 2]
    labels = [problem.cases[0].test.labels[i] for i in together]
    assert f"test modes {labels[0]} and {labels[1]} are compared as one subspace" in said
    assert result.certificate is not None
    assert result.certificate.predicted_decrease < 1e-9
    lower, upper = problem.parameters.bounds
    found = least_squares(
        lambda v: problem.follow(v, result.after, derivatives=False).residuals,
        np.clip(result.x, lower + 1e-9, upper - 1e-9),
        lambda v: problem.follow(v, result.after).jacobian,
        (lower, upper), ftol=1e-12, xtol=1e-12, gtol=1e-12, max_nfev=100,
    )  # fmt: skip
    assert found.cost >= result.objective * (1.0 - 1e-6)


@pytest.mark.parametrize("search", [LineSearch(), GaussNewton()])
@pytest.mark.slow
def test_the_other_searches_end_there(search: LineSearch | GaussNewton):
    problem = lattice(1)
    result = update(problem, replace(MINIMUM, search=search))
    assert result.status.ok
    assert result.objective == pytest.approx(update(problem, MINIMUM).objective, rel=1e-6)


@pytest.mark.slow
def test_without_an_optimum_the_best_point_is_returned():
    """Full steps go up and down, and the pairing alternates."""
    result = update(lattice(3), replace(MINIMUM, search=GaussNewton()))
    objectives = [i.objective for i in result.history]
    assert result.status is Status.PAIRING_CYCLES
    assert result.objective == min(objectives) < objectives[-1]
    np.testing.assert_array_equal(result.x, result.history[result.number].x)
    # nothing is gained by comparing less
    assert result.before.squares.keys() <= result.after.squares.keys()


# ----------------------------------------------------------------------------------------------------
# Linear residuals: what is sought is a small convex problem, which a general solver solves too.


@dataclass(frozen=True)
class Linear(Residual):
    """A x − b."""

    A: Reals = field(repr=False)
    b: Reals = field(repr=False)
    label = "linear"

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        x = state.full.x
        jacobian = self.A if derivatives else np.zeros((len(self.b), 0))
        return [self.block(state.case.name, "A", self.A @ x - self.b, jacobian, 1.0)]


def linear_problem(A: Reals, b: Reals, bounds: tuple[float, float] = (0.5, 1.5)) -> UpdateProblem:
    """Parameters 1 + x, as many as A has columns."""
    k = A.shape[1]
    springs = [(-1, i, 100.0) for i in range(k)]
    model = factor_model(spring_structure(springs, [1.0] * k), {f"p{i}": [i + 1] for i in range(k)}, bounds)
    return UpdateProblem((case_without_modes(model, (Linear(A, b),)),), model.model.parameters)


def under_determined(seed: int) -> tuple[Reals, Reals]:
    """Eight residuals of six parameters, two combinations of which have no effect, and one a small one."""
    rng = np.random.default_rng(seed)
    u, v = (np.linalg.qr(rng.standard_normal((8, 6)))[0], np.linalg.qr(rng.standard_normal((6, 6)))[0])
    A = (u * [40.0, 30.0, 20.0, 0.2, 0.0, 0.0]) @ v.T
    return A, A @ rng.uniform(-0.6, 0.6, 6) + rng.standard_normal(8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_it_is_the_smallest_change_within_the_margin(seed: int):
    A, b = under_determined(seed)
    problem = linear_problem(A, b)
    result = update(problem)
    small = result.smallest_change
    assert small is not None
    lower, upper = problem.parameters.bounds
    sd = problem.parameters.prior[1]

    def chi_square(x: Reals) -> float:
        return float(np.sum((A @ x - b) ** 2))

    least = least_squares(
        lambda x: A @ x - b, np.zeros(6), lambda x: A, (lower, upper), ftol=1e-15, xtol=1e-15, gtol=1e-15
    )
    assert -1e-9 < small.chi_square - chi_square(least.x) < 0.05 * small.allowed
    assert 0.75 * small.allowed <= small.increase <= 0.95 * small.allowed
    assert small.increase == pytest.approx(chi_square(result.x) - small.chi_square, abs=1e-9)
    margin = small.chi_square + small.increase
    best = minimize(
        lambda x: np.sum((x / sd) ** 2), result.x, jac=lambda x: 2.0 * x / sd**2, method="SLSQP",
        bounds=list(zip(lower, upper)),
        constraints={
            "type": "ineq", "fun": lambda x: margin - chi_square(x), "jac": lambda x: -2.0 * A.T @ (A @ x - b)
        },
        options={"ftol": 1e-14, "maxiter": 500},
    )  # fmt: skip
    np.testing.assert_allclose(result.x, best.x, atol=2e-4)
    assert small.size == pytest.approx(np.sqrt(best.fun), rel=1e-4)
    assert small.size <= small.optimum_size
    assert result.certificate is not None
    assert result.certificate.projected_gradient < 1e-5


def test_where_all_is_determined_the_minimum_is_the_result():
    A, b = under_determined(0)
    A = A + np.vstack([5.0 * np.eye(6), np.zeros((2, 6))])
    result = update(linear_problem(A, b))
    assert result.smallest_change is None
    assert not any(i.to_smallest_change for i in result.history)


def test_what_has_no_effect_stays_nominal():
    """A parameter on which nothing depends does not move, whatever the noise of the others."""
    A, b = under_determined(1)
    A[:, 2] = 0.0
    assert abs(update(linear_problem(A, b)).x[2]) < 1e-9


def test_an_allowance_that_reaches_nominal_ends_there():
    A, b = under_determined(2)
    result = update(linear_problem(A, 1e-3 * b), SensitivityMethod(smallest_change=1e4))
    assert np.abs(result.x).max() < 1e-6


def test_residuals_smaller_than_stated_allow_less():
    A, b = under_determined(3)
    full, less = (update(linear_problem(A, f * b)).smallest_change for f in (1.0, 0.1))
    assert full is not None
    assert less is not None
    assert less.allowed < 0.1 * full.allowed


def test_the_result_does_not_depend_on_where_the_update_starts():
    A, b = under_determined(4)
    problem = linear_problem(A, b)
    one, other = (update(problem, start=problem.start(np.full(6, v))) for v in (-0.4, 0.4))
    np.testing.assert_allclose(one.x, other.x, atol=0.02)
    assert one.status in (Status.UNDETERMINED, Status.CONVERGED_AT_BOUNDS, Status.CONVERGED)


@pytest.mark.slow
def test_wide_bounds_do_no_harm():
    """The same frequencies with bounds that span fifteen decades."""
    springs, groups = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0)], {"a": [1], "b": [2], "c": [3]}
    found = []
    for bounds in ((0.5, 1.5), (1e-6, 1e9)):
        model = factor_model(spring_structure(springs, [1.0, 2.0, 1.5]), groups, bounds)
        truth = model.model.parameters.normalise([1.2, 0.9, 1.1])
        case = simulated_case(model, truth, (0, 1, 2), 3)
        problem = UpdateProblem((case,), model.model.parameters, (FrequencyResidual(0.01), ShapeResidual(0.1)))
        found.append(update(problem, MINIMUM))
        assert found[-1].status.ok
        assert len(found[-1].history) < 15
        np.testing.assert_allclose(list(found[-1].values.values()), [1.2, 0.9, 1.1], rtol=1e-6)
