"""Whole updates: recoveries of known truths, every status, pairing events, regularisation, coverage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import femtune.updating.sensitivity_method as method_module
from femtune.errors import FemtuneError
from femtune.model import AddedMass, Configuration, ConfiguredModel, EigenSolution, ModelPoint
from femtune.model.full_model import direct
from femtune.parameters import Parameter, tied
from femtune.residuals import (
    ComparedCase,
    Evaluation,
    FrequencyResidual,
    PairingRules,
    PairResidual,
    ShapeResidual,
    UpdateProblem,
)
from femtune.status import Status
from femtune.updating import MinimumChange, Prior, SensitivityMethod, UpdateResult, update
from femtune.updating.sensitivity_method import Point, Walk
from structures.springs import factor_model, sensor_rows, simulated_case, spring_structure

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
MASSES = [1.0, 2.0, 1.5, 1.0]
GROUPS = {"a": [1], "b": [2], "c": [3], "m": [1002]}
TRUTH = (0.25, -0.3, 0.15, 0.2)
Residuals = tuple[PairResidual, ...]
RULES: Residuals = (FrequencyResidual(0.01), ShapeResidual(0.1))


def chain(groups: dict[str, Sequence[int]] | None = None, **more: object) -> ConfiguredModel:
    return factor_model(spring_structure(CHAIN, MASSES), groups or GROUPS, **more)  # type: ignore[arg-type]


def problem_of(*cases: ComparedCase, residuals: Residuals = RULES) -> UpdateProblem:
    return UpdateProblem(cases, cases[0].configured.model.parameters, residuals)


def noisy(case: ComparedCase, frequency: float, shape: float, seed: int) -> ComparedCase:
    """The test with relative scatter of its frequencies and absolute of its unit-norm shapes."""
    rng, test = np.random.default_rng(seed), case.test
    shapes = test.shapes / np.linalg.norm(test.shapes, axis=0)
    return replace(
        case,
        test=replace(
            test,
            freq_hz=test.freq_hz * (1.0 + frequency * rng.standard_normal(len(test))),
            shapes=shapes + shape * rng.standard_normal(shapes.shape),
        ),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "residuals", [RULES, (FrequencyResidual(0.01, "eigenvalue"), ShapeResidual(0.1, "largest-entry"))]
)
def test_a_truth_is_recovered(residuals: Residuals):
    result = update(problem_of(simulated_case(chain(), TRUTH, range(4), 4), residuals=residuals))  # type: ignore[arg-type]
    np.testing.assert_allclose(result.x, TRUTH, atol=1e-6)
    assert result.status in (Status.EXACT, Status.CONVERGED)
    assert result.values["a"] == pytest.approx(1.25)
    assert [i.number for i in result.history] == list(range(len(result.history)))


def test_few_sensors_and_entries_that_were_not_measured():
    case = simulated_case(chain(), TRUTH, (0, 1, 3), 3, count=4)
    shapes = np.array(case.test.shapes)
    shapes[1, 0] = shapes[2, 2] = np.nan
    result = update(problem_of(replace(case, test=replace(case.test, shapes=shapes))))
    np.testing.assert_allclose(result.x, TRUTH, atol=1e-6)


@pytest.mark.slow
def test_repeated_modes():
    """A ring whose pairs the truth splits; the start has them exactly repeated."""
    links = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    model = factor_model(spring_structure(links, [1.0] * 6), {"a": [1], "b": [3, 8], "m": [1002]})
    case = simulated_case(model, (0.3, -0.2, 0.15), (0, 1, 2, 3, 4, 5), 6)
    case = replace(case, rules=PairingRules(mac_gate=0.2, relative_gap=0.03))
    result = update(problem_of(case))
    np.testing.assert_allclose(result.x, (0.3, -0.2, 0.15), atol=1e-6)


def test_a_symmetric_truth_keeps_its_repeated_modes():
    links = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    groups = {"ring": range(1, 7), "ground": range(7, 13)}
    model = factor_model(spring_structure(links, [1.0] * 6), groups)  # type: ignore[arg-type]
    result = update(problem_of(simulated_case(model, (0.4, -0.25), (0, 1, 2, 3, 5), 5)))
    np.testing.assert_allclose(result.x, (0.4, -0.25), atol=1e-6)


@pytest.mark.slow
def test_two_configurations_determine_what_one_does_not():
    """Stiffness and mass of a single oscillator: only their ratio from one frequency, both with an added mass."""
    structure = spring_structure([(-1, 0, 1000.0)], [2.0])
    groups = {"k": [1], "m": [1001]}
    bare = factor_model(structure, groups)
    loaded = factor_model(structure, groups, configuration=Configuration("loaded", masses=(AddedMass(1, 1.0),)))
    truth = (0.2, -0.1)
    one, two = (simulated_case(m, truth, (0,), 1) for m in (bare, loaded))
    alone = update(problem_of(one, residuals=(FrequencyResidual(0.01),)))
    assert alone.status is Status.UNDETERMINED
    assert np.isnan(list(alone.sd.values())).all()
    both = update(problem_of(one, two, residuals=(FrequencyResidual(0.01),)))
    np.testing.assert_allclose(both.x, truth, atol=1e-6)


def test_ties_are_updated_and_propagated():
    half = tied("half", "0.5 + 0.5*a")
    model = chain({"a": [1], "half": [2], "c": [3]}, more=[half])
    result = update(problem_of(noisy(simulated_case(model, (0.2, -0.1), range(4), 4), 0.002, 0.01, 1)))  # type: ignore
    assert result.values["half"] == pytest.approx(0.5 + 0.5 * result.values["a"])
    assert result.sd["half"] == pytest.approx(0.5 * result.sd["a"])


@pytest.mark.slow
def test_converged():
    result = update(problem_of(noisy(simulated_case(chain(), TRUTH, range(4), 4), 0.005, 0.02, 3)))  # type: ignore
    assert result.status is Status.CONVERGED
    gradient = result.after.jacobian.T @ result.after.residuals
    size = np.linalg.norm(result.after.jacobian, axis=0) * np.linalg.norm(result.after.residuals)
    assert (np.abs(gradient) < 1e-4 * size).all()
    assert result.after.objective < result.before.objective
    objectives = [i.objective for i in result.history]
    assert objectives == sorted(objectives, reverse=True)


@pytest.mark.slow
def test_at_bounds():
    """The truth lies outside: the parameter stays at its bound, without deviation, the others move on."""
    result = update(problem_of(simulated_case(chain(bounds=(0.9, 1.1)), TRUTH, range(4), 4)))  # type: ignore[arg-type]
    assert result.status is Status.CONVERGED_AT_BOUNDS
    assert result.at_bound
    for name in result.at_bound:
        i = result.parameters.index(name)
        assert result.covariance.reasons[i] == "at bound, σ not given"
        assert np.isnan(result.sd[name])
        assert result.values[name] in (pytest.approx(0.9), pytest.approx(1.1))


@pytest.mark.slow
def test_undetermined_parameters_do_not_move():
    """Two springs in parallel: the start's difference is kept."""
    springs = [*CHAIN, (0, 1, 300.0)]
    model = factor_model(spring_structure(springs, MASSES), {"a": [1], "b": [2], "twin": [5]})
    case = noisy(simulated_case(model, (0.2, -0.2, -0.2), range(4), 4), 0.005, 0.02, 2)  # type: ignore[arg-type]
    result = update(problem_of(case))
    assert result.status is Status.UNDETERMINED
    # 700·b + 300·twin is known; what is unknown (3, −7)/√58 has not moved
    assert abs(result.x[1:] @ np.array([3.0, -7.0])) < 1e-4
    assert np.isfinite([result.sd["a"]]).all()
    assert np.isnan([result.sd["b"], result.sd["twin"]]).all()
    assert 0.7 * result.x[1] + 0.3 * result.x[2] == pytest.approx(-0.2, abs=0.02)


