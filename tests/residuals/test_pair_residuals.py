"""Residuals of paired modes: scales, forms of the MAC, flexibility, covariances; Jacobians, at repeated modes too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.residuals import ComparedCase, OfModes, OfPairs, PairingRules, UpdateProblem
from femtune.residuals.flexibility import FlexibilityResidual
from femtune.residuals.frequency import FrequencyCovariance, FrequencyResidual
from femtune.residuals.mac import MacResidual, mac_residual
from femtune.residuals.shape import ShapeResidual, StrainResidual, scaled_difference
from femtune.residuals.weights import Weights
from femtune.testing import check_residual
from structures.springs import factor_model, simulated_case, spring_structure

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
TRUTH = (0.15, -0.2, 0.1)
HALF = np.full((6, 6), 0.5) + 0.5 * np.eye(6)

RESIDUALS: dict[str, Callable[[int, int], OfPairs]] = {
    "frequency": lambda s, m: FrequencyResidual(0.01),
    "eigenvalue": lambda s, m: FrequencyResidual(0.01, "eigenvalue"),
    "frequencies by covariance": lambda s, m: FrequencyCovariance(1e-4 * HALF[:m, :m]),
    "eigenvalues by covariance": lambda s, m: FrequencyCovariance(1e-4 * HALF[:m, :m], "eigenvalue"),
    "unit norm": lambda s, m: ShapeResidual(0.1),
    "largest entry": lambda s, m: ShapeResidual(0.1, "largest-entry"),
    "scale factor": lambda s, m: ShapeResidual(0.1, "scale-factor"),
    "mass": lambda s, m: ShapeResidual(0.1, "mass"),
    "shapes by covariance": lambda s, m: ShapeResidual(Weights(covariance=0.01 * HALF[:s, :s]), "largest-entry"),
    "some sensors": lambda s, m: StrainResidual(0.1, sensors=DofSet.parse(("1X+", "4X+"))),
    "root of the MAC": lambda s, m: MacResidual(0.1),
    "ratio of the MAC": lambda s, m: MacResidual(0.1, "ratio"),
    "one minus MAC": lambda s, m: MacResidual(0.1, "difference"),
    "flexibility": lambda s, m: FlexibilityResidual(0.05),
    "diagonal of the flexibility": lambda s, m: FlexibilityResidual(0.05, "diagonal"),
    "of some modes": lambda s, m: OfModes(ShapeResidual(0.1), ("2",)),
}


def chain_case(**more: object) -> ComparedCase:
    model = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), {"a": [1, 2], "b": [3], "m": [1002]})
    return as_mass_scaled(simulated_case(model, TRUTH, (0, 2, 3), 3, **more))


def ring_case() -> ComparedCase:
    """A ring with two pairs of repeated modes at nominal, which the parameters split; tested where they are split."""
    springs = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    model = factor_model(spring_structure(springs, [1.0] * 6), {"a": [1], "b": [3], "m": [1002]})
    case = simulated_case(model, (0.2, 0.1, 0.1), range(6), 6)  # type: ignore[arg-type]
    return as_mass_scaled(replace(case, rules=PairingRules(mac_gate=0.2, relative_gap=0.05)))


def as_mass_scaled(case: ComparedCase) -> ComparedCase:
    return replace(case, test=replace(case.test, normalisation="mass"))


def problem_of(case: ComparedCase, residual: OfPairs) -> UpdateProblem:
    return UpdateProblem((replace(case, residuals=(residual,)),), case.configured.model.parameters)


@pytest.mark.quick(0)
@pytest.mark.parametrize("name", RESIDUALS)
def test_jacobian(name: str):
    check_residual(problem_of(chain_case(), RESIDUALS[name](3, 3)), np.array([0.02, 0.1, -0.1]))


@pytest.mark.quick(0, gate=12)
@pytest.mark.parametrize("name", RESIDUALS)
@pytest.mark.parametrize("x", [(0.0, 0.0, 0.0), (0.05, -0.02, 0.0)])
def test_jacobian_at_repeated_modes(name: str, x: tuple[float, ...]):
    """Each parameter breaks the symmetry: single eigenvalues have no Jacobian there, what is compared has."""
    problem = problem_of(ring_case(), RESIDUALS[name](6, 6))
    assert {(1, 2), (3, 4)} <= {models for _, models in problem.start(np.zeros(3)).states[0].groups}
    check_residual(problem, np.array(x))


@pytest.mark.quick(0)
@pytest.mark.parametrize("name", RESIDUALS)
def test_zero_at_the_truth(name: str):
    problem = problem_of(chain_case(), RESIDUALS[name](3, 3))
    assert problem.start(np.array(TRUTH)).objective < 1e-18
    assert problem.start(np.zeros(3)).objective > 1e-6


def test_scales_by_hand():
    shape, test, none = np.array([-3.0, 0.0, -4.0]), np.array([4.0, np.nan, 3.0]), np.zeros((3, 1))
    mac = (24.0 / 25.0) ** 2
    factor, _, at = scaled_difference(shape, none, test, "scale-factor")
    # the best factor is φᵀψ/φᵀφ = −24/25
    np.testing.assert_allclose(factor, (np.array([72.0, 96.0]) / 25.0 - [4.0, 3.0]) / 5.0)
    assert np.linalg.norm(factor) == pytest.approx(np.sqrt(1.0 - mac))
    assert at.tolist() == [0, 2]
    mass, _, _ = scaled_difference(shape, none, test, "mass")
    np.testing.assert_allclose(mass, [(3.0 - 4.0) / 5.0, (4.0 - 3.0) / 5.0])
    assert scaled_difference(shape, none, test, "largest-entry")[2].tolist() == [2]


def test_forms_of_the_mac_by_hand():
    shape, test, none = np.array([3.0, 4.0]), np.array([4.0, 3.0]), np.zeros((2, 1))
    mac = (24.0 / 25.0) ** 2
    assert mac_residual(shape, none, test, 0.5, "ratio")[0] == pytest.approx((1.0 - mac) / mac / 0.5)
    assert mac_residual(shape, none, test, 0.5, "difference")[0] == pytest.approx((1.0 - mac) / 0.5)


def test_flexibility_of_all_modes_is_the_static_one():
    """With all modes and sensors Σ φφᵀ/λ is K⁻¹."""
    model = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), {"a": [1, 2], "b": [3]})
    case = as_mass_scaled(simulated_case(model, (0.1, -0.2), range(4), 4))  # type: ignore[arg-type]
    found = problem_of(case, FlexibilityResidual(1.0)).start(np.zeros(2))
    inverse = [np.linalg.inv(model.at(np.array(x)).stiffness.toarray()) for x in ((0.0, 0.0), (0.1, -0.2))]
    expected = (inverse[0] - inverse[1])[np.triu_indices(4)] / np.abs(inverse[1]).max()
    np.testing.assert_allclose(found.residuals, expected, atol=1e-9)


def test_a_covariance_that_is_diagonal_weighs_like_its_deviations():
    case = chain_case()
    sd = np.array([0.02, 0.03, 0.05])
    whole = problem_of(case, FrequencyCovariance(np.diag(sd**2))).start(np.zeros(3))
    each = problem_of(replace(case, test=replace(case.test, freq_sd_hz=sd)), FrequencyResidual("test"))
    np.testing.assert_allclose(whole.residuals, each.start(np.zeros(3)).residuals, rtol=1e-12)
    own = replace(case.test, covariance=np.diag([*sd**2, 1.0, 1.0, 1.0]))
    by_test = problem_of(replace(case, test=own), FrequencyCovariance("test")).start(np.zeros(3))
    np.testing.assert_allclose(by_test.residuals, whole.residuals, rtol=1e-12)


def test_a_covariance_gives_the_mahalanobis_distance():
    case, covariance = chain_case(), 1e-4 * (np.eye(3) + 0.3)
    at = problem_of(case, FrequencyCovariance(covariance)).start(np.zeros(3))
    error = at.states[0].solution.freq_hz[:3] - case.test.freq_hz
    assert 2.0 * at.objective == pytest.approx(error @ np.linalg.solve(covariance, error), rel=1e-9)
    # a mode that is left out takes its row and column along
    fewer = replace(case, left_out={1: "not trusted"})
    rest = problem_of(fewer, FrequencyCovariance(covariance)).start(np.zeros(3))
    kept = [0, 2]
    expected = error[kept] @ np.linalg.solve(covariance[np.ix_(kept, kept)], error[kept])
    assert 2.0 * rest.objective == pytest.approx(expected, rel=1e-9)


def test_sensors_are_found_by_their_labels():
    """A test that lost its first sensor still compares the entries that are left, with their own weights."""
    case, seen = chain_case(), DofSet.parse(("4X+", "1X+", "3X+"))
    whole = problem_of(case, ShapeResidual(Weights([0.1, 0.2, 0.3]), "mass", seen)).start(np.zeros(3)).blocks[0]
    kept = case.test.dofs.select([1, 2])
    less = replace(case, test=case.test.select_dofs(kept), sensors=case.sensors[[1, 2]])
    part = problem_of(less, ShapeResidual(Weights([0.1, 0.2, 0.3]), "mass", seen)).start(np.zeros(3)).blocks[0]
    ratio = np.linalg.norm(case.test.shapes[:, 0]) / np.linalg.norm(less.test.shapes[:, 0])
    np.testing.assert_allclose(part.values, whole.values[[0, 2]] * ratio)


def spoilt(case: ComparedCase, **changes: object) -> ComparedCase:
    return replace(case, test=replace(case.test, **changes))


@pytest.mark.parametrize(
    ("residual", "changes", "code"),
    [
        (ShapeResidual(0.1, "mass"), {"normalisation": "unknown"}, "residual.not-mass-scaled"),
        (FlexibilityResidual(0.1), {"normalisation": "unit-norm"}, "residual.not-mass-scaled"),
        (FrequencyCovariance("test"), {}, "residual.no-scatter"),
        (FrequencyCovariance(np.eye(2)), {}, "residual.weights"),
        (ShapeResidual(Weights(covariance=np.eye(5))), {}, "residual.weights"),
        (ShapeResidual(0.1, sensors=DofSet.parse(("3X+",))), {}, "residual.unmeasured"),
        (OfModes(ShapeResidual(0.1), ("9",)), {}, "residual.nothing-compared"),
    ],
)
@pytest.mark.quick(2)
def test_what_cannot_be_compared_is_said(residual: OfPairs, changes: dict, code: str):
    with pytest.raises(FemtuneError) as error:
        problem_of(spoilt(chain_case(), **changes), residual).start(np.zeros(3))
    assert error.value.code == code
    assert error.value.hint


def test_all_modes_unpaired_is_said_for_residuals_of_pairs_too():
    case = chain_case()
    far = spoilt(case, freq_hz=10.0 * case.test.freq_hz)
    with pytest.raises(FemtuneError, match=r"correlate\.no-pairs"):
        problem_of(far, ShapeResidual(0.1)).start(np.zeros(3))
