"""Many starts: where they end, what is the same, what is as good, and what a run that was broken off leaves behind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.executor import Executor, Processes, Serial
from femtune.residuals import FrequencyResidual, PairingRules, ShapeResidual, UpdateProblem
from femtune.status import Status
from femtune.updating import (
    Link,
    MultiStart,
    Sample,
    SensitivityMethod,
    StartOutcome,
    StartResult,
    StartRules,
    multi_start,
    starting_points,
    update,
)
from femtune.updating import starts as starts_module
from femtune.updating.starts import distinct_optima, follow_up, noise_level, outcomes, start_sentences
from structures.springs import factor_model, simulated_case, spring_structure

from .four_masses import CHAIN, TRUTH, chain_problem


@pytest.fixture(scope="module")
def problem() -> UpdateProblem:
    return chain_problem()


@pytest.fixture(scope="module")
def twins() -> UpdateProblem:
    """Two coupled oscillators, of which the frequencies cannot tell which is the stiffer one."""
    springs = [(-1, 0, 100.0), (-1, 1, 100.0), (0, 1, 30.0)]
    model = factor_model(spring_structure(springs, [1.0, 1.0]), {"a": [1], "b": [2]})
    case = simulated_case(model, (0.5, -0.4), (0, 1), 2, fixed=((0, 0), (1, 1)))
    return UpdateProblem((case,), model.model.parameters, (FrequencyResidual(0.01),))


@pytest.fixture(scope="module")
def found(problem: UpdateProblem) -> MultiStart:
    return multi_start(problem, rules=StartRules(8, seed=3, hops=2))


def test_points_are_a_latin_hypercube_of_the_bounds(problem: UpdateProblem):
    points = starting_points(problem.parameters, StartRules(16, seed=1))
    lower, upper = problem.parameters.bounds
    cells = np.floor(16 * (points - lower) / (upper - lower)).astype(int)
    assert (np.sort(cells, axis=0) == np.arange(16)[:, None]).all()
    again = starting_points(problem.parameters, StartRules(16, seed=1))
    np.testing.assert_array_equal(points, again)
    assert not np.allclose(points, starting_points(problem.parameters, StartRules(16, seed=2)))


@pytest.mark.slow
def test_every_start_is_kept_and_the_best_is_the_truth(found: MultiStart):
    assert [s.number for s in found.starts] == list(range(1, 9))
    np.testing.assert_allclose(found.best.x, TRUTH, atol=1e-6)
    assert found.best.status is Status.EXACT
    assert found.sentences[0].endswith("of 8 starts reached the same optimum.")
    for s in found.starts:
        missed = not np.allclose(s.end, TRUTH, atol=1e-4)
        assert missed == (found.outcomes[s.number] is not StartOutcome.BEST)


@pytest.mark.slow
def test_two_answers_that_the_data_cannot_tell_apart(twins: UpdateProblem):
    """The one or the other is the stiffer one: two exact optima, and the report must not call one the answer."""
    found = multi_start(twins, rules=StartRules(10, seed=0))
    ends = {tuple(np.round(o.x, 5)) for o in found.optima if o.as_good}
    assert ends == {(0.5, -0.4), (-0.4, 0.5)}
    assert not found.unique
    assert any("the result is not unique" in s for s in found.sentences)


@pytest.mark.parametrize("unfinished", [False, True])
@pytest.mark.slow
def test_one_end_of_each_optimum_is_followed(
    twins: UpdateProblem, unfinished: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On another problem of the same truth: both optima are followed once, and all their starts end with them."""
    found = multi_start(twins, rules=StartRules(10, seed=0))
    lost = found.starts[-1].number
    starts = tuple(replace(s, status=Status.MAX_ITERATIONS) if s.number == lost else s for s in found.starts)
    optima = distinct_optima(starts, twins.parameters.prior[1], found.noise)
    members = [o.members for o in optima if len(o.members) > 1]
    assert len(members) == 2
    begun = []
    real = starts_module.update
    monkeypatch.setattr(starts_module, "update", lambda *a, **k: begun.append(k["start"].x) or real(*a, **k))
    other = replace(twins, residuals=(FrequencyResidual(0.02),))
    after = follow_up(
        replace(found, starts=starts, optima=optima), other, SensitivityMethod(), found.best.side, unfinished=unfinished
    )
    assert len(begun) == len(optima) + unfinished
    for numbers in members:
        ends = np.array([s.end for s in after.starts if s.number in numbers])
        np.testing.assert_array_equal(ends, np.tile(ends[0], (len(ends), 1)))
    assert {o.members for o in after.optima} >= set(members) or unfinished
    if not unfinished:
        assert after.starts[-1].end is starts[-1].end
        assert after.starts[-1].iterations == starts[-1].iterations