def test_exact():
    assert update(problem_of(simulated_case(chain(), (0.0,) * 4, range(4), 4))).status is Status.EXACT  # type: ignore


def test_a_tiny_standard_deviation_does_not_make_all_residuals_zero():
    """Frequencies that are met to 1e-12 leave shapes with errors of several standard deviations."""
    case = noisy(simulated_case(chain(), TRUTH, range(4), 2), 0.0, 0.1, 4)  # type: ignore[arg-type]
    result = update(problem_of(case, residuals=(FrequencyResidual(1e-12), ShapeResidual(0.02))))
    assert result.status.ok
    assert result.status is not Status.EXACT
    assert np.abs(result.after.residuals).max() > 1.0


def test_iteration_limit():
    problem = problem_of(simulated_case(chain(), TRUTH, range(4), 4))  # type: ignore[arg-type]
    result = update(problem, SensitivityMethod(max_iterations=1))
    assert result.status is Status.MAX_ITERATIONS
    assert not result.status.ok
    assert len(result.history) == 2


@pytest.mark.slow
def test_stalled(monkeypatch: pytest.MonkeyPatch):
    """A Jacobian of the wrong sign: no short step lowers the objective, and that is not called convergence."""
    problem = problem_of(simulated_case(chain(), TRUTH, range(4), 4))  # type: ignore[arg-type]
    right = Walk.point

    def wrong(self: Walk, evaluation: Evaluation) -> Point:
        point = right(self, evaluation)
        return Point(point.evaluation, point.residuals, -point.jacobian)

    monkeypatch.setattr(Walk, "point", wrong)
    result = update(problem)
    assert result.status is Status.STALLED
    assert result.objective <= result.history[0].objective


