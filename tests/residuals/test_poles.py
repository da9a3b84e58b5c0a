"""Residuals of complex eigenvalues and damping ratios: closed forms, dense linear algebra, Jacobians, clusters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

from femtune.errors import FemtuneError
from femtune.model.damping import ModalDamping, as_hysteretic, constant_damping, damping_table
from femtune.residuals import (
    ComparedCase,
    ComplexEigenvalueResidual,
    DampingResidual,
    OfModes,
    OfPairs,
    PairingRules,
    UpdateProblem,
)
from femtune.residuals.poles import PoleResidual, pole_of
from femtune.testing import check_residual
from structures.springs import factor_model, simulated_case, spring_structure, with_poles

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
DASHPOTS = [(-1, 1, 0.6), (2, 3, 0.9)]
LOSS = [0.02, 0.05, 0.0, 0.01]
GROUPS = {"k": [1, 2], "m": [1002], "c": [2001], "d": [2002]}
TRUTH = (0.1, -0.1, 0.3, -0.2)
TABLE = damping_table([0.0, 10.0], [0.005, 0.03])
COVARIANCE = 1e-6 * (np.full((6, 6), 0.3) + 0.7 * np.eye(6))


def chain_case(loss: object = LOSS, dashpots: object = DASHPOTS, damping: ModalDamping | None = None) -> ComparedCase:
    model = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0], dashpots, loss), GROUPS)  # type: ignore[arg-type]
    case = simulated_case(model, TRUTH, (0, 2, 3), 3, count=4)
    return with_poles(case, TRUTH, damping)


def ring_case() -> ComparedCase:
    """A ring with two pairs of repeated modes, which parameters split; the damping couples them."""
    springs = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    dashpots = [(-1, i, 0.2) for i in range(6)] + [(0, 1, 0.05)]
    groups = {"a": [1], "b": [3], "c": [2003]}
    model = factor_model(spring_structure(springs, [1.0] * 6, dashpots), groups)
    case = simulated_case(model, (0.2, 0.1, 0.1), range(6), 6)
    return with_poles(replace(case, rules=PairingRules(mac_gate=0.2, relative_gap=0.05)), (0.2, 0.1, 0.1))


def with_spread(case: ComparedCase) -> ComparedCase:
    m = len(case.test)
    sd = {"freq_sd_hz": 0.001 * case.test.freq_hz, "damping_sd": np.linspace(1e-4, 3e-4, m)}
    root = np.concatenate(list(sd.values()))
    correlation = np.full((2 * m, 2 * m), 0.3) + 0.7 * np.eye(2 * m)
    return replace(case, test=replace(case.test, covariance=correlation * np.outer(root, root), **sd))


def problem_of(case: ComparedCase, residual: OfPairs) -> UpdateProblem:
    return UpdateProblem((replace(case, residuals=(residual,)),), case.configured.model.parameters)


RESIDUALS: dict[str, Callable[[type[PoleResidual]], OfPairs]] = {
    "sd": lambda kind: kind(sd=0.01),
    "sd of the test": lambda kind: kind(sd="test"),
    "covariance of the test": lambda kind: kind(covariance="test"),
    "one mode": lambda kind: OfModes(kind(sd=0.01), ("2",)),
}
KINDS = (ComplexEigenvalueResidual, DampingResidual)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", RESIDUALS)
def test_jacobian_and_truth(kind: type[PoleResidual], name: str):
    problem = problem_of(with_spread(chain_case()), RESIDUALS[name](kind))
    check_residual(problem, np.array([0.02, 0.1, -0.1, 0.05]))
    assert problem.start(np.array(TRUTH)).objective < 1e-16
    assert problem.start(np.zeros(4)).objective > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("damping", [TABLE, as_hysteretic(TABLE), constant_damping(0.01)])
def test_modal_damping(kind: type[PoleResidual], damping: ModalDamping):
    """Besides that of the elements, or alone; a constant ratio alone depends on no parameter."""
    alone = [[(-1, 1, 1e-9), (2, 3, 1e-9)]] if damping.freq_hz is not None else []
    for dashpots in (DASHPOTS, *alone):
        problem = problem_of(chain_case(0.0, dashpots, damping), kind(sd=0.01, damping=damping))
        check_residual(problem, np.array([0.02, 0.1, -0.1, 0.05]), 1e-5)
        assert problem.start(np.array(TRUTH)).objective < 1e-16


def test_one_mass_by_hand():
    """m λ² + c λ + k = 0: ζ = c/(2√(km)), λ = ω(−ζ + i√(1 − ζ²)), and their derivatives."""
    m, k, c = 2.0, 800.0, 8.0
    model = factor_model(spring_structure([(-1, 0, k)], [m], [(-1, 0, c)]), {"k": [1], "m": [1001], "c": [2001]})
    case = simulated_case(model, (0.0, 0.0, 0.0), (0,), 1)
    case = replace(case, test=replace(case.test, freq_hz=np.array([3.0]), damping_ratio=np.array([0.05])))
    ratio, omega = c / (2.0 * np.sqrt(k * m)), np.sqrt(k / m)
    found = problem_of(case, DampingResidual(sd=0.1)).start(np.zeros(3))
    np.testing.assert_allclose(found.residuals, [(ratio / 0.05 - 1.0) / 0.1], rtol=1e-10)
    np.testing.assert_allclose(found.jacobian, np.array([[-0.5, -0.5, 1.0]]) * ratio / 0.05 / 0.1, rtol=1e-8)
    pole = omega * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
    measured = pole_of(np.array([3.0]), np.array([0.05]))[0]
    np.testing.assert_allclose(abs(measured), 6.0 * np.pi)
    error = (pole - measured) / abs(measured) / 0.1
    found = problem_of(case, ComplexEigenvalueResidual(sd=0.1)).start(np.zeros(3))
    np.testing.assert_allclose(found.residuals, [error.real, error.imag], rtol=1e-10)
    (block,) = found.blocks
    assert block.label.endswith("mode 1 complex eigenvalue")
    assert block.sd == pytest.approx(0.1)


def test_all_poles_beside_the_companion_matrix():
    case = chain_case(0.0)
    at = case.configured.at(np.zeros(4))
    K, M, C = (matrix.toarray() for matrix in (at.stiffness, at.mass, at.viscous))
    inverse = np.linalg.inv(M)
    poles = la.eigvals(np.block([[np.zeros((4, 4)), np.eye(4)], [-inverse @ K, -inverse @ C]]))
    poles = poles[poles.imag > 0.0]
    poles = poles[np.argsort(np.abs(poles))][:3]
    measured = pole_of(case.test.freq_hz, case.test.damping_ratio)
    found = problem_of(case, ComplexEigenvalueResidual(sd=1.0)).start(np.zeros(4)).residuals
    np.testing.assert_allclose(found[::2] + 1j * found[1::2], (poles - measured) / abs(measured), rtol=1e-9)


@pytest.mark.slow
def test_standard_deviations_of_the_test_are_those_of_the_pole():
    """Many draws of frequency and damping ratio beside the covariance that weights the residual."""
    case = with_spread(chain_case())
    test, rng = case.test, np.random.default_rng(3)
    pairs = list(problem_of(case, DampingResidual(sd=1.0)).start(np.array(TRUTH)).states[0].pairs(False))
    for residual in (ComplexEigenvalueResidual(covariance="test"), DampingResidual(covariance="test")):
        drawn = rng.multivariate_normal(np.concatenate([test.freq_hz, test.damping_ratio]), test.covariance, size=400)
        values = []
        for z in drawn:
            noisy = replace(case, test=replace(test, freq_hz=z[:3], damping_ratio=z[3:]))
            values.append(residual.of_pairs([replace(p, case=noisy) for p in pairs])[0].values)
        np.testing.assert_allclose(np.cov(np.array(values).T), np.eye(len(values[0])), atol=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("x", [(0.0, 0.0, 0.0), (0.05, -0.02, 0.1)])
def test_clusters_are_compared_by_their_mean(kind: type[PoleResidual], x: tuple[float, ...]):
    """Poles of repeated modes have no derivatives in several parameters; their mean has."""
    problem = problem_of(ring_case(), kind(sd=0.01))
    found = problem.start(np.zeros(3))
    assert {(1, 2), (3, 4)} <= {models for _, models in found.states[0].groups}
    assert [b.mode for b in found.blocks] == ["1", "2 and 3", "4 and 5", "6"]
    assert [b.sd for b in found.blocks] == pytest.approx([0.01, 0.01 / np.sqrt(2), 0.01 / np.sqrt(2), 0.01])
    check_residual(problem, np.array(x))
    assert problem.start(np.array([0.2, 0.1, 0.1])).objective < 1e-14


@pytest.mark.slow
def test_one_mode_of_a_cluster_is_compared_by_its_shape():
    case = ring_case()
    problem = problem_of(case, OfModes(DampingResidual(sd=0.01), ("3",)))
    (block,) = problem.start(np.array([0.2, 0.1, 0.1])).blocks
    assert block.mode == "3"
    assert abs(block.values[0]) < 1e-6
    check_residual(problem, np.array([0.15, 0.1, 0.1]))


def test_one_mode_of_a_repeated_pair_is_refused():
    springs = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    model = factor_model(spring_structure(springs, [1.0] * 6, [(-1, i, 0.2) for i in range(6)]), {"a": [1]})
    case = with_poles(simulated_case(model, (0.0,), range(6), 6), (0.0,))
    with pytest.raises(FemtuneError) as caught:
        problem_of(case, OfModes(DampingResidual(sd=0.01), ("3",))).start(np.zeros(1))
    assert caught.value.code == "derivative.close-poles"


@pytest.mark.quick(0)
@pytest.mark.parametrize(
    ("ratios", "code"),
    [
        (None, "residual.no-damping"),
        ([0.01, np.nan, 0.01], "residual.no-damping"),
        ([0.01, 1.2, 0.01], "residual.no-damping/not-oscillating"),
        ([0.01, 0.0, 0.01], "residual.no-damping/not-oscillating"),
    ],
)
@pytest.mark.parametrize("kind", KINDS)
def test_damping_ratios_that_are_none(kind: type[PoleResidual], ratios: list[float] | None, code: str):
    case = chain_case()
    case = replace(case, test=replace(case.test, damping_ratio=None if ratios is None else np.array(ratios)))
    with pytest.raises(FemtuneError) as caught:
        problem_of(case, kind(sd=0.01)).start(np.zeros(4))
    assert caught.value.code == code.split("/", maxsplit=1)[0]
    assert "mode " in caught.value.what


def test_an_overdamped_motion_has_no_partner():
    dashpots = [(-1, 1, 200.0), (2, 3, 0.01), *((-1, i, 200.0) for i in (0, 2, 3))]
    model = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0], dashpots), GROUPS)
    case = simulated_case(model, TRUTH, (0, 2, 3), 3, count=4)
    case = replace(case, test=replace(case.test, damping_ratio=np.full(3, 0.01)))
    with pytest.raises(FemtuneError) as caught:
        problem_of(case, DampingResidual(sd=0.01)).start(np.zeros(4))
    assert caught.value.code == "residual.no-complex-mode"


def test_unknown_standard_deviation_of_one_mode():
    case = with_spread(chain_case())
    sd = np.array([1e-4, np.nan, 1e-4])
    case = replace(case, test=replace(case.test, damping_sd=sd, covariance=None))
    with pytest.raises(FemtuneError) as caught:
        problem_of(case, DampingResidual(sd="test")).start(np.zeros(4))
    assert caught.value.code == "residual.no-scatter"
    assert "mode 2" in caught.value.what
    # before the update, the modes are those that the residual compares
    assert DampingResidual(sd="test").without_sd(case.test) == (1,)
    assert OfModes(DampingResidual(sd="test"), ("1", "3")).without_sd(case.test) == ()
    assert DampingResidual(sd=0.01).without_sd(case.test) == ()
    unknown = replace(case.test, freq_sd_hz=np.array([np.nan, 0.1, 0.1]))
    assert ComplexEigenvalueResidual(sd="test").without_sd(unknown) == (0, 1)
    # frequencies do not matter for the damping ratio of a single mode
    known = replace(case, test=replace(case.test, damping_sd=np.full(3, 1e-4), freq_sd_hz=None))
    assert len(problem_of(known, DampingResidual(sd="test")).start(np.zeros(4)).residuals) == 3
