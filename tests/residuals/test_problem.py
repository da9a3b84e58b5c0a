"""Residual blocks: values by hand, Jacobians of all forms and scalings, pairing and tracking."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.model import solve_modes
from femtune.residuals import (
    ComparedCase,
    Evaluation,
    FrequencyResidual,
    MacResidual,
    PairingRules,
    PairResidual,
    ShapeResidual,
    UpdateProblem,
    describe_change,
)
from femtune.residuals.frequency import frequency_residual
from femtune.residuals.mac import mac_residual
from femtune.residuals.pairing import alternating, join, keep_paired, track
from femtune.residuals.shape import scaled_difference
from femtune.testing import ResidualDerivativeChecks, check_residual
from structures.springs import factor_model, sensor_rows, simulated_case, spring_structure

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
GROUPS = {"a": [1, 2], "b": [3], "m": [1002]}
TRUTH = (0.15, -0.2, 0.1)

FORMS = {
    "frequency": (FrequencyResidual(0.01),),
    "eigenvalue": (FrequencyResidual(0.01, "eigenvalue"),),
    "unit norm": (FrequencyResidual(0.01), ShapeResidual(0.1)),
    "largest entry": (ShapeResidual(0.1, "largest-entry"),),
    "mac": (FrequencyResidual(0.02), MacResidual(0.5)),
}


def chain_case(sensors: tuple[int, ...] = (0, 2, 3), **more: object) -> ComparedCase:
    return simulated_case(
        factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), GROUPS), TRUTH, sensors, 3, **more
    )


def problem_of(case: ComparedCase, residuals: tuple[PairResidual, ...]) -> UpdateProblem:
    return UpdateProblem((case,), case.configured.model.parameters, residuals)


@pytest.mark.quick(0)
@pytest.mark.parametrize("form", FORMS)
def test_jacobian_of_every_form(form: str):
    check_residual(problem_of(chain_case(), FORMS[form]), np.array([0.02, 0.1, -0.1]))


class TestRepeatedPairs(ResidualDerivativeChecks):
    """A ring whose parameters break the symmetry, with test shapes that are turned in their pairs."""

    points = ((0.0, 0.0, 0.0), (0.05, -0.02, 0.0))

    def make_problem(self) -> UpdateProblem:
        springs = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
        model = factor_model(spring_structure(springs, [1.0] * 6), {"a": [1], "b": [3], "m": [1002]})
        case = simulated_case(model, (0.2, 0.1, 0.1), range(6), 6)  # type: ignore[arg-type]
        rules = PairingRules(mac_gate=0.2, relative_gap=0.05)
        return problem_of(replace(case, rules=rules), (FrequencyResidual(0.01), ShapeResidual(0.1)))


def test_the_pairs_are_compared_as_subspaces():
    problem = TestRepeatedPairs().make_problem()
    groups = problem.start(np.zeros(3)).states[0].groups
    assert {(1, 2), (3, 4)} <= {models for _, models in groups}


def test_residuals_vanish_at_the_truth_and_only_there():
    problem = problem_of(chain_case(), FORMS["unit norm"])
    assert problem.start(np.array(TRUTH)).objective < 1e-20
    assert problem.start(np.zeros(3)).objective > 1.0


def test_frequency_residuals_by_hand():
    value = (2 * np.pi * 11.0) ** 2
    plain, slope = frequency_residual(value, np.array([2.0 * value]), 10.0, 0.05)
    assert plain[0] == pytest.approx(0.1 / 0.05)
    # λ ∝ x² has f ∝ x: twice the relative slope of f
    assert slope[0, 0] == pytest.approx(1.1 / 0.05)
    squared, slope = frequency_residual(value, np.array([value]), 10.0, 0.05, "eigenvalue")
    assert squared[0] == pytest.approx(0.21 / 0.05)
    assert slope[0, 0] == pytest.approx(1.21 / 0.05)


def test_shape_residuals_by_hand():
    shape, test, none = np.array([-3.0, 0.0, -4.0]), np.array([4.0, np.nan, 3.0]), np.zeros((3, 1))
    unit, _, _ = scaled_difference(shape, none, test, "unit-norm")
    np.testing.assert_allclose(unit, [0.6 - 0.8, 0.8 - 0.6])
    largest, _, _ = scaled_difference(shape, none, test, "largest-entry")
    np.testing.assert_allclose(largest, [4 / 3 - 3 / 4])
    mac, _ = mac_residual(shape, none, test, 0.5)
    np.testing.assert_allclose(mac, [(1 - 0.96) / 0.96 / 0.5])
    # the norm of the difference is √(2(1 − √MAC))
    assert np.linalg.norm(unit) == pytest.approx(np.sqrt(2 * (1 - 0.96)))


@pytest.mark.slow
def test_entries_that_were_not_measured_are_left_out():
    case = chain_case((0, 1, 2, 3))
    shapes = np.array(case.test.shapes)
    shapes[1, 0] = shapes[3, 2] = np.nan
    spoilt = replace(case, test=replace(case.test, shapes=shapes))
    problem = problem_of(spoilt, FORMS["unit norm"])
    assert problem.start(np.array(TRUTH)).objective < 1e-20
    assert [len(b.values) for b in problem.start(np.zeros(3)).blocks if b.kind == "shape"] == [3, 4, 3]
    check_residual(problem, np.zeros(3))


def test_scatter_of_the_test():
    case = chain_case()
    sd = 0.002 * case.test.freq_hz
    known = replace(case, test=replace(case.test, freq_sd_hz=sd))
    of_frequency = problem_of(known, (FrequencyResidual("test"),)).start(np.zeros(3))
    of_eigenvalue = problem_of(known, (FrequencyResidual("test", "eigenvalue"),)).start(np.zeros(3))
    assert [b.sd for b in of_frequency.blocks] == pytest.approx([0.002] * 3)
    # λ scatters twice as much as f, so that both forms weigh alike to first order
    assert [b.sd for b in of_eigenvalue.blocks] == pytest.approx([0.004] * 3)
    with pytest.raises(FemtuneError, match=r"residual\.no-scatter"):
        problem_of(case, (FrequencyResidual("test"),)).start(np.zeros(3))


def test_zero_pairs_are_an_error():
    case = chain_case()
    far = replace(case, test=replace(case.test, freq_hz=10.0 * case.test.freq_hz))
    with pytest.raises(FemtuneError, match=r"correlate\.no-pairs"):
        problem_of(far, FORMS["frequency"]).start(np.zeros(3))


def crossing_case() -> ComparedCase:
    """Two uncoupled oscillators, 0 below 1 at nominal and above it at the truth."""
    model = factor_model(spring_structure([(-1, 0, 100.0), (-1, 1, 130.0)], [1.0, 1.0]), {"a": [1], "b": [2]})
    rows = sensor_rows(model, (0, 1))
    test = ModeSet(
        np.sqrt([150.0, 120.0]) / (2 * np.pi), np.eye(2), DofSet(model.free_dof(i) for i in (0, 1)), labels=("A", "B")
    )
    return ComparedCase(model, test, rows, count=2)


def test_tracking_keeps_the_motion():
    problem = problem_of(crossing_case(), FORMS["frequency"])
    start = problem.start(np.zeros(2))
    assert start.states[0].groups == (((0,), (0,)), ((1,), (1,)))
    there = problem.follow(np.array([0.5, -0.1]), start)
    assert there.states[0].groups == (((0,), (1,)), ((1,), (0,)))
    events = describe_change(start.states[0].case, start.states[0].groups, there.states[0].groups)
    assert events == [
        "baseline: test mode A with model mode 1 before, with model mode 2 now",
        "baseline: test mode B with model mode 2 before, with model mode 1 now",
    ]
    assert sum(len(tests) for state in there.states for tests, _ in state.groups) == 2
    assert problem.pair_again(there) is there


def test_states_of_another_model_are_paired_as_an_evaluation():
    problem = problem_of(chain_case(), FORMS["frequency"])
    end = problem.start(np.zeros(3))
    first, second, third = end.states[0].groups
    (fresh,) = problem.solved(np.zeros(3))
    # what a fresh pairing would drop stays
    (kept,) = problem.paired_as(end, [fresh.with_groups((first, second))])
    assert kept.groups == (first, second, third)
    # another partner counts, unless a test mode would lose its own
    swapped = ((0,), (1,)), ((1,), (0,)), third
    (other,) = problem.paired_as(end, [fresh.with_groups(swapped)])
    assert other.groups == swapped
    (held,) = replace(problem, pairing_held=True).paired_as(end, [fresh.with_groups(swapped)])
    assert held.groups == end.states[0].groups
    (robbed,) = problem.paired_as(end, [fresh.with_groups((((1,), (0,)), third))])
    assert robbed.groups == end.states[0].groups
    # test modes that were compared as one subspace still are
    joined = replace(end, states=(end.states[0].with_groups((((0, 1), (0, 1)), third)),))
    assert problem.paired_as(joined, [fresh])[0].groups == (((0, 1), (0, 1)), third)
    # nothing to change
    assert problem.paired_as(end, [fresh]) == [fresh]


def test_tracking_at_exact_crossing_stays_finite():
    """The trial point where both oscillators have one frequency: neither NaN nor a warning."""
    problem = problem_of(crossing_case(), FORMS["unit norm"])
    there = problem.follow(np.array([0.3, 0.0]), problem.start(np.zeros(2)))
    assert np.isfinite(there.jacobian).all()
    assert np.isfinite(there.residuals).all()


def test_a_paired_mode_does_not_leave_the_residual():
    before = (((0,), (0,)), ((1,), (2,)))
    assert keep_paired(before, (((0,), (0,)),)) == before
    # also where another test mode claims its model mode
    assert keep_paired(before, (((0,), (2,)),)) == before
    # partners may be exchanged, and found
    assert keep_paired(before, (((0,), (2,)), ((1,), (0,)))) == (((0,), (2,)), ((1,), (0,)))
    assert keep_paired(before, (((2,), (1,)),)) == (*before, ((2,), (1,)))


def test_tracking_of_nothing():
    solution = solve_modes(chain_case().configured.at(np.zeros(3)), 2)
    assert track((), solution, solution) == ()


def test_more_paired_modes_than_the_model_has_are_an_error():
    configured = chain_case().configured
    many, few = (solve_modes(configured.at(np.zeros(3)), count) for count in (3, 1))
    groups = (((0,), (0,)), ((1,), (1,)), ((2,), (2,)))
    few = replace(few, eigenvalues=few.eigenvalues[:1], shapes=few.shapes[:, :1])
    with pytest.raises(FemtuneError) as error:
        track(groups, many, few)
    check_shown("residual.modes-lost", error.value)


def test_a_point_without_residuals_has_none_by_any_parameter():
    at = Evaluation(np.zeros(3), (), ())
    assert at.residuals.shape == (0,)
    assert at.jacobian.shape == (0, 3)
    assert at.objective == 0.0


def test_mean_error_of_equal_misfits_is_their_size():
    case = chain_case()
    off = replace(case, test=replace(case.test, freq_hz=case.test.freq_hz / 1.03))
    found = problem_of(off, FORMS["frequency"]).start(np.array(TRUTH))
    assert found.mean_error == pytest.approx(0.03, rel=1e-9)
    assert [b.error for b in found.blocks] == pytest.approx([0.03] * 3)
    assert found.blocks[0].label == "baseline mode 1 frequency"


def test_modes_that_alternate_are_those_that_share_a_group_or_a_partner():
    single = (((0,), (0,)), ((1,), (1,)), ((2,), (2,)), ((3,), (3,)), ((4,), (4,)))
    swapped = (((0,), (1,)), ((1,), (0,)), ((2,), (2,)), ((3,), (3,)), ((4,), (4,)))
    grouped = (((0,), (0,)), ((1,), (1,)), ((2, 3), (2, 3)), ((4,), (4,)))
    assert alternating([(single, swapped)]) == (frozenset({0, 1}),)
    assert alternating([(single, grouped)]) == (frozenset({2, 3}),)
    assert set(alternating([(single, swapped), (grouped, single)])) == {frozenset({0, 1}), frozenset({2, 3})}
    assert alternating([(single, single[:4])]) == ()
    assert alternating([]) == ()


def test_joined_test_modes_are_one_group_with_all_their_partners():
    single = (((0,), (1,)), ((1,), (0,)), ((2,), (2,)))
    assert join(single, (frozenset({0, 1}),)) == (((0, 1), (0, 1)), ((2,), (2,)))
    assert join((((0, 1), (0, 1)), ((2,), (2,))), (frozenset({1, 2}),)) == (((0, 1, 2), (0, 1, 2)),)
    assert join(single[2:], (frozenset({0, 1}),)) == single[2:]