def test_solve_failed(monkeypatch: pytest.MonkeyPatch):
    """Trial points that cannot be solved, however near: the last good one is kept."""
    problem = problem_of(simulated_case(chain(), TRUTH, range(4), 4))  # type: ignore[arg-type]

    def fails(*arguments: object, **more: object) -> None:
        raise FemtuneError("eigen.mechanism", "no")

    monkeypatch.setattr(UpdateProblem, "follow", fails)
    result = update(problem)
    assert result.status is Status.SOLVE_FAILED
    np.testing.assert_allclose(result.x, 0.0)


def test_pairing_cycles(monkeypatch: pytest.MonkeyPatch):
    """A pairing that changes after every step."""
    original = UpdateProblem.pair_again

    def swaps(self: UpdateProblem, at: object, joined: object = ()) -> object:
        fresh = original(self, at)  # type: ignore[arg-type]
        (state,) = fresh.states
        rest = state.groups[:3] if len(state.groups) == 4 else (*state.groups, ((3,), (3,)))
        return self.assess(fresh.x, [replace(state, groups=rest)])

    problem = problem_of(noisy(simulated_case(chain(), TRUTH, range(4), 4), 0.05, 0.1, 4))  # type: ignore[arg-type]
    monkeypatch.setattr(UpdateProblem, "pair_again", swaps)
    monkeypatch.setattr(method_module, "MANY_PAIRING_CHANGES", 0)
    result = update(problem)
    assert result.status is Status.PAIRING_CYCLES
    assert "test mode 4 with model mode 4 before, without partner now" in result.events[0]


def test_modes_that_cross_keep_their_motion():
    """Start: mode 1 is mass 0 alone. Truth: mode 1 is mass 1. Shapes tell, frequencies alone would not."""
    model = factor_model(
        spring_structure([(-1, 0, 100.0), (-1, 1, 130.0), (0, 1, 2.0)], [1.0, 1.0]), {"a": [1], "b": [2]}
    )
    rows = sensor_rows(model, (0, 1))
    truth = simulated_case(model, (0.6, -0.1), (0, 1), 2)
    assert abs(truth.test.shapes[1, 0]) > abs(truth.test.shapes[0, 0])
    case = ComparedCase(model, truth.test, rows, count=2, rules=PairingRules(frequency_gate=0.5))
    result = update(problem_of(case))
    np.testing.assert_allclose(result.x, (0.6, -0.1), atol=1e-6)


def test_a_mode_that_comes_into_the_gate_is_an_event():
    case = simulated_case(chain(bounds=(0.2, 3.0)), (0.9, 0.0, 0.0, 0.0), range(4), 4)  # type: ignore[arg-type]
    case = replace(case, rules=PairingRules(frequency_gate=0.12))
    result = update(problem_of(case))
    assert len(result.before.blocks) < len(result.after.blocks)
    assert result.events[0].startswith("iteration 1: baseline: test mode")
    np.testing.assert_allclose(result.x, (0.9, 0.0, 0.0, 0.0), atol=1e-6)


def linear_problem() -> UpdateProblem:
    """Eigenvalue of one oscillator by its stiffness factor: λ/λe − 1 = (1 + x)/1.2 − 1, linear in x."""
    model = factor_model(spring_structure([(-1, 0, 100.0)], [1.0]), {"k": [1]},
                         more=[Parameter("k", 1.0, 0.5, 2.0, prior_mean=1.1, prior_sd=0.05)])  # fmt: skip
    return problem_of(simulated_case(model, (0.2,), (0,), 1), residuals=(FrequencyResidual(0.1, "eigenvalue"),))


def test_minimum_change_by_hand():
    """min ((x − 0.2)/.12)² + μ²x²."""
    result = update(linear_problem(), SensitivityMethod(regularisation=MinimumChange(4.0)))
    s = 1 / 0.12
    assert result.x[0] == pytest.approx(0.2 * s**2 / (s**2 + 16.0), rel=1e-6)