@pytest.mark.slow
def test_what_is_known_is_not_done_again(problem: UpdateProblem, found: MultiStart):
    told: list[StartResult] = []
    full = multi_start(problem, rules=StartRules(8, seed=3, hops=2), report=told.append)
    known = {(s.number, s.tries): s for s in told[:5]}
    again: list[StartResult] = []
    rest = multi_start(problem, rules=StartRules(8, seed=3, hops=2), known=known, report=again.append)
    assert len(again) == len(told) - 5
    for a, b in zip(full.starts, rest.starts):
        np.testing.assert_array_equal(a.end, b.end)
    np.testing.assert_allclose(rest.best.x, full.best.x, atol=1e-7)
    assert full.sentences == rest.sentences == found.sentences


@pytest.mark.slow
def test_processes_find_the_same_to_the_last_bit(problem: UpdateProblem, found: MultiStart):
    told: list[tuple[int, int]] = []
    rules = StartRules(8, seed=3, hops=2)
    other = multi_start(problem, rules=rules, executor=Processes(2), report=lambda s: told.append((s.number, s.tries)))
    assert [s.end.tobytes() for s in other.starts] == [s.end.tobytes() for s in found.starts]
    assert [(s.objective, s.tries, s.iterations) for s in other.starts] == [
        (s.objective, s.tries, s.iterations) for s in found.starts
    ]
    assert other.sentences == found.sentences
    assert [i.x.tobytes() for i in other.best.history] == [i.x.tobytes() for i in found.best.history]
    np.testing.assert_array_equal(other.best.after.residuals, found.best.after.residuals)
    # the end is on the cases of this process, which can go on from there
    assert other.best.after.states[0].case is problem.cases[0]
    np.testing.assert_allclose(problem.pair_again(other.best.after).residuals, other.best.after.residuals)
    assert len(told) == sum(s.tries for s in found.starts)


@pytest.mark.parametrize(
    "executor",
    [pytest.param(Serial(), id="serial"), pytest.param(Processes(2), id="processes", marks=pytest.mark.long)],
)
@pytest.mark.slow
def test_the_best_samples_are_the_starts(problem: UpdateProblem, executor: Executor):
    rules, told = StartRules(4, seed=5, samples=12), list[Sample]()
    found = multi_start(problem, rules=rules, executor=executor, report_sample=told.append)
    points = starting_points(problem.parameters, rules)
    assert len(points) == len(told) == 12
    values, counts = [], []
    for x in points:
        try:
            at = problem.start(x)
            values.append(at.objective)
            counts.append(at.independent)
        except FemtuneError:
            values.append(np.nan)
            counts.append(0)
    np.testing.assert_allclose([s.objective for s in found.samples], values, rtol=1e-9)
    # points from which fewer modes are paired have smaller objectives for this reason alone
    assert len(set(counts)) > 1
    best = points[np.lexsort((values, -np.array(counts)))[:3]]
    np.testing.assert_array_equal([s.start for s in found.starts], [np.zeros(3), *best])
    known = {s.number: s for s in told[:7]}
    again: list[Sample] = []
    rest = multi_start(problem, rules=rules, sampled=known, report_sample=again.append)
    assert {s.number for s in again} == set(range(1, 13)) - set(known)
    assert [s.end.tobytes() for s in rest.starts] == [s.end.tobytes() for s in found.starts]


@pytest.mark.slow
def test_starts_move_only_the_active_parameters_and_settle_constraints_once(problem: UpdateProblem):
    method = SensitivityMethod(regularisation=Link(0.1))
    found = multi_start(problem, method, StartRules(3, hops=1), active=["b"])
    assert all(s.start[0] == s.end[0] == 0.0 for s in found.starts)
    ends = [s.end[1] for s in found.starts if s.at_optimum]
    assert np.ptp(ends) < 1e-6


@pytest.mark.slow
def test_a_start_that_cannot_be_solved_is_kept_with_its_reason(problem: UpdateProblem, monkeypatch: pytest.MonkeyPatch):
    right = UpdateProblem.start

    def fails(self: UpdateProblem, x: np.ndarray) -> object:
        if x[0] > 0.5:
            raise FemtuneError("eigen.mechanism", "no stiffness there")
        return right(self, x)

    monkeypatch.setattr(UpdateProblem, "start", fails)
    found = multi_start(problem, rules=StartRules(6, seed=0))
    lost = [s for s in found.starts if s.status is None]
    assert lost
    assert {s.problem for s in lost} == {"no stiffness there"}
    assert f"{len(lost)} starts could not be solved." in found.sentences


@pytest.mark.slow
def test_an_end_with_fewer_pairs_is_not_the_best():
    """Far from the truth a mode lies outside of the frequency gate: without its residuals the objective is smaller."""
    model = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), {"a": [1], "b": [2], "c": [3]})
    case = simulated_case(model, TRUTH, range(4), 4, rules=PairingRules(0.1, 0.5))  # type: ignore[arg-type]
    scatter = 1.0 + 0.035 * np.array([1.0, -1.0, 1.0, -1.0])
    case = replace(case, test=replace(case.test, freq_hz=case.test.freq_hz * scatter))
    problem = UpdateProblem((case,), model.model.parameters, (FrequencyResidual(0.01), ShapeResidual(0.1)))
    found = multi_start(problem, rules=StartRules(10, seed=3))
    ends = [s for s in found.starts if s.at_optimum]
    most = max(s.residuals for s in ends)
    fewer = [s for s in ends if s.residuals < most]
    assert min(s.objective for s in fewer) < found.best.objective
    assert found.best.after.independent == most
    # there the modes without a partner are compared with the nearest model mode
    assert all(s.common > s.objective for s in fewer)
    assert all(found.best.objective <= s.common * (1 + 1e-9) for s in ends)
    assert not {found.outcomes[s.number] for s in fewer} & {StartOutcome.BEST, StartOutcome.FEWER_DATA}
    assert any("ended where fewer test modes find a partner" in sentence for sentence in found.sentences)
    np.testing.assert_allclose(found.best.x, TRUTH, atol=0.2)


@pytest.mark.slow
def test_starts_are_not_worse_than_the_plain_update_by_the_same_comparisons():
    """However many modes find partners at the ends: no end, that of the plain update included, is better."""
    model = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), {"a": [1], "b": [2], "c": [3]})
    for seed in range(3):
        rng = np.random.default_rng(seed)
        rules = PairingRules(0.15, 0.5)
        case = simulated_case(model, tuple(rng.uniform(-0.4, 0.6, 3)), range(4), 4, rules=rules)  # type: ignore[arg-type]
        case = replace(case, test=replace(case.test, freq_hz=case.test.freq_hz * (1.0 + 0.05 * rng.standard_normal(4))))
        problem = UpdateProblem((case,), model.model.parameters, (FrequencyResidual(0.01), ShapeResidual(0.1)))
        plain, found = update(problem), multi_start(problem, rules=StartRules(5, seed=seed))
        assert found.starts[0].objective == pytest.approx(plain.objective)
        tests = tuple(frozenset(range(4)) for _ in problem.cases)
        assert problem.over(found.best.after, tests) <= problem.over(plain.after, tests) * (1.0 + 1e-9)


def end(
    number: int, x: float, objective: float, status: Status | None = Status.CONVERGED, residuals: int = 9
) -> StartResult:
    return StartResult(number, np.zeros(1), np.array([x]), objective, status, 1, 5, residuals=residuals)


def test_ends_by_hand():
    starts = [
        end(1, 0.0, 4.0), end(2, 1.0, 4.5), end(3, 1e-4, 4.0), end(4, 3.0, 40.0), end(5, 0.0, 1.0, Status.STALLED),
        end(6, 0.0, np.nan, None), end(7, 5.0, 0.1, residuals=6),
    ]  # fmt: skip
    optima = distinct_optima(starts, np.ones(1), noise=1.9)
    assert [(o.members, o.as_good) for o in optima] == [((1, 3), True), ((2,), True), ((4,), False)]
    found = outcomes(starts, optima)
    assert [found[i].name for i in range(1, 8)] == [
        "BEST", "AS_GOOD", "BEST", "WORSE", "UNFINISHED", "FAILED", "FEWER_DATA",
    ]  # fmt: skip
    assert start_sentences(starts, optima) == (
        "2 of 7 starts reached the same optimum.",
        "1 start reached 1 other optimum that is equally good within the noise; the result is not unique.",
        "1 start reached an optimum with a higher objective.",
        "1 start ended where fewer test modes are paired; its objective is not compared with the others.",
        "1 start did not converge.",
        "1 start could not be solved.",
    )
    assert "None of 1 starts converged" in start_sentences(starts[4:5], ())[0]


def test_noise_is_what_was_stated_or_what_is_seen():
    # half the 95 % quantile of chi-square with two degrees of freedom is ln 20
    assert noise_level(50.0, 100, 2) == pytest.approx(np.log(20.0))
    # a misfit of a hundredth of what was stated: the bar is as much lower
    assert noise_level(0.5e-2, 100, 2) < 1e-3
    assert noise_level(1e-20, 100, 2) < 1e-14
    # too few residuals to see any scatter
    assert noise_level(1e-6, 4, 2) == pytest.approx(np.log(20.0))