def test_prior_by_hand():
    """Maximum a posteriori of two Gaussians, and its deviation."""
    result = update(linear_problem(), SensitivityMethod(regularisation=Prior()))
    s, p = 1 / 0.12, 1 / 0.05
    assert result.x[0] == pytest.approx((0.2 * s**2 + 0.1 * p**2) / (s**2 + p**2), rel=1e-6)
    assert result.covariance.misfit["frequency"] < 1.0
    assert result.sd["k"] == pytest.approx(1 / np.sqrt(s**2 + p**2), rel=1e-6)


def coverage(model: ConfiguredModel, truth: Sequence[float], residuals: Residuals, repeats: int) -> np.ndarray:
    """|x − truth| in standard deviations, of every repeat and parameter."""
    clean = simulated_case(model, truth, range(model.n_free), model.n_free)  # type: ignore[arg-type]
    z = []
    for seed in range(repeats):
        case = noisy(clean, 0.004, 0.0, seed)
        known = replace(case.test, freq_sd_hz=0.004 * case.test.freq_hz)
        result: UpdateResult = update(problem_of(replace(case, test=known), residuals=residuals))
        z.append((result.x - truth) / result.covariance.sd)
    return np.abs(np.array(z))


@pytest.mark.long
def test_intervals_cover_what_they_promise():
    """Known scatter of frequencies, 200 tests: ±1σ holds 68 %, ±2σ 95 %, within three binomial deviations."""
    model = chain({"a": [1, 2], "b": [3, 4]}, bounds=(0.3, 3.0))
    z = coverage(model, (0.2, -0.15), (FrequencyResidual("test"),), 200)
    # measured scatter is never made smaller, but enlarged where the fit is bad: a little more than promised
    for limit, promise in ((1.0, 0.683), (2.0, 0.954)):
        share = (z < limit).mean(axis=0)
        margin = 3.0 * np.sqrt(promise * (1 - promise) / 200)
        assert (share > promise - margin).all(), (limit, share)
    assert ((z < 1.0).mean(axis=0) < 0.683 + 0.15).all()


@pytest.mark.long
@pytest.mark.parametrize(("frequency", "shape"), [(0.004, 0.02), (0.02, 0.005)])
def test_intervals_cover_with_shapes_too(frequency: float, shape: float):
    """Frequencies and shapes that scatter as stated, 150 tests: errors of one standard deviation on average."""
    model = chain({"a": [1, 2], "b": [3, 4]}, bounds=(0.3, 3.0))
    truth = (0.2, -0.15)
    clean = simulated_case(model, truth, range(model.n_free), model.n_free)  # type: ignore[arg-type]
    z = []
    for seed in range(150):
        residuals = (FrequencyResidual(frequency), ShapeResidual(shape))
        result = update(problem_of(noisy(clean, frequency, shape, seed), residuals=residuals))
        z.append((result.x - truth) / result.covariance.sd)
    size = np.sqrt(np.mean(np.square(z), axis=0))
    # the mean square of 150 draws scatters by √(2/150); misfits above one widen the intervals a little
    assert ((size > 0.8) & (size < 1.0 + 3.0 * np.sqrt(0.5 / 150))).all(), size


@pytest.mark.slow
def test_a_refused_trial_costs_no_derivatives(monkeypatch: pytest.MonkeyPatch):
    """Derivatives belong to accepted points, their number to those of the history."""
    case = simulated_case(chain(), (0.9, -0.7, 0.8, -0.6), range(4), 4)
    problem = problem_of(noisy(case, 0.02, 0.3, 1))  # type: ignore[arg-type]
    solved: list[tuple[float, ...]] = []
    derived: set[tuple[float, ...]] = set()
    modes, derivative = type(direct).modes, type(direct).derivative

    def counted(own: object, point: ModelPoint, *more: object) -> object:
        solved.append(tuple(point.x))
        return modes(own, point, *more)  # type: ignore[arg-type]

    def noted(own: object, solution: EigenSolution, *more: object) -> object:
        derived.add(tuple(solution.point.x))
        return derivative(own, solution, *more)  # type: ignore[arg-type]

    monkeypatch.setattr(type(direct), "modes", counted)
    monkeypatch.setattr(type(direct), "derivative", noted)
    result = update(problem)
    assert derived == {tuple(i.x) for i in result.history}
    assert len(set(solved)) > len(derived)
